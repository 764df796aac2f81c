"""Rows that no frames bring near their joints, and why."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Bool, Index, evenly
from calib.geometry.model import RobotModel
from calib.measurement.observations import Measurements
from testbed.files.frames_fit import (
    FAR,
    PARTED,
    Frames,
    fit_frames,
    flange_poses,
    stretches,
    target_groups,
)
from testbed.files.tried.runs import IN_A_ROW, run_words, runs_of

MOST_FITTED = 300
"""Rows that frames are fitted to, evenly spread; more show nothing new of gross errors."""
TIMES, LEAST = 10.0, 0.010
"""A row is mismatched if its error is above so many medians and above so many meters."""
FEWEST = 10
"""Rows of a kind below which none is left out."""
LARGEST_SHARE = 0.2
"""Part of the rows above which it is the reading of the file that is wrong, not some rows."""
NEAR = 5
"""Rows before and after, among which the joints of a mismatched one are looked for."""
FITS = 7.0
"""A reading fits other joints, or another target, if it is off by less than so many medians, as
where shots have slipped: a nominal arm misses some poses by several times its usual error."""
MOST_ASTRAY = 1000
"""Other mismatched rows among which they are looked for."""


@dataclass(frozen=True, slots=True, eq=False)
class _Group:
    """Rows of one target from one station, and the frames that most of them fit."""

    rows: Index
    frames: Frames
    bad: Index
    """Places among the rows of those that do not."""
    usual: float
    """Median error of all of them [m]."""

    @property
    def near(self) -> float:
        """Error up to which a reading fits other joints, or another target [m]."""
        return max(FITS * self.usual, 1e-4)


def mismatched_rows(
    model: RobotModel, table: Measurements, place: Sequence[str]
) -> tuple[Bool, dict[int, str], list[Index]]:
    """Rows (m,) that no frames bring near their joints, why, and the groups that may have slipped.

    Of rows that follow each other the first says why, for all of them.

    Parameters
    ----------
    model : RobotModel
        Nominal.
    table : Measurements
        All rows.
    place : sequence of str
        File and line of each.
    """
    mismatched = np.zeros(len(table), dtype=bool)
    why: dict[int, str] = {}
    doubtful, groups = [], []
    for rows in target_groups(table):
        if len(rows) < PARTED:
            continue
        F, position = flange_poses(model, table.q[rows]), table.position[rows]
        rotation = table.rotation[rows] if table.is_pose[rows[0]] else None
        frames, bad = trimmed_frames(F, position, rotation)
        usual = float(np.median(frames.position_errors(F, position)))
        if len(bad) > 1 or usual > FAR:
            doubtful.append(rows)
        groups.append(_Group(rows, frames, bad, usual))
    for group in groups:
        rows, bad = group.rows, group.bad
        if len(rows) < FEWEST or len(bad) > LARGEST_SHARE * len(rows):
            continue
        mismatched[rows[bad]] = True
        alone = []
        for row in map(int, rows[bad]):
            F = flange_poses(model, table.q[[row]])
            error = float(group.frames.position_errors(F, table.position[[row]])[0])
            why[row] = f"{error * 1e3:.0f} mm off"
            if (found := _fitting_label(groups, group, table, row, F)) is not None:
                why[row] += f", fits the {found[0]} of {_line(place, row, found[1])}"
            elif (other := _fitting_joints(group, model, table, row)) is not None:
                why[row] += f", fits the joints of {_line(place, row, other)}"
            else:
                alone.append(row)
        for run in runs_of(np.flatnonzero(np.isin(rows, alone)).tolist()):
            first, *others = map(int, rows[run])
            F, position = flange_poses(model, table.q[rows[run]]), table.position[rows[run]]
            why[first] = (
                f"{len(run)} {IN_A_ROW}, up to {_line(place, first, others[-1])}: "
                f"{run_words(F, position, group.frames, group.near)}"
            )
            for row in others:
                del why[row]
    return mismatched, why, doubtful


def _line(place: Sequence[str], row: int, other: int) -> str:
    """The line of another row, with its file where that is not the file of the first one."""
    file, _, line = place[other].rpartition(":")
    return f"line {line}" if file == place[row].rpartition(":")[0] else place[other]


def trimmed_frames(F: Array, position: Array, rotation: Array | None) -> tuple[Frames, Index]:
    """Frames from the rows that fit, and the rows that do not: gross errors do not count."""
    some = evenly(np.arange(len(F)), MOST_FITTED)
    frames, limit = _trimmed(F, position, rotation, _sound_stretch(F, position, rotation, some))
    if limit > LEAST:  # gross errors may have bent the fit so far that they pass for sound
        keep = _concentrated(F, position, rotation, some, frames)
        again, less = _trimmed(F, position, rotation, keep)
        if less < limit / 2:
            frames, limit = again, less
    return frames, np.flatnonzero(frames.position_errors(F, position) > limit)


def _trimmed(
    F: Array, position: Array, rotation: Array | None, keep: Index
) -> tuple[Frames, float]:
    """Frames from the rows near them, beginning with some; how far off these are at most [m]."""
    some = evenly(np.arange(len(F)), MOST_FITTED)
    half = max(6, len(some) // 2)
    for _ in range(10):
        frames = _fitted(F, position, rotation, keep)
        errors = frames.position_errors(F[some], position[some])
        limit = max(TIMES * float(np.median(errors)), LEAST)
        good = some[errors <= limit]
        if len(good) < half:
            # gross errors spoil the first fit: leave out the worst half and look again
            good = np.sort(some[np.argsort(errors, kind="stable")[:half]])
        if np.array_equal(good, keep):
            break
        keep = good
    return frames, limit


def _concentrated(
    F: Array, position: Array, rotation: Array | None, some: Index, frames: Frames
) -> Index:
    """The half of some rows that fit each other best, from frames which gross errors have bent.

    References
    ----------
    Concentration steps of least trimmed squares (Rousseeuw and Van Driessen 2006).
    """
    half, keep = max(6, len(some) // 2), np.zeros(0, dtype=np.int64)
    for _ in range(10):
        errors = frames.position_errors(F[some], position[some])
        best = np.sort(some[np.argsort(errors, kind="stable")[:half]])
        if np.array_equal(best, keep):
            break
        keep = best
        frames = _fitted(F, position, rotation, keep)
    return keep


def _fitted(F: Array, position: Array, rotation: Array | None, rows: Index) -> Frames:
    """Frames from some rows; of many parts of a file, so that one valley has to be enough."""
    turned = None if rotation is None else rotation[rows]
    return fit_frames(F[rows], position[rows], turned, one_valley=True)


def _sound_stretch(F: Array, position: Array, rotation: Array | None, rows: Index) -> Index:
    """The rows if one fit brings most of them near their joints, else the best part of them."""
    best, least = rows, np.inf
    for part in stretches(rows):
        frames = _fitted(F, position, rotation, part)
        usual = float(np.median(frames.position_errors(F[rows], position[rows])))
        if usual < least:
            best, least = part, usual
        if least < LEAST:
            break
    return best


def _fitting_joints(group: _Group, model: RobotModel, table: Measurements, row: int) -> int | None:
    """Row nearby, or one that fits nowhere either, whose joints fit the reading of one, if any."""
    k = int(np.flatnonzero(group.rows == row)[0])
    near = np.arange(max(k - NEAR, 0), min(k + NEAR + 1, len(group.rows)))
    others = np.union1d(near, group.bad[:MOST_ASTRAY])
    others = group.rows[others[others != k]]
    # of a place that a tip touches again, all joints fit each other's readings
    others = others[(table.position[others] != table.position[row]).any(axis=1)]
    if not len(others):
        return None
    F = flange_poses(model, table.q[others])
    errors = group.frames.position_errors(F, table.position[row])
    best = int(np.argmin(errors))
    return int(others[best]) if errors[best] <= group.near else None


def _fitting_label(
    groups: Sequence[_Group], own: _Group, table: Measurements, row: int, F: Array
) -> tuple[str, int] | None:
    """Target or station that fits a reading at F (1, 4, 4) instead, and a row that states it.

    A row of the same pose, if there is one.
    """
    for group in groups:
        if group is own or group.frames.position_errors(F, table.position[[row]])[0] > group.near:
            continue
        there = table.station[group.rows[0]] == table.station[row]
        same = group.rows[table.pose_id[group.rows] == table.pose_id[row]]
        return "target" if there else "station", int(same[0] if len(same) else group.rows[0])
    return None
