"""The recording of a calibration: its numbers are those of the record, seen from the base."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib.geometry.frames import inverse, rot_y, rot_z, slide
from testbed.identify.handback.deliver import delivered_robot
from testbed.identify.recording.regions import regions_at
from testbed.identify.recording.story import calibration_story, show
from testbed.recording.story import stance, timeline_of
from testbed.recording.write import story_bytes
from tests.calibrated import real, robot
from tests.planes import unfitting
from tests.recorded import column, scalars, store


def story():
    return calibration_story(real(), delivered_robot(real(), robot(), real().fit))


@pytest.fixture(scope="module")
def opened(tmp_path_factory):
    path = tmp_path_factory.mktemp("recording") / "campaign.rrd"
    path.write_bytes(story_bytes(story()))
    return store(path)


@pytest.fixture(scope="module")
def timeline():
    return timeline_of(story().chapters)


@pytest.fixture(scope="module")
def shown():
    return show(real())


def test_the_curves_are_the_errors_of_the_record(opened, shown, timeline):
    found = real()
    for name, misses in (("before", found.before_misses), ("after", found.fit.misses)):
        for phase, rows in (("measure", shown.measured), ("evaluate", shown.judged)):
            at, values = scalars(opened, f"/{phase}/{name}")
            assert np.array_equal(at, timeline.phase(phase).at)
            np.testing.assert_array_equal(values, misses.position[rows] * 1e3)


def test_all_poses_are_shown_when_they_are_few_and_held_out_ones_come_last(shown, timeline):
    found = real()
    assert np.array_equal(shown.measured, np.flatnonzero(found.is_used))
    assert np.array_equal(shown.judged, np.flatnonzero(found.split.is_test))
    at = timeline.phase("evaluate").at
    assert at[-1] < timeline.n_steps
    # the robot rests where something is known about the pose
    np.testing.assert_allclose(timeline.q[at], found.measurements.q[shown.judged], atol=1e-12)


def test_arrows_lead_from_what_is_predicted_to_what_was_seen(opened, shown):
    found, factor = real(), shown.factor
    _, origins = column(opened, f"/world/held_out/after_x{factor}", "Arrows3D:origins")
    _, vectors = column(opened, f"/world/held_out/after_x{factor}", "Arrows3D:vectors")
    tip = np.array(origins[-1]) + np.array(vectors[-1]) / factor
    base = found.fit.identification.model.chain.T_world_base
    seen = (found.measurements.position[shown.judged] - base[:3, 3]) @ base[:3, :3]
    # the file keeps float32
    np.testing.assert_allclose(tip, seen, atol=1e-6)


def test_every_text_fits_its_window():
    assert unfitting(story()) == []


def test_the_tracker_stands_where_the_measuring_frame_is(opened, shown):
    base = real().fit.identification.model.chain.T_world_base
    np.testing.assert_allclose(shown.station @ base, np.eye(4), atol=1e-12)
    assert "/world/held_out/all" in {str(path) for path in opened.schema().entity_paths()}


def test_ellipsoids_are_the_believed_regions_seen_from_the_base(opened, shown):
    found = real()
    regions = regions_at(found, shown.judged, shown.station)
    path = f"/world/held_out/region_95_x{regions.factor}"
    centers, half, quaternions = (
        np.array(column(opened, path, f"Ellipsoids3D:{part}")[1][-1])
        for part in ("centers", "half_sizes", "quaternions")
    )
    stated = found.proof.belief.regions(found.measurements.q[shown.judged])
    base = found.fit.identification.model.chain.T_world_base
    # the file keeps float32
    expected = (stated.position - base[:3, 3]) @ base[:3, :3]
    np.testing.assert_allclose(centers, expected, atol=1e-6)
    turn = base[:3, :3] @ Rotation.from_quat(quaternions).as_matrix()
    axes = turn * (half / regions.factor / stated.factor)[:, None, :]
    S = stated.covariance
    np.testing.assert_allclose(axes @ np.swapaxes(axes, 1, 2), S, atol=1e-5 * S.max())
    assert regions_at(replace(found, proof=replace(found.proof, belief=None)), [0], base) is None


def test_an_arm_that_hangs_is_drawn_as_it_hangs_beside_a_level_tracker(shown):
    """Its file says how the base is turned; up in the picture is up in the room."""
    wall = slide(0.0, 0.0, 1.5) @ rot_z(0.4) @ rot_y(np.pi / 2)
    seen = slide(2.0, 1.0, 0.3) @ rot_z(-1.3) @ wall  # by a tracker that is level
    level = stance(wall) @ inverse(seen)
    np.testing.assert_allclose(level[:3, 2], [0.0, 0.0, 1.0], atol=1e-15)
    for upright in (np.eye(4), slide(1.0, 2.0, 0.0) @ rot_z(0.7)):
        np.testing.assert_array_equal(stance(upright), np.eye(4))
    found = real()
    chain = replace(found.nominal.chain, T_world_base=wall)
    hung = show(replace(found, nominal=replace(found.nominal, chain=chain)))
    np.testing.assert_allclose(hung.station, stance(wall) @ shown.station, atol=1e-15)
    np.testing.assert_allclose(hung.seen, shown.seen @ stance(wall)[:3, :3].T, atol=1e-12)
    # a frame below the floor of the room is no tracker's
    for below, stands in ((0.5, False), (4.0, True)):
        there = replace(robot(), model=replace(robot().model, chain=chain), mounting_height=below)
        lower = slide(0.0, 0.0, -1.0) @ rot_z(0.3)  # of the measuring frame, seen from the base
        place = inverse(stance(wall)) @ lower
        model = found.fit.identification.model
        told = replace(model, chain=replace(model.chain, T_world_base=inverse(place)))
        fits = tuple(
            replace(one, identification=replace(one.identification, model=told))
            for one in found.fits
        )
        moved = replace(found, fits=fits, nominal=replace(found.nominal, chain=chain))
        drawn = replace(there, model=replace(there.model, chain=told.chain))
        assert calibration_story(moved, drawn).has_tracker is stands
