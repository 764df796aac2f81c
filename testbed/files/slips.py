"""Shots that were missed, or taken twice, inside a file: from there on rows belong to other poses.

Frames are fitted to a stretch of rows that hang together; then each row is given the joints so many
rows away that fit it, by the cheapest way (Viterbi): to change the distance costs as much as some
rows that fit nowhere.

So a change is named from two rows on: the first row of a file, or the last two, may not hang
together with the others. From 15 rows on nearly every other one is named; of fewer rows most are,
none below 8. What is not named is not taken either: one or two rows that fit nowhere are left out
with a warning, and a file of 6 poses or more of which nothing else holds is refused by the probe,
as that of another robot.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.model import RobotModel
from calib.measurement.observations import Measurements
from testbed.files.frames_fit import (
    ENOUGH,
    FAR,
    PARTED,
    Frames,
    Misfit,
    fit_frames,
    flange_poses,
    stretches,
)
from testbed.files.joints import Joints
from testbed.files.readings import Readings
from testbed.files.refusal import refusal

SHIFTS = np.arange(-3, 4)
"""How many rows away joints are looked for."""
MOST = 20_000
"""Rows above which nothing is tried."""
MOST_FITTED = 60
"""Rows that frames are fitted to."""
ROUNDS = 3
"""Fits to all rows at the joints found for them."""
TIMES, CHANGE = 5.0, 40.0
"""A row fits nowhere if its error is so many usual ones; what a change costs, in their squares."""
WHOLE = 0.8
"""Part of the rows that must fit in the end."""
SHOWN = 4
"""Changes named in one sentence."""


@dataclass(frozen=True, slots=True)
class Slip:
    """From some rows on, readings belong to other joints than before."""

    rows: tuple[int, ...]
    """First readings that do, by their place among those looked at."""
    shifts: tuple[int, ...]
    """How many rows further their joints stand; below zero: before."""
    left: Misfit
    """What base and tool leave with every row at its joints."""

    def sentence(self, place: Sequence[str]) -> str:
        """``from line 12 on, row k-1 belongs to pose k; one shot is missing``.

        `place` has file and line of each reading looked at.
        """
        parts, before = [], 0
        for row, shift in zip(self.rows, self.shifts, strict=True):
            count, what = abs(shift - before), "missing" if shift > before else "too many"
            shots = "one shot is" if count == 1 else f"{count} shots are"
            k = f"k{-shift:+d}" if shift else "k"
            line = place[row].rpartition(":")[2]
            parts.append(f"from line {line} on, row {k} belongs to pose k; {shots} {what}")
            before = shift
        return "; ".join(parts[:SHOWN])

    @property
    def fix(self) -> str:
        """What mends the first of them."""
        if self.shifts[0] < 0:
            return "take out the row that is too many"
        return "take out the joints of the pose that was missed, or measure it again"


def find_slip(F: Array, index: Index, position: Array, rotation: Array | None) -> Slip | None:
    """Where readings and joints part; None if nowhere, or if nothing fits.

    Parameters
    ----------
    F : (n, 4, 4) array
        Flange poses at the joints, in their order [m].
    index : (m,) array of int
        Joints that each reading is taken to belong to.
    position : (m, 3) array
        Readings of one target from one station, in their order [m].
    rotation : (m, 3, 3) array, optional
        The same of full poses.
    """
    m = len(index)
    if not PARTED <= m <= MOST:
        return None
    starts = [
        _fitted(F, index + shift, position, rotation, rows)
        for rows in stretches(np.arange(m))
        for shift in (0, 1, -1)
    ]
    errors = [_errors(frames, F, index, position) for frames in starts if frames is not None]
    if not errors:
        return None
    found = min(errors, key=lambda each: float(np.minimum(each.min(axis=1), FAR).sum()))
    for _ in range(ROUNDS):
        path = _path(found)
        joints = index + SHIFTS[path]
        each = np.take_along_axis(found, path[:, None], axis=1)[:, 0]
        good = np.flatnonzero(each <= TIMES * _usual(found))
        frames = _fitted(F, joints, position, rotation, good)
        if frames is None or len(good) < WHOLE * m:
            return None
        found = _errors(frames, F, index, position)
    assert frames is not None  # one of the last round
    turned = None if rotation is None else rotation[good]
    left = frames.misfit(F[joints[good]], position[good], turned)
    # one row before the first change fits nowhere: the way cannot know its joints
    shifts = np.concatenate([[0], SHIFTS[path[good]]])
    changes = np.flatnonzero(np.diff(shifts))
    if not len(changes) or left.score > FAR:
        return None
    rows = good[changes]
    if changes[0] == 0 and rows[0] == np.argmax((joints >= 0) & (joints < len(F))):
        rows[0] = 0  # no row before could have joints
    return Slip(tuple(rows.tolist()), tuple(shifts[changes + 1].tolist()), left)


def raise_if_slipped(
    model: RobotModel, table: Measurements, groups: Sequence[Index], place: Sequence[str]
) -> None:
    """Refuse rows of one target that belong to the joints of other rows.

    A table that is shifted as a whole is left to the probe, which tries other causes, too.

    Raises
    ------
    InputError
        M31: from which row on, and how many shots are missing or too many.
    """
    for rows in groups:
        rotation = table.rotation[rows] if table.is_pose[rows[0]] else None
        F, index = flange_poses(model, table.q[rows]), np.arange(len(rows))
        slip = find_slip(F, index, table.position[rows], rotation)
        if slip is not None and slip.rows != (0,):
            lines = [place[row] for row in rows]
            raise refusal(
                lines[slip.rows[0]], "match", slip.sentence(lines), code="M31",
                allowed=f"base+tool fit leaves {slip.left.shown} then", fix=slip.fix,
            )  # fmt: skip


def parted(
    model: RobotModel, joints: Joints, readings: Readings, index: Index, rows: Index
) -> tuple[str, str]:
    """Place and sentence of where readings in `rows`, for joints in `index`, part from them.

    Where nobody knows, the file and nothing.
    """
    if readings.kind != "distance":
        rotation = readings.rotation[rows] if readings.kind == "pose" else None
        F = flange_poses(model, joints.q)
        slip = find_slip(F, index, readings.position[rows], rotation)
        if slip is not None:
            lines = [readings.place[row] for row in rows]
            return lines[slip.rows[0]], f": {slip.sentence(lines)}"
    return readings.where, ""


def _fitted(
    F: Array, joints: Index, position: Array, rotation: Array | None, rows: Index
) -> Frames | None:
    """Frames from some rows at the joints they are given; None if there are too few."""
    rows = rows[(joints[rows] >= 0) & (joints[rows] < len(F))]
    if len(rows) < ENOUGH:
        return None
    spread = np.linspace(0, len(rows) - 1, min(len(rows), MOST_FITTED)).round().astype(np.int64)
    some = rows[spread]
    turned = None if rotation is None else rotation[some]
    return fit_frames(F[joints[some]], position[some], turned)


def _errors(frames: Frames, F: Array, index: Index, position: Array) -> Array:
    """Distance (m, s) of each reading from where each shift has it; inf beyond the ends [m]."""
    known = (F[:, :3, 3] + F[:, :3, :3] @ frames.arm) @ frames.R.T + frames.t
    joints = index[:, None] + SHIFTS
    inside = (joints >= 0) & (joints < len(F))
    at = known[np.clip(joints, 0, len(F) - 1)]
    return np.where(inside, np.linalg.norm(position[:, None] - at, axis=2), np.inf)


def _usual(errors: Array) -> float:
    """Error of a row at the joints that fit it best [m]."""
    return max(float(np.median(errors.min(axis=1))), 1e-4)


def _path(errors: Array) -> Index:
    """The cheapest way (m,) through the shifts of all rows."""
    cost = np.minimum(errors / _usual(errors), TIMES) ** 2
    total, back = cost[0], np.zeros(cost.shape, dtype=np.int64)
    for k in range(1, len(cost)):
        cheapest = int(np.argmin(total))
        stay = total <= total[cheapest] + CHANGE
        back[k] = np.where(stay, np.arange(len(SHIFTS)), cheapest)
        total = np.minimum(total, total[cheapest] + CHANGE) + cost[k]
    path = np.full(len(cost), int(np.argmin(total)), dtype=np.int64)
    for k in range(len(cost) - 1, 0, -1):
        path[k - 1] = back[k, path[k]]
    return path
