"""A tracker beside an arm on a wall or below a ceiling is level, and so is all that it tells."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.frames import exp_so3, leveled, rot_x, rot_y, rot_z, slide, transform
from calib.uncertainty.statement.instrument import LEVEL, InstrumentErrors
from testbed.laboratory.bench import open_bench
from testbed.laboratory.tracker.errors import NESTS
from testbed.laboratory.tracker.of_scenario import tracker_from
from testbed.plan.tour import readings_of
from testbed.plan.words import axes_words
from testbed.scenario.laboratory import At960Tracker
from tests.planned import QUICK, ROBOT, quick_plan, scenario

WALL = slide(0.2, 0.1, 1.5) @ rot_z(0.7) @ rot_y(np.pi / 2)
CEILING = slide(0.0, 0.0, 3.0) @ rot_z(-1.1) @ rot_x(np.pi)


def standing(T_world_base):
    """The shipped arm's chain, its base elsewhere."""
    return replace(ROBOT.model.chain, T_world_base=T_world_base)


def test_axes_beside_any_base_are_level_and_right_handed():
    rng = np.random.default_rng(5)
    for turn in rng.normal(size=(200, 3)):
        R = exp_so3(turn)
        axes = leveled(transform(R, np.zeros(3)))
        np.testing.assert_array_equal(axes[:, 2], [0.0, 0.0, 1.0])
        np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-15)  # roundings
        assert np.linalg.det(axes) > 0
        # seen from above x goes where the base's x goes, or its z where x is steep
        ahead = (R[:, 0] if abs(R[2, 0]) < np.sin(np.pi / 4) else R[:, 2])[:2]
        assert axes[:2, 0] @ ahead == pytest.approx(np.linalg.norm(ahead), abs=1e-15)


def test_a_base_that_stands_level_keeps_every_bit_of_its_own_axes():
    for angle in (0.0, 0.3, -2.5):
        base = slide(1.0, -2.0, 0.5) @ rot_z(angle)
        tracker = tracker_from(At960Tracker(drift_um_per_sqrt_h=5.0), standing(base))
        np.testing.assert_array_equal(
            tracker.T_world_tracker, base @ slide(*(np.array((2600.0, -2000.0, 300.0)) / 1e3))
        )
        np.testing.assert_array_equal(
            tracker.drift.nests, np.array(NESTS) @ base[:3, :3].T + base[:3, 3]
        )


@pytest.mark.parametrize("base", [WALL, CEILING], ids=["wall", "ceiling"])
def test_elevations_are_above_the_horizon_and_heights_along_the_vertical(base):
    """And the place of the station is that of the base frame, however the tracker is turned."""
    bench = open_bench(scenario(QUICK))
    chain = standing(base)
    robot = replace(ROBOT, model=replace(ROBOT.model, chain=chain))
    settings = At960Tracker(station_mm=(900.0, -1300.0, 1700.0))
    there = replace(bench, robot=robot, tracker=tracker_from(settings, chain))
    station = base @ [0.9, -1.3, 1.7, 1.0]
    q = np.random.default_rng(6).uniform(*robot.limits.T, (20, 6))
    T = robot.model.poses(q)
    tool, probe = readings_of(there, q)
    aim = there.tracker.aim(chain)
    for reading, points in ((tool, T[:, :3, 3]), (probe, T[:, :3, 3] + T[:, :3, :3] @ aim)):
        above = points[:, 2] - station[2]
        far = np.linalg.norm(points - station[:3], axis=1)
        np.testing.assert_allclose(reading.position[:, 2], above, atol=1e-14)
        np.testing.assert_allclose(np.sin(reading.elevation), above / far, atol=1e-14)
        np.testing.assert_allclose(reading.range, far, atol=1e-14)
    # a station out of level tips over level axes and never turns about the vertical
    B = InstrumentErrors(level=1e-5).sensitivity(
        T[:, :3, 3], T[:, :3, :3], there.tracker.T_world_tracker
    )
    assert not B[:, 5, LEVEL].any()


def test_a_plan_says_what_the_axes_of_its_angles_are():
    made = quick_plan()
    notes = []
    for base in (made.nominal.chain.T_world_base, WALL, CEILING):
        chain = standing(base)
        tracker = tracker_from(made.scenario.tracker, chain)
        there = replace(
            made,
            nominal=replace(made.nominal, chain=chain),
            T_world_tracker=tracker.T_world_tracker,
        )
        notes.append(axes_words(there))
        assert there.station_mm == pytest.approx(made.scenario.tracker.station_mm, abs=1e-9)
    upright, wall, ceiling = notes
    assert upright == "axes parallel to the robot's base"
    assert wall == "level axes: z up, x as the z of the robot's base points, seen from above"
    assert ceiling == "level axes: z up, x as the x of the robot's base points, seen from above"
