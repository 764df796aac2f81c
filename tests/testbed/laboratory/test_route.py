"""The measuring order: short, free when tested more finely, honest where blocked."""

from dataclasses import replace
from itertools import pairwise, permutations, product

import numpy as np
import pytest

from calib.arrays import Array
from calib.errors import InputError
from testbed.laboratory.cell import cell_from
from testbed.laboratory.pool import Candidates, PosePool
from testbed.laboratory.route import moves
from testbed.laboratory.route.islands import Islands
from testbed.laboratory.route.moves import RESOLUTION, Mover, spread, travel_times
from testbed.laboratory.route.route import Route, measuring_route
from testbed.laboratory.route.tours import best_tour, length
from testbed.laboratory.simulator import Simulator
from testbed.robots.catalog import Robot, load_robot
from testbed.robots.meshes.files import load_mesh
from testbed.robots.placements import link_poses
from testbed.scenario.laboratory import BoxObstacle, CellSettings
from testbed.scenario.tables import PoolSettings
from tests.reference import TX60_LIMITS

STATION, AIM, SHARE, SETTLE = (2.6, -2.0, 0.3), (0.0, 0.0, 0.06), 0.3, 3.0
CLUTTER = (
    BoxObstacle(size_mm=(100.0, 1500.0, 600.0), position_mm=(420.0, 0.0, -100.0)),
    BoxObstacle(size_mm=(800.0, 40.0, 1600.0), position_mm=(500.0, 250.0, 500.0)),
)


def cluttered(robot: Robot, *obstacles: BoxObstacle) -> Simulator:
    chain = robot.model.chain
    return Simulator(robot, chain, cell_from(CellSettings(obstacle=obstacles), chain))


@pytest.fixture(scope="module")
def simulator(robot: Robot) -> Simulator:
    return cluttered(robot, *CLUTTER)


@pytest.fixture(scope="module")
def pool(robot: Robot, simulator: Simulator) -> PosePool:
    candidates = Candidates(robot, simulator, PoolSettings(size=120), STATION, aim=AIM)
    return candidates.draw(np.random.default_rng(1))


@pytest.fixture(scope="module")
def route(robot: Robot, simulator: Simulator, pool: PosePool) -> Route:
    return routed(robot, simulator, pool.q[:29], vias=pool.q)


def postures(route: Route) -> Array:
    """Every posture in turn: the start, stops and poses."""
    legs = (np.vstack([via, pose]) for via, pose in zip(route.via, route.q, strict=True))
    return np.vstack([route.start, *legs])


def routed(robot: Robot, simulator: Simulator, q: Array, **options) -> Route:
    options = {"speed_share": SHARE, "settle": SETTLE} | options
    return measuring_route(robot, simulator, q, np.random.default_rng(2), **options)


def test_the_time_of_a_move_is_that_of_its_slowest_joint():
    a, b = np.random.default_rng(0).normal(size=(2, 7, 6))
    speeds = np.array([1.0, 2.0, 0.5, 3.0, 1.0, 0.1])
    expected = [max(abs(a[k, j] - b[k, j]) / speeds[j] for j in range(6)) for k in range(7)]
    np.testing.assert_allclose(travel_times(a, b, speeds), expected, rtol=1e-15)


def test_every_pose_is_visited_once_and_the_times_add_up(robot, pool, route):
    assert sorted(route.order) == list(range(29))
    np.testing.assert_array_equal(route.q, pool.q[:29][route.order])
    here, total = np.zeros(6), 0.0
    for via, pose, time in zip(route.via, route.q, route.times, strict=True):
        # a second way: joint by joint, stop by stop
        own = 0.0
        for stop in [*via, pose]:
            own += max(abs(stop - here) / (SHARE * robot.speeds))
            here = stop
        assert time == pytest.approx(own, rel=1e-12)
        total += own
    assert route.move_time == pytest.approx(total, rel=1e-12)
    assert route.total_time == pytest.approx(total + 29 * SETTLE, rel=1e-12)
    assert len(postures(route)) == 30 + sum(len(via) for via in route.via)


def test_every_move_is_free_when_tested_ten_times_more_finely(simulator, route):
    assert not route.blocked
    assert route.detours > 0  # the clutter does matter here
    bounds = simulator.travel_bounds()
    for a, b in pairwise(postures(route)):
        n = int(np.ceil(np.abs(b - a) @ bounds / (RESOLUTION / 10))) + 1
        line = a + np.linspace(0, 1, n + 1)[:, None] * (b - a)
        # between two tests of the route a corner may graze by less than half the resolution;
        # on these moves none does
        assert not simulator.collides(line).any()


def test_straight_moves_in_the_given_order_would_have_hit_something(simulator, pool):
    stops = np.vstack([np.zeros(6), pool.q[:29]])
    hits = [
        simulator.collides(a + np.linspace(0, 1, 200)[:, None] * (b - a)).any()
        for a, b in pairwise(stops)
    ]
    assert sum(hits) > 3


def test_the_route_is_never_longer_than_the_given_order(robot, simulator, pool, route):
    assert route.move_time <= route.given_time
    assert route.move_time < 0.7 * route.given_time  # and usually much shorter
    again = routed(robot, simulator, route.q, vias=pool.q)
    assert again.given_time == pytest.approx(again.given_time)
    assert again.move_time <= again.given_time * (1 + 1e-9)


def test_the_route_is_the_same_every_time(robot, simulator, pool, route):
    again = routed(robot, simulator, pool.q[:29], vias=pool.q)
    np.testing.assert_array_equal(again.order, route.order)
    for a, b in zip(again.via, route.via, strict=True):
        np.testing.assert_array_equal(a, b)


def test_small_tours_are_the_best_there_are():
    rng = np.random.default_rng(0)
    for _ in range(60):
        n = int(rng.integers(2, 8))
        x = rng.uniform(size=(n, 3))
        times = np.abs(x[:, None] - x).max(axis=-1)
        best = min(length(times, np.array((0, *p))) for p in permutations(range(1, n)))
        # local search promises no more than a local optimum; at this size it is the optimum
        assert length(times, best_tour(times, np.arange(n))) <= best * (1 + 1e-12)


def test_no_turn_move_or_swap_shortens_a_large_tour():
    x = np.random.default_rng(3).uniform(size=(25, 6))
    times = np.abs(x[:, None] - x).max(axis=-1)
    tour = best_tour(times, np.arange(25))
    assert tour[0] == 0
    assert sorted(tour) == list(range(25))
    least = length(times, tour) * (1 - 1e-8)
    for i in range(1, 25):
        for j in range(i + 1, 26):
            turned = np.concatenate([tour[:i], tour[i:j][::-1], tour[j:]])
            assert length(times, turned) >= least
            rest = np.concatenate([tour[:i], tour[j:]])
            if j - i > 3:
                continue
            for k in range(1, len(rest) + 1):
                for piece in (tour[i:j], tour[i:j][::-1]):
                    assert length(times, np.concatenate([rest[:k], piece, rest[k:]])) >= least


def test_ties_and_the_given_tour():
    # all times equal: nothing gains, so the given tour stays
    given = np.array([0, 3, 1, 2])
    np.testing.assert_array_equal(best_tour(np.ones((4, 4)) - np.eye(4), given), given)


def test_no_point_of_the_robot_moves_farther_than_the_bound(robot, simulator):
    bounds = simulator.travel_bounds()
    rng = np.random.default_rng(4)
    q = rng.uniform(*TX60_LIMITS.T, (100, 6))
    step = rng.normal(0, 0.02, (100, 6)) * (rng.uniform(size=(100, 6)) < 0.5)
    T, moved = (link_poses(robot.model.chain, one) for one in (q, q + step))
    largest = np.zeros(100)
    for visual in robot.visuals:
        points = load_mesh(visual.file).vertices[::7]
        gone = np.einsum("mij,vj->mvi", (moved - T)[:, visual.link, :3, :3], points)
        gone += (moved - T)[:, None, visual.link, :3, 3]
        largest = np.maximum(largest, np.linalg.norm(gone, axis=2).max(axis=1))
    bound = np.abs(step) @ bounds
    assert (largest <= bound + 1e-12).all()
    assert (largest / np.maximum(bound, 1e-12)).max() > 0.5  # and it is no wild overestimate


def test_between_two_tests_nothing_moves_farther_than_stated(robot, simulator):
    class Watched:
        def __init__(self):
            self.seen = []

        def travel_bounds(self):
            return simulator.travel_bounds()

        def collides(self, q):
            self.seen.append(q)
            return np.zeros(len(q), dtype=bool)

    watched = Watched()
    mover = Mover(watched, robot.limits, robot.speeds)
    start, end = np.zeros(6), np.array([1.0, -0.4, 0.3, 0.0, 2.0, -3.0])
    assert mover.is_free(start, end)
    q = np.concatenate(watched.seen)
    assert mover.tested == len(q)
    q = q[np.argsort(q[:, 0])]
    np.testing.assert_array_equal(q[[0, -1]], [start, end])
    assert (np.abs(np.diff(q, axis=0)) @ simulator.travel_bounds()).max() <= 0.01 + 1e-12


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 8, 9, 100])
def test_tests_are_spread_and_none_is_left_out(n):
    assert sorted(spread(n)) == list(range(n))
    if n > 8:  # the first nine of them leave no gap larger than a quarter
        assert np.diff(np.sort(spread(n)[:9])).max() <= np.ceil(n / 4)


def test_without_anything_offered_a_way_around_is_searched(robot, simulator, pool, monkeypatch):
    monkeypatch.setattr(moves, "VIAS", 0)
    stops = np.vstack([np.zeros(6), pool.q[:29]])
    mover = Mover(simulator, robot.limits, robot.speeds)
    rng = np.random.default_rng(0)
    blocked = [(a, b) for a, b in pairwise(stops) if not mover.is_free(a, b)][:5]
    assert len(blocked) == 5
    for a, b in blocked:
        way = mover.way(a, b, stops, rng)
        assert way.found
        assert len(way.via)
        assert (way.via >= robot.limits[:, 0]).all()
        assert (way.via <= robot.limits[:, 1]).all()
        assert all(mover.is_free(x, y) for x, y in pairwise([a, *way.via, b]))
        assert way.time >= travel_times(a, b, robot.speeds)


@pytest.mark.slow
def test_ways_of_several_stops_lead_to_the_right_pose_in_both_directions(
    robot, simulator, pool, monkeypatch
):
    monkeypatch.setattr(moves, "VIAS", 0)
    found = [routed(robot, simulator, pool.q[k : k + 8]) for k in (0, 80)]
    # some detour of two stops or more is driven against the direction it was searched in
    assert any(
        len(via) > 1 and a > b
        for route in found
        for via, a, b in zip(route.via[1:], route.order[:-1], route.order[1:], strict=True)
    )
    mover = Mover(simulator, robot.limits, robot.speeds)
    for route in found:
        assert all(mover.is_free(a, b) for a, b in pairwise(postures(route)))


def test_a_pose_that_cannot_be_reached_is_named(robot, monkeypatch):
    # joint 1 may only turn a little: the wall between the two sides cannot be passed
    monkeypatch.setattr(moves, "NODES", 150)
    left, right = (np.array([turn, 1.2, 0.8, 0.0, 0.5, 0.0]) for turn in (-1.2, 1.2))
    wall = BoxObstacle(size_mm=(3000.0, 20.0, 4000.0), position_mm=(1780.0, 0.0, 0.0))
    limits = robot.limits.copy()
    limits[0], limits[1], limits[2] = (-1.3, 1.3), (1.1, 1.3), (0.7, 0.9)
    caged = replace(robot, limits=limits)
    simulator = cluttered(robot, wall)
    found = routed(caged, simulator, np.stack([right]), start=left)
    assert found.blocked == ((-1, 0),)
    assert np.isinf(found.given_time)
    assert found.times[0] == pytest.approx(2.4 / (SHARE * robot.speeds[0]))
    free = routed(caged, cluttered(robot), np.stack([right]), start=left)
    assert not free.blocked
    assert free.sentence.startswith("1 pose in ")


def test_a_start_or_a_pose_that_collides_is_refused(robot, simulator, pool):
    inside = pool.rejected_q[[name == "obstacle" for name in pool.rejected_reason]][0]
    with pytest.raises(
        InputError, match=r"in pose 2 the robot hits an obstacle; .* leave the pose"
    ):
        routed(robot, simulator, np.vstack([pool.q[:2], inside]))
    with pytest.raises(InputError, match=r"in the start posture the robot hits an obstacle; .*deg"):
        routed(robot, simulator, pool.q[:2], start=inside)
    with pytest.raises(InputError, match="no poses to order"):
        routed(robot, simulator, np.zeros((0, 6)))


def test_one_pose_is_a_route(robot, simulator, pool):
    one = routed(robot, simulator, pool.q[:1], vias=pool.q)
    assert one.order.tolist() == [0]
    assert one.total_time == pytest.approx(one.times[0] + SETTLE)


def test_islands_are_those_of_a_search_through_all_that_was_told():
    rng = np.random.default_rng(5)
    for _ in range(40):
        n = int(rng.integers(2, 9))
        islands, joined, parted = Islands(n), np.eye(n, dtype=bool), list[tuple[int, int]]()
        for _ in range(12):
            a, b = (int(k) for k in rng.permutation(n)[:2])
            together = np.linalg.matrix_power(joined.astype(float), n) > 0
            if rng.uniform() < 0.4:
                islands.join(a, b)
                joined[a, b] = joined[b, a] = True
            else:
                islands.part(a, b)
                parted += [] if together[a, b] else [(a, b), (b, a)]
            together = np.linalg.matrix_power(joined.astype(float), n) > 0
            for x, y in product(range(n), range(n)):
                known = any(together[x, p] and together[q, y] for p, q in parted)
                assert islands.apart(x, y) == (known and not together[x, y])


@pytest.mark.slow
def test_postures_of_other_turns_are_given_up_after_bounded_work(monkeypatch):
    # every joint of a UR10 may turn once either way; the shoulder and the elbow cannot pass from
    # one turn to the next, so that most pairs of random postures have no way between them
    monkeypatch.setattr(moves, "NODES", 100)
    monkeypatch.setattr(moves, "PATIENCE", 20_000)
    robot = load_robot("universal_ur10")
    simulator = Simulator(robot, robot.model.chain)
    q = np.random.default_rng(6).uniform(*robot.limits.T, (60, 6))
    q = q[~simulator.collides(q)][:14]
    searched, told, tested = [], [], []
    search, collides = Mover._search, simulator.collides
    monkeypatch.setattr(Mover, "_search", lambda *all_: searched.append(1) or search(*all_))
    monkeypatch.setattr(simulator, "collides", lambda q: tested.append(len(q)) or collides(q))
    found = routed(robot, simulator, q, tell=told.append)
    assert len(found.blocked) > 3
    assert np.isinf(found.given_time)
    assert told == list(range(1, len(told) + 1))
    # a straight move is at most 2 pi on every joint twice: the bound of postures tested for one
    straight = float(np.ptp(robot.limits, axis=1) @ simulator.travel_bounds()) / RESOLUTION + 2
    # the last search may begin just before the patience ends; each way found may need one too
    assert sum(tested) < 3 * 20_000 + len(told) * straight
    assert len(searched) < len(told) / 3
    # what is called free is: islands say only where not to search
    mover = Mover(simulator, robot.limits, robot.speeds)
    legs = zip(pairwise([-1, *found.order.tolist()]), found.via, found.q, strict=True)
    here = found.start
    for pair, via, there in legs:
        if pair not in found.blocked:
            assert all(mover.is_free(a, b) for a, b in pairwise([here, *via, there]))
        here = there
