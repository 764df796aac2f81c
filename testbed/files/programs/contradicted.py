"""Joint columns of a Cartesian program that do not reach the poses in the same rows."""

from typing import Literal

import numpy as np

from calib.arrays import Array
from calib.compensation import PoseCorrection
from calib.geometry.inverse import InverseStatus
from testbed.files.columns import unit_of
from testbed.files.joints import joint_columns
from testbed.files.table import DataTable
from testbed.robots.catalog import Robot

TargetStatus = InverseStatus | Literal["other joints"]
"""Outcome of a target; "other joints" if its row has joints that do not reach its pose."""
APART, APART_SLIDE = float(np.radians(5.0)), 0.05
"""Distance between joints in the row of a Cartesian target and the posture found for it, from which
they belong to another target; joints that name a configuration are rounded to a degree at most
[rad, m]."""


def contradicted(
    table: DataTable, robot: Robot, stated: Array, correction: PoseCorrection
) -> tuple[tuple[TargetStatus, ...], tuple[str, ...]]:
    """Status of each target, and a sentence on stated joints (m, n) that do not reach the poses."""
    columns, slides = joint_columns(table, robot), robot.model.chain.prismatic > 0
    if columns is None:
        return correction.status, ()
    off = np.abs(correction.q_before - stated)
    # whole turns of an axis do not count
    off = np.where(slides, off, np.abs(np.mod(off + np.pi, 2 * np.pi) - np.pi))
    far = (off > np.where(slides, APART_SLIDE, APART)) & correction.corrected[:, None]
    if not far.any():
        return correction.status, ()
    row, count = int(np.argmax(far.any(axis=1))), int(far.any(axis=1).sum())
    j = int(np.argmax(np.where(far[row], off[row] / np.where(slides, APART_SLIDE, APART), 0.0)))
    J = robot.controller.written(correction.q_before[row])
    # a joint without a column is named by the next one
    place = min(int(np.searchsorted(robot.controller.counted(len(slides)), j)), len(J) - 1)
    taken = J[place] / columns.factors[place]
    name, many = columns.names[place], count > 1
    them, theirs, first = ("them", "their poses", "the first ") if many else ("it", "its pose", "")
    written = f'{table.names[name]} = "{table.texts(name)[row][:20]}"'
    said = (
        f"{count} of {len(table)} targets {'are' if many else 'is'} left as written: the joints "
        f"beside {them} do not belong to {theirs}, {first}in line {table.sheet.lines[row]}: "
        f"{written}, but the pose is reached with {taken:.6g} {unit_of(name)}; put the joints "
        "beside their poses, or leave their columns out"
    )
    status: list[TargetStatus] = list(correction.status)
    for k in np.flatnonzero(far.any(axis=1)):
        status[k] = "other joints"
    return tuple(status), (said,)
