"""How an arm that moves is shown: loops, what dies away, a film, each against another way."""

import re
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from calib.geometry.bodies import bent_forward
from calib.geometry.jacobian import joint_columns
from calib.geometry.model import RobotModel
from testbed.laboratory.truth.moving import MovingArm
from testbed.laboratory.truth.springs import ElasticArm
from testbed.recording.story import timeline_of
from testbed.recording.timeline import visit
from testbed.robots.catalog import load_robot
from testbed.robots.placements import placements
from testbed.scenario.read import changed
from testbed.store.quantities import as_json
from testbed.studies import load_scenario
from testbed.studies.trial.bending.play import EVERY, SLOW, STEP, filmed, loops, waited
from testbed.studies.trial.bending.recording import move_chapter
from testbed.studies.trial.bending.records import Ways
from testbed.studies.trial.bending.report import motion_figures
from testbed.studies.trial.results import motion_headline
from testbed.studies.trial.study import STUDY
from tests.testbed.laboratory.test_moving import CHAIN, FRICTION, SPRINGS, UP, Q, motion, um
from tests.toy_story import chapter

DRIVES = replace(SPRINGS, bearing=np.zeros(0))
REST = ElasticArm(CHAIN, DRIVES)
WIDTH = 2 * FRICTION / SPRINGS.drive


def arm(springs=DRIVES, **changes):
    return MovingArm(CHAIN, springs, motion(**changes))


def test_who_follows_the_motors_step_by_step_ends_where_the_approach_ends():
    moving = arm(SPRINGS, dwell=0.1)
    path = np.vstack([moving.approach(Q[0], UP[0]), np.tile(Q[0], (100, 1))])
    (expected,) = moving.deflections(Q[:1], UP[:1], (0.1,))
    # the same steps; powers of arrays differ in their last bit, and what swings forgets it
    np.testing.assert_allclose(moving.follow(path)[-1], expected[0], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(
        moving.follow(path[:60], every=7), moving.follow(path)[6:60:7][:8]
    )


def test_a_loop_is_twice_the_friction_over_the_stiffness_wide_and_closes():
    command, turn, tool, width, tool_width = loops(arm(), REST, Q[0])
    # what is still unwound in the dampers at 1e-3 deg/s, and what slips while it is held
    np.testing.assert_allclose(width, WIDTH, rtol=0.01)
    np.testing.assert_allclose(np.ptp(turn, axis=0), WIDTH, rtol=0.05)
    # once round, from the upper end to the upper end
    np.testing.assert_allclose(command[[0, -1]].max(axis=0), 3 * WIDTH, rtol=1e-6)
    np.testing.assert_allclose(turn[0], turn[-1], rtol=0, atol=0.01 * WIDTH.max())
    assert len(command) == round(SLOW / STEP) // EVERY + 1
    _, J = RobotModel(CHAIN).poses_and_jacobian(Q[:1])
    expected = np.linalg.norm(J[0, :3, joint_columns(CHAIN)].T @ WIDTH)
    assert tool_width == pytest.approx(expected, rel=0.01)
    assert np.ptp(tool) == pytest.approx(expected, rel=0.05)


def test_without_friction_there_is_no_loop():
    _, _, _, width, tool_width = loops(arm(friction=np.zeros(6)), REST, Q[0])
    assert np.abs(width).max() < 0.01 * WIDTH.min()
    assert tool_width < 1e-6


def test_what_dies_away_is_the_distance_from_the_last_look():
    moving = arm(friction=0.3 * FRICTION, dwell=0.25)
    dwell, away, seen, apart = waited(moving, Q[:2], UP[:2])
    assert (dwell[0], dwell[-1], away.shape) == (0.0, 1.0, (len(dwell), 4))
    assert away[0].mean() > 20e-6 > away[-1].max()
    k = int(np.abs(dwell - 0.25).argmin())
    np.testing.assert_allclose(seen, away[k], rtol=0, atol=0.1 * away[0].mean())
    ends = [
        np.concatenate([moving.looks(Q[:2], side * UP[:2], (t,))[0, :, :3, 3] for side in (1, -1)])
        for t in (0.25, 4.0)
    ]
    np.testing.assert_allclose(seen, np.linalg.norm(ends[0] - ends[1], axis=1), atol=1e-12)
    np.testing.assert_allclose(um(ends[0][:2] - ends[0][2:]), 1e6 * apart, atol=1e-6)


@pytest.mark.parametrize("springs", [SPRINGS, DRIVES], ids=["bearings", "drives"])
def test_a_film_shows_the_arm_beside_where_it_would_rest(springs):
    rest = ElasticArm(CHAIN, springs)
    motors, bends, away = filmed(arm(springs), rest, Q[1], UP[1])
    assert (motors[-1] == Q[1]).all()
    assert (motors[0] != Q[1]).all()
    still = rest.bends(motors)
    T, stands = (bent_forward(CHAIN, motors, still + part) for part in (bends, 0 * bends))
    np.testing.assert_allclose(away, np.linalg.norm((T - stands)[:, :3, 3], axis=1), atol=1e-12)
    assert away.max() > 5 * away[-1]


@cache
def film():
    motors, bends, away = filmed(arm(SPRINGS), ElasticArm(CHAIN, SPRINGS), Q[1], UP[1])
    both = {"film_q": motors, "film_bends": bends, "film_away": away}
    return Ways(
        *loops(arm(), REST, Q[0]), *waited(arm(dwell=0.25), Q[:2], UP[:2]),
        **{name: np.concatenate([part, part]) for name, part in both.items()},
        film_starts=np.array([0, len(motors)]), film_step=EVERY * STEP,
    )  # fmt: skip


class Pen:
    """Keeps the transforms, on a timeline."""

    def __init__(self, timeline):
        self.timeline, self.drawn = timeline, {}

    def transforms(self, path, T):
        self.drawn[path] = T

    def static(self, path, what):
        pass


def test_the_recording_draws_the_swinging_arm_by_its_factor_and_hides_it_elsewhere():
    seen, robot = film(), load_robot("staubli_tx60")
    shown = SimpleNamespace(setting=SimpleNamespace(nominal=robot.model, test_q=Q))
    told = move_chapter(shown, seen, robot)
    timeline = timeline_of([chapter("go", visit(Q)), told])
    phase, pen = timeline.phase("move"), Pen(timeline)
    told.draw(pen, phase)
    root = next(path for path in pen.drawn if path.endswith("/base")).removesuffix("/base")
    factor = int(re.fullmatch(r"world/swings_x(\d+)", root)[1])
    assert any(f"drawn {factor} times" in line for line in told.text)
    assert 0.03 < factor * seen.film_away.max() <= 0.08
    np.testing.assert_array_equal(timeline.q[phase.at], seen.film_q)
    (chart,) = told.charts
    np.testing.assert_array_equal(chart.curves[0].values, 1e6 * seen.film_away)
    assert chart.across(np.array([1])) == seen.film_step
    assert len(phase.at) == len(seen.film_away)
    drawn = np.eye(4)
    for joint in range(1, 7):
        drawn = drawn @ pen.drawn[root + "".join(f"/link{k + 1}" for k in range(joint))]
    bends = np.zeros((timeline.n_steps, 6, 3))
    bends[phase.at] = factor * seen.film_bends
    expected = bent_forward(robot.model.chain, timeline.q, bends)
    tool = placements(robot.model.chain).tool
    np.testing.assert_allclose(drawn @ tool, expected, rtol=0, atol=1e-12)


def test_the_report_states_the_loops_and_what_no_wait_takes_away():
    seen = film()
    truth = SimpleNamespace(dwell_s=0.25)
    campaign = SimpleNamespace(motion=seen, scenario=SimpleNamespace(truth=truth))
    loop, wait = motion_figures(campaign)
    for width in np.degrees(seen.loop_width) * 1e3:
        assert f": {width:.1f} mdeg" in loop.svg
    assert f"tool: {1e6 * seen.tool_width:.0f} µm" in loop.svg
    assert f"{1e6 * seen.apart.mean():.0f} µm on average" in wait.caption
    smooth = replace(seen, tool_width=1e-7)
    assert len(motion_figures(SimpleNamespace(motion=smooth, scenario=campaign.scenario))) == 1
    assert motion_figures(SimpleNamespace(motion=None, scenario=campaign.scenario)) == ()


def test_what_is_published_of_it_carries_its_unit():
    seen = film()
    told = as_json(motion_headline(seen))
    np.testing.assert_allclose(told["loop_width_mdeg"], 1e3 * np.degrees(seen.loop_width))
    assert told["tool_loop_width_um"] == pytest.approx(1e6 * seen.tool_width, rel=1e-12)
    assert told["both_sides_max_um"] == pytest.approx(1e6 * seen.apart.max(), rel=1e-12)
    assert told["from_rest_mean_um"] == pytest.approx(1e6 * seen.seen.mean(), rel=1e-12)


@pytest.mark.parametrize(("preset", "there"), [("elastic", False), ("moving", True)])
def test_only_an_arm_that_moves_has_a_record_of_it(preset, there):
    scenario = changed(load_scenario("quick"), {"truth": {"preset": preset}})
    assert ("motion" in [record.key for record in STUDY.records(scenario)]) == there
