"""Whether something moved between two readings, so that all later ones are displaced together.

A tracker that was pushed, a robot that was shifted on its foot, a reflector that came loose, a tool
that slipped with all of its reflectors and a joint whose zero slipped leave a step in the readings:
from some row on they differ by a few numbers, which are the same in all later rows. Model misfit
follows the poses instead, and thermal drift comes slowly.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
from scipy.special import fdtrc

from calib.arrays import LATER, Array, Index, frozen
from calib.geometry.frames import inverse, points_of_frames, skew
from calib.identification.fit_statistics import RED
from calib.identification.result import Identification
from calib.information.rank import RANK_TOLERANCE
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict, predicted_positions, tool_poses
from calib.measurement.residual import table_whiteners
from calib.shown import Shown

What = Literal["station", "base", "target", "tool", "joint"]
"""The base is offered only with several stations, the tool only with several targets: with one, a
motion of the base looks like one of the station, and of the tool like one of the target."""
FEWEST = 8
"""Fewest poses on either side of a step; six numbers would fit fewer too well."""
EXPLAINED = 0.8
"""Fraction of the chi-square beyond noise that a step must explain; misfit has no place in time."""
SUDDEN = 20.0
"""Chi-square, in units of the rest per degree of freedom, by which a step must beat a slow change.
"""
APART = 4.0
"""Standard errors between the means of a joint before and after the step, from which the poses lie
elsewhere: there, model misfit looks like a step."""
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
    """Number of the station, of the target in `targets_of`, or of the joint, from 0; 0 for base and
    tool."""
    last: int
    """Last row of the table before the step, in time."""
    row: int
    """First row after the step, in time."""
    rows: int
    """Number of rows that the step displaces."""
    change: Annotated[Array, "k"]
    """(k,) shift [m] and rotation [rad] of station or base about the mean point; of the tool about
    the mean target, in its axes; shift of the target in these axes [m], and its rotation [rad] if
    that was measured; change of the joint [rad, m]."""
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


def moved_once(identification: Identification, table: Measurements, order: Index) -> Moved | None:
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
    fit = _Whitened.of(identification, rows)
    kinds, alike = list(_changes(identification, rows)), len(rows) / rows.n_poses
    steps: list[tuple[float, Moved]] = []
    for what, number, plain in kinds:
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
        count = fit.freedom / alike
        worth = float(count * np.log(fit.square / rest) - told * np.log(count))
        if chance >= RED or gain < EXPLAINED * excess:
            continue
        sudden = SUDDEN * max(scale, 1.0) * alike
        if gain - fit.slow(plain) < sudden or _elsewhere(rows, k):
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


def targets_of(table: Measurements) -> tuple[Array, Index]:
    """Distinct targets (t, k) of a table, as in `Measurements.target_key`, and each row's (m,)."""
    targets, which = np.unique(table.target_key, axis=0, return_inverse=True)
    return targets, which.ravel()


def _changes(
    identification: Identification, rows: Measurements
) -> Iterator[tuple[What, int, Array]]:
    """Things that may have moved: kind, number, and derivative (m, 6, k) of rows by its change."""
    model = identification.model
    m, n = len(rows), model.chain.n_joints
    p, frames = predicted_positions(model, rows), model.fixtures.station_frames[rows.station]
    T_station_tool = inverse(frames) @ tool_poses(model, rows)
    R = T_station_tool[:, :3, :3]
    full = rows.is_pose[:, None, None]
    stations = np.unique(rows.station)

    def piece(axes: Array, places: Array) -> Array:
        """Derivative (m, 6, 6) of points (m, 3) of a rigid body by its shift and rotation."""
        C = np.zeros((m, 6, 6))
        C[:, :3, :3] = axes
        C[:, :3, 3:] = -axes @ skew(places)
        C[:, 3:, 3:] = full * axes
        return C

    for station in stations:
        here = rows.station == station
        C = piece(np.broadcast_to(np.eye(3), R.shape), p - p[here].mean(axis=0))
        yield "station", int(station), np.where(here[:, None, None], C, 0.0)
    if len(stations) > 1:
        world = points_of_frames(frames, p)
        axes = np.swapaxes(frames[:, :3, :3], 1, 2)
        yield "base", 0, piece(axes, world - world.mean(axis=0))
    targets, which = targets_of(rows)
    for target in range(len(targets)):
        C = np.zeros((m, 6, 6 if rows.is_pose[which == target].any() else 3))
        C[:, :3, :3] = R
        if C.shape[2] > 3:
            C[:, 3:, 3:] = full * R
        yield "target", target, np.where((which == target)[:, None, None], C, 0.0)
    if len(targets) > 1:
        from_origin = (p - T_station_tool[:, :3, 3])[:, :, None]
        places = (np.swapaxes(R, 1, 2) @ from_origin)[..., 0]
        yield "tool", 0, piece(R, places - places.mean(axis=0))
    derivative = predict(model, rows).rows
    names = identification.parameters.names
    for joint in range(n):
        own_name = f"{'d' if model.chain.prismatic[joint] else 'theta'}{joint + 1}"
        yield "joint", joint, derivative[:, :, [names.index(own_name)]]


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


def _elsewhere(rows: Measurements, k: int) -> bool:
    """Whether the mean of some joint differs between the poses before row k and those after."""
    q, first = np.unique(rows.q, axis=0, return_index=True)
    before, after = q[first < k], q[first >= k]
    if min(len(before), len(after)) < 2:
        return True
    spread = before.var(axis=0, ddof=1) / len(before) + after.var(axis=0, ddof=1) / len(after)
    gap = np.abs(before.mean(axis=0) - after.mean(axis=0))
    return bool((gap > APART * np.sqrt(spread)).any())
