"""The tracker scatters as it states, in the frames it states, and nothing else."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from calib.arrays import Array
from calib.geometry.frames import exp_so3, inverse, log_so3, rot_z, slide, transform
from calib.geometry.jacobian import joint_columns, reflector_rows
from calib.measurement.observations import Measurements
from testbed.laboratory.tracker.of_scenario import tracker_from
from testbed.laboratory.tracker.tracker import Tracker
from testbed.laboratory.truth.robot import TrueRobot
from testbed.scenario.laboratory import At960Tracker, PaperTracker
from tests.reference import DEG, SIGMA_POSITION, SIGMA_ROTATION, UM, pool_r, tx60

MODEL, Q = tx60(), pool_r()
NO_SCATTER, SIGMA_Q = np.zeros(6), np.full(6, 14.5e-6)
REFLECTOR = (50.0, 30.0, 80.0)


def shots(tracker: Tracker, q: Array, m: int, seed: int = 0, sigma_q: Array = NO_SCATTER) -> Any:
    """m readings of one pose: errors (m, 6), and what was stated of it (6, 6)."""
    true = TrueRobot(MODEL, sigma_q)
    rng, many = np.random.default_rng(seed), np.repeat(q[None], m, axis=0)
    covariance = tracker.covariance(MODEL, q[None], sigma_q)
    T = true.poses(many, rng=rng)
    seen = tracker.measure(T, many, np.zeros(m), 0, np.broadcast_to(covariance[0], (m, 6, 6)), rng)
    exact = true.poses(q[None])
    turn = log_so3(seen.rotation @ np.swapaxes(exact[:, :3, :3], -1, -2))
    if tracker.measures == "point":
        turn = np.zeros((m, 3))
    return np.concatenate([seen.position - tracker.targets(exact), turn], axis=1), covariance[0]


def deviation(errors: Array, stated: Array) -> float:
    """Largest difference between sample and stated covariance, in sd of the sample covariance."""
    m, d = len(errors), np.diag(stated)
    sd = np.sqrt((np.outer(d, d) + stated**2) / m)  # normal errors
    return float((np.abs(errors.T @ errors / m - stated) / sd).max())


@pytest.mark.parametrize("settings", [PaperTracker(), At960Tracker()])
@pytest.mark.parametrize("sigma_q", [NO_SCATTER, SIGMA_Q])
@pytest.mark.parametrize("pose", [0, 7])
def test_a_hundred_thousand_shots_scatter_as_stated(settings, sigma_q, pose):
    tracker = tracker_from(settings, MODEL.chain)
    errors, stated = shots(tracker, Q[pose], 100_000, sigma_q=sigma_q)
    assert deviation(errors, stated) < 4  # specification section 4
    assert (np.abs(errors.mean(0)) < 4 * np.sqrt(np.diag(stated) / len(errors))).all()


@pytest.mark.parametrize("preset", [PaperTracker, At960Tracker])
def test_a_reflector_scatters_as_stated_at_the_reflector(preset):
    settings = preset(measures="point", reflector_mm=REFLECTOR)
    tracker = tracker_from(settings, MODEL.chain)
    errors, stated = shots(tracker, Q[3], 100_000, sigma_q=SIGMA_Q)
    assert deviation(errors[:, :3], stated[:3, :3]) < 4
    # a lever of 99 mm: the joints scatter the reflector elsewhere than the tool origin
    at_tool = tracker_from(preset(), MODEL.chain).covariance(MODEL, Q[3:4], SIGMA_Q)[0]
    assert deviation(errors[:, :3], at_tool[:3, :3]) > 4


def test_the_test_itself_sees_a_wrong_covariance():
    tracker = tracker_from(At960Tracker(), MODEL.chain)
    errors, stated = shots(tracker, Q[0], 100_000)
    assert deviation(errors, stated * 1.04) > 4


def test_the_paper_preset_is_isotropic_and_holds_the_robots_repeatability():
    stated = tracker_from(PaperTracker(), MODEL.chain).covariance(MODEL, Q[:20], NO_SCATTER)
    expected = np.diag(np.repeat([SIGMA_POSITION**2, SIGMA_ROTATION**2], 3))
    # rotation covariance passes through R diag R': a few roundings
    np.testing.assert_allclose(stated, np.tile(expected, (20, 1, 1)), rtol=1e-13, atol=1e-22)


def test_the_at960_preset_is_the_written_formula():
    tracker = tracker_from(At960Tracker(), MODEL.chain)
    T = MODEL.poses(Q[:5])
    for pose, stated in zip(T, tracker.covariance(MODEL, Q[:5], NO_SCATTER), strict=True):
        beam = pose[:3, 3] - [2.6, -2.0, 0.3]
        rho = np.linalg.norm(beam)
        uu = np.outer(beam, beam) / rho**2
        position = (
            (2 * UM + 0.15 * UM * rho) ** 2 * uu
            + (3 * UM + 1.5 * UM * rho) ** 2 * (np.eye(3) - uu)
            + (2.5 * UM) ** 2 * np.eye(3)
        )
        angles = np.array([0.002, 0.002, 0.0035]) * DEG
        rotation = pose[:3, :3] @ np.diag(angles**2) @ pose[:3, :3].T
        np.testing.assert_allclose(stated[:3, :3], position, rtol=1e-12, atol=1e-24)
        np.testing.assert_allclose(stated[3:, 3:], rotation, rtol=1e-12, atol=1e-24)
        assert not stated[:3, 3:].any()


def test_joint_repeatability_adds_its_image_at_the_tracked_point():
    settings = At960Tracker(measures="point", reflector_mm=REFLECTOR)
    tracker = tracker_from(settings, MODEL.chain)
    T, J = MODEL.poses_and_jacobian(Q[:5])
    rows = reflector_rows(T, J, np.tile(np.array(REFLECTOR) / 1e3, (5, 1)))[1]
    image = rows[:, :, joint_columns(MODEL.chain)] * SIGMA_Q
    added = tracker.covariance(MODEL, Q[:5], SIGMA_Q) - tracker.covariance(MODEL, Q[:5], NO_SCATTER)
    np.testing.assert_allclose(
        added[:, :3, :3], image @ np.swapaxes(image, 1, 2), rtol=1e-9, atol=1e-20
    )


def test_scatter_is_small_along_the_beam_and_grows_with_range_across_it():
    near, far = (
        tracker_from(At960Tracker(station_mm=station), MODEL.chain)
        for station in ((2000.0, 0.0, 0.0), (8000.0, 0.0, 0.0))
    )
    for tracker in (near, far):
        stated = tracker.covariance(MODEL, Q[:1], NO_SCATTER)[0, :3, :3]
        beam = MODEL.poses(Q[:1])[0, :3, 3] - tracker.station
        values, vectors = np.linalg.eigh(stated)
        # the softest direction is the beam
        assert abs(vectors[:, 0] @ beam) / np.linalg.norm(beam) == pytest.approx(1, abs=1e-9)
        assert values[1] == pytest.approx(values[2], rel=1e-9)
    assert np.trace(far.covariance(MODEL, Q[:1], NO_SCATTER)[0, :3, :3]) > 4 * np.trace(
        near.covariance(MODEL, Q[:1], NO_SCATTER)[0, :3, :3]
    )


def test_rotating_robot_and_tracker_together_rotates_the_scatter():
    turn = slide(0.3, -0.2, 0.1) @ rot_z(0.7)
    turned = replace(MODEL, chain=replace(MODEL.chain, T_world_base=turn))
    settings = At960Tracker()
    here = tracker_from(settings, MODEL.chain).covariance(MODEL, Q[:9], SIGMA_Q)
    there = tracker_from(settings, turned.chain).covariance(turned, Q[:9], SIGMA_Q)
    R = np.kron(np.eye(2), turn[:3, :3])
    np.testing.assert_allclose(there, R @ here @ R.T, rtol=1e-9, atol=1e-22)


def test_carrying_the_tracker_around_the_target_rotates_its_scatter():
    tracker = tracker_from(At960Tracker(), MODEL.chain)
    target = MODEL.poses(Q[:1])[0, :3, 3]
    R = exp_so3(np.array([0.4, -0.3, 1.1]))
    around = transform(np.eye(3), target) @ transform(R, np.zeros(3)) @ slide(*-target)
    carried = replace(tracker, T_world_tracker=around @ tracker.T_world_tracker)
    here, there = (t.covariance(MODEL, Q[:1], NO_SCATTER)[0, :3, :3] for t in (tracker, carried))
    np.testing.assert_allclose(there, R @ here @ R.T, rtol=1e-9, atol=1e-22)
    assert np.abs(there - here).max() > 1e-12  # square of a micrometer: really another one
    # the noise itself turns as well, not only what is stated of it
    errors, _ = shots(carried, Q[0], 100_000)
    assert deviation(errors[:, :3], R @ here @ R.T) < 4
    assert deviation(errors[:, :3], here) > 4


def test_turning_the_tracker_in_place_changes_nothing():
    # a spherical instrument has no preferred direction: only the beam counts
    tracker = tracker_from(At960Tracker(), MODEL.chain)
    turned = replace(tracker, T_world_tracker=tracker.T_world_tracker @ rot_z(1.0))
    np.testing.assert_array_equal(
        tracker.covariance(MODEL, Q[:9], SIGMA_Q), turned.covariance(MODEL, Q[:9], SIGMA_Q)
    )


def test_noise_follows_the_shot_and_the_statement_follows_the_plan():
    # a true pose far from the nominal one: what is stated must not know it
    tracker = tracker_from(At960Tracker(), MODEL.chain)
    q = np.repeat(Q[:1], 50_000, axis=0)
    T = MODEL.poses(Q[:1]).copy()
    T[0, :3, 3] += 20 * (T[0, :3, 3] - tracker.station)  # 20 times as far away
    stated = tracker.covariance(MODEL, q[:1], NO_SCATTER)
    seen = tracker.measure(
        np.repeat(T, len(q), axis=0),
        q,
        np.zeros(len(q)),
        0,
        np.broadcast_to(stated[0], (len(q), 6, 6)),
        np.random.default_rng(0),
    )
    sd = np.sqrt(np.trace(np.cov((seen.position - T[0, :3, 3]).T)))
    rho = np.linalg.norm(T[0, :3, 3] - tracker.station)
    across, along = 3 * UM + 1.5 * UM * rho, 2 * UM + 0.15 * UM * rho
    expected = np.sqrt(2 * across**2 + along**2 + 3 * (2.5 * UM) ** 2)
    assert sd == pytest.approx(expected, rel=0.015)  # 4 sd of an sd from 1e5 numbers
    np.testing.assert_array_equal(seen.covariance[0], stated[0])


@pytest.mark.parametrize("measures", ["pose", "point"])
def test_the_table_says_what_was_measured(measures):
    reflector = REFLECTOR if measures == "point" else (0.0, 0.0, 0.0)
    settings = At960Tracker(measures=measures, reflector_mm=reflector)
    tracker = tracker_from(settings, MODEL.chain)
    q, ids = Q[:6], np.array([3, 1, 4, 1, 5, 9])
    covariance = tracker.covariance(MODEL, q, SIGMA_Q)
    seen = tracker.measure(MODEL.poses(q), q, ids, 2, covariance, np.random.default_rng(1))
    assert isinstance(seen, Measurements)
    assert set(seen.kind.tolist()) == {measures}
    assert seen.n_equations == (36 if measures == "pose" else 18)
    np.testing.assert_array_equal(seen.pose_id, ids)
    np.testing.assert_array_equal(seen.repeat, 2)
    np.testing.assert_array_equal(seen.offset, np.tile(np.array(reflector) / 1e3, (6, 1)))
    exact = MODEL.poses(q) @ transform(np.eye(3), np.array(reflector) / 1e3)
    # tens of micrometers of noise around the right point
    assert 1e-6 < np.abs(seen.position - exact[:, :3, 3]).max() < 1e-4


def test_a_noiseless_tracker_reports_the_truth():
    tracker = replace(
        tracker_from(At960Tracker(), MODEL.chain),
        range_sd=(0.0, 0.0), transverse_sd=(0.0, 0.0), centering_sd=0.0, rotation_sd=(0.0,) * 3,
    )  # fmt: skip
    T = MODEL.poses(Q[:6])
    seen = tracker.measure(
        T, Q[:6], np.arange(6), 0, np.tile(np.eye(6), (6, 1, 1)), np.random.default_rng(0)
    )
    np.testing.assert_array_equal(seen.position, T[:, :3, 3])
    np.testing.assert_allclose(seen.rotation, T[:, :3, :3], atol=1e-16)


def test_same_stream_same_readings():
    tracker = tracker_from(PaperTracker(), MODEL.chain)
    covariance = tracker.covariance(MODEL, Q[:6], NO_SCATTER)
    a, b = (
        tracker.measure(
            MODEL.poses(Q[:6]), Q[:6], np.arange(6), 0, covariance, np.random.default_rng(4)
        )
        for _ in range(2)
    )
    np.testing.assert_array_equal(a.position, b.position)
    np.testing.assert_array_equal(a.rotation, b.rotation)


def test_the_station_is_given_in_the_base_frame_and_the_aim_in_the_tool_frame():
    base, tool = (
        slide(1.0, 2.0, 0.5) @ rot_z(0.4),
        slide(0.1, 0.0, 0.2) @ transform(exp_so3(np.array([0.3, -0.2, 0.1])), np.zeros(3)),
    )
    chain = replace(MODEL.chain, T_world_base=base, T_flange_tool=tool)
    tracker = tracker_from(PaperTracker(), chain)
    np.testing.assert_allclose(
        (inverse(base) @ [*tracker.station, 1.0])[:3], [2.6, -2.0, 0.3], atol=1e-15
    )
    # the drawn probe hangs on the flange, wherever the tool frame is
    np.testing.assert_allclose(
        tool @ [*tracker.aim(chain), 1.0], [0.0, 0.0, 0.060, 1.0], atol=1e-15
    )
    point = tracker_from(PaperTracker(measures="point", reflector_mm=REFLECTOR), chain)
    np.testing.assert_array_equal(point.aim(chain), np.array(REFLECTOR) / 1e3)
