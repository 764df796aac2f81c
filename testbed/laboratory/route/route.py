"""Measuring order: a short tour through the poses, and the ways between them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, frozen
from calib.errors import refuse
from calib.geometry.chain import joint_vectors
from testbed.laboratory.route.islands import Islands
from testbed.laboratory.route.moves import RESOLUTION, Mover, Way, times_between, travel_times
from testbed.laboratory.route.tours import best_tour
from testbed.laboratory.simulator import Simulator
from testbed.robots.catalog import Robot
from testbed.units import counted

BLOCKED_TIME = 1e6
"""What a move without a way costs when orders are compared [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class Route:
    """An order of poses with the moves between them, from a start posture; it does not return."""

    start: Array
    """(n,) posture before the first move [rad, m]."""
    order: Index
    """(m,) positions of the poses in the given list, in measuring order."""
    q: Array
    """(m, n) the poses in measuring order [rad, m]."""
    via: tuple[Array, ...]
    """(m,) stops (k, n) on the way to each pose, none where the straight move is free [rad, m]."""
    times: Array
    """(m,) time of the moves to each pose, stops included [s]."""
    settle: float
    """Rest at each pose [s]."""
    given_time: float
    """Time of the moves in the order given, with its own detours; inf if one is blocked [s]."""
    best_time: float
    """The same of the shortest order found [s]."""
    blocked: tuple[tuple[int, int], ...]
    """Pairs of poses, by position in the given list (-1: start), with no way between them."""
    cut_off: Index
    """(c,) positions in the given list of poses that a search found no way to from the start, or
    from a pose that ways lead to from there."""

    @property
    def move_time(self) -> float:
        """Time spent moving [s]."""
        return float(self.times.sum())

    @property
    def total_time(self) -> float:
        """Time of moving and resting [s]."""
        return self.move_time + self.settle * len(self.order)

    @property
    def detours(self) -> int:
        """Poses that are reached by stops in between."""
        return sum(len(stops) > 0 for stops in self.via)

    @property
    def timing(self) -> str:
        """How long it takes, in words."""
        return (
            f"{counted(len(self.order), 'pose')} in {self.total_time:.0f} s, "
            f"{self.move_time:.0f} s of them moving"
        )

    @property
    def sentence(self) -> str:
        """How long a route without blocked moves takes, in words."""
        around = "every straight joint move is free"
        if self.detours:
            need = "move needs" if self.detours == 1 else "moves need"
            around = f"{self.detours} {need} a stop on the way around"
        return (
            f"{self.timing}; {around} (tested every {RESOLUTION * 1e3:g} mm of the fastest point)"
        )


def measuring_route(
    robot: Robot,
    simulator: Simulator,
    q: ArrayLike,
    rng: np.random.Generator,
    *,
    speed_share: float = 1.0,
    settle: float = 0.0,
    start: ArrayLike | None = None,
    vias: ArrayLike | None = None,
    ranges: ArrayLike | None = None,
    keep: bool = False,
    tell: Callable[[int], None] = lambda _: None,
) -> Route:
    """Order poses for a short time on the way and make every move free of collisions.

    The order is a local optimum under turning a piece around, moving a piece and swapping, over the
    times of the ways; a straight move that hits something counts with the time of its detour. Moves
    are tested only where an order uses them, and ways around are searched for only between postures
    that no search has parted yet. The route is never longer than the given order.

    Parameters
    ----------
    robot : Robot
        Speeds and limits.
    simulator : Simulator
        Of the robot's nominal chain, with the obstacles of the cell.
    q : (m, n) array_like
        Poses to measure, all free of collisions [rad, m].
    rng : Generator
        Draws postures where a way around must be searched.
    speed_share : float
        Share of the robot's largest joint speeds.
    settle : float
        Rest at each pose [s].
    start : (n,) array_like, optional
        Where the robot starts; all joints at zero by default [rad, m].
    vias : (k, n) array_like, optional
        Free postures offered as stops of detours, such as the pool; the poses themselves and the
        start always are.
    ranges : (n, 2) array_like, optional
        Joint values between which a way around is searched; the joint limits by default [rad, m].
    keep : bool
        Whether the poses are gone to as given, whatever the time.
    tell : callable
        Called with the number of moves tested so far, after each.

    Raises
    ------
    InputError
        If the start or a pose collides, or there is no pose.
    """
    chain = robot.model.chain
    q = joint_vectors(chain, q)
    if not len(q):
        message, fix = "no poses to order", "choose a pose or more"
        raise refuse("q", code="M27", message=message, fix=fix)
    zero = np.zeros(q.shape[1])
    (home,) = joint_vectors(chain, np.asarray(zero if start is None else start)[None])
    stops = np.vstack([home, q])
    _check_free(simulator, stops)
    speeds = robot.speeds * speed_share
    between = robot.limits if ranges is None else np.asarray(ranges, dtype=np.float64)
    mover = Mover(simulator, between, speeds, robot.controller)
    offered = stops if vias is None else np.vstack([stops, joint_vectors(chain, vias)])
    tour, ways, islands = _shortest_tour(mover, stops, offered, rng, tell)
    given = np.arange(len(stops))
    given_time, best_time = (
        float(sum(ways[pair].time for pair in _pairs(order))) for order in (given, tour)
    )
    if keep:
        tour = given
    via, times_taken, lost = list[Array](), list[float](), list[tuple[int, int]]()
    for a, b in pairwise(tour.tolist()):
        way = ways[min(a, b), max(a, b)]
        via.append(way.via if a < b else frozen(way.via[::-1]))
        if way.found:
            times_taken.append(way.time)
            continue
        # timed as if it were straight: somebody has to lead the robot around
        times_taken.append(float(travel_times(stops[a], stops[b], speeds)))
        lost.append((a - 1, b - 1))
    return Route(
        start=frozen(home),
        order=frozen(tour[1:] - 1, np.int64),
        q=frozen(stops[tour[1:]]),
        via=tuple(via),
        times=frozen(times_taken),
        settle=float(settle),
        given_time=given_time,
        best_time=best_time,
        blocked=tuple(lost),
        cut_off=frozen([k - 1 for k in range(1, len(stops)) if islands.apart(0, k)], np.int64),
    )


def _shortest_tour(
    mover: Mover,
    stops: Array,
    offered: Array,
    rng: np.random.Generator,
    tell: Callable[[int], None],
) -> tuple[Index, dict[tuple[int, int], Way], Islands]:
    """The shortest order found, the ways of all pairs tried, and which stops are cut off.

    Among the ways are those of the order given.
    """
    times, given = times_between(stops, mover.speeds), np.arange(len(stops))
    ways, islands = dict[tuple[int, int], Way](), Islands(len(stops))
    tour = best_tour(times, given)
    while missing := [pair for one in (tour, given) for pair in _pairs(one) if pair not in ways]:
        for a, b in dict.fromkeys(missing):
            around = mover.patient and not islands.apart(a, b)
            ways[a, b] = mover.way(stops[a], stops[b], offered, rng, around=around)
            if ways[a, b].found:
                islands.join(a, b)
            elif around:
                islands.part(a, b)
            tell(len(ways))
        # all at once, since an order takes no blocked pair before every other one is tried
        for a, b in islands.pairs(apart=mover.patient):
            if (a, b) not in ways:
                ways[a, b] = mover.way(stops[a], stops[b], offered, rng, around=False)
                tell(len(ways))
        for (a, b), way in ways.items():
            times[a, b] = times[b, a] = way.time if way.found else BLOCKED_TIME
        tour = best_tour(times, given)
    return tour, ways, islands


def _pairs(tour: Index) -> Iterator[tuple[int, int]]:
    """Pairs of neighbors, the smaller first: ways are the same back and forth."""
    for a, b in pairwise(tour.tolist()):
        yield min(a, b), max(a, b)


def _check_free(simulator: Simulator, stops: Array) -> None:
    """Refuse a start (first row) or poses that hit something where they stand."""
    hits = np.flatnonzero(simulator.collides(stops))
    if not len(hits):
        return
    field, where, fix = "q", f"pose {hits[0] - 1}", "leave the pose out"
    if hits[0] == 0:
        field, where, fix = "start", "the start posture", "write another [plan] start_deg"
    posture, allowed = stops[hits[0]], "a route leads through free postures"
    message = f"in {where} the robot hits {simulator.hit_word(posture)}"
    raise refuse(field, posture.tolist(), allowed, code="M27", message=message, fix=fix)
