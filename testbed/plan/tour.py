"""Held-out poses, the measuring order of a plan, and what the tracker will show at each pose."""

from collections.abc import Callable

import numpy as np

from calib.arrays import Array, Index, frozen
from calib.errors import InputError, refuse
from calib.geometry.frames import target_points
from testbed.laboratory.bench import Bench
from testbed.laboratory.goal import Goal, box_of, of_the_goal
from testbed.laboratory.joint_lists import check_joints, from_deg
from testbed.laboratory.pool import is_new, joint_ranges
from testbed.laboratory.route.moves import RESOLUTION, Mover
from testbed.laboratory.route.route import Route, measuring_route
from testbed.plan.records import FAR, Reading, Tour
from testbed.scenario.planning import BoxGoal
from testbed.streams import stream
from testbed.units import sentence

MANY_TURNS = 3.5 * np.pi
"""Range of a turning joint that may be the reason why no way is found; wrists have 3 pi [rad]."""


def held_out(bench: Bench, goal: Goal, taken: Array) -> Array:
    """Held-out poses (h, n): random from the goal, filled up from the pool's box where too few.

    Parameters
    ----------
    bench : Bench
        The laboratory.
    goal : Goal
        Where the robot will work.
    taken : (k, n) array
        Joint vectors that must not come again: pool and poses measured already.
    """
    scenario = bench.scenario
    count, pool, settings = scenario.plan.held_out, scenario.pool, scenario.plan.goal
    rng = stream(scenario.seed, "plan", "held-out")
    found = np.zeros((0, bench.robot.model.chain.n_joints))
    if isinstance(settings, BoxGoal):
        center, size = box_of(scenario, settings)
        pool = pool.model_copy(update={"box_center_mm": center, "box_size_mm": size})
    elif count:
        anywhere = pool.model_copy(update={"box_size_mm": (1e6, 1e6, 1e6)})
        fault = bench.candidates(anywhere).first_fault(goal.q)
        seen = goal.q[is_new(goal.q, taken) & (fault < 0)]
        found = seen[rng.permutation(len(seen))[:count]]
    if len(found) == count:
        return frozen(found)
    exclude = np.vstack([taken, found])
    try:
        rest = bench.candidates(pool).draw(rng, size=count - len(found), exclude=exclude).q
    except InputError as error:
        error = of_the_goal(error) if isinstance(settings, BoxGoal) else error
        message = error.message.replace("poses are feasible", "held-out poses are feasible")
        raise refuse(
            error.field, error.value, error.allowed, code=error.code, message=message,
            fix=f"{error.fix}, or lower [plan] held_out",
        ) from error  # fmt: skip
    return frozen(np.vstack([found, rest]))


def tour_of(
    bench: Bench,
    start: Array,
    chosen: Array,
    places: Index,
    held_out: Array,
    offered: Array,
    *,
    tell: Callable[[int], None] = lambda _: None,
) -> Tour:
    """Identification and held-out poses mixed in one order: a short tour, or at random.

    Parameters
    ----------
    bench : Bench
        The laboratory; its scenario has speed and rest.
    start : (n,) array
        Where the robot stands before [rad, m].
    chosen : (m, n) array
        Poses to identify from [rad, m].
    places : (m,) array of int
        Their places in the pool.
    held_out : (h, n) array
        Poses kept apart [rad, m].
    offered : (k, n) array
        Free postures that detours may pass through [rad, m].
    tell : callable
        Called with the number of moves tested so far, after each.
    """
    plan, every = bench.scenario.plan, np.vstack([chosen, held_out])
    at_random = stream(bench.scenario.seed, "plan", "order").permutation(len(every))
    ranges = joint_ranges(bench.robot, bench.scenario.pool)
    solid = len(bench.robot.shapeless) < len(bench.robot.limits)
    turning = ~bench.robot.model.chain.prismatic.astype(bool)
    many_turns = bool((np.ptp(ranges, axis=1)[turning] > MANY_TURNS).any())
    route = measuring_route(
        bench.robot,
        bench.simulator,
        every[at_random],
        stream(bench.scenario.seed, "plan", "route"),
        speed_share=plan.speed_share,
        settle=plan.settle_s,
        start=start,
        vias=offered,
        ranges=ranges,
        keep=plan.order == "random",
        tell=tell,
    )
    everywhere = np.concatenate([places, np.full(len(held_out), -1)])
    listed = at_random[route.order]
    at = {int(k): i for i, k in enumerate(route.order)}
    blocked = tuple(sorted(max(at[a] if a >= 0 else -1, at[b]) for a, b in route.blocked))
    return Tour(
        q=route.q,
        roles=tuple("identify" if k < len(chosen) else "test" for k in listed),
        pool_place=frozen(everywhere[listed], np.int64),
        start=route.start,
        vias=route.via,
        move=route.times,
        other=route.best_time if plan.order == "random" else route.given_time,
        speeds=frozen(bench.robot.speeds * plan.speed_share),
        settle=route.settle,
        blocked=blocked,
        cut_off=tuple(sorted(at[int(k)] for k in route.cut_off)),
        clearance=_clearance(bench, route, blocked) if solid else np.nan,
        sentence=_sentence(route, blocked, many_turns=many_turns) if solid else route.timing,
    )


def mover_of(bench: Bench) -> Mover:
    """Who tests moves of the robot in its cell."""
    robot = bench.robot
    ranges = joint_ranges(robot, bench.scenario.pool)
    return Mover(bench.simulator, ranges, robot.speeds, robot.controller)


def _clearance(bench: Bench, route: Route, blocked: tuple[int, ...]) -> float:
    """Smallest distance to floor and obstacles at every posture that the moves were tested at."""
    simulator = bench.simulator
    bounds, postures, here = simulator.travel_bounds(), [route.start[None]], route.start
    for k, (q, via) in enumerate(zip(route.q, route.via, strict=True)):
        for there in (*via, q):
            count = max(int(np.ceil(np.abs(there - here) @ bounds / RESOLUTION)), 1)
            share = np.linspace(0, 1, count + 1)[:, None] if k not in blocked else np.ones((1, 1))
            postures.append(here + share * (there - here))
            here = there
    return float(simulator.clearances(np.vstack(postures), most=FAR).min())


def _sentence(route: Route, blocked: tuple[int, ...], *, many_turns: bool) -> str:
    """How long it takes and whether the moves are free; blocked ones by their place in the order.

    The route names poses by where they stood in the list given to it, which no one else sees.
    """
    if not blocked:
        return sentence(route.sentence)
    moves = ", ".join(f"to pose {k + 1} of the order" for k in blocked)
    fix = (
        "or narrow [pool] joint_ranges_deg: in a range of more than a turn a posture comes more "
        "than once, and the way from one turn to the next is often blocked"
        if many_turns
        else "or move the obstacle"
    )
    return (
        f"No free way was found {moves}; lead the robot around by hand there, drop the pose, {fix}."
    )


def start_of(bench: Bench) -> Array:
    """Posture (n,) the robot starts from [rad, m]: of the scenario, else zero or mid-range.

    Raises
    ------
    InputError
        The robot cannot stand like that.
    """
    given, robot = bench.scenario.plan.start_deg, bench.robot
    lower, upper = robot.limits.T
    start = np.where((lower <= 0) & (upper >= 0), 0.0, (lower + upper) / 2)
    if not robot.controller.plain:
        own = robot.controller.limits.T
        start = robot.controller.to_arm(np.clip(robot.controller.of_arm(start), *own))
        if not given:
            check_joints(robot, start[None], ["[plan] start_deg, at joints of zero"], "plan")
    if given:
        start = np.asarray(from_deg(robot, [given], "[plan] start_deg", single=True)[0])
    if bench.simulator.collides(start[None])[0]:
        what = bench.simulator.hit_word(start)
        near = not bench.touching.collides(start[None])[0]
        verb = f"comes nearer than {bench.scenario.plan.clearance_mm:g} mm to" if near else "hits"
        message = (
            f"[plan] start_deg: the robot {verb} {what} there"
            if given
            else f"[plan] has no start_deg, and with joints at zero the robot {verb} {what}"
        )
        fix = "write a start_deg where the robot stands free"
        raise refuse("plan.start_deg", start.tolist(), code="M27", message=message, fix=fix)
    return start


def readings_of(bench: Bench, q: Array) -> tuple[Reading, ...]:
    """Predicted readings at joint targets q (s, n), from the nominal robot.

    A 6-D target has two: the tool frame's origin, which the tracker reports, and the probe, which
    the beam goes to.
    """
    tracker, chain = bench.tracker, bench.robot.model.chain
    T = bench.robot.model.poses(q)
    targets: tuple[tuple[str, Array], ...]
    if tracker.measures == "point":
        targets = (("reflector", tracker.reflector),)
    else:
        targets = (("tool", tracker.reflector), ("probe", tracker.aim(chain)))
    return tuple(
        _reading(name, target_points(T, offset), tracker.T_world_tracker)
        for name, offset in targets
    )


def _reading(target: str, points: Array, T_world_tracker: Array) -> Reading:
    """World points (s, 3) as the tracker tells them."""
    seen = (points - T_world_tracker[:3, 3]) @ T_world_tracker[:3, :3]
    x, y, z = seen.T
    return Reading(
        target=target,
        position=frozen(seen),
        azimuth=frozen(np.arctan2(y, x)),
        elevation=frozen(np.arctan2(z, np.hypot(x, y))),
        range=frozen(np.linalg.norm(seen, axis=1)),
    )
