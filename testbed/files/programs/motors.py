"""Corrections that a controller can send: within its own limits, and by the joints it has."""

from dataclasses import replace
from typing import TypeVar

import numpy as np

from calib.arrays import Array, frozen
from calib.compensation import LARGEST, Correction, PoseCorrection
from calib.geometry.inverse import SINGULAR_CONDITION, InverseStatus
from calib.geometry.inverse_search import PoseSearch
from calib.geometry.model import RobotModel
from calib.geometry.operating import OperatingConditions
from calib.geometry.parameters import CHARACTERISTIC_LENGTH
from testbed.robots.controller import BEYOND
from testbed.robots.robot import Robot

STEPS, STILL = 40, 1e-13
"""Steps of a search from where a program stands, and the one after which it has ended [rad, m]."""
LEAST = 1e-11
"""Share of the largest singular value below which motors move nothing: angles count 3e-5."""
Corrected = TypeVar("Corrected", Correction, PoseCorrection)


def by_motors(
    robot: Robot,
    identified: RobotModel,
    correction: Corrected,
    T: Array,
    q: Array,
    at: OperatingConditions,
) -> Corrected:
    """A correction that the robot's controller can send.

    Where joints are held by others, the tool point is brought to its target by the joints that have
    a motor, and the rotation as near as these then bring it. Targets that lead beyond the
    controller's own limits get the status "limits".

    Parameters
    ----------
    robot : Robot
        Its controller and the limits of its joints.
    identified : RobotModel
        What the robot is.
    correction : Correction or PoseCorrection
        By joints that all move by themselves.
    T : (m, 4, 4) array
        Wanted poses [m].
    q : (m, n) array
        Joints of the arm at the targets as they were [rad, m].
    at : OperatingConditions
        Of the targets.
    """
    controller = robot.controller
    if controller.plain:
        return correction
    if controller.held:
        correction = _searched(robot, identified, correction, T, controller.holding(q), at)
    fits = controller.allows(q) & controller.allows(correction.q)
    status: list[InverseStatus] = [
        "limits" if one == "reached" and not fits[k] else one
        for k, one in enumerate(correction.status)
    ]
    return replace(correction, status=tuple(status))


def _searched(
    robot: Robot,
    identified: RobotModel,
    correction: Corrected,
    T: Array,
    q: Array,
    at: OperatingConditions,
) -> Corrected:
    """The same by Gauss-Newton over the joints that have a motor, from joints q (m, n)."""
    controller, start = robot.controller, q
    motors = controller.matrix[:, controller.counted(q.shape[1])]
    task = PoseSearch(identified, T, q, robot.limits, at, whole_turns=False, position_first=True)
    for _ in range(STEPS):
        e, J = task.error(q)
        step = (np.linalg.pinv(J / task.unit @ motors, rcond=LEAST) @ e[..., None])[..., 0]
        q = q + step @ motors.T
        if np.abs(step).max(initial=0.0) < STILL:
            break
    e, J = task.error(q)
    place, turn = task.missed(e)
    near = task.near(e)
    lower, upper = robot.limits.T
    inside = ((q >= lower - BEYOND) & (q <= upper + BEYOND)).all(axis=1)
    # of the three equations that are solved
    s = np.linalg.svd((J / task.unit @ motors)[:, :3], compute_uv=False)
    condition = s[:, 0] / np.maximum(s[:, -1], 1e-16 * s[:, 0])
    unit = np.where(identified.chain.prismatic, CHARACTERISTIC_LENGTH, 1.0)
    far = (np.abs(q - start) > LARGEST * unit).any(axis=1) | (condition > SINGULAR_CONDITION)
    status: list[InverseStatus] = []
    for k, before in enumerate(correction.status):
        outcome: InverseStatus = "singular" if far[k] else "reached" if inside[k] else "limits"
        # what the nominal arm cannot take stays so
        kept = isinstance(correction, PoseCorrection) and before in ("limits", "out of reach")
        status.append(before if kept else outcome if near[k] else "out of reach")
    found = {"q": frozen(q), "position_error": frozen(place), "rotation_error": frozen(turn)}
    if isinstance(correction, PoseCorrection):
        return replace(
            correction, **found, T=frozen(robot.model.poses(q)), status=tuple(status),
            condition=frozen(condition),
        )  # fmt: skip
    return replace(
        correction, **found, step=frozen(q - start), status=tuple(status),
        condition=frozen(condition),
    )  # fmt: skip
