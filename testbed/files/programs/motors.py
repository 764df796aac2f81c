"""Corrections that a controller can execute: within its own limits, and by joints with a motor."""

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from calib.arrays import Array, Bool, frozen
from calib.compensation import LARGEST, Correction, PoseCorrection
from calib.geometry.inverse import SINGULAR_CONDITION, InverseStatus
from calib.geometry.inverse_search import PoseSearch
from calib.geometry.model import RobotModel
from calib.geometry.operating import AS_USUAL, OperatingConditions
from calib.geometry.parameters import CHARACTERISTIC_LENGTH
from testbed.robots.controller import BEYOND
from testbed.robots.robot import Robot

STEPS, STILL = 40, 1e-13
"""Most steps of a search, and the length of the last step [rad, m]."""
LEAST = 1e-11
"""Singular values below this share of the largest one count as zero: angles count 3e-5."""
Corrected = TypeVar("Corrected", Correction, PoseCorrection)


def by_motors(
    robot: Robot,
    identified: RobotModel,
    correction: Corrected,
    T: Array,
    q: Array,
    at: OperatingConditions,
) -> Corrected:
    """A correction that the robot's controller can execute.

    If joints are held by others, the joints with a motor bring the tool point to its target, and
    the rotation as near to its own as they then can. Targets beyond the controller's own limits get
    the status "limits".

    Parameters
    ----------
    robot : Robot
        The robot, with its controller and joint limits.
    identified : RobotModel
        Identified model of the robot.
    correction : Correction or PoseCorrection
        Correction with all joints moving independently.
    T : (m, 4, 4) array
        Wanted poses [m].
    q : (m, n) array
        Joint values of the arm at the original targets [rad, m].
    at : OperatingConditions
        Conditions of the targets.
    """
    controller = robot.controller
    if controller.plain:
        return correction
    if controller.held:
        if isinstance(correction, PoseCorrection):
            # the pose may be rounded, or one that this arm cannot take: its position counts
            q = _brought(robot, robot.model, T, controller.holding(q), AS_USUAL).q
            correction = replace(correction, q_before=frozen(q))
        correction = _searched(robot, identified, correction, T, q, at)
    fits = controller.allows(q) & controller.allows(correction.q)
    status: list[InverseStatus] = [
        "limits" if one == "reached" and not fits[k] else one
        for k, one in enumerate(correction.status)
    ]
    return replace(correction, status=tuple(status))


@dataclass(frozen=True, slots=True, eq=False)
class _Brought:
    """Poses of the tool that the motors can reach."""

    q: Array
    """(m, n) joint values [rad, m]."""
    place: Array
    """(m,) distance of the tool point from its target [m]."""
    turn: Array
    """(m,) angle of the rotation to its target [rad]."""
    near: Bool
    """(m,) whether the tool point reaches its target."""
    condition: Array
    """(m,) condition number of the three equations of the point."""


def _brought(
    robot: Robot, model: RobotModel, T: Array, q: Array, at: OperatingConditions
) -> _Brought:
    """Bring the tool of a model to T (m, 4, 4) from joints q (m, n) [rad, m], by Gauss-Newton."""
    motors = robot.controller.matrix[:, robot.controller.counted(q.shape[1])]
    task = PoseSearch(model, T, q, robot.limits, at, whole_turns=False, position_first=True)
    for _ in range(STEPS):
        e, J = task.error(q)
        step = (np.linalg.pinv(J / task.unit @ motors, rcond=LEAST) @ e[..., None])[..., 0]
        q = q + step @ motors.T
        if np.abs(step).max(initial=0.0) < STILL:
            break
    e, J = task.error(q)
    s = np.linalg.svd((J / task.unit @ motors)[:, :3], compute_uv=False)
    condition = s[:, 0] / np.maximum(s[:, -1], 1e-16 * s[:, 0])
    return _Brought(q, *task.missed(e), task.near(e), np.asarray(condition))


def _searched(
    robot: Robot,
    identified: RobotModel,
    correction: Corrected,
    T: Array,
    start: Array,
    at: OperatingConditions,
) -> Corrected:
    """The correction by joints with a motor alone, from joint values `start` (m, n) [rad, m]."""
    found = _brought(robot, identified, T, start, at)
    lower, upper = robot.limits.T
    inside = ((found.q >= lower - BEYOND) & (found.q <= upper + BEYOND)).all(axis=1)
    unit = np.where(identified.chain.prismatic, CHARACTERISTIC_LENGTH, 1.0)
    far = (np.abs(found.q - start) > LARGEST * unit).any(axis=1)
    far |= found.condition > SINGULAR_CONDITION
    status: list[InverseStatus] = []
    for k, before in enumerate(correction.status):
        outcome: InverseStatus = "singular" if far[k] else "reached" if inside[k] else "limits"
        # outside its limits the nominal arm cannot take the original target
        kept = isinstance(correction, PoseCorrection) and before == "limits"
        status.append(before if kept else outcome if found.near[k] else "out of reach")
    if isinstance(correction, PoseCorrection):
        correction = replace(correction, T=frozen(robot.model.poses(found.q)))
    else:
        correction = replace(correction, step=frozen(found.q - start))
    return replace(
        correction, q=frozen(found.q), position_error=frozen(found.place),
        rotation_error=frozen(found.turn), condition=frozen(found.condition), status=tuple(status),
    )  # fmt: skip
