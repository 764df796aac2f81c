"""Base and tool of a nominal robot fitted to readings, and what the fit leaves."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.chain import Chain
from calib.geometry.frames import exp_so3, length, log_so3, skew, target_points, turn_angle
from calib.geometry.model import RobotModel
from calib.identification.start.closed_forms import (
    centroid,
    fitted_frame,
    hand_eye_rotations,
    lifted_rotation,
    tool_rotation,
)
from calib.identification.start.one_point import OnePoint
from calib.measurement.observations import Measurements

LEVER = 0.3
"""A radian counts like so many meters where position and rotation are judged together."""
ROUNDS = 3
"""Alternations after the linear lift of a position-only fit."""
STEPS, SETTLED = 25, 1e-3
"""Steps of base and tool together at most; they end where one gains less than this part."""
HOPELESS = 0.3
"""Score above which no step follows: such a fit would trade positions for rotations [m]."""
WEAK = 1e-2
"""Information per row below which points stand so nearly on a line that a fit may have several
valleys: 2e-3 at most on lines of 0.8 rad a joint, 0.05 or more of many-sided poses [m^2]."""
ARMS = 0.2 * np.vstack([np.eye(3), -np.eye(3)])
"""Places of a reflector in the flange that such a fit begins from as well [m]."""
DAMPING, FREE = 1e-6, 1e-12
"""Of the first of these steps and of the one that tells whether more is to be gained, for each row
[m^2]; directions that are measured weaker wait."""
PARTED = 8
"""Rows of a kind below which it is not asked whether they have slipped."""
STRETCHES, ENOUGH = (1, 2, 3, 5), 4
"""Into how many parts the rows are cut where one fit brings few of them near; fewest of a part."""
FAR = 0.020
"""Error that the right reading of a file of the right robot never leaves, near nominal [m]."""
TIMES = 5.0
"""What explains readings leaves so many times less than what does not."""
SHARE = 0.05
"""The same as a share of the spread of the readings, where that is more: of arms less exact than
those of industry. A wrong reading leaves a tenth and more."""


@dataclass(frozen=True, slots=True)
class Misfit:
    """Root mean squares that a fit of base and tool leaves."""

    position: float
    """[m]."""
    rotation: float
    """[rad]; zero for points."""

    @property
    def score(self) -> float:
        """Both in one number [m]."""
        return float(np.hypot(self.position, LEVER * self.rotation))

    @property
    def shown(self) -> str:
        """Both for people."""
        size = self.position
        if not np.isfinite(size):
            return "no answer at all"
        angle = f" and {_two(np.degrees(self.rotation))} deg" if self.rotation else ""
        return (f"{_two(size * 1e3)} mm" if size < 10 else f"{_two(size)} m") + angle


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """What takes flange poses of the nominal robot to what was measured."""

    R: Array
    """(3, 3) base in the world."""
    t: Array
    """(3,) base in the world [m]."""
    arm: Array
    """(3,) measured point in the flange [m]."""
    Y: Array | None
    """(3, 3) tool in the flange; None for points."""

    def position_errors(self, F: Array, position: Array) -> Array:
        """(m,) distance between measured and predicted positions [m]."""
        predicted = target_points(F, self.arm) @ self.R.T + self.t
        return length(position - predicted)

    def misfit(self, F: Array, position: Array, rotation: Array | None) -> Misfit:
        """Root mean squares of what the fit leaves."""
        left = _rms(self.position_errors(F, position))
        if self.Y is None or rotation is None:
            return Misfit(left, 0.0)
        predicted = self.R @ F[:, :3, :3] @ self.Y
        return Misfit(left, _rms(turn_angle(rotation @ np.swapaxes(predicted, 1, 2))))


def far_for(position: Array) -> float:
    """Error that the right reading of positions (m, 3) never leaves [m]."""
    return max(FAR, SHARE * float(np.sqrt(np.var(position, axis=0).sum())))


def flange_poses(model: RobotModel, q: Array) -> Array:
    """T_base_flange (m, 4, 4) of nominal links at joints q (m, n) [m]."""
    return _bare(model).poses(q)


@lru_cache(maxsize=16)
def _bare(model: RobotModel) -> RobotModel:
    """The same arm without base and tool: it is asked for at hundreds of readings in turn."""
    return RobotModel(Chain(model.chain.links, model.chain.kinds), model.joint_errors)


def target_groups(table: Measurements) -> list[Index]:
    """Rows of each target and station, the largest group first; distances are left out."""
    _, group = np.unique(table.target_key, axis=0, return_inverse=True)
    each = [np.flatnonzero(group.ravel() == k) for k in range(int(group.max(initial=-1)) + 1)]
    optical = [rows for rows in each if not table.is_distance[rows[0]]]
    return sorted(optical, key=len, reverse=True)


def fit_frames(
    F: Array, position: Array, rotation: Array | None, *, one_valley: bool = False
) -> Frames:
    """Base and tool from flange poses F (m, 4, 4) and what was measured.

    Points: the linear lift, then Procrustes and the arm in turn. Full poses: besides that, hand-eye
    by the Kronecker product, which needs tools that turn; the better of both. Along a line in
    joint space these end far from the least misfit, so that steps of all together follow; of points
    there, from tools of several places as well, since the misfit has more than one valley, unless
    `one_valley` is enough.
    """
    frames, strength = _least_misfit(_closed_fit(F, position, rotation), F, position, rotation)
    if one_valley or rotation is not None or strength > WEAK:
        return frames
    starts = (_with_arm(arm, F, position) for arm in (np.zeros(3), *ARMS))
    fits = [frames, *(_least_misfit(start, F, position, None)[0] for start in starts)]
    return min(fits, key=lambda fit: fit.misfit(F, position, None).score)


def _with_arm(arm: Array, F: Array, position: Array) -> Frames:
    """The base that suits a place of the reflector in the flange."""
    T = fitted_frame(position, target_points(F, arm), np.eye(3))
    return Frames(T[:3, :3], T[:3, 3], arm, None)


def _closed_fit(F: Array, position: Array, rotation: Array | None) -> Frames:
    """Base and tool by linear algebra alone: near the least misfit where poses are many-sided."""
    one = np.zeros(len(F), dtype=np.int64)
    X = lifted_rotation(F, position, one, np.zeros((1, 3)), np.zeros(1, dtype=np.bool_))
    sums = OnePoint.of(F, position)
    for _ in range(ROUNDS):
        X = sums.rotation(sums.arm(X), X)
    by_position = _from(X, sums, F, rotation)
    turned = None if rotation is None else hand_eye_rotations(F, rotation)
    if turned is None:
        return by_position
    by_rotation = _from(turned[0], sums, F, rotation)
    return min(by_rotation, by_position, key=lambda fit: fit.misfit(F, position, rotation).score)


def _from(X: Array, sums: OnePoint, F: Array, rotation: Array | None) -> Frames:
    """Base and tool for a rotation X (3, 3) of the base."""
    arm = sums.arm(X)
    tool = None if rotation is None else tool_rotation(X, F, rotation)
    return Frames(X, sums.shift(X, arm), arm, tool)


def _least_misfit(
    frames: Frames, F: Array, position: Array, rotation: Array | None
) -> tuple[Frames, float]:
    """Frames of the least score nearby, by damped steps of base and tool together.

    With the weakest direction's information per row [m^2]; infinite where nothing was tried.

    References
    ----------
    Levenberg 1944; Marquardt 1963. The shift is eliminated: it is the mean of what is left.
    """
    left = _residuals(frames, F, position, rotation)
    cost, damping = float(left @ left), DAMPING * len(F)
    weakest = np.inf
    if cost > HOPELESS**2 * len(F):
        return frames, weakest
    for _ in range(STEPS):
        J = _derivatives(frames, F, rotation is not None)
        strength, V = np.linalg.eigh(J.T @ J)
        weakest = float(strength[0]) / len(F)
        along, strength = V.T @ (J.T @ left), np.maximum(strength, 0.0)
        if float(along @ (along / (strength + FREE * len(F)))) < SETTLED * cost:
            break
        while damping < len(F):
            other = _moved(frames, V @ (along / (strength + damping)), F, position)
            changed = _residuals(other, F, position, rotation)
            if changed @ changed < cost:
                break
            damping *= 10
        else:
            break
        frames, left, cost, damping = other, changed, float(changed @ changed), damping / 30
    return frames, weakest


def _residuals(frames: Frames, F: Array, position: Array, rotation: Array | None) -> Array:
    """What frames leave of positions, and of rotations in meters: their squares are the score's."""
    left = position - target_points(F, frames.arm) @ frames.R.T - frames.t
    if frames.Y is None or rotation is None:
        return left.ravel()
    turns = log_so3(rotation @ np.swapaxes(frames.R @ F[:, :3, :3] @ frames.Y, 1, 2))
    return np.concatenate([left.ravel(), LEVER * turns.ravel()])


def _derivatives(frames: Frames, F: Array, turned: bool) -> Array:
    """Of what the residuals lose: columns of a turn of the base, of the arm, and of the tool."""
    m, R, Y = len(F), frames.R @ F[:, :3, :3], frames.Y if turned else None
    J: Array = np.zeros((m if Y is None else 2 * m, 3, 6 if Y is None else 9))
    J[:m, :, :3] = -skew(F[:, :3, 3] @ frames.R.T + R @ frames.arm)
    J[:m, :, 3:6] = R
    J[:m] -= centroid(J[:m])
    if Y is not None:
        # of small turns: their logarithm adds
        J[m:, :, :3], J[m:, :, 6:] = LEVER * np.eye(3), LEVER * (R @ Y)
    return J.reshape(-1, J.shape[2])


def _moved(frames: Frames, step: Array, F: Array, position: Array) -> Frames:
    """Frames after a step, and the shift that suits them."""
    R, arm = exp_so3(step[:3]) @ frames.R, frames.arm + step[3:6]
    t = centroid(position - target_points(F, arm) @ R.T)
    return Frames(R, t, arm, None if frames.Y is None else frames.Y @ exp_so3(step[6:]))


def stretches(rows: Index) -> Iterator[Index]:
    """All rows, then parts of them that hang together: gross errors hardly lie in each."""
    for parts in STRETCHES:
        yield from (part for part in np.array_split(rows, parts) if len(part) >= ENOUGH)


def _two(value: float) -> str:
    """At least two digits, and never a power of ten."""
    return f"{value:.2g}" if value < 10 else f"{value:.0f}"


def _rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.square(values).mean()))
