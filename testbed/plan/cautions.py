"""What a plan did not test or count, in words: what to look at before its moves are made."""

from itertools import product
from typing import NamedTuple

import numpy as np

from calib.arrays import Array
from calib.geometry.frames import transform_points
from testbed.laboratory.cell import Obstacle
from testbed.plan.records import Plan
from testbed.robots.robot import UPRIGHT
from testbed.scenario.laboratory import At960Tracker
from testbed.units import counted, listed

JOINTS = 6
"""Programs are for arms with so many turning joints."""
WARNING = "Warning: "
"""Begins a sentence on what was not asked of a plan."""


def mark(plan: Plan) -> str:
    """What holds of every pose and move, as far as it was tested."""
    if plan.tour.blocked:
        return "✗ Not every move is free"
    tested, tracker = [], "the tracker's"
    if tests_contact(plan):
        tested.append("is free of collisions")
    if tests_cone(plan):
        tested.append("faces the tracker")
        tracker = "its"
    if plan.scenario.pool.line_of_sight and tests_contact(plan):
        tested.append(f"is in {tracker} line of sight")
    whole = f"Every pose {listed(tested or ['keeps to the joint limits'])}"
    if tests_contact(plan):
        whole += ", and every move is free"
    open_ = [one.what for one in _untested(plan)]
    return f"! {whole}; but {' and '.join(open_)}" if open_ else f"✓ {whole}"


def tests_cone(plan: Plan) -> bool:
    """Whether poses were tested for facing the tracker."""
    return plan.scenario.tracker.acceptance_deg < 180.0


def has_program(plan: Plan) -> bool:
    """Whether programs are written for such an arm: one of six turning joints."""
    kinds = plan.nominal.chain.kinds
    return len(kinds) == JOINTS and "prismatic" not in kinds


def tests_contact(plan: Plan) -> bool:
    """Whether any part of the moving robot was tested for what it hits."""
    return len(plan.shapeless) < plan.nominal.chain.n_joints


def uncounted(plan: Plan) -> tuple[str, ...]:
    """Warnings of what the scenario's tracker does to readings and the promise leaves out."""
    tracker, said = plan.scenario.tracker, []
    if not isinstance(tracker, At960Tracker):
        return ()
    if tracker.drift_um_per_sqrt_h:
        said.append(
            f"{WARNING}the promise counts no drift, and [tracker] drift_um_per_sqrt_h is "
            f"{tracker.drift_um_per_sqrt_h:g}; the tool point will be known less well"
        )
    lost = {key: getattr(tracker, key) for key in ("outliers", "missed") if getattr(tracker, key)}
    if lost:
        stated = listed([f"{key} is {count}" for key, count in lost.items()])
        said.append(
            f"{WARNING}the promise counts every shot as good, and [tracker] {stated}; plan "
            f"{counted(sum(lost.values()), 'pose')} more"
        )
    return tuple(said)


def untested(plan: Plan) -> tuple[str, ...]:
    """Warnings, one for each thing that decides whether a pose can be measured and was not asked.

    A reflector alone may be seen from all around; a 6-D target never is.
    """
    return tuple(f"{WARNING}{one.what}, since {one.why}" for one in _untested(plan))


class _Untested(NamedTuple):
    """Something that was not asked."""

    what: str
    """Which thing was not tested, in words."""
    why: str
    """Why it was not, and what to do."""


def _untested(plan: Plan) -> list[_Untested]:
    """What `untested` warns of, part by part."""
    said = [*_shapes(plan), *_floor(plan)]
    if plan.scenario.tracker.measures == "pose" and not tests_cone(plan):
        said.append(
            _Untested(
                "whether the probe faces the tracker was not tested",
                "[tracker] acceptance_deg is 180; write what the probe can take, such as 60, or "
                "some of these poses cannot be measured",
            )
        )
    if not plan.scenario.pool.line_of_sight:
        said.append(
            _Untested(
                "whether the beam is blocked was not tested",
                "[pool] line_of_sight is false; some of these poses may be hidden",
            )
        )
    return said


def _shapes(plan: Plan) -> list[_Untested]:
    """Bodies whose shape the robot's file does not give, or not so that it is read."""
    said = []
    if plan.unread:
        links, it = listed([f"link {k}" for k in plan.unread]), len(plan.unread) == 1
        said.append(
            _Untested(
                f"whether {links} hit{'s' * it} anything was tested in part only",
                f"a shape of {'it' if it else 'each'} is none that is read; write it as a box, "
                "cylinder, sphere, capsule or mesh",
            )
        )
    if not plan.shapeless:
        return said
    if not tests_contact(plan):
        moves, gives = "the robot hits anything or hides", "none of its links"
    elif len(plan.shapeless) == 1:
        moves, gives = f"link {plan.shapeless[0]} hits anything or hides", "it"
    else:
        moves = f"{listed([f'link {k}' for k in plan.shapeless])} hit anything or hide"
        gives = "them"
    said.append(
        _Untested(
            f"whether {moves} the target was not tested",
            f"the robot's file gives {gives} a shape that collides; add shapes, or look at every "
            "move before the robot makes it",
        )
    )
    return said


def _floor(plan: Plan) -> list[_Untested]:
    """Where the floor that the robot was tested against is not that of the room."""
    T = plan.nominal.chain.T_world_base
    stands = any(_is_below(one, T[:3, 3]) for one in plan.obstacles)
    if T[2, 2] >= UPRIGHT or stands or plan.mounted or not tests_contact(plan):
        return []
    return [
        _Untested(
            "whether the robot hits the floor of the room was not tested",
            "the z axis of its base does not point up, and the floor of its file lies across that "
            "axis; write mounting_height_mm in robot.toml, or the floor as an obstacle below the "
            "base",
        )
    ]


def _is_below(obstacle: Obstacle, place: Array) -> bool:
    """Whether an obstacle lies straight below a place (3,) of the world [m]."""
    corners = np.array(list(product((-0.5, 0.5), repeat=3))) * obstacle.size
    points = corners if obstacle.mesh is None else obstacle.mesh.vertices
    T = obstacle.T_world_obstacle
    low, high = (ends(transform_points(T, points), axis=0) for ends in (np.min, np.max))
    beside = (low[:2] > place[:2]) | (high[:2] < place[:2])
    return not beside.any() and bool(high[2] <= place[2])
