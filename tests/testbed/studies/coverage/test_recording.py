"""The coverage study in a recording: its curves and dots are the record's numbers."""

import numpy as np
import pytest

from testbed.studies.coverage import recording
from testbed.studies.coverage.recording import GAP, NAMES, PANEL, ROW, chapter, frame_words
from testbed.studies.coverage.study import STUDY, CoverageStudy
from testbed.studies.coverage.summary import cells
from tests import viewed
from tests.campaign import with_records
from tests.planes import overlaps, unfitting
from tests.recorded import column, record, scalars, small_campaign, store, timeline, told

ROBOTS = 12
SINGLE = 1e-4
"""Places on the panel are float32: 1e-7 of 366 units, and the mean marker of a running sum."""


def study(truth, level, seed):
    rng = np.random.default_rng(seed)
    flat = np.zeros((2, ROBOTS))
    return CoverageStudy(
        truth=truth,
        level=0.95,
        judged=100,
        inside=rng.binomial(100, level, (2, 4, ROBOTS)) / 100,
        radius=np.full((2, 4, ROBOTS), 2e-5),
        p_value=flat,
        held_out_p=flat,
        flagged=flat > 0,
        believed=flat + 1.0,
        growth=flat + 1.0,
        p_drift=flat,
        converged=flat == 0,
        extended=np.zeros(ROBOTS, dtype=bool),
        log_evidence=np.zeros(ROBOTS),
        before=np.zeros(ROBOTS),
        mean_error=flat,
        names=(),
        normal_error=np.zeros((0, ROBOTS)),
        nees=np.zeros(0),
    )


@pytest.fixture(scope="module")
def campaign():
    return with_records(
        small_campaign(),
        coverage__rigid=study("rigid", 0.95, 1),
        coverage__wen2022=study("wen2022", 0.02, 2),
    )


@pytest.fixture(scope="module")
def path(campaign, tmp_path_factory):
    return record(tmp_path_factory.mktemp("recording") / "coverage.rrd", campaign)


@pytest.fixture(scope="module")
def opened(path):
    return store(path)


def test_curves_are_the_mean_over_the_robots_so_far(opened, campaign):
    for one in STUDY.of(campaign):
        for i, model in enumerate(("geometric", "extended")):
            at, values = scalars(opened, f"/coverage/{model}/{one.truth}", "robot")
            naive = [100 * np.mean(one.inside[i, 0, : k + 1]) for k in range(ROBOTS)]
            assert at.tolist() == list(range(ROBOTS))
            # two orders of summation of twelve numbers up to 100
            assert np.abs(values - naive).max() < 1e-12


def test_titles_names_and_numbers_do_not_lie_on_each_other():
    kinds = ["rigid", "wen2022", "soft", "elastic", "unmodelled", "slight"]
    assert overlaps(frame_words(kinds)) == []
    assert min(word.box[0] for word in frame_words(kinds)) >= -NAMES


def test_every_text_fits_its_window(campaign):
    assert unfitting(told(campaign)) == []


def test_a_robot_is_a_dot_at_its_share_in_its_row(opened, campaign):
    one = STUDY.of(campaign)[1]
    _, rows = column(opened, "/attained/wen2022/extended/discrepancy/robots", "Points2D:positions")
    dots = np.array(rows[-1]).reshape(-1, 2)
    assert np.abs(dots[:, 0] - 2 * (PANEL + GAP) - 100 * one.inside[1, 2]).max() < SINGLE
    assert (np.abs(dots[:, 1] - 3 * ROW) < ROW / 2).all()
    assert len(np.unique(dots[:, 1])) == ROBOTS


def test_the_mean_ends_at_the_share_that_the_report_states(opened, campaign):
    for cell in cells(STUDY.of(campaign)):
        entity = f"/attained/{cell.truth}/{cell.model}/{cell.statement}/mean"
        _, rows = column(opened, entity, "Points2D:positions")
        shift = ("region", "model", "discrepancy", "conformal").index(cell.statement) * (
            PANEL + GAP
        )
        assert rows[-1][0][0] - shift == pytest.approx(100 * cell.share.value, abs=SINGLE)
        assert cell.believable == (cell.truth == "rigid")


def test_the_phase_comes_last_and_the_words_count_what_falls_short(campaign):
    story, bare = timeline(campaign), timeline(small_campaign())
    assert [phase.name for phase in story.phases][:4] == [phase.name for phase in bare.phases]
    last = story.phase("coverage")
    assert (last.start, last.stop) == (bare.n_steps, story.n_steps)
    assert len(last.at) == ROBOTS
    assert len(np.unique(last.at)) == ROBOTS
    assert np.array_equal(story.q[last.start], bare.q[-1])
    assert chapter(campaign).text[-1].startswith("- 8 of 16 statements fall short")


def test_of_very_many_robots_the_first_are_shown_and_the_words_count_all(campaign, monkeypatch):
    every = chapter(campaign)
    monkeypatch.setattr(recording, "MOST_SHOWN", 5)
    found = chapter(campaign)
    assert found.text[1].startswith("- the first 5 of 12 robots of each of 2 kinds come in")
    assert found.text[-1] == every.text[-1]
    assert len(timeline(campaign).phase("coverage").at) == 5
    shown, all_of = (one.charts[0].curves[0].values for one in (found, every))
    assert np.array_equal(shown, all_of[:5])


def test_the_file_is_whole(path):
    assert viewed.verify(path)
