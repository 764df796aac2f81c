"""Whether something moved between two readings, so that all later ones are displaced together.

A tracker that was pushed, a robot that was shifted on its foot, a reflector that came loose, a tool
that slipped with all of its reflectors, a joint whose zero slipped, another load and another robot
leave a step in the readings: from some row on they differ by a few numbers, which are the same in
all later rows. Model misfit follows the poses instead, and thermal drift comes slowly.
"""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import fdtrc

from calib.arrays import LATER, Array, Index, frozen
from calib.geometry.gravity import DOWN
from calib.identification.fit_statistics import RED
from calib.identification.outliers.changes import What, changes
from calib.identification.result import Identification
from calib.information.rank import RANK_TOLERANCE
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.measurement.residual import table_whiteners
from calib.shown import Shown

FEWEST = 8
"""Fewest poses on either side of a step; six numbers would fit fewer too well."""
EXPLAINED = 0.8
"""Fraction of the chi-square beyond noise that a step must explain; misfit has no place in time."""
BY_ANOTHER = 0.95
"""The same of another robot, whose many numbers follow some misfit as well."""
ENOUGH = 1.5
"""Coordinates for each number of the change, on either side of the step."""
SUDDEN = 20.0
"""Chi-square, in units of the rest per degree of freedom, by which a step must beat a slow change.
"""
APART = 4.0
"""Standard errors between the means of a joint before and after the step, from which the poses lie
elsewhere: there, model misfit looks like a step. For a load and another robot, which follow the
poses, between the mean squares, too."""
ODDS = 20.0
"""Odds, by BIC, from which what moved is told from something else that may have."""
TOLD = 1e-6
"""Squared part of a change that must remain beside the free numbers to tell it from theirs."""
ROUNDING = 1e-10
"""Part of chi-square below which its rest after a step is rounding, which may be below zero: sums
and projections of squares lose a few of sixteen digits."""


@dataclass(frozen=True, slots=True, eq=False)
class Moved(Shown):
    """What moved between two readings, and how far."""

    what: What
    number: int
    """Number of the station, of the target in `targets_of`, or of the joint, from 0; else 0."""
    last: int
    """Last row of the table before the step, in time."""
    row: int
    """First row after the step, in time."""
    rows: int
    """Number of rows that the step displaces."""
    change: Annotated[Array, "k"]
    """(k,) shift [m] and rotation [rad] of station or base about the mean point; of the tool about
    the mean target, in its axes; shift of the target in these axes [m], and its rotation [rad] if
    that was measured; change of the joint [rad, m]; mass of a load times the compliance of each
    joint [kg rad/(N m)]; change of all free numbers [m, rad]."""
    size: float
    """Root mean square displacement of those readings [m]."""
    explained: float
    """Fraction of the chi-square beyond noise that the step explains."""
    p_value: float
    """Probability of as large a step anywhere by chance, for noise of any scale."""
    or_else: Annotated[tuple[tuple[What, int], ...], LATER] = ()
    """What else may have moved instead, with its number: the readings do not tell the two apart."""

    def __repr__(self) -> str:
        return f"Moved({self.what} {self.number + 1}, {1e6 * self.size:.3g} um, row {self.row})"


def moved_once(
    identification: Identification, table: Measurements, order: Index, *, gravity: ArrayLike = DOWN
) -> Moved | None:
    """The one thing that moved between two rows of a table, if such a step explains the residuals.

    None otherwise, and with distances or fewer than twice `FEWEST` poses.

    Parameters
    ----------
    identification : Identification
        Fit of all rows of `table`.
    table : Measurements
        Poses and points.
    order : (m,) array
        Place of each row in time.
    gravity : (3,) array_like
        Acceleration of gravity in the frame of the base [m/s^2].

    References
    ----------
    Fall of chi-square by columns C of the rows from k on, beside the free numbers and their basis
    Q: b' S^+ b with b = C'r and S = C'C - C'Q Q'C over these rows; F test with Bonferroni's factor
    for all k and all kinds, and the kinds compared by BIC: those that may be it as well at odds of
    less than `ODDS` are named. The rows of a pose share its misfit: c of them count as one, with
    chi-square and degrees of freedom divided by c (design effect: Kish 1965).
    """
    if table.is_distance.any() or table.n_poses < 2 * FEWEST:
        return None
    in_time = np.argsort(order, kind="stable")
    rows = table.rows(in_time)
    places = _places(rows)
    free = _Whitened.of(identification, rows)
    kinds, alike = list(changes(identification, rows, gravity)), len(rows) / rows.n_poses
    steps: list[tuple[float, Moved]] = []
    for what, number, plain in kinds:
        # what an arm without springs bends by all the time is no step in its load
        fit = free.beside(plain) if what == "load" else free
        gain, k, told, change = fit.step(plain, places)
        if gain <= 0 or not told:
            continue
        rest, freedom = max(fit.square - gain, ROUNDING * fit.square), fit.freedom - told
        excess = fit.square - fit.freedom
        if freedom < 1 or excess <= 0:
            continue
        scale = rest / freedom
        one = float(fdtrc(told, freedom / alike, gain / told / scale / alike))
        chance = one * len(places) * len(kinds)
        count, numbers = free.freedom / alike, free.freedom - freedom
        worth = float(count * np.log(free.square / rest) - numbers * np.log(count))
        if chance >= RED or gain < (BY_ANOTHER if what == "robot" else EXPLAINED) * excess:
            continue
        sudden = SUDDEN * max(scale, 1.0) * alike
        if gain - fit.slow(plain) < sudden or _elsewhere(rows, k, spread=what in ("load", "robot")):
            continue
        by = plain[k:] @ change
        seen = np.abs(plain[k:]).max(axis=(1, 2)) > 0
        found = Moved(
            what, number, int(in_time[k - 1]), int(in_time[k]), int(seen.sum()), frozen(change),
            float(np.sqrt((by[seen, :3] ** 2).sum() / max(int(seen.sum()), 1))),
            min(gain / excess, 1.0), min(chance, 1.0),
        )  # fmt: skip
        steps.append((worth, found))
    if not steps:
        return None
    best, found = max(steps, key=lambda step: step[0])
    near = best - 2 * np.log(ODDS)
    others = [one for worth, one in steps if worth > near and one is not found]
    return replace(found, or_else=tuple((one.what, one.number) for one in others))


@dataclass(frozen=True, slots=True, eq=False)
class _Whitened:
    """Whitened rows in order of time, projected off the free numbers."""

    whiteners: Array
    r: Array
    """(m, 6) residuals orthogonal to the columns of the free numbers, whose prior is not used."""
    Q: Array
    """(m, 6, f) orthonormal basis of these columns over all rows."""
    square: float
    freedom: int

    @classmethod
    def of(cls, identification: Identification, rows: Measurements) -> "_Whitened":
        seen, parameters = predict(identification.model, rows), identification.parameters
        W = np.where(seen.filled[:, :, None], table_whiteners(rows), 0.0)
        A = W @ (seen.rows[:, :, parameters.free_index] * parameters.free_scale)
        U, s, _ = np.linalg.svd(A.reshape(-1, A.shape[2]), full_matrices=False)
        U = U[:, s > RANK_TOLERANCE * s.max(initial=0.0)]
        r = (W @ seen.residual[:, :, None]).ravel()
        r = r - U @ (U.T @ r)
        freedom = int(seen.filled.sum()) - U.shape[1]
        Q = U.reshape(len(rows), 6, -1)
        return cls(W, r.reshape(len(rows), 6), Q, float(r @ r), freedom)

    def beside(self, plain: Array) -> "_Whitened":
        """The same beside changes (m, 6, k) that all rows have."""
        C, Q = (
            self._scaled(plain)[0].reshape(-1, plain.shape[2]),
            self.Q.reshape(-1, self.Q.shape[2]),
        )
        U, s, _ = np.linalg.svd(C - Q @ (Q.T @ C), full_matrices=False)
        U = U[:, s > np.sqrt(TOLD)]
        r = self.r.ravel()
        r = r - U @ (U.T @ r)
        both = np.hstack([Q, U]).reshape(*self.r.shape, -1)
        return _Whitened(
            self.whiteners, r.reshape(self.r.shape), both, float(r @ r),
            self.freedom - U.shape[1],
        )  # fmt: skip

    def step(self, plain: Array, places: Index) -> tuple[float, int, int, Array]:
        """Largest drop of chi-square by a step, its first row, its rank and its numbers (k,)."""
        C, size = self._scaled(plain)
        after = [
            np.cumsum(one[::-1], axis=0)[::-1]
            for one in (
                np.einsum("mri,mrj->mij", C, C),
                np.einsum("mri,mrf->mif", C, self.Q),
                np.einsum("mri,mr->mi", C, self.r),
            )
        ]
        seen = np.cumsum((self.whiteners.any(axis=2)).sum(axis=1)[::-1])[::-1]
        beside = np.minimum(seen[places], seen[0] - seen[places])
        places = places[beside >= ENOUGH * min(plain.shape[2], self.Q.shape[2])]
        if not len(places):
            return 0.0, 0, 0, np.zeros(plain.shape[2])
        CC, CQ, b = (one[places] for one in after)
        S = CC - CQ @ np.swapaxes(CQ, 1, 2)
        values, axes = np.linalg.eigh(S)
        along = (np.swapaxes(axes, 1, 2) @ b[:, :, None])[..., 0]
        told = values > TOLD
        inverse = np.where(told, 1 / np.where(told, values, 1.0), 0.0)
        gain = (along**2 * inverse).sum(axis=1)
        best = int(np.argmax(gain))
        change = axes[best] @ (inverse[best] * along[best])
        return float(gain[best]), int(places[best]), int(told[best].sum()), change * size

    def slow(self, plain: Array) -> float:
        """Largest drop of chi-square by the same change if it comes slowly: linear, or settling."""
        C, _ = self._scaled(plain)
        share = np.linspace(0, 1, len(C))
        gains = []
        for shape in (share, *(1 - np.exp(-share / life) for life in (0.1, 0.3))):
            grown = C * shape[:, None, None]
            flat = grown.reshape(-1, C.shape[2])
            CQ = flat.T @ self.Q.reshape(len(flat), -1)
            values, axes = np.linalg.eigh(flat.T @ flat - CQ @ CQ.T)
            along = axes.T @ (flat.T @ self.r.ravel())
            told = values > TOLD
            gains.append(float((along[told] ** 2 / values[told]).sum()))
        return max(gains)

    def _scaled(self, plain: Array) -> tuple[Array, Array]:
        """Whitened columns of length one over all rows, and the factors (k,) that scale them."""
        C = self.whiteners @ plain
        size = np.sqrt((C**2).sum(axis=(0, 1)))
        size = np.where(size > 0, 1 / np.where(size > 0, size, 1.0), 0.0)
        return C * size, size


def _places(rows: Measurements) -> Index:
    """First rows of stops, in time, with enough poses on either side."""
    pose = rows.pose_id
    first = np.flatnonzero(np.concatenate([[False], pose[1:] != pose[:-1]]))
    count = np.arange(1, len(first) + 1)  # stops before each
    return np.asarray(first[(count >= FEWEST) & (len(first) + 1 - count >= FEWEST)])


def _elsewhere(rows: Measurements, k: int, *, spread: bool) -> bool:
    """Whether the mean of some joint differs between the poses before row k and those after.

    With `spread` also how far it goes from its mean: what follows the poses, as misfit does, would
    look like that.
    """
    q, first = np.unique(rows.q, axis=0, return_index=True)
    if spread:
        q = np.hstack([q, (q - q.mean(axis=0)) ** 2])
    before, after = q[first < k], q[first >= k]
    if min(len(before), len(after)) < 2:
        return True
    noise = before.var(axis=0, ddof=1) / len(before) + after.var(axis=0, ddof=1) / len(after)
    gap = np.abs(before.mean(axis=0) - after.mean(axis=0))
    return bool((gap > APART * np.sqrt(noise)).any())
