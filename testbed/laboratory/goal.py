"""Where the tool must be right, and the joint values that bring it there."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, frozen
from calib.errors import InputError, refuse
from calib.geometry.frames import exp_so3, inverse, log_so3, slide, transform
from calib.geometry.inverse import inverse_kinematics
from calib.information.criteria import NEEDS_GOALS
from calib.information.goals import Goals, goal_matrix
from calib.shown import Shown
from testbed.laboratory.bench import PROBED_POSES, Bench
from testbed.laboratory.joint_lists import from_deg
from testbed.laboratory.pool import joint_ranges
from testbed.scenario.planning import BoxGoal, ListGoal, PathGoal
from testbed.scenario.scenario import Scenario
from testbed.streams import stream
from testbed.units import counted

Corner = tuple[float, float, float]
STARTS = 64
"""Postures from which the search for a goal posture begins."""
MOST_POSES = 5000
"""A path is cut into at most so many postures."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Goal(Shown):
    """The postures at which the tool point's uncertainty counts."""

    q: Array
    """(g, n) joints [rad, m]."""
    weights: Array
    """(g,) shares, which sum to one."""
    point: Array
    """(3,) the point that counts, in the tool frame [m]."""
    sentence: str
    """What the goal is, in words."""


def goal_of(bench: Bench) -> Goal:
    """The goal postures of a scenario's [plan.goal], with weights that sum to one.

    Raises
    ------
    InputError
        The goal lies outside the robot's reach; names the entry.
    """
    plan = bench.scenario.plan
    settings = plan.goal
    point = point_of(bench)
    if isinstance(settings, ListGoal):
        q = _entries(bench, settings)
        shares = np.array(settings.weights) if settings.weights else np.ones(len(q))
        text = f"{counted(len(q), 'listed pose')}"
    elif isinstance(settings, PathGoal):
        q, shares, length = _path(bench, settings)
        text = (
            f"a path of {length * 1e3:.0f} mm in {counted(len(q), 'posture')}, each meter counting "
            "the same"
        )
    else:
        q = box_poses(bench, settings)
        shares = np.ones(len(q))
        middle, size = box_of(bench.scenario, settings)
        x, y, z = size
        center = ", ".join(f"{value:g}" for value in middle)
        text = (
            f"{counted(len(q), 'random feasible pose')} in a box of {x:g} x {y:g} x {z:g} mm "
            f"around ({center}) mm in the base frame"
        )
    if point.any():
        text += (
            f", for the point ({', '.join(f'{value * 1e3:g}' for value in point)}) mm of the tool"
        )
    return Goal(frozen(q), frozen(shares / shares.sum()), point, text)


def point_of(bench: Bench) -> Array:
    """The point (3,) of the tool that counts [m]: [plan] point_mm, else what the tracker tracks.

    One reflector does not show how the tool is turned about it: where nothing else is asked for,
    the reflector itself is what can be known.
    """
    wanted = np.array(bench.scenario.plan.point_mm) / 1e3
    return frozen(wanted if wanted.any() else bench.tracker.reflector)


def box_of(scenario: Scenario, goal: BoxGoal) -> tuple[Corner, Corner]:
    """Center and edges of the goal's box in the base frame [mm]; the pool's unless given."""
    center, size = goal.center_mm, goal.size_mm
    return center or scenario.pool.box_center_mm, size or scenario.pool.box_size_mm


def box_poses(bench: Bench, goal: BoxGoal) -> Array:
    """Feasible postures (g, n) in the goal's box, seen by the tracker or not."""
    scenario = bench.scenario
    center, size = box_of(scenario, goal)
    pool = scenario.pool.model_copy(update={"box_center_mm": center, "box_size_mm": size})
    rng = stream(scenario.seed, "plan", "goal")
    try:
        return bench.candidates(pool, seen=False, near=True).draw(rng, size=goal.poses).q
    except InputError as error:
        raise of_the_goal(error) from error


def of_the_goal(error: InputError) -> InputError:
    """An error of a draw in the goal's box, in the words of [plan.goal]."""
    fix = error.fix.replace("box_center_mm", "center_mm").replace("box_size_mm", "size_mm")
    message = error.message.replace("[pool]", "[plan.goal]")
    return refuse(
        "plan.goal", error.value, error.allowed, code=error.code, message=message, fix=fix
    )


def _entries(bench: Bench, goal: ListGoal | PathGoal) -> Array:
    """Joint values (k, n) of the goal's entries, solved for where tool poses are given."""
    robot = bench.robot
    if goal.joints_deg:
        listed = from_deg(robot, goal.joints_deg, "[plan.goal] joints_deg")
        for k, q_k in enumerate(listed):
            _check_free(bench, q_k, f"[plan.goal] joints_deg entry {k + 1}")
        return listed
    poses = _tool_poses(bench, goal)
    q = list[Array]()
    for k, T in enumerate(poses):
        q.append(_posture(bench, T, q[-1] if q else None, f"[plan.goal] tool_mm_deg entry {k + 1}"))
    return np.array(q)


def _check_free(bench: Bench, q: Array, name: str) -> None:
    """Refuse a goal posture q (n,) at which the robot hits something."""
    if bench.touching.collides(q[None])[0]:
        message = f"{name} makes the robot hit {bench.touching.hit_word(q)}"
        raise refuse("plan.goal", q.tolist(), code="S37", message=message, fix="move it")


def _tool_poses(bench: Bench, goal: ListGoal | PathGoal) -> Array:
    """Wanted tool poses (k, 4, 4) in the world [m]."""
    values = np.array(goal.tool_mm_deg)
    T_base_tool = transform(exp_so3(np.radians(values[:, 3:])), values[:, :3] / 1e3)
    return np.asarray(bench.robot.model.chain.T_world_base @ T_base_tool)


def _posture(bench: Bench, T: Array, before: Array | None, name: str) -> Array:
    """The posture (n,) nearest to the one before it that brings the tool to T and hits nothing."""
    robot = bench.robot
    ranges = joint_ranges(robot, bench.scenario.pool)
    lower, upper = ranges.T
    starts = stream(bench.scenario.seed, "plan", "inverse").uniform(
        lower, upper, (STARTS, len(lower))
    )
    if before is not None:
        starts[0] = before
    found = inverse_kinematics(
        robot.model, np.broadcast_to(T, (STARTS, 4, 4)), starts, robot.limits
    )
    q = found.q[found.reached]
    q = q[robot.controller.allows(q)]
    if not len(q):
        missed = float(found.position_error.min())
        x, y, z = (inverse(robot.model.chain.T_world_base) @ T)[:3, 3] * 1e3
        allowed = "the tool cannot take that orientation there inside the joint limits"
        if missed > 1e-6:
            allowed = f"the tool comes no nearer than {missed * 1e3:.4g} mm"
        message = f"{name} at ({x:g}, {y:g}, {z:g}) mm is outside the robot's reach"
        fix = "move it into reach or turn it"
        raise refuse("plan.goal", allowed=allowed, code="S37", message=message, fix=fix)
    free = ~bench.touching.collides(q)
    if not free.any():
        message = (
            f"{name} makes the robot hit itself, the floor or an obstacle in every posture found"
        )
        raise refuse("plan.goal", code="S37", message=message, fix="move it")
    q = q[np.flatnonzero(free)]
    reference = ranges.mean(axis=1) if before is None else before
    return np.asarray(q[np.argmin(np.abs(q - reference).max(axis=1))])


def _path(bench: Bench, goal: PathGoal) -> tuple[Array, Array, float]:
    """Postures (g, n) along a path, what each counts (g,), and the tool's way [m]."""
    corners, model = _entries(bench, goal), bench.robot.model
    lines = len(corners) - 1
    weights = np.array(goal.weights) if goal.weights else np.ones(lines)
    targets = _tool_poses(bench, goal) if goal.tool_mm_deg else None
    postures, shares, total = list[Array](), list[float](), 0.0
    for k in range(lines):
        if targets is None:
            fine = corners[k] + np.linspace(0, 1, 101)[:, None] * (corners[k + 1] - corners[k])
            ends = model.poses(fine)[:, :3, 3]
        else:
            ends = targets[k : k + 2, :3, 3]
        length = float(np.linalg.norm(np.diff(ends, axis=0), axis=1).sum())
        pieces = max(1, int(np.ceil(length / (goal.step_mm / 1e3))))
        if len(postures) + pieces > MOST_POSES:
            message = (
                f"[plan.goal] step_mm is {goal.step_mm:g}, which cuts the path into more than "
                f"{MOST_POSES} postures"
            )
            fix = "choose a larger step"
            raise refuse("plan.goal.step_mm", code="S37", message=message, fix=fix)
        # middles of equal pieces: no corner counts twice, and the sum over a line is its length
        for part in (np.arange(pieces) + 0.5) / pieces:
            name = f"[plan.goal] the line from corner {k + 1} to {k + 2}"
            if targets is None:
                postures.append(corners[k] + part * (corners[k + 1] - corners[k]))
                _check_free(bench, postures[-1], name)
            else:
                T = _between(targets[k], targets[k + 1], float(part))
                before = postures[-1] if postures else corners[0]
                postures.append(_posture(bench, T, before, name))
            shares.append(weights[k] * max(length, 1e-9) / pieces)
        total += length
    return np.array(postures), np.array(shares), total


def _between(start: Array, end: Array, part: float) -> Array:
    """The pose `part` of the way from one to another, straight and turning evenly."""
    turn = log_so3((start[:3, :3].T @ end[:3, :3])[None])[0]
    place = start[:3, 3] + part * (end[:3, 3] - start[:3, 3])
    return np.asarray(slide(*place) @ transform(start[:3, :3] @ exp_so3(part * turn), np.zeros(3)))


def goals_of(bench: Bench) -> Goals:
    """Goals of [plan.goal], the pool's box by default, in the kept numbers.

    Its poses come from the stream ``"plan", "goal"``: none is a held-out pose, none a candidate.

    Raises
    ------
    InputError
        The goal is out of reach, or moves with something that no pose of the pool shows.
    """
    goal = goal_of(bench)
    bench.check_seen(bench.pool_q[:PROBED_POSES], goal.q, goal.point)
    return goal_matrix(
        bench.robot.model, goal.q, bench.kept(), weights=goal.weights, target=goal.point
    )


def wants_goals(scenario: Scenario) -> bool:
    """Whether any record of a campaign asks for the goal."""
    needed = any(trial.criterion in NEEDS_GOALS for trial in scenario.trial)
    return needed or scenario.studies.population > 0
