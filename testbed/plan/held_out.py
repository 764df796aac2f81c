"""Poses kept apart: where the robot will work, measurable, and none of them in the pool."""

import numpy as np

from calib.arrays import Array, frozen
from calib.errors import InputError, refuse
from testbed.laboratory.bench import Bench
from testbed.laboratory.goal import Goal, box_of, of_the_goal
from testbed.laboratory.pool import is_new
from testbed.scenario.read import BoxGoal
from testbed.streams import stream


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
