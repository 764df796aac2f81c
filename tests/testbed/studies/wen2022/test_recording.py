"""The clouds of the tool point in a recording: read back, they are the report's clouds."""

import re

import numpy as np
import pytest

from testbed.cli.recording_steps import phases_of
from testbed.studies.wen2022.cloud.draws import SHOWN, clouds_of, mean_half_width
from testbed.studies.wen2022.cloud.recording import (
    CLOUD_SIZE,
    LOOKS,
    STAGES,
    chapter,
    factor,
    stages,
)
from tests import viewed
from tests.campaign import with_records
from tests.planes import unfitting
from tests.recorded import column, record, scalars, small_campaign, store, timeline, told
from tests.reported import paper_campaign

SINGLE = 2e-7
"""The scene is float32: 1e-7 of about 1 m."""


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return record(tmp_path_factory.mktemp("recording") / "clouds.rrd", paper_campaign())


@pytest.fixture(scope="module")
def opened(path):
    return store(path)


@pytest.fixture(scope="module")
def clouds():
    return clouds_of(paper_campaign())


def entity(cloud, clouds):
    return f"/world/zero_pose_x{factor(clouds)}/{cloud.source.replace(' ', '_')}"


def each(clouds):
    return [(k, cloud) for k, pair in enumerate(clouds.values()) for cloud in pair]


def test_the_points_are_those_of_the_figure_at_the_stated_magnification(opened, clouds):
    times = factor(clouds)
    (stated,) = re.findall(r"both drawn (\d+) times", "\n".join(chapter(paper_campaign()).text))
    assert int(stated) == times
    for _, cloud in each(clouds):
        _, rows = column(opened, entity(cloud, clouds), "Points3D:positions")
        rows = [row for row in rows if row]
        assert len(rows) == STAGES
        last = (np.array(rows[-1]).reshape(-1, 3) - cloud.nominal) / times
        # what the report draws, but for the rounding of the scene
        np.testing.assert_allclose(last, cloud.shown, rtol=0, atol=SINGLE / times)
        lengths = [min(count, SHOWN) for count in stages(len(cloud.points))]
        assert [len(row) for row in rows] == lengths
        assert np.array_equal(rows[0], rows[-1][: lengths[0]])


def test_every_text_fits_its_window():
    assert unfitting(told(paper_campaign())) == []


def test_the_zero_pose_is_where_the_clouds_hang(clouds):
    for _, cloud in each(clouds):
        np.testing.assert_allclose(cloud.nominal, [0, 0.020, 0.670], atol=1e-15)
    assert factor(clouds) * max(np.abs(c.ends).max() for _, c in each(clouds)) <= CLOUD_SIZE


def test_the_last_box_is_the_range_of_all_draws(opened, clouds):
    for _, cloud in each(clouds):
        _, rows = column(opened, f"{entity(cloud, clouds)}/range", "LineStrips3D:strips")
        box = np.array([row for row in rows if row][-1]).reshape(-1, 3)
        ends = (np.stack([box.min(axis=0), box.max(axis=0)], -1) - cloud.nominal[:, None]) / factor(
            clouds
        )
        np.testing.assert_allclose(ends, cloud.ends, rtol=0, atol=2 * SINGLE / factor(clouds))


def test_each_pair_has_its_stretch_its_colors_and_its_words(opened, clouds):
    story = timeline(paper_campaign())
    phase = story.phase("draw")
    assert phase.stop == story.n_steps
    for k, cloud in each(clouds):
        path = entity(cloud, clouds)
        at, rows = column(opened, path, "Points3D:positions", "step")
        shown = [step for step, row in zip(at, rows, strict=True) if row]
        assert shown == phase.at[STAGES * k : STAGES * (k + 1)].tolist()
        _, (words,) = column(opened, f"{path}/label", "Points3D:labels")
        look = LOOKS[cloud.source.endswith("random")]
        whose = list(clouds)[k]
        assert words == [f"{look.name}, {whose}"]
    assert len({look.color for look in LOOKS}) == len({look.label for look in LOOKS}) == 2


def test_the_last_step_of_all_where_the_viewer_opens_shows_the_last_clouds(opened, path, clouds):
    """Wiped behind the last step, they made a step of its own, which showed nothing."""
    story = timeline(paper_campaign())
    begins, last = phases_of(path)
    assert last == story.n_steps - 1
    assert begins == {phase.name: phase.start for phase in story.phases}
    phase = story.phase("draw")
    for k, cloud in each(clouds):
        place = entity(cloud, clouds)
        wiped = [phase.at[STAGES * (k + 1)]] if k + 1 < len(clouds) else []
        for name in (place, f"{place}/range", f"{place}/label"):
            assert column(opened, name, "Clear:is_recursive")[0].tolist() == wiped


def test_the_curves_are_half_widths_of_the_draws_so_far(opened, clouds):
    for k, cloud in each(clouds):
        at, values = scalars(opened, f"/draw/{cloud.source.replace(' ', '_')}", "stage")
        assert at.tolist() == list(range(STAGES * k, STAGES * (k + 1)))
        x = cloud.points[:, 0]
        naive = [(max(x[:n]) - min(x[:n])) / 2 / cloud.u[0] for n in stages(len(x))]
        np.testing.assert_allclose(values, naive, rtol=1e-12)
        _, normal = scalars(opened, f"/draw/normal_{k}", "stage")
        np.testing.assert_allclose(normal, mean_half_width(stages(len(x)).tolist()), rtol=1e-12)
    assert normal[-1] == pytest.approx(3.85, abs=0.005)


def test_the_robot_shows_the_zero_pose_and_leaves_before_the_first_draw():
    campaign = paper_campaign()
    story = timeline(campaign)
    phase = story.phase("draw")
    q = story.q[phase.start : phase.stop]
    rest = np.flatnonzero((q == 0).all(axis=1)) + phase.start
    assert len(rest) >= 10
    assert rest[-1] < phase.at[0]
    # it comes from where it was, and then stands still below the clouds
    np.testing.assert_allclose(q[0], story.q[phase.start - 1], atol=0.1)
    later = story.q[phase.at[0] :]
    assert (later == later[0]).all()
    assert campaign.setting.nominal.poses(later[:1])[0, 2, 3] < 0.2


def test_a_campaign_without_the_study_has_no_such_chapter():
    assert chapter(small_campaign()) is None
    assert chapter(with_records(paper_campaign(), tool_point=None)) is None


def test_the_file_is_whole(path):
    assert viewed.verify(path)
