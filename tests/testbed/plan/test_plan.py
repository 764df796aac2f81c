"""A plan: its numbers made again by other means, its order free when tested more finely."""

import numpy as np
import pytest

from calib.geometry.frames import transform
from testbed.laboratory.bench import open_bench
from testbed.laboratory.cell import cell_from
from testbed.laboratory.goal import goal_of
from testbed.laboratory.simulator import Simulator
from testbed.laboratory.tracker.of_scenario import tracker_from
from testbed.plan.plan import compared, plan
from testbed.plan.results import plan_csv
from testbed.plan.words import measured_words
from tests.calib.slopes import slopes, twist
from tests.planned import BARE, ROBOT, SMALL, legs, quick_plan, scenario, small_plan

CHAIN = ROBOT.model.chain
STEP = 1e-5
"""Of central differences [m, rad]: their error is its square, the rounding 1e-16 divided by it."""
DIFFERENCED = 1e-6
"""What central differences leave of a standard uncertainty: condition times 1e-10."""


@pytest.fixture(scope="session")
def made():
    return small_plan()


def tracker_of(made):
    """The tracker at the station of a plan."""
    settings = made.scenario.tracker.model_copy(update={"station_mm": made.station_mm})
    return tracker_from(settings, CHAIN)


def pose_change(q, numbers, *, point=(0.0, 0.0, 0.0)):
    """Change of the tool point and turn (m, 6, p) by these numbers, by central differences."""
    at = transform(np.eye(3), np.asarray(point))
    return slopes(
        lambda step: ROBOT.model.moved(step).poses(q) @ at, np.zeros(ROBOT.model.n_numbers), STEP,
        by=numbers, minus=twist,
    )  # fmt: skip


def matrices(made, q):
    """Information (m, p, p) of each pose q in scaled units, from differences and `inv` alone."""
    tracker, free = tracker_of(made), np.flatnonzero(made.parameters.free)
    C = tracker.covariance(ROBOT.model, q, open_bench(made.scenario).sigma_q)
    J = pose_change(q, free) * made.parameters.free_scale
    return np.swapaxes(J, 1, 2) @ np.linalg.inv(C) @ J


def uncertainty(made, M):
    """Standard uncertainty (g,) over the goal with information M (p, p)."""
    free = np.flatnonzero(made.parameters.free)
    G = pose_change(made.goal.q, free, point=made.goal.point)
    rows = (G * made.parameters.free_scale)[:, :3]
    return np.sqrt(np.einsum("gai,ij,gaj->g", rows, np.linalg.inv(M), rows))


def brute_u(made, q):
    """The same after poses q."""
    return uncertainty(made, matrices(made, q).sum(axis=0))


def test_the_predicted_uncertainty_is_that_of_the_information_summed_by_brute_force(made):
    u = brute_u(made, made.pool.q[made.places])
    assert made.u == pytest.approx(u, rel=DIFFERENCED)
    assert made.u_mean == pytest.approx(np.sqrt((u**2).mean()), rel=DIFFERENCED)
    assert made.u_worst == pytest.approx(u.max(), rel=DIFFERENCED)


def test_the_uncertainty_while_measuring_is_that_of_the_first_poses(made):
    q = made.tour.q[[role == "identify" for role in made.tour.roles]]
    assert np.array_equal(q, made.pool.q[made.places])
    assert made.u_of_step[-1] == pytest.approx(made.u_mean, rel=1e-12)
    assert made.u_of_step[8] == pytest.approx(
        np.sqrt((brute_u(made, q[:9]) ** 2).mean()), rel=DIFFERENCED
    )
    # four poses of six rows cannot tell 30 numbers
    assert np.isnan(made.u_of_step[:4]).all()
    assert (np.diff(made.u_of_step[np.isfinite(made.u_of_step)]) < 0).all()


def test_readings_are_what_mujoco_and_the_arc_tangent_say(made):
    T = Simulator(ROBOT, CHAIN).poses(made.tour.q)
    station = CHAIN.T_world_base @ np.array([*np.array(made.station_mm) / 1e3, 1.0])
    # the reflector cube sits on the tool's z axis, beyond the tool frame's origin
    aim = tracker_of(made).aim(CHAIN)
    for reading, offset in zip(made.readings, (np.zeros(3), aim), strict=True):
        world = T[:, :3, 3] + T[:, :3, :3] @ offset - station[:3]
        x, y, z = (world @ CHAIN.T_world_base[:3, :3]).T
        # two kinematics agree to 1e-15 m; over 2 m that is an angle of 1e-15
        assert reading.position == pytest.approx(np.array([x, y, z]).T, abs=1e-12)
        assert reading.range == pytest.approx(np.sqrt(x * x + y * y + z * z), abs=1e-12)
        for k in range(len(T)):
            azimuth, elevation = reading.azimuth[k], reading.elevation[k]
            assert azimuth == pytest.approx(np.arctan2(y[k], x[k]), abs=1e-12)
            assert elevation == pytest.approx(np.arcsin(z[k] / reading.range[k]), abs=1e-11)
    assert [reading.target for reading in made.readings] == ["tool", "probe"]


def test_every_pose_is_seen_from_the_station_and_hits_nothing(made):
    tracker = tracker_of(made)
    simulator = Simulator(ROBOT, CHAIN, cell_from(made.scenario.cell, CHAIN))
    assert not simulator.collides(made.tour.q).any()
    aim = tracker.aim(CHAIN)
    assert simulator.sees(made.tour.q, tracker.station, aim).all()
    T = ROBOT.model.poses(made.tour.q)
    beam = tracker.station - T[:, :3, 3] - T[:, :3, :3] @ aim
    beam /= np.linalg.norm(beam, axis=1, keepdims=True)
    outward = T[:, :3, :3] @ (aim / np.linalg.norm(aim))
    assert np.degrees(np.arccos((beam * outward).sum(axis=1))).max() <= 60.0


def test_held_out_poses_are_new_and_where_the_robot_will_work(made):
    test = np.array([role == "test" for role in made.tour.roles])
    held = made.tour.q[test]
    assert len(held) == 6
    for others in (made.pool.q, made.goal.q):
        nearest = np.abs(held[:, None] - others[None]).max(axis=2).min()
        # 36 random joint values in some 200 deg agree to 1e-3 rad with probability 1e-12
        assert nearest > 1e-3
    box = made.scenario.plan.goal
    base = np.linalg.inv(CHAIN.T_world_base)
    place = (ROBOT.model.poses(held)[:, :3, 3] @ base[:3, :3].T + base[:3, 3]) * 1e3
    assert (np.abs(place - box.center_mm) <= np.array(box.size_mm) / 2).all()
    assert (made.tour.pool_place[test] == -1).all()


def test_the_order_is_a_permutation_of_what_was_chosen(made):
    kept = made.tour.pool_place[made.tour.pool_place >= 0]
    assert np.array_equal(kept, made.places)
    assert len(set(kept.tolist())) == len(kept)
    assert np.array_equal(made.tour.q[made.tour.pool_place >= 0], made.pool.q[kept])


def test_every_straight_move_is_free_when_tested_five_times_as_finely(made):
    simulator = Simulator(ROBOT, CHAIN, cell_from(made.scenario.cell, CHAIN))
    bound = simulator.travel_bounds()
    assert made.tour.blocked == ()
    # the post makes some straight moves impossible: else this would prove little
    assert any(len(via) for via in made.tour.vias)
    for start, end in legs(made):
        count = int(np.ceil((np.abs(end - start) @ bound) / 0.002)) + 1
        share = np.linspace(0, 1, count)[:, None]
        assert not simulator.collides(start + share * (end - start)).any()
    for k, via in enumerate(made.tour.vias):
        if len(via):
            before = made.tour.q[k - 1] if k else made.tour.start
            share = np.linspace(0, 1, 2000)[:, None]
            straight = before + share * (made.tour.q[k] - before)
            assert simulator.collides(straight).any()


def test_the_duration_is_that_of_the_moves_at_speed_and_the_rests(made):
    ends = legs(made)
    seconds = (np.abs(ends[:, 1] - ends[:, 0]) / (0.3 * ROBOT.speeds)).max(axis=1)
    assert made.tour.move.sum() == pytest.approx(seconds.sum(), rel=1e-12)
    assert made.tour.duration == pytest.approx(seconds.sum() + 4.0 * len(made.tour), rel=1e-12)


def test_the_curve_falls_the_bound_stays_below_and_the_target_is_met_with_the_poses_said(made):
    curve, m = made.curve, len(made.places)
    assert (np.diff(curve.counts) > 0).all()
    assert (np.diff(curve.u) <= 0).all()
    assert (np.diff(curve.bound) <= 0).all()
    assert (curve.bound <= curve.u).all()
    seen = np.isfinite(curve.random)
    assert (curve.u[seen] <= curve.random[seen]).all()
    target = 10e-6  # U = 20 um at k = 2
    assert curve.target == pytest.approx(target)
    assert curve.reached == m
    assert made.u_mean <= target
    assert curve.u[curve.counts == m] == pytest.approx(made.u_mean, rel=1e-12)
    assert 1 < curve.fewest <= m
    below, reached = curve.counts < curve.fewest, curve.counts >= curve.fewest
    assert (curve.bound[below] > target).all()
    assert (curve.bound[reached] <= target).all()


def test_no_random_set_of_fewer_than_the_proven_number_reaches_the_target(made):
    """Not a proof of the bound, which the design tests have; it would show a bound too high."""
    rng = np.random.default_rng(0)
    q = made.pool.q
    for _ in range(5):
        places = rng.permutation(len(q))[: made.curve.fewest - 1]
        u = brute_u(made, q[places])
        assert np.sqrt((u**2).mean()) > made.curve.target


def test_the_certificate_says_what_bound_and_figure_say(made):
    proof = made.proof
    assert proof.efficiency == pytest.approx(proof.bound / made.u_mean, rel=1e-9)
    at = made.curve.counts == len(made.places)
    assert made.curve.bound[at] == pytest.approx(proof.bound, rel=1e-9)
    said = (
        f"U = {2e6 * proof.bound:#.4g} µm (k = 2, 3-D, at least 95\u202f%, RMS over the goal); "
        f"this set reaches {2e6 * made.u_mean:#.4g} µm"
    )
    assert said in proof.sentence
    assert f"at least {np.floor(proof.efficiency * 1000) / 1000:.3f}" in proof.sentence


def test_the_best_next_poses_are_the_best_by_brute_force():
    made = quick_plan()
    M = matrices(made, made.pool.q)
    whole = M[made.places].sum(axis=0)
    left = [k for k in range(len(M)) if k not in set(made.places.tolist())]
    u = {k: float(np.sqrt((uncertainty(made, whole + M[k]) ** 2).mean())) for k in left}
    best = sorted(left, key=lambda k: u[k])[:5]
    assert [one.place for one in made.next_poses] == best
    for one in made.next_poses:
        assert one.u == pytest.approx(u[one.place], rel=DIFFERENCED)


def test_leverage_is_the_trace_of_each_candidate_against_the_chosen_information():
    made = quick_plan()
    assert made.leverage.shape == (len(made.pool.q),)
    # over the chosen set the traces add up to the number of parameters
    assert made.leverage[made.places].sum() == pytest.approx(made.parameters.n_free, rel=1e-9)
    assert (made.leverage > 0).all()


def test_the_best_station_is_the_one_with_the_smallest_uncertainty_of_its_own_design(made):
    seen = made.stations
    assert len(seen.stations) == 3
    assert seen.u_mean[seen.best] == seen.u_mean.min()
    assert made.station_mm == pytest.approx(tuple(seen.stations[seen.best] * 1e3), abs=1e-9)
    assert len({len(design) for design in seen.designs}) == 1
    worse = (seen.best + 1) % 3
    settled = scenario(SMALL | {"plan.stations.list_mm": [(seen.stations[worse] * 1e3).tolist()]})
    bench = open_bench(settled, clearance=settled.plan.clearance_mm / 1e3)
    alone = compared(bench, goal_of(bench))
    # one station gets the same design whether compared with others or not
    assert alone.u_mean[0] == pytest.approx(seen.u_mean[worse], rel=1e-12)


def test_poses_measured_already_count_and_are_not_chosen_again(tmp_path):
    first = quick_plan()
    file = tmp_path / "plan.csv"
    file.write_text(plan_csv(first), encoding="utf-8")
    more = plan(scenario(BARE, **{"plan.measured": str(file), "plan.poses": 3}))
    old = first.pool.q[first.places]
    # nine decimals of a degree are kept
    assert more.measured_q == pytest.approx(old, abs=1e-11)
    chosen = more.pool.q[more.places]
    assert len(chosen) == 3
    assert np.abs(chosen[:, None] - old[None]).max(axis=2).min() > 1e-6
    # not chosen because not offered: rounding does not make a measured pose a new one
    assert np.abs(more.pool.q[:, None] - old[None]).max(axis=2).min() > 1e-6
    u = brute_u(more, np.vstack([more.measured_q, chosen]))
    assert more.u == pytest.approx(u, rel=DIFFERENCED)
    assert more.u_mean < first.u_mean
    x, y, z = more.station_mm
    assert f"measured from [tracker] station_mm, ({x:.0f}, {y:.0f}, {z:.0f})" in measured_words(
        more
    )
    # the first pose of the sequel already makes everything known
    assert np.isfinite(more.u_of_step).all()


def test_two_measured_poses_tell_too_little_alone_and_still_count(tmp_path):
    """Their information is singular: nothing may divide by it before more poses come."""
    file = tmp_path / "two.csv"
    file.write_text(
        "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n10,20,30,40,50,60\n-10,5,9,2,8,-9\n"
    )
    made = plan(scenario(BARE, **{"plan.measured": str(file), "plan.poses": 6}))
    assert np.isnan(made.u_of_step[:2]).all()
    assert np.isfinite(made.u_of_step[-1])
    q = np.vstack([made.measured_q, made.pool.q[made.places]])
    assert made.u == pytest.approx(brute_u(made, q), rel=10 * DIFFERENCED)
