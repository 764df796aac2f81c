"""Rows that no frames bring near their joints, and why."""

import numpy as np

from calib.arrays import Array, Bool, Index
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


def mismatched_rows(
    model: RobotModel, table: Measurements
) -> tuple[Bool, dict[int, str], list[Index]]:
    """Rows (m,) that no frames bring near their joints, why, and the groups that may have slipped.

    Parameters
    ----------
    model : RobotModel
        Nominal.
    table : Measurements
        All rows.
    """
    mismatched = np.zeros(len(table), dtype=bool)
    why: dict[int, str] = {}
    doubtful = []
    for rows in target_groups(table):
        if len(rows) < PARTED:
            continue
        F, position = flange_poses(model, table.q[rows]), table.position[rows]
        rotation = table.rotation[rows] if table.is_pose[rows[0]] else None
        frames, bad = _trimmed_frames(F, position, rotation)
        errors = frames.position_errors(F, position)
        if len(bad) > 1 or np.median(errors) > FAR:
            doubtful.append(rows)
        if len(rows) < FEWEST or len(bad) > LARGEST_SHARE * len(rows):
            continue
        mismatched[rows[bad]] = True
        for k in map(int, bad):
            sentence = f"{errors[k] * 1e3:.0f} mm off"
            other = _fitting_joints(frames, F, position, k, float(np.median(errors)))
            if other is not None:
                sentence += f", fits the joints of row {other - k:+d}"
            why[int(rows[k])] = sentence
    return mismatched, why, doubtful


def _trimmed_frames(F: Array, position: Array, rotation: Array | None) -> tuple[Frames, Index]:
    """Frames from the rows that fit, and the rows that do not: gross errors do not count."""
    some = np.unique(np.linspace(0, len(F) - 1, min(len(F), MOST_FITTED)).round().astype(np.int64))
    keep, half = _sound_stretch(F, position, rotation, some), max(6, len(some) // 2)
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
    return frames, np.flatnonzero(frames.position_errors(F, position) > limit)


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


def _fitting_joints(
    frames: Frames, F: Array, position: Array, k: int, ordinary: float
) -> int | None:
    """Row nearby whose joints fit reading `k`, if any."""
    near = [j for j in range(max(k - NEAR, 0), min(k + NEAR + 1, len(F))) if j != k]
    errors = frames.position_errors(F[near], position[k])
    best = int(np.argmin(errors))
    return near[best] if errors[best] <= max(3 * ordinary, 1e-4) else None
