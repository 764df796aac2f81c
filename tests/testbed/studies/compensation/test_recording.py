"""The corrected program in a recording: its curves and clouds are the record's numbers."""

import numpy as np
import pytest

from testbed.studies.compensation.recording import chapter, factor, shown
from testbed.studies.compensation.study import STUDY, CompensationStudy
from tests import viewed
from tests.campaign import with_records
from tests.planes import unfitting
from tests.recorded import column, record, scalars, small_campaign, store, timeline, told

ROBOTS, POSES, CYCLES = 2, 5, 4
SINGLE = 1e-6
"""The scene is float32: 1e-7 of about 1 m, and readings drawn some hundred times larger."""


def study(truth):
    rng = np.random.default_rng(4)
    q = small_campaign().setting.test_q[:POSES]
    scale = np.array([4e-4, 7e-5, 7e-6])
    figures = rng.uniform(0.5, 1, (3, 3, 3, ROBOTS, POSES)) * scale[:, None, None, None, None]
    return CompensationStudy(
        truth=truth,
        trial="designed-29",
        poses=29,
        cycles=CYCLES,
        T=small_campaign().setting.test_true[:POSES],
        q=q,
        figures=figures,
        distances=np.zeros((3, 2, 3, ROBOTS)),
        true=np.zeros((3, ROBOTS, POSES)),
        held_out=np.zeros((3, 2, ROBOTS)),
        extended=np.ones(ROBOTS, dtype=bool),
        corrected=np.ones((3, ROBOTS, POSES), dtype=bool),
        reach=np.ones((2, ROBOTS, POSES)),
        place=np.full((ROBOTS, POSES), "inside"),
        step=np.zeros((3, ROBOTS)),
        targets=q + 1e-3 * np.arange(3)[:, None, None, None] + np.zeros((ROBOTS, 1, 1)),
        readings=rng.normal(size=(3, POSES, CYCLES, 3)) * scale[:, None, None, None],
        pose_id=np.arange(1, POSES + 1),
    )


@pytest.fixture(scope="module")
def campaign():
    return with_records(
        small_campaign(), compensation__rigid=study("rigid"), compensation__wen2022=study("wen2022")
    )


@pytest.fixture(scope="module")
def path(campaign, tmp_path_factory):
    return record(tmp_path_factory.mktemp("recording") / "compensation.rrd", campaign)


@pytest.fixture(scope="module")
def opened(path):
    return store(path)


def test_the_kind_of_the_scenario_is_shown_and_without_it_the_first(campaign):
    one = shown(STUDY.of(campaign), campaign.scenario)
    assert one is STUDY.of(campaign)[1]
    assert shown(STUDY.of(campaign)[:1], campaign.scenario).truth == "rigid"


def test_every_text_fits_its_window(campaign):
    assert unfitting(told(campaign)) == []


def test_the_curves_are_ap_in_micrometres_bit_for_bit(opened, campaign):
    figures = STUDY.of(campaign)[1].figures
    for name, variant, start in (("before", 0, 0), ("after", 2, POSES)):
        at, values = scalars(opened, f"/compensate/{name}", "visit")
        assert at.tolist() == list(range(start, start + POSES))
        assert np.array_equal(values, 1e6 * figures[variant, 0, 0, 0])


def test_readings_end_where_they_were_read_so_many_times_larger(opened, campaign):
    one = STUDY.of(campaign)[1]
    times = factor(one)
    command = one.T[:, :3, 3]
    for name, variant in (("before", 0), ("chosen", 2)):
        entity = f"/world/program/{name}_x{times}"
        _, rows = column(opened, f"{entity}/readings", "Points3D:positions")
        assert [len(row) for row in rows] == [CYCLES * k for k in range(1, POSES + 1)]
        drawn = np.array(rows[-1]).reshape(POSES, CYCLES, 3)
        assert np.abs((drawn - command[:, None]) / times - one.readings[variant]).max() < SINGLE
        _, arrows = column(opened, f"{entity}/mean", "Arrows3D:vectors")
        mean = one.readings[variant].mean(axis=1)
        assert np.abs(np.array(arrows[-1]).reshape(POSES, 3) / times - mean).max() < SINGLE


def test_the_robot_stops_at_the_targets_as_written_and_then_as_corrected(campaign):
    one, story = STUDY.of(campaign)[1], timeline(campaign)
    phase = story.phase("compensate")
    assert phase.stop == story.n_steps
    stops = np.vstack([one.targets[0, 0], one.targets[2, 0]])
    # a glide ends by adding the way there: one rounding of angles below 2 pi
    assert np.abs(story.q[phase.at] - stops).max() < 1e-14


def test_the_words_say_what_the_figures_say(campaign):
    one = STUDY.of(campaign)[1]
    text = "\n".join(chapter(campaign).text)
    assert f"mean AP {1e6 * one.figures[0, 0, 0, 0].mean():.0f} to" in text
    assert f"drawn {factor(one)} times" in text


def test_the_file_is_whole(path):
    assert viewed.verify(path)
