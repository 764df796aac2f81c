"""Frames fitted to readings, and the rows that do not belong to their joints."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.geometry.chain import Chain
from calib.geometry.frames import log_so3
from calib.geometry.model import RobotModel
from calib.identification.start.closed_forms import (
    fitted_frame,
    hand_eye_rotations,
    lifted_rotation,
    shift_and_arms,
    tool_rotation,
)
from calib.measurement.observations import Measurements

MOST_FITTED = 300
"""Rows that frames are fitted to, evenly spread; more of them tell nothing new of gross errors."""
LEVER = 0.3
"""A radian counts like so many meters where position and rotation are judged together."""
ROUNDS = 3
"""Alternations after the linear lift of a position-only fit."""


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """What takes flange poses of the nominal robot to what was seen."""

    R: Array
    """(3, 3) base in the world."""
    t: Array
    """(3,) base in the world [m]."""
    arm: Array
    """(3,) seen point in the flange [m]."""
    Y: Array | None
    """(3, 3) tool in the flange; None for points."""

    def misses(self, F: Array, position: Array) -> Array:
        """(m,) distance between what was seen and what these frames predict [m]."""
        predicted = (F[:, :3, 3] + F[:, :3, :3] @ self.arm) @ self.R.T + self.t
        return np.asarray(np.linalg.norm(position - predicted, axis=1))

    def turns(self, F: Array, rotation: Array) -> Array:
        """(m,) angle between the rotations seen and predicted [rad]; zero for points."""
        if self.Y is None:
            return np.zeros(len(F))
        predicted = self.R @ F[:, :3, :3] @ self.Y
        off = log_so3(rotation @ np.swapaxes(predicted, 1, 2))
        return np.asarray(np.linalg.norm(off, axis=1))

    def left(self, F: Array, position: Array, rotation: Array | None) -> "Fit":
        """Root mean squares of both."""
        turned = 0.0 if rotation is None else _rms(self.turns(F, rotation))
        return Fit(_rms(self.misses(F, position)), turned)


@dataclass(frozen=True, slots=True)
class Fit:
    """Root mean squares that a fit of base and tool leaves."""

    position: float
    """[m]."""
    rotation: float
    """[rad]; zero for points."""

    @property
    def score(self) -> float:
        """Both in one number [m]."""
        return float(np.hypot(self.position, LEVER * self.rotation))


def fitted_frames(F: Array, position: Array, rotation: Array | None) -> Frames:
    """Base and tool from flange poses F (m, 4, 4) and what was seen.

    Points: the linear lift, then Procrustes and the arm in turn. Full poses: besides that, hand-eye
    by the Kronecker product, which needs tools that turn; the better of both.
    """
    m = len(F)
    one = np.zeros(m, dtype=np.int64)
    free, about = np.zeros(1, dtype=np.bool_), np.zeros((1, 3))
    X = lifted_rotation(F, position, one, about, free)
    t, arm = shift_and_arms(X, F, position, one, about, free)
    for _ in range(ROUNDS):
        known = F[:, :3, 3] + F[:, :3, :3] @ arm[0]
        X = fitted_frame(position, known, X)[:3, :3]
        t, arm = shift_and_arms(X, F, position, one, about, free)
    if rotation is None:
        return Frames(X, t, arm[0], None)
    by_position = Frames(X, t, arm[0], tool_rotation(X, F, rotation))
    turned = hand_eye_rotations(F, rotation)
    if turned is None:
        return by_position
    X = turned[0]
    t, arm = shift_and_arms(X, F, position, one, about, free)
    by_rotation = Frames(X, t, arm[0], tool_rotation(X, F, rotation))
    return min(
        by_rotation, by_position, key=lambda frames: frames.left(F, position, rotation).score
    )


def fit(F: Array, position: Array, rotation: Array | None) -> Fit:
    """How well a reading fits."""
    return fitted_frames(F, position, rotation).left(F, position, rotation)


def trimmed_frames(
    F: Array, position: Array, rotation: Array | None, *, times: float, least: float
) -> tuple[Frames, Index]:
    """Frames from the rows that fit, and the rows that do not: gross errors do not count.

    A row does not fit if it is missed by more than `times` the median and more than `least` [m].
    """
    some = np.unique(np.linspace(0, len(F) - 1, min(len(F), MOST_FITTED)).round().astype(np.int64))
    keep, half = some, max(6, len(some) // 2)
    for _ in range(10):
        own = None if rotation is None else rotation[keep]
        frames = fitted_frames(F[keep], position[keep], own)
        misses = frames.misses(F[some], position[some])
        limit = max(times * float(np.median(misses)), least)
        good = some[misses <= limit]
        if len(good) < half:
            # gross errors spoil the first fit: leave out the worst half and look again
            good = np.sort(some[np.argsort(misses, kind="stable")[:half]])
        if np.array_equal(good, keep):
            break
        keep = good
    return frames, np.flatnonzero(frames.misses(F, position) > limit)


def _rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.square(values).mean()))


TIMES, LEAST = 10.0, 0.010
"""A row is wrong if it is missed by more than so many medians and so many meters."""
FEWEST = 10
"""Rows of a kind below which nothing is judged."""
LARGEST_SHARE = 0.2
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
        if len(bad) > LARGEST_SHARE * len(rows):
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
