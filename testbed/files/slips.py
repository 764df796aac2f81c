"""Shots that were missed, or taken twice, inside a file: from there on rows belong to other poses.

Readings and joints are aligned with gaps (Needleman, Wunsch 1970): base and tool from a stretch of
rows that hang together say where each pose should be seen; a row at its joints costs the square of
its error, leaving a reading or a pose alone costs as much as a row that fits nowhere. What is found
is where the cheapest way leaves some alone, fits the rest, and where other ways cost as little.

So one missed and one extra shot are named wherever they stand, as soon as one row between them fits
other joints. What a file cannot tell is not guessed: a reading and its joints that are wrong side
by side are one wrong shot, two rows in each other's place are swapped; both are left out with a
warning, as are the rows behind the last joints. Below 8 rows nothing is asked.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index, evenly
from calib.geometry.frames import target_points, turn_angle
from calib.geometry.model import RobotModel
from calib.measurement.observations import Measurements
from testbed.files.frames_fit import (
    ENOUGH,
    FAR,
    LEVER,
    PARTED,
    Frames,
    Misfit,
    fit_frames,
    flange_poses,
    stretches,
)
from testbed.files.gap_alignment import ALONE, aligned, without_swaps
from testbed.files.joints import Joints
from testbed.files.readings import Readings
from testbed.files.refusal import refusal

BAND = 6
"""Rows that joints may be away, besides those that one side has more than the other."""
MOST, MOST_MORE = 20_000, 100
"""Rows, and rows more on one side, above which nothing is tried."""
MOST_FITTED = 60
"""Rows that frames are fitted to."""
STARTS, ROUNDS = 3, 5
"""Stretches whose frames are aligned with, and alignments with frames of all rows that fit."""
TIMES = 7.0
"""A row fits its joints if its error is below so many usual ones."""
ALIKE = 10.0
"""Ways that cost no more than this on top are as good: errors of a nominal robot are alike in
neighboring poses, so this is more than chance would need."""
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
    spans: tuple[tuple[int, int], ...]
    """First and last reading that a missed shot may stand before, or that may be the extra one:
    what lies between fits alike."""
    left: Misfit
    """What base and tool leave with every row at its joints."""

    def sentence(self, place: Sequence[str]) -> str:
        """``from line 12 on, row k-1 belongs to pose k; one shot is missing``.

        `place` has file and line of each reading looked at.
        """
        lines = [int(each.rpartition(":")[2]) for each in place]
        parts, before = [], 0
        for row, shift, span in zip(self.rows, self.shifts, self.spans, strict=True):
            count, missing = abs(shift - before), shift > before
            shots = "one shot is" if count == 1 else f"{count} shots are"
            k = f"k{-shift:+d}" if shift else "k"
            begin = _lines(lines, span) if missing else f"line {lines[row]}"
            what = "missing" if missing else f"too many ({_lines(lines, span)})"
            parts.append(f"from {begin} on, row {k} belongs to pose k; {shots} {what}")
            before = shift
        return "; ".join(parts[:SHOWN])

    @property
    def fix(self) -> str:
        """What mends the first of them."""
        if self.shifts[0] < 0:
            return "take out the row that is too many"
        return "take out the joints of the pose that was missed, or measure it again"


def find_slip(F: Array, position: Array, rotation: Array | None) -> Slip | None:
    """Where readings and joints part; None if nowhere, or if nothing fits.

    Parameters
    ----------
    F : (n, 4, 4) array
        Flange poses at the joints, in their order [m].
    position : (m, 3) array
        Readings of one target from one station, in their order [m].
    rotation : (m, 3, 3) array, optional
        The same of full poses.
    """
    n, m = len(F), len(position)
    if not PARTED <= m <= MOST or abs(n - m) > MOST_MORE:
        return None
    shifts = np.arange(min(n - m, 0) - BAND, max(n - m, 0) + BAND + 1)
    starts = [
        _fitted(F, np.arange(m) + shift, position, rotation, rows)
        for rows in stretches(np.arange(m))
        for shift in (0, 1, -1)
    ]
    errors = [_errors(frames, F, position, rotation, shifts) for frames in starts if frames]
    errors.sort(key=lambda each: float(np.minimum(each.min(axis=1), FAR).sum()))
    tried = [_settled(F, position, rotation, each, shifts) for each in errors[:STARTS]]
    found = [each for each in tried if each is not None]
    return min(found, key=lambda each: each[0])[1] if found else None


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
        slip = find_slip(flange_poses(model, table.q[rows]), table.position[rows], rotation)
        if slip is not None and slip.rows != (0,):
            lines = [place[row] for row in rows]
            raise refusal(
                lines[slip.rows[0]], "match", slip.sentence(lines), code="M31",
                allowed=f"then the readings miss the robot by {slip.left.shown}", fix=slip.fix,
            )  # fmt: skip


def parted(model: RobotModel, joints: Joints, readings: Readings, rows: Index) -> tuple[str, str]:
    """Place and sentence of where readings in `rows` part from the joints in their order.

    Where nobody knows, the file and nothing.
    """
    if readings.kind != "distance":
        rotation = readings.rotation[rows] if readings.kind == "pose" else None
        slip = find_slip(flange_poses(model, joints.q), readings.position[rows], rotation)
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
    some = evenly(rows, MOST_FITTED)
    turned = None if rotation is None else rotation[some]
    return fit_frames(F[joints[some]], position[some], turned, one_valley=True)


def _errors(
    frames: Frames, F: Array, position: Array, rotation: Array | None, shifts: Index
) -> Array:
    """How far (m, s) each reading is from where each shift has it; inf beyond the ends [m].

    A turn counts as in `Misfit.score`.
    """
    known = target_points(F, frames.arm) @ frames.R.T + frames.t
    joints = np.arange(len(position))[:, None] + shifts
    inside = (joints >= 0) & (joints < len(F))
    at = np.clip(joints, 0, len(F) - 1)
    errors = np.linalg.norm(position[:, None] - known[at], axis=2)
    if rotation is not None and frames.Y is not None:
        turned = rotation[:, None] @ np.swapaxes(frames.R @ F[:, :3, :3] @ frames.Y, 1, 2)[at]
        errors = np.hypot(errors, LEVER * turn_angle(turned))
    return np.where(inside, errors, np.inf)


def _settled(
    F: Array, position: Array, rotation: Array | None, errors: Array, shifts: Index
) -> tuple[float, Slip | None] | None:
    """What the alignment that begins with some errors (m, s) costs, and the slip in it.

    Frames are fitted again to all rows that fit. None if too few do.
    """
    m, before = len(position), None
    for _ in range(ROUNDS):
        usual = max(float(np.median(errors.min(axis=1))), 1e-4)
        cost = np.minimum((errors / usual) ** 2, 2 * ALONE - 1)
        total, way = aligned(cost, shifts, len(F))
        own = np.take_along_axis(errors, np.clip(way, 0, None)[:, None], axis=1)[:, 0]
        fits = (way >= 0) & (own <= TIMES * usual)
        frames = _fitted(F, np.arange(m) + shifts[way], position, rotation, np.flatnonzero(fits))
        if frames is None or fits.sum() < WHOLE * m:
            return None
        if before is not None and np.array_equal(before, way):
            break
        errors, before = _errors(frames, F, position, rotation, shifts), way
    assert frames is not None  # one of the last round
    good = without_swaps(np.flatnonzero(fits), way, errors <= TIMES * usual, shifts)
    turned = None if rotation is None else rotation[good]
    left = frames.misfit(F[good + shifts[way[good]]], position[good], turned)
    return (total, _slip(cost, way, good, shifts, left)) if left.score <= FAR else None


def _slip(cost: Array, way: Index, good: Index, shifts: Index, left: Misfit) -> Slip | None:
    """The changes of shift along a way at the rows that fit; None if there are none."""
    place = np.concatenate([[-int(shifts[0])], way[good]])
    changes = np.flatnonzero(np.diff(place))
    begins = [0, *good[changes].tolist(), len(way)]
    rows, spans = [], []
    for k, row, low, high in zip(changes, begins[1:], [0, *begins[1:]], begins[2:], strict=False):
        old, new = int(place[k]), int(place[k + 1])
        alone = max(old - new, 0)
        # the cost of rows before c at the old joints and of those behind the ones left alone
        before = np.concatenate([[0.0], np.cumsum(cost[low:high, old])])
        after = np.concatenate([[0.0], np.cumsum(cost[low:high, new][::-1])])[::-1]
        each = before[: len(before) - alone] + after[alone:]
        first = last = row - alone - low
        most = each[first] + ALIKE
        while first > 0 and each[first - 1] <= most:
            first -= 1
        while last < len(each) - 1 and each[last + 1] <= most:
            last += 1
        first, last = first + low, last + low
        spans.append((first, last + alone - 1) if alone else (first, last))
        # nothing stands before an extra first row
        rows.append(row if not alone else first + alone if first else 0)
    then = tuple(int(shifts[place[k + 1]]) for k in changes)
    return Slip(tuple(rows), then, tuple(spans), left) if rows else None


def _lines(lines: Sequence[int], span: tuple[int, int]) -> str:
    """``line 12``, ``line 12 or 13``, ``one of lines 12 to 14``: they fit alike."""
    shown = lines[span[0] : span[1] + 1]
    if len(shown) < 3:
        return f"line {' or '.join(map(str, shown))}"
    return f"one of lines {shown[0]} to {shown[-1]}"
