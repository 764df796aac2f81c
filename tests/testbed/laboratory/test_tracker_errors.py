"""What a tracker gets wrong on purpose: the same every time, wandering, grossly, or not at all."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib.arrays import Array
from calib.errors import InputError
from calib.geometry.frames import exp_so3, log_so3, rot_x, rot_z, slide, transform
from calib.measurement.observations import Measurements
from calib.uncertainty.statement.instrument import TURN
from testbed.laboratory.tracker.errors import NESTS, StationBias, StationDrift, draw
from testbed.laboratory.tracker.of_scenario import bias_size, tracker_from
from testbed.laboratory.tracker.tracker import Tracker, streams_below
from testbed.scenario.laboratory import At960Tracker
from tests.reference import DEG, UM, pool_r, tx60
from tests.testbed.laboratory.test_tracker import NO_SCATTER, REFLECTOR, deviation

MODEL, Q = tx60(), pool_r()
SIZE = bias_size(At960Tracker(level_mdeg=0.6))
EVERY = {"systematic": True, "drift_um_per_sqrt_h": 20.0, "outliers": 3, "missed": 2}
"""All switches of what is off by default."""


def read(tracker: Tracker, q: Array, seed: int = 0, time: Array | None = None) -> Measurements:
    """One visit of poses (m, 6)."""
    return next(visits(tracker, q, [seed], time))


def visits(
    tracker: Tracker, q: Array, seeds: Iterable[int], time: Array | None = None
) -> Iterator[Measurements]:
    """Visits of the same poses (m, 6)."""
    T, stated = MODEL.poses(q), tracker.covariance(MODEL, q, NO_SCATTER)
    for seed in seeds:
        rng = np.random.default_rng(seed)
        yield tracker.measure(T, q, np.arange(len(q)), 0, stated, rng, time=time)


@cache
def campaigns() -> Array:
    """The fourteen numbers of 20 000 campaigns."""
    rng = np.random.default_rng(0)
    return np.array([draw(SIZE, rng) for _ in range(20_000)])


def at960(*, seed: int | None = 3, **changes) -> Tracker:
    return tracker_from(At960Tracker(**changes), MODEL.chain, seed=seed)


def test_by_default_there_is_none_of_it():
    plain, seeded = at960(seed=None), at960(seed=3)
    assert plain.bias is None
    assert plain.drift is None
    a, b = read(plain, Q[:40]), read(seeded, Q[:40])
    np.testing.assert_array_equal(a.position, b.position)
    np.testing.assert_array_equal(a.rotation, b.rotation)


def test_planning_knows_no_systematic_error():
    assert at960(seed=None, systematic=True).bias is None
    np.testing.assert_array_equal(
        at960(systematic=True).covariance(MODEL, Q[:5], NO_SCATTER),
        at960().covariance(MODEL, Q[:5], NO_SCATTER),
    )


@pytest.mark.parametrize("switch", EVERY)
def test_switching_one_of_them_moves_no_other_and_no_noise(switch):
    rest = {key: value for key, value in EVERY.items() if key != switch}
    both = read(at960(**EVERY), Q[:60]), read(at960(**rest), Q[:60])
    if switch == "missed":
        kept = np.isin(both[1].pose_id, both[0].pose_id)
        assert kept.sum() == 58
        np.testing.assert_array_equal(both[0].position, both[1].rows(kept).position)
        return
    np.testing.assert_array_equal(both[0].pose_id, both[1].pose_id)
    moved = both[0].position - both[1].position
    if switch == "outliers":
        assert (np.abs(moved).max(1) > 1e-9).sum() <= 3
        return
    # the difference is what the term alone adds to the noise
    alone = read(at960(**{switch: EVERY[switch]}), Q[:60])
    none = read(at960(), Q[:60])
    same = np.isin(alone.pose_id, both[0].pose_id)
    # sums of meters and micrometers, rounded in another order
    np.testing.assert_allclose(moved, (alone.position - none.position)[same], atol=1e-15)


# systematic part


def test_the_systematic_part_is_the_written_formula():
    size, rng, again = SIZE, np.random.default_rng(1), np.random.default_rng(1)
    b = draw(size, rng)
    offset, scale = again.uniform(-1, 1) * 2.5 * UM, again.standard_normal() * 0.2 * UM
    phi1, phi2 = again.uniform(0, 2 * np.pi, 2)
    place, turn = again.standard_normal(3) * 2.5 * UM, again.uniform(-1, 1, 3) * 0.005 * DEG
    tilt = again.standard_normal(2) * 0.6e-3 * DEG
    T_world_tracker = slide(2.6, -2.0, 0.3) @ rot_z(0.4) @ rot_x(0.1)
    T = MODEL.poses(Q[:50])
    found = StationBias(size, b).errors(T[:, :3, 3], T[:, :3, :3], T_world_tracker)
    R0 = T_world_tracker[:3, :3]
    for pose, error in zip(T, found, strict=True):
        x, y, z = R0.T @ (pose[:3, 3] - T_world_tracker[:3, 3])
        rho, az = np.hypot(np.hypot(x, y), z), np.arctan2(y, x)
        el = np.arcsin(z / rho)
        across = 7.5 * UM + 3 * UM * rho
        # turned by error / distance; in azimuth the circle is smaller by cos el
        d_az = across * np.sin(az + phi1) / (rho * np.cos(el))
        d_el = across * np.sin(2 * el + phi2) / rho
        d_rho = offset + scale * rho
        h = 1e-3
        shift = from_spherical(az + h * d_az, el + h * d_el, rho + h * d_rho)
        shift = (shift - from_spherical(az - h * d_az, el - h * d_el, rho - h * d_rho)) / (2 * h)
        about = R0 @ [*tilt, 0.0]  # the whole station leans
        shift = R0 @ shift + np.cross(about, pose[:3, 3] - T_world_tracker[:3, 3])
        # meters are rounded to 1e-16, divided by 2 h; the shift is of 20 um
        np.testing.assert_allclose(error[:3] - pose[:3, :3] @ place, shift, atol=2e-12)
        np.testing.assert_allclose(error[3:], pose[:3, :3] @ turn + about, atol=1e-18)


def from_spherical(azimuth: float, elevation: float, distance: float) -> Array:
    """A point in the frame of the tracker [m]."""
    level = np.cos(elevation)
    direction = [level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)]
    return distance * np.array(direction)


def test_the_fourteen_numbers_have_the_stated_variances():
    b = campaigns()
    normal = b / np.sqrt(SIZE.variance)
    correlation = normal.T @ normal / len(b)
    # kurtosis is at most 3: sd of a mean square is sqrt(2/n), of a mean product sqrt(1/n); the
    # largest of 105 within 4.5 of those
    assert np.abs(correlation - np.eye(14)).max() < 4.5 * np.sqrt(2 / len(b))
    assert np.abs(normal.mean(0)).max() < 4.5 / np.sqrt(len(b))
    assert np.abs(b[:, 0]).max() <= 2.5 * UM
    assert np.abs(b[:, TURN]).max() <= 0.005 * DEG
    np.testing.assert_allclose(b[:, 2] ** 2 + b[:, 3] ** 2, 1, rtol=1e-12)


def test_it_is_the_same_all_campaign_long_and_another_in_another_campaign():
    tracker, other = at960(systematic=True), at960(systematic=True, seed=4)
    none = at960()
    offsets = [
        read(tracker, Q[:20], seed).position - read(none, Q[:20], seed).position for seed in (0, 1)
    ]
    np.testing.assert_allclose(offsets[0], offsets[1], atol=1e-15)
    assert np.abs(offsets[0]).max() > 1 * UM
    assert np.abs(other.bias.numbers - tracker.bias.numbers).max() > 1e-3


def test_shots_scatter_as_stated_about_a_shifted_mean():
    tracker = at960(systematic=True)
    q = np.repeat(Q[:1], 100_000, axis=0)
    T = np.repeat(MODEL.poses(Q[:1]), len(q), axis=0)
    stated = tracker.covariance(MODEL, Q[:1], NO_SCATTER)[0]
    table = np.broadcast_to(stated, (len(q), 6, 6))
    seen = tracker.measure(T, q, np.zeros(len(q)), 0, table, np.random.default_rng(0))
    turn = log_so3(seen.rotation @ np.swapaxes(T[:, :3, :3], 1, 2))
    errors = np.concatenate([seen.position - T[:, :3, 3], turn], axis=1)
    shift = tracker.bias.errors(T[:1, :3, 3], T[:1, :3, :3], tracker.T_world_tracker)[0]
    assert deviation(errors - shift, stated) < 4
    assert deviation(errors, stated) > 4
    assert (np.abs(errors.mean(0) - shift) < 4 * np.sqrt(np.diag(stated) / len(q))).all()


@pytest.mark.slow
def test_over_many_campaigns_the_systematic_part_has_the_covariance_of_its_sensitivity():
    tracker, T = at960(), MODEL.poses(Q[:2])
    B = SIZE.sensitivity(T[:, :3, 3], T[:, :3, :3], tracker.T_world_tracker).reshape(12, 14)
    drawn = campaigns()
    expected = B @ np.diag(SIZE.variance) @ B.T
    # two poses share their errors: the blocks off the diagonal are there
    assert np.abs(expected[:6, 6:]).max() > 0.1 * np.abs(expected).max()
    # a sum of bounded numbers has lighter tails than normal: 4.5 normal sd hold the worst of 78
    assert deviation(drawn @ B.T, expected) < 4.5


def test_rotating_robot_and_tracker_together_rotates_the_systematic_part():
    turn = slide(0.3, -0.2, 0.1) @ transform(exp_so3(np.array([0.5, 0.2, 0.9])), np.zeros(3))
    T = MODEL.poses(Q[:9])
    here = SIZE.sensitivity(T[:, :3, 3], T[:, :3, :3], slide(2.6, -2.0, 0.3))
    moved = turn @ T
    there = SIZE.sensitivity(moved[:, :3, 3], moved[:, :3, :3], turn @ slide(2.6, -2.0, 0.3))
    R = np.kron(np.eye(2), turn[:3, :3])
    np.testing.assert_allclose(there, R @ here, atol=1e-15)


def test_turning_the_tracker_about_its_own_axis_moves_the_phase_of_its_azimuth():
    # unlike noise, the circles of a tracker have a zero
    T, station = MODEL.poses(Q[:9]), slide(2.6, -2.0, 0.3)
    at = [SIZE.sensitivity(T[:, :3, 3], T[:, :3, :3], station @ rot_z(a)) for a in (0.0, 0.7)]
    c, s = np.cos(0.7), np.sin(0.7)
    sine, cosine = at[0][:, :, 2], at[0][:, :, 3]
    np.testing.assert_allclose(at[1][:, :, 2], c * sine - s * cosine, atol=1e-18)
    np.testing.assert_allclose(at[1][:, :, [0, 1, 4, 5]], at[0][:, :, [0, 1, 4, 5]], atol=1e-15)


def test_a_reflector_has_the_systematic_part_at_the_reflector():
    changes = {"measures": "point", "reflector_mm": REFLECTOR}
    tracker, plain = at960(systematic=True, **changes), at960(**changes)
    a, b = read(tracker, Q[:10]), read(plain, Q[:10])
    T = MODEL.poses(Q[:10])
    shift = tracker.bias.errors(tracker.targets(T), T[:, :3, :3], tracker.T_world_tracker)
    np.testing.assert_allclose(a.position - b.position, shift[:, :3], atol=1e-15)
    np.testing.assert_array_equal(a.rotation, b.rotation)


# drift


def test_the_station_walks_at_random_between_two_rounds_over_the_nests():
    rate = 20 * UM / 60
    drift = StationDrift(rate, 600.0, np.array(NESTS))
    time = np.array([0.0, 100.0, 599.0, 600.0, 700.0, 1900.0])
    rng = np.random.default_rng(0)
    walks = np.array([drift.walk(time, rng) for _ in range(4000)])
    since = np.array([0.0, 100.0, 599.0, 0.0, 100.0, 100.0])
    # sd of an sd from 12 000 numbers: .65 %, four of them
    np.testing.assert_allclose(
        walks.std(axis=(0, 2)), rate * np.sqrt(since), rtol=0.026, atol=1e-20
    )
    # 20 um after an hour without nests
    hour = np.array([0.0, 3600.0])
    never = StationDrift(rate, 1e9, np.array(NESTS))
    free = [never.walk(hour, rng)[1] for _ in range(4000)]
    assert np.std(free) == pytest.approx(20 * UM, rel=0.026)
    x = walks[:, :, 0]
    # within one round the later shot holds the walk of the earlier one; rounds are independent
    both = (x[:, 1] * x[:, 2]).mean() / (rate**2 * 100)
    assert both == pytest.approx(1, abs=4 * np.sqrt((1 + 599 / 100) / 4000))
    apart = (x[:, 2] * x[:, 4]).mean() / (rate**2 * np.sqrt(599 * 100))
    assert abs(apart) < 4 / np.sqrt(4000)


def test_the_scenario_gives_the_walk_per_root_of_an_hour():
    drift = at960(drift_um_per_sqrt_h=20.0, nests_s=900.0).drift
    assert drift.rate * np.sqrt(3600) == pytest.approx(20 * UM, rel=1e-12)
    assert drift.every == 900.0
    base = slide(1.0, 2.0, 0.0) @ rot_z(0.5)
    chain = replace(MODEL.chain, T_world_base=base)
    elsewhere = tracker_from(At960Tracker(drift_um_per_sqrt_h=20.0), chain).drift
    np.testing.assert_allclose(
        elsewhere.nests, [(base @ [*nest, 1.0])[:3] for nest in NESTS], atol=1e-15
    )


def test_no_later_shot_changes_an_earlier_walk_within_a_round():
    drift = StationDrift(1e-6, 1e9, np.array(NESTS))
    time = np.arange(30) * 10.0
    whole, part = (drift.walk(time[:m], np.random.default_rng(1)) for m in (30, 12))
    np.testing.assert_allclose(whole[:12], part, atol=1e-18)


@pytest.mark.slow
def test_readings_hold_the_walk_and_the_noise_of_the_nests():
    tracker, plain = at960(drift_um_per_sqrt_h=50.0, nests_s=200.0), at960()
    both = zip(*(visits(one, Q[:61], range(200)) for one in (tracker, plain)), strict=True)
    added = np.array([moved.position - still.position for moved, still in both])
    nests = tracker.own_covariance(tracker.drift.nests)[:, :3, :3].mean(0) / len(NESTS)
    since = np.arange(61) * 10.0 % 200.0
    for k in (0, 19, 20, 60):
        expected = nests + np.eye(3) * tracker.drift.rate**2 * since[k]
        assert deviation(added[:, k], expected) < 4.5
    # the nests bring it back: the error does not grow from round to round
    assert np.abs(added[:, 40:]).std() < 1.2 * np.abs(added[:, :20]).std()
    # rotation is not touched
    np.testing.assert_array_equal(read(tracker, Q[:61]).rotation, read(plain, Q[:61]).rotation)


def test_carrying_tracker_and_nests_rotates_the_walk():
    turn = transform(exp_so3(np.array([0.2, -0.4, 1.0])), np.zeros(3))
    tracker = at960(drift_um_per_sqrt_h=50.0)
    walks = [
        t.drift.walk(np.arange(9) * 10.0, np.random.default_rng(0)) @ t.T_world_tracker[:3, :3].T
        for t in (tracker, replace(tracker, T_world_tracker=turn @ tracker.T_world_tracker))
    ]
    np.testing.assert_allclose(walks[1], walks[0] @ turn[:3, :3].T, atol=1e-18)


def test_time_counts_from_the_first_shot_of_a_visit():
    tracker = at960(drift_um_per_sqrt_h=50.0)
    early, late = (read(tracker, Q[:20], 0, start + np.arange(20) * 10.0) for start in (0, 7200))
    np.testing.assert_array_equal(early.position, late.position)
    slow = read(tracker, Q[:20], 0, np.arange(20) * 1000.0)
    assert np.abs(slow.position - early.position).max() > 1 * UM


# outliers and missed shots


def test_outliers_are_as_many_and_as_large_as_asked_and_flagged_nowhere():
    tracker, plain = at960(outliers=3, outlier_mm=0.5, outlier_deg=0.1), at960()
    errors, chosen = [], np.zeros(61)
    both = (visits(one, Q[:61], range(150)) for one in (tracker, plain))
    for seen, good in zip(*both, strict=True):
        moved = seen.position - good.position
        rows = np.flatnonzero(moved.any(1))
        assert len(rows) == 3
        chosen[rows] += 1
        turn = log_so3(seen.rotation[rows] @ np.swapaxes(good.rotation[rows], 1, 2))
        errors.append(np.concatenate([moved[rows], turn], axis=1))
        np.testing.assert_array_equal(seen.covariance, good.covariance)
    all_of_them = np.concatenate(errors)
    stated = np.diag(np.repeat([0.5e-3, 0.1 * DEG], 3) ** 2)
    assert deviation(all_of_them, stated) < 4
    # each pose about as often: 450 in 61 places, 7 each, sd 2.7
    assert np.abs(chosen - 450 / 61).max() < 4.5 * np.sqrt(450 / 61)


@pytest.mark.parametrize("measures", ["pose", "point"])
def test_missed_shots_leave_no_row(measures):
    reflector = REFLECTOR if measures == "point" else (0.0, 0.0, 0.0)
    tracker = at960(missed=4, measures=measures, reflector_mm=reflector)
    seen = read(tracker, Q[:30])
    assert len(seen) == 26
    assert len(set(seen.pose_id.tolist())) == 26
    np.testing.assert_array_equal(seen.q, Q[seen.pose_id])
    assert seen.n_equations == 26 * (6 if measures == "pose" else 3)
    again = read(tracker, Q[:30], seed=1)
    assert set(seen.pose_id.tolist()) != set(again.pose_id.tolist())


@pytest.mark.parametrize("key", ["outliers", "missed"])
def test_more_mishaps_than_shots_are_refused(key):
    with pytest.raises(InputError, match=f"{key} is 9; the visit has 5 shots"):
        read(at960(**{key: 9}), Q[:5])


def test_streams_below_depend_on_the_stream_and_not_on_what_it_gave():
    one, used = np.random.default_rng(5), np.random.default_rng(5)
    used.standard_normal(100)
    used.spawn(3)
    first, second = ([s.normal() for s in streams_below(rng)] for rng in (one, used))
    assert first == second
    assert len(set(first)) == 4
    assert not set(first) & {s.normal() for s in np.random.default_rng(5).spawn(4)}
