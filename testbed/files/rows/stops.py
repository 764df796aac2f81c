"""Rows at the same joints are one pose, whatever they are called: they repeat one error."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.measurement.grouping import first_met, spans, united
from calib.measurement.observations import Measurements
from calib.uncertainty.statement.conditions import Conditions
from testbed.files.matching import visits_of
from testbed.files.rows.operating import SAME_JOINTS
from testbed.units import counted

NEAR, NEAR_SLIDE = float(np.radians(0.05)), 5e-5
"""How far joints may lie apart where the arm was sent to one place, as those that were read back:
controllers leave a hundredth of a degree, and no misfit changes within that [rad, m]."""


def one_stop(
    table: Measurements, conditions: Conditions, names: tuple[str, ...], slides: Bool
) -> tuple[Measurements, tuple[str, ...], tuple[str, ...]]:
    """The table with one pose for all rows at the same joints, names of poses, and what is odd.

    Rows under another payload or tool are apart: the robot bends otherwise there. Reflectors and
    stations are not: they see one stop of the robot.

    Parameters
    ----------
    table : Measurements
        Rows of one session, numbered by what they are called.
    conditions : Conditions
        Of its rows.
    names : tuple of str
        Name of each pose by its number.
    slides : (n,) array of bool
        Which joints slide.
    """
    there = near_joints(table.q, np.where(slides, NEAR_SLIDE, NEAR))
    same = np.column_stack([there, *_loads(conditions)]).astype(np.float64)
    called = first_met(table.pose_id[:, None])
    group = united(called, first_met(same))
    if np.array_equal(group, called):
        return table, names, ()
    # each pose keeps the number of its first row
    _, first, number = np.unique(group, return_index=True, return_inverse=True)
    pose = table.pose_id[first][number.ravel()]
    several = np.isin(pose, pose[pose != table.pose_id])
    _, seen = np.unique(table.target_key, axis=0, return_inverse=True)
    counts = visits_of(zip(pose.tolist(), seen.ravel().tolist(), strict=True))
    left = set(pose.tolist())
    where = "at the same joints under different pose_ids"
    if not np.array_equal(there, at_joints(table.q)):
        where = "within 0.05 deg (50 um where they slide) of each other in all joints"
    odd = (
        f"{counted(int(several.sum()), 'row')} stand {where}: they count as "
        f"{_poses(len(np.unique(pose[several])))}"
    )
    return (
        replace(table, pose_id=pose, repeat=np.where(several, counts, table.repeat)),
        tuple(name if k in left else "" for k, name in enumerate(names)),
        (odd,),
    )


def near_joints(q: Array, near: Array) -> Index:
    """Group (m,) of rows q (m, n) that lie within `near` (n,) of each other.

    A chain of rows, each near the next one, is a path and no stop: of it the same joints alone are.
    """
    group, there = at_joints(q, near), at_joints(q)
    path: Bool = np.any(spans(q, group) > near, axis=1)
    return np.where(path[group], len(path) + there, group)


def at_joints(q: Array, gap: Array | float = SAME_JOINTS) -> Index:
    """Group (m,) of rows q (m, n): those that gaps above `gap` part in some joint differ.

    Within a group each joint is parted at its gaps, joint after joint, until nothing parts.
    """
    group, count = np.zeros(len(q), dtype=np.int64), 0
    while True:
        for joint, least in zip(q.T, np.broadcast_to(gap, q.shape[1:]), strict=True):
            order = np.lexsort((joint, group))
            parts = (np.diff(joint[order]) > least) | (np.diff(group[order]) > 0)
            group[order] = np.concatenate([[0], np.cumsum(parts)])
        if group[order[-1]] == count:
            return group
        count = int(group[order[-1]])


def _loads(conditions: Conditions) -> Sequence[Array | Index]:
    """Columns that tell under which payload and tool each row stands."""
    stated = (conditions.payload, conditions.center)
    tool = () if conditions.tool is None else (np.unique(conditions.tool, return_inverse=True)[1],)
    return [column for column in stated if column is not None] + list(tool)


def _poses(count: int) -> str:
    """How many, in words."""
    return "one pose" if count == 1 else counted(count, "pose")
