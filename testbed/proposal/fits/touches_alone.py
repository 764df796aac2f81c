"""Files of joints alone, with which a tip touched one place each that no file states."""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array
from calib.errors import InputError
from calib.geometry.model import RobotModel
from testbed.files.frames_fit import FAR, TIMES, flange_poses
from testbed.files.refusal import refusal
from testbed.files.session import Session
from testbed.proposal.data import Found
from testbed.proposal.sizes import signed
from testbed.robots.robot import Robot
from testbed.units import MM, listed, significant

FEWEST = 8
"""Rows of a file: six numbers are fitted to them."""
ROUNDS = 5
"""Fits of that point, each to the rows nearest to the one before."""
BESIDE = ("pose_id", "repeat", "target", "order", "time")
"""What may stand beside joints that are alone."""


def touches_alone(looks: Sequence[Found], robot: Robot) -> InputError | None:
    """The error where the joints of each file keep some point of the flange at one place.

    Nothing else explained the files. Joints that only happen to be given move any point of it.
    """
    model, left = robot.model, list[float]()
    if model.chain.prismatic.any() or not looks:
        return None
    for look in looks:
        q = _joints(look, model.chain.n_joints)
        if q is None:
            return None
        left.append(min(_scatter(model, unit * q) for unit in (1.0, np.pi / 180)))
    if not max(left) < FAR:
        return None
    names = [look.called for look in looks]
    several = len(names) > 1
    message = (
        f"{'hold' if several else 'holds'} joints and no readings; a nominal {robot.name} keeps "
        f"one point of its tool at one place in the rows{' of each' * several}, within "
        f"{significant(max(left) * MM, 2)} mm in the median"
    )
    fix = (
        f"if a tip touched one place{' in each file' * several}, write "
        f"{'all rows into one table, and' if several else 'in each row'} the known coordinates of "
        "its place beside the joints, in columns x_mm, y_mm, z_mm"
    )
    return refusal(
        listed(names), "DATA", message, code="M35", allowed="joints with readings", fix=fix
    )


def is_one_place(session: Session) -> bool:
    """Whether all readings are positions of one place, to the last digit."""
    table = session.measurements
    points = not (table.is_pose | table.is_distance).any()
    return points and not np.ptp(table.position, axis=0).any()


def _joints(look: Found, n: int) -> Array | None:
    """Joints (m, n) of a file that holds nothing else, in the unit that it has; else None."""
    if look.kind == "bare" and look.width == n:
        names = [str(k) for k in range(look.names + 1, look.names + n + 1)]
    else:
        own = [f"q{k + 1}" for k in range(n)]
        if look.kind == "bare" or not look.has(*own) or not {*look.stems} <= {*own, *BESIDE}:
            return None
        names = [look.stems[name].theirs for name in own]
    q = signed(look, names).T
    return q if len(q) >= FEWEST and np.isfinite(q).all() else None


def _scatter(model: RobotModel, q: Array) -> float:
    """Median [m] by which the point of the flange that moves least leaves its place.

    Of the three quarters of the rows that are nearest to it, as the tip may have been elsewhere in
    some. Infinite if the flange itself hardly moves: then any joints would do.
    """
    F = flange_poses(model, q)
    R, p = F[:, :3, :3], F[:, :3, 3]
    A = np.concatenate([R, np.broadcast_to(-np.eye(3), R.shape)], axis=2)
    left, near = np.zeros(len(q)), np.arange(len(q))
    for _ in range(ROUNDS):
        found = np.linalg.lstsq(A[near].reshape(-1, 6), -p[near].ravel(), rcond=None)[0]
        left = np.linalg.norm(A @ found + p, axis=1)
        near = np.argsort(left)[: max(FEWEST, 3 * len(q) // 4)]
    travel = float(np.median(np.linalg.norm(p - np.median(p, axis=0), axis=1)))
    middle = float(np.median(left))
    return middle if travel > TIMES * middle else np.inf
