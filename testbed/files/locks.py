"""Rows that do not belong to their joints: wrong locks and swapped rows, found, told, left out."""

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.geometry.chain import Chain
from calib.geometry.model import RobotModel
from calib.measurement.observations import Measurements
from testbed.files.fit import Frames, trimmed_frames

TIMES, LEAST = 10.0, 0.010
"""A row is wrong if it is missed by more than so many medians and so many meters."""
FEWEST = 10
"""Rows of a kind below which nothing is judged."""
MOST = 0.2
"""Part of the rows above which it is the reading of the file that is wrong, not some rows."""
NEAR = 5


def groups(table: Measurements) -> list[Index]:
    """Rows of each target and station, the largest group first; distances are left out."""
    _, group = np.unique(table.target_key, axis=0, return_inverse=True)
    found = [np.flatnonzero(group.ravel() == k) for k in range(int(group.max(initial=-1)) + 1)]
    optical = [rows for rows in found if not table.is_distance[rows[0]]]
    return sorted(optical, key=len, reverse=True)


def flange_poses(model: RobotModel, q: Array) -> Array:
    """T_base_flange (m, 4, 4) of nominal links at joints q (m, n) [m]."""
    bare = RobotModel(Chain(model.chain.links, model.chain.kinds), model.joint_errors)
    return bare.poses(q)


def wrong_rows(model: RobotModel, table: Measurements) -> tuple[Bool, dict[int, str]]:
    """Rows (m,) that no frames bring near their joints, and what each of them is.

    Parameters
    ----------
    model : RobotModel
        Nominal.
    table : Measurements
        All rows.
    """
    wrong = np.zeros(len(table), dtype=bool)
    told: dict[int, str] = {}
    for rows in groups(table):
        if len(rows) < FEWEST:
            continue
        F, seen = flange_poses(model, table.q[rows]), table.position[rows]
        turned = table.rotation[rows] if table.is_pose[rows[0]] else None
        frames, bad = trimmed_frames(F, seen, turned, times=TIMES, least=LEAST)
        if len(bad) > MOST * len(rows):
            continue
        misses = frames.misses(F, seen)
        for k in bad:
            wrong[rows[k]] = True
            told[int(rows[k])] = f"{misses[k] * 1e3:.0f} mm off"
            other = _fitting(frames, F, seen, int(k), float(np.median(misses)))
            if other is not None:
                told[int(rows[k])] += f", fits the joints of row {other - int(k):+d}"
    return wrong, told


def _fitting(frames: Frames, F: Array, seen: Array, k: int, ordinary: float) -> int | None:
    """Row nearby whose joints a reading fits, if any."""
    near = [j for j in range(max(k - NEAR, 0), min(k + NEAR + 1, len(F))) if j != k]
    misses = [float(frames.misses(F[j : j + 1], seen[k : k + 1])[0]) for j in near]
    best = int(np.argmin(misses))
    return near[best] if misses[best] <= max(3 * ordinary, 1e-4) else None
