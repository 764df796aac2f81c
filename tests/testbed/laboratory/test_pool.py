"""Candidate poses: the reference pool, every kept pose feasible, every rejection accounted for."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.chain import forward
from calib.geometry.frames import rot_z, slide
from calib.geometry.model import RobotModel
from testbed.laboratory import pool as pool_module
from testbed.laboratory.pool import CONE, OBSTACLE, PATIENCE, SAMPLE, Candidates, PosePool
from testbed.laboratory.pool import REASONS as ALL
from testbed.laboratory.simulator import Simulator
from testbed.robots.catalog import Robot
from testbed.robots.coupled import ControllerTable
from testbed.scenario.tables import PoolSettings
from tests.reference import TX60_LIMITS, pool_r, tx60

REASONS = tuple(name for k, name in enumerate(ALL) if k not in (CONE, OBSTACLE))
"""Without obstacles and with a probe that is seen from anywhere."""
STATION, AIM = (2.6, -2.0, 0.3), (0.0, 0.0, 0.06)


@pytest.fixture(scope="module")
def pool(robot: Robot, simulator: Simulator) -> PosePool:
    return drawn(robot, simulator)


def drawn(
    robot: Robot, simulator: Simulator, *, seed: int = 5, station: Any = STATION, **changes: Any
) -> PosePool:
    """Pool of 1000 from a numbered stream, with changed settings; size and exclude go through."""
    extra = {key: changes.pop(key) for key in ("size", "exclude") if key in changes}
    cone = {key: changes.pop(key) for key in ("acceptance",) if key in changes}
    candidates = Candidates(robot, simulator, PoolSettings(**changes), station, aim=AIM, **cone)
    return candidates.draw(np.random.default_rng(seed), **extra)


def test_with_all_tests_off_it_is_the_reference_pool(robot, simulator):
    pool = drawn(robot, simulator, self_collision=False, line_of_sight=False)
    np.testing.assert_array_equal(pool.q, pool_r())
    # printed in the specification, section 1.5
    printed = [1.12583078, 1.64711204, -1.35636902, 3.72701185, 1.74375574, -4.53786832]
    np.testing.assert_allclose(pool.q[0], printed, atol=5e-9)
    assert np.linalg.norm(pool.T[:, :3, 3], axis=1).mean() == pytest.approx(0.45702112, abs=5e-9)
    goals = drawn(robot, simulator, seed=99, size=2000, self_collision=False, line_of_sight=False)
    assert np.linalg.norm(goals.T[:, :3, 3], axis=1).mean() == pytest.approx(0.46119699, abs=5e-9)


def test_poses_keep_the_limits_of_a_controller_and_what_it_holds(robot, simulator):
    table = ControllerTable(
        joints=("q3 = J3 - J2", "q5 = -q2 - q3"), limits_deg={"J3": (-40.0, 60.0)}
    )
    controller = table.controller(robot.model.chain.kinds)
    made = drawn(
        replace(robot, controller=controller), simulator, size=50, self_collision=False,
        line_of_sight=False, joint_margin_deg=2.0,
    ).q  # fmt: skip
    J3 = np.degrees(made[:, 2] + made[:, 1])
    assert ((J3 > -38) & (J3 < 58)).all()
    assert np.abs(made[:, 4] + made[:, 1] + made[:, 2]).max() < 1e-15
    assert ((made > TX60_LIMITS[:, 0]) & (made < TX60_LIMITS[:, 1])).all()


def test_every_kept_pose_passes_every_test(pool, simulator):
    assert pool.q.shape == (1000, 6)
    np.testing.assert_allclose(pool.T, forward(tx60().chain, pool.q), atol=1e-15)
    p = pool.T[:, :3, 3]
    assert (np.abs(p - [0.25, 0, 0.2]) < [0.45, 0.6, 0.4]).all()
    assert ((pool.q > TX60_LIMITS[:, 0]) & (pool.q < TX60_LIMITS[:, 1])).all()
    assert not simulator.collides(pool.q).any()
    assert simulator.sees(pool.q, STATION, AIM).all()


def test_every_candidate_is_kept_or_rejected_for_the_first_reason_that_applies(robot, simulator):
    pool = drawn(robot, simulator, joint_margin_deg=10.0)
    assert pool.rejection_names == REASONS
    assert len(pool.q) + pool.rejection_counts.sum() == pool.n_drawn
    # the same candidates, judged by hand
    block = np.random.default_rng(5).uniform(*TX60_LIMITS.T, (4000, 6))[: pool.n_drawn]
    p = forward(tx60().chain, block)[:, :3, 3]
    margin = np.radians(10.0)
    itself, floor, _ = simulator.contacts(block)
    fails = np.array(
        [
            (np.abs(p - [0.25, 0, 0.2]) >= [0.45, 0.6, 0.4]).any(1),
            ((block < TX60_LIMITS[:, 0] + margin) | (block > TX60_LIMITS[:, 1] - margin)).any(1),
            itself,
            floor,
            ~simulator.sees(block, STATION, AIM),
        ]
    )
    first = np.where(fails.any(0), fails.argmax(0), -1)
    np.testing.assert_array_equal(pool.q, block[first < 0])
    np.testing.assert_array_equal(pool.rejection_counts, [(first == k).sum() for k in range(5)])
    for k, name in enumerate(REASONS):
        sample = pool.rejected_q[[reason == name for reason in pool.rejected_reason]]
        np.testing.assert_array_equal(sample, block[first == k][:SAMPLE])
    assert len(pool.rejected_q) <= 500


def test_moving_the_whole_cell_moves_poses_but_not_joints(robot, pool):
    T = slide(1.0, -2.0, 0.5) @ rot_z(1.0)
    chain = replace(robot.model.chain, T_world_base=T)
    elsewhere = replace(robot, model=RobotModel(chain))
    station = T[:3, :3] @ STATION + T[:3, 3]
    moved = drawn(elsewhere, Simulator(elsewhere, chain), station=station)
    np.testing.assert_array_equal(moved.q, pool.q)
    np.testing.assert_allclose(moved.T, T @ pool.T, atol=1e-14)


def test_a_low_box_meets_the_floor(robot, simulator):
    low = drawn(robot, simulator, size=50, box_center_mm=(350.0, 0.0, -300.0))
    assert low.rejection_counts[REASONS.index("floor")] > 0
    free = drawn(
        robot, simulator, size=50, box_center_mm=(350.0, 0.0, -300.0), self_collision=False
    )
    assert not free.rejection_counts[
        [REASONS.index("floor"), REASONS.index("self-collision")]
    ].any()


def test_an_unneeded_test_is_not_made(robot, simulator):
    blind = drawn(robot, simulator, line_of_sight=False)
    assert blind.rejection_counts[REASONS.index("line of sight")] == 0
    assert not simulator.sees(blind.q, STATION, AIM).all()
    careless = drawn(robot, simulator, self_collision=False)
    assert simulator.collides(careless.q).any()


def test_the_margin_keeps_away_from_the_limits_and_moves_no_other_candidate(robot, simulator, pool):
    careful = drawn(robot, simulator, joint_margin_deg=15.0, size=100)
    margin = np.radians(15.0)
    assert (careful.q >= TX60_LIMITS[:, 0] + margin).all()
    assert (careful.q <= TX60_LIMITS[:, 1] - margin).all()
    # same stream and block size: the careful pool is a part of the careless one
    careless = drawn(robot, simulator, size=100)
    shared = careless.q[
        ((careless.q >= TX60_LIMITS[:, 0] + margin) & (careless.q <= TX60_LIMITS[:, 1] - margin))
        .all(1)
    ]  # fmt: skip
    np.testing.assert_array_equal(careful.q[: len(shared)], shared)


def test_held_out_poses_are_never_in_the_pool_and_come_from_the_same_distribution(
    robot, simulator, pool
):
    # the same stream: without care the held-out poses would be the pool's own
    test = drawn(robot, simulator, size=250, exclude=pool.q)
    again = drawn(robot, simulator, size=250)
    in_pool = {row.tobytes() for row in pool.q}
    assert any(row.tobytes() in in_pool for row in again.q)
    assert not any(row.tobytes() in in_pool for row in test.q)
    other = drawn(robot, simulator, size=1000, seed=6, exclude=pool.q)
    # means of 1000 joints and positions agree within 4 sd of their difference
    for a, b in ((pool.q, other.q), (pool.T[:, :3, 3], other.T[:, :3, 3])):
        sd = np.sqrt((a.var(0) + b.var(0)) / 1000)
        assert (np.abs(a.mean(0) - b.mean(0)) < 4 * sd).all()


def test_same_stream_same_pool(robot, simulator, pool):
    again = drawn(robot, Simulator(robot, robot.model.chain), seed=5)
    np.testing.assert_array_equal(again.q, pool.q)
    np.testing.assert_array_equal(again.rejected_q, pool.rejected_q)


def test_arrays_are_read_only(pool):
    for array in (pool.q, pool.T, pool.rejected_q, pool.rejection_counts):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"box_center_mm": (2000.0, 0.0, 0.0)},
            r"only 0 of 50 poses.*\"outside the box\" rejects (\d+) of \1; move box_center_mm",
        ),
        ({"joint_margin_deg": 90.0}, 'the test "joint limits" rejects .* lower joint_margin_deg'),
        (
            {"box_center_mm": (0.0, 0.0, -230.0), "box_size_mm": (100.0, 100.0, 100.0)},
            '"self-collision" rejects .* move the box away',
        ),
        (
            {"box_center_mm": (450.0, 0.0, -420.0), "box_size_mm": (300.0, 300.0, 80.0)},
            '"floor" rejects .* raise the box',
        ),
        ({"station": (0.0, 0.0, -0.3)}, r'"line of sight" rejects .* move \[tracker\] station_mm'),
    ],
)
def test_a_hopeless_pool_says_which_test_to_change(robot, simulator, changes, message, monkeypatch):
    monkeypatch.setattr(pool_module, "PATIENCE", ((20_000, 1e-3), (2_000, 1e-2)))
    with pytest.raises(InputError, match=message) as caught:
        drawn(robot, simulator, size=50, **changes)
    assert caught.value.code == "S37"


def test_a_pose_that_lost_digits_in_a_table_does_not_come_again(robot, simulator):
    """Nine decimals of a degree are kept: 1e-11 rad, not the bytes."""
    first = drawn(robot, simulator, size=20)
    read = np.radians(np.round(np.degrees(first.q[:5]), 9))
    assert not np.array_equal(read, first.q[:5])
    again = drawn(robot, simulator, size=20, exclude=read)
    assert np.abs(again.q[:, None] - read[None]).max(axis=2).min() > 1e-3
    assert np.array_equal(again.q[:15], first.q[5:])


@pytest.mark.slow
def test_a_rare_pool_is_still_filled(robot, simulator, monkeypatch):
    # a box of 6 cm: one candidate in thousands, well above where patience ends
    monkeypatch.setattr(pool_module, "PATIENCE", ((4_000, 1e-4), PATIENCE[1]))
    rare = drawn(
        robot, simulator, size=5, box_center_mm=(400.0, 0.0, 200.0), box_size_mm=(60.0,) * 3
    )
    assert len(rare.q) == 5
    assert rare.n_drawn > max(4_000, 5 / 1e-2)
    assert PATIENCE[0][1] < 5 / rare.n_drawn


def test_the_acceptance_cone_keeps_the_probe_turned_to_the_tracker(robot, simulator, pool):
    half = np.radians(40.0)
    narrow = drawn(robot, simulator, size=200, acceptance=half)

    def angle(q):
        T = forward(tx60().chain, q)
        beam = np.array(STATION) - (T @ [*AIM, 1.0])[:, :3]
        cross = np.linalg.norm(np.cross(T[:, :3, 2], beam), axis=1)
        return np.arctan2(cross, np.einsum("mi,mi->m", T[:, :3, 2], beam))  # not by arccos

    assert (angle(narrow.q) <= half + 1e-12).all()
    assert angle(narrow.q).max() > 0.9 * half  # the cone is used up to its edge
    lost = narrow.rejected_q[[name == "acceptance cone" for name in narrow.rejected_reason]]
    assert len(lost) == SAMPLE
    assert (angle(lost) > half).all()
    assert "acceptance cone" not in pool.rejection_names  # a full cone is none


def test_a_cone_that_nothing_fits_in_says_so(robot, simulator):
    with pytest.raises(InputError, match=r'"acceptance cone" rejects .* raise acceptance_deg'):
        drawn(robot, simulator, size=50, acceptance=1e-4)
