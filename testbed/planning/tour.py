"""The way through the poses of a plan: the one place where a plan asks for a route."""

import numpy as np

from calib.arrays import Array, Index, frozen
from calib.errors import InputError
from testbed.laboratory.route import Route, measuring_route
from testbed.planning.bench import PlanBench
from testbed.planning.joint_lists import from_deg
from testbed.planning.records import Tour
from testbed.streams import stream


def tour_of(
    bench: PlanBench,
    start: Array,
    chosen: Array,
    places: Index,
    held_out: Array,
    offered: Array,
) -> Tour:
    """Identification and held-out poses in one short tour.

    Parameters
    ----------
    bench : PlanBench
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
    """
    plan, q = bench.scenario.plan, np.vstack([chosen, held_out])
    route = measuring_route(
        bench.robot,
        bench.simulator,
        q,
        stream(bench.scenario.seed, "plan", "route"),
        speed_share=plan.speed_share,
        settle=plan.settle_s,
        start=start,
        vias=offered,
    )
    everywhere = np.concatenate([places, np.full(len(held_out), -1)])
    at = {int(k): i for i, k in enumerate(route.order)}
    blocked = tuple(sorted(max(at[a] if a >= 0 else -1, at[b]) for a, b in route.blocked))
    return Tour(
        q=route.q,
        roles=tuple("identify" if k < len(chosen) else "test" for k in route.order),
        pool_place=frozen(everywhere[route.order], np.int64),
        start=route.start,
        vias=route.via,
        move=route.times,
        speeds=frozen(bench.robot.speeds * plan.speed_share),
        settle=route.settle,
        blocked=blocked,
        sentence=_sentence(route, blocked),
    )


def _sentence(route: Route, blocked: tuple[int, ...]) -> str:
    """How long it takes and whether the moves are free; blocked ones by their place in the order.

    The route names poses by where they stood in the list given to it, which no one else sees.
    """
    if not blocked:
        return route.sentence[:1].upper() + route.sentence[1:] + "."
    moves = ", ".join(f"to pose {k + 1} of the order" for k in blocked)
    return (
        f"No free way was found {moves}; lead the robot around by hand there, drop the pose, or "
        "move the obstacle."
    )


def start_of(bench: PlanBench) -> Array:
    """Posture (n,) the robot starts from [rad, m]: of the scenario, else zero or mid-range.

    Raises
    ------
    InputError
        The robot cannot stand like that.
    """
    given, robot = bench.scenario.plan.start_deg, bench.robot
    lower, upper = robot.limits.T
    start = np.where((lower <= 0) & (upper >= 0), 0.0, (lower + upper) / 2)
    if given:
        start = np.asarray(from_deg(robot, [given], "[plan] start_deg")[0])
    if bench.simulator.collides(start[None])[0]:
        raise InputError(
            "[plan] start_deg: the robot hits itself, the floor or an obstacle there"
            if given
            else "[plan] has no start_deg, and with joints at zero the robot hits something",
            code="M27",
            field="plan.start_deg",
            value=start.tolist(),
            fix="write a start_deg where the robot stands free",
        )
    return start
