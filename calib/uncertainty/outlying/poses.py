"""Held-out poses that stand out while all others agree: a wrong reading, or a place of its own.

They are named, and neither left out of what is believed nor explained: one reading of a pose does
not tell a wrong shot from a model that fails there.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.special import chdtrc, chdtri

from calib.arrays import Array, Bool, Index, frozen
from calib.geometry.model import RobotModel
from calib.identification.fit_statistics import MOST_OUTLIERS
from calib.identification.identify import Identification
from calib.information.propagation import propagated
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict, predicted_positions
from calib.shown import Shown, length_words
from calib.uncertainty.frames.motion_fit import asked, chi_square
from calib.uncertainty.frames.rigid import motions_of, rest_of
from calib.uncertainty.regions import mahalanobis_squared
from calib.uncertainty.statement.belief import Belief
from calib.uncertainty.statement.shape import same_count

CHANCE = 0.01
"""Chance that any of the held-out poses stands out if all are sound."""
AGREES = 0.05
"""Chance of the others from which on they agree."""
FEWEST = 6
"""Poses that have to be left to agree: as many as are asked for another frame."""
ROUNDS = 10
"""Motions fitted to the poses that agree with the last one; three or four do."""
MOST_NAMED = 10
"""Poses named in one sentence."""


@dataclass(frozen=True, slots=True, eq=False)
class Strays(Shown):
    """Held-out poses that stand out, the worst first, and the others, which agree."""

    poses: Annotated[Index, "k"]
    """(k,) `pose_id` of each."""
    largest: float
    """Largest of their errors [m]."""
    usual: float
    """Median error of the others [m]."""
    n_others: int
    p_others: float
    """Chance of the errors of the others, by noise, parameters and the misfit believed without any
    held-out row."""
    moved: bool = False
    """Whether all poses are off by one motion, which is taken off these errors."""

    def __repr__(self) -> str:
        return f"Strays({len(self.poses)} of {len(self.poses) + self.n_others} held-out poses)"

    @property
    def sentence(self) -> str:
        """The result in words, by the numbers of the poses."""
        return self.said_of([str(pose) for pose in self.poses])

    def said_of(self, names: Sequence[str]) -> str:
        """The same by the names (k,) of the poses."""
        one, shown = len(names) == 1, list(names[:MOST_NAMED])
        if len(names) > MOST_NAMED:
            shown.append(f"{len(names) - MOST_NAMED} more")
        which = shown[0] if one else f"{', '.join(shown[:-1])} and {shown[-1]}"
        pose, stands, largest, its, this = (
            ("pose", "stands", "its error is", "its reading is", "this pose")
            if one
            else ("poses", "stand", "their errors are up to", "their readings are", "these poses")
        )
        also, others, counts = "", "the calibration", f"; {'it counts' if one else 'they count'}"
        if self.moved:
            also, others, counts = " beside that motion", "it", ""
        return (
            f"held-out {pose} {which} {stands} out{also}: {largest} {length_words(self.largest)}, "
            f"where {length_words(self.usual)} is usual, and the other {self.n_others} agree with "
            f"{others}; either {its} wrong, or the model fails there: measure {this} again"
            f"{counts}{' in every figure' * bool(counts)}"
        )

    @property
    def counted_words(self) -> str:
        """How many there are, to stand among others in a sentence."""
        return f"{len(self.poses)} that {'stands' if len(self.poses) == 1 else 'stand'} out"


def far_off(belief: Belief, points: Measurements) -> bool:
    """Whether any held-out row is further off than its noise and the numbers make likely.

    A cheap question before the others: without a misfit, and each row alone.
    """
    if points.n_poses <= FEWEST:
        return False
    seen = predict(belief.model, points)
    e = seen.residual[:, :3]
    V = propagated(seen.rows[:, :3], belief.covariance)
    V = V + belief.misfit.larger_noise**2 * points.covariance[:, :3, :3]
    return bool((mahalanobis_squared(e, V) > chdtri(3, CHANCE / len(points))).any())


def strays_of(
    belief: Belief, points: Measurements, fit: Identification, train: Measurements
) -> Strays | None:
    """Held-out poses that stand out, if all others agree; None where none does, or they do not.

    Also None where the training rows bound no misfit. Of each visit only a few may stand out.

    Parameters
    ----------
    belief : Belief
        What is believed without the held-out rows.
    points : Measurements
        Held-out poses and points.
    fit, train
        As `other_frame` takes them.

    References
    ----------
    e'inv(S + N)e of each pose, chi-square, after Bonferroni; the others with the whole covariance.
    """
    if not np.isfinite(belief.misfit.upper):
        return None
    poses, n = np.unique(points.pose_id), points.n_poses
    stations = np.unique(points.station)
    seen = [_errors(belief, points.rows(points.station == s), fit, train) for s in stations]
    far = np.zeros(n, np.bool_)
    for one in seen:
        score, limit = _scores(one, n * len(seen))
        own = score > limit
        if own.sum() > MOST_OUTLIERS * len(own):
            return None
        far[np.searchsorted(poses, np.unique(one.points.pose_id))] |= own
    if not far.any() or n - far.sum() < FEWEST:
        return None
    p = min(_chance(one, ~np.isin(one.points.pose_id, poses[far])) for one in seen)
    p_others = min(1.0, len(seen) * p)
    if p_others < AGREES:
        return None
    return _named(points, predict(belief.model, points).misses, poses[far], p_others)


def strays_beside(
    belief: Belief, points: Measurements, fit: Identification, train: Measurements,
    *, station: bool, target: bool,
) -> tuple[Strays, Bool] | None:  # fmt: skip
    """The same beside a motion of all poses, of station or target or both; and the rows (m,) left.

    Parameters
    ----------
    belief, points, fit, train
        As `strays_of` takes them, from one station.
    station, target : bool
        Which of them may have moved.

    References
    ----------
    Least trimmed squares by concentration steps (Rousseeuw & Van Driessen 1999) from all poses.
    """
    n = points.n_poses
    pose = np.unique(points.pose_id, return_inverse=True)[1].ravel()
    kept = np.ones(n, np.bool_)
    least = max(n - int(MOST_OUTLIERS * n), FEWEST)
    if least >= n:
        return None
    for _ in range(ROUNDS):
        seen = _errors(belief, points, fit, train, station=station, target=target, used=kept[pose])
        score, limit = _scores(seen, n)
        near = score <= limit
        if near.sum() < least:  # the motion is still drawn to them
            near = np.argsort(np.argsort(score / limit, kind="stable"), kind="stable") < least
        if np.array_equal(near, kept):
            break
        kept = near
    if kept.all() or (score[kept] > limit[kept]).any():
        return None
    rows = kept[pose]
    p = _chance(seen, rows)
    if p < AGREES:
        return None
    misses = np.linalg.norm(seen.rest, axis=1)
    poses = np.unique(points.pose_id)
    return _named(points, misses, poses[~kept], p, moved=True), rows


def without_motion(
    strays: Strays, model: RobotModel, points: Measurements, *, seen_by: int, station: bool,
    target: bool,
) -> Strays:  # fmt: skip
    """The same by errors without a motion, which the other poses that a station saw tell."""
    misses, own = np.array(predict(model, points).misses), points.station == seen_by
    some = points.rows(own)
    p = predicted_positions(model, some)
    tool = motions_of(model, some, p.mean(axis=0))[:, :3, 6:]
    used = ~np.isin(some.pose_id, strays.poses)
    rest = rest_of(some.position, p, tool, station=station, target=target, used=used)
    misses[own] = np.linalg.norm(rest, axis=1)
    return _named(points, misses, strays.poses, strays.p_others, moved=True)


@dataclass(frozen=True, slots=True, eq=False)
class _Errors:
    """Errors of rows (m) from one station, and whitened beside what they share."""

    points: Measurements
    rest: Array
    """(m, 3) what the motion leaves of them [m]."""
    shared: Array
    """(3 m, P) what they share."""
    error: Array
    """(3 m, 1) the rest."""
    motion: Array
    """(3 m, k) the motion; no column where nothing moved."""


def _errors(
    belief: Belief, points: Measurements, fit: Identification, train: Measurements,
    *, station: bool = False, target: bool = False, used: Bool | None = None,
) -> _Errors:  # fmt: skip
    """What a motion of station or target leaves of all errors; `used` rows (m,) tell the motion."""
    p = predicted_positions(belief.model, points)
    about = p.mean(axis=0)
    base, tool = np.split(motions_of(belief.model, points, about)[:, :3], [6], axis=2)
    growth = np.maximum(belief.proven.applies(points.q, points.conditions).growth, 1.0)
    size = belief.misfit.upper * float(np.sqrt(growth.mean()))
    rest = points.position - p
    if station or target:
        rest = rest_of(points.position, p, tool, station=station, target=target, used=used)
    shared, error, of_base, of_tool = asked(
        belief, points, size, about, (rest, base, tool), fit, train
    )
    motion = np.concatenate([error[:, :0], *[of_base] * station, *[of_tool] * target], axis=1)
    return _Errors(points, rest, shared, error, motion)


def _scores(seen: _Errors, n: int) -> tuple[Array, Array]:
    """Chi-square (p,) of each pose, by ascending number, and its limit among `n` poses."""
    poses = np.unique(seen.points.pose_id)
    score, limit = np.empty(len(poses)), np.empty(len(poses))
    for rows in same_count(seen.points.pose_id):
        k = 3 * rows.shape[1]
        of = (3 * rows[:, :, None] + np.arange(3)).reshape(len(rows), k)
        B, e = seen.shared[of], seen.error[of]
        V = np.eye(k) + B @ np.swapaxes(B, 1, 2)
        own = np.searchsorted(poses, seen.points.pose_id[rows[:, 0]])
        score[own] = (e * np.linalg.solve(V, e)).sum(axis=(1, 2))
        limit[own] = chdtri(k, CHANCE / n)
    return score, limit


def _chance(seen: _Errors, rows: Bool) -> float:
    """Chance of the errors of some rows (m,) together."""
    some = np.repeat(rows, 3)
    if not some.any():
        return 1.0
    square, rank = chi_square(seen.shared[some], seen.error[some], seen.motion[some])
    return float(chdtrc(max(int(some.sum()) - rank, 1), square))


def _named(
    points: Measurements, misses: Array, far: Index, p_others: float, *, moved: bool = False
) -> Strays:
    """The poses `far` of all, by the errors (m,) of the rows [m], worst first."""
    error, poses = points.largest_of_poses(misses), np.unique(points.pose_id)
    out = np.isin(poses, far)
    ranked = np.argsort(-error[out], kind="stable")
    return Strays(
        frozen(poses[out][ranked], np.int64), float(error[out].max()),
        float(np.median(error[~out])), int((~out).sum()), p_others, moved,
    )  # fmt: skip
