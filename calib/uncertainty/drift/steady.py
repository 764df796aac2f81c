"""A drift that goes one way all session long, where the order of the poses hides it.

Poses that are sorted, as by their first joint, turn such a drift into numbers of the model: hardly
any residual is left of it, and held-out poses that were measured among them agree with what is
wrong. How large it may be, the rest of the residuals says; what it would then leave is added.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.special import chdtrc

from calib.arrays import Array, Index
from calib.identification.identify import Identification
from calib.information.rank import RANK_TOLERANCE
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.shown import Shown, length_words
from calib.uncertainty.drift.beside_drift import rows_in_time
from calib.uncertainty.statement.gain import estimator_gain, of_all_numbers
from calib.uncertainty.statement.misfit import DROP
from calib.uncertainty.statement.shape import MisfitShape

HIDDEN = 0.7
"""Part of its square, where most of it goes, that the numbers take of a drift, above which it is
asked for: of poses sorted by the first joint it is .95 to .99, loosely .8, of a tour .3 to .5 and
of a random order .2; of up to .6 the residuals show enough to widen the misfit by more."""
BENT = 0.5
"""Size of what bends it, as joints that warm ever less, beside what is straight."""
SIZES = 0.02 * 1.12 ** np.arange(90)
"""Sizes that are tried beside zero, in those of the noise: 12 % apart, up to 480."""


@dataclass(frozen=True, slots=True, eq=False)
class SteadyDrift(Shown):
    """The largest steady drift that the rows allow, and what it leaves in the estimate."""

    sd: float
    """Standard deviation per axis of where it stands, over the rows [m]."""
    p_value: float
    """Chance of rows that speak so for one, if there is none."""
    hidden: float
    """Part of its square that the numbers take, in the direction in which they take most."""
    at_tool: float
    """What it leaves at the target, 3-D, root mean square over the rows identified from [m]."""
    covariance: Annotated[Array, "P", "P"]
    """(P, P) of all numbers [m, rad]."""

    def __repr__(self) -> str:
        sd, at_tool = self.sd, self.at_tool
        sizes = (length_words(sd, at_tool, um=".3g"), length_words(at_tool, sd, um=".3g"))
        return f"SteadyDrift({', '.join(sizes)} at the tool)"

    @property
    def way(self) -> float:
        """How far a straight one of this size goes per axis from the first row to the last [m]."""
        return 2 * float(np.sqrt(3)) * self.sd

    @property
    def words(self) -> str:
        """Its size."""
        return (
            f"a steady drift of up to {length_words(self.way)} per axis from the first row to the "
            f"last, by which tool points may be off by {length_words(self.at_tool)} (root mean "
            "square)"
        )


def steady_drift(
    identification: Identification,
    train: Measurements,
    train_order: Index,
    held_out: Measurements,
    held_out_order: Index,
    *,
    shape: MisfitShape,
    misfit: float,
) -> SteadyDrift | None:
    """The largest steady drift that the positions allow; None where the order hides none.

    Parameters as of `memory.drift`.

    References
    ----------
    d = P(t) c along each axis of the station, P of `_course`, c ~ N(0, s^2) beside noise and misfit
    V0, x flat: with S and r what the numbers leave of D'inv(V0) [D, y], S = U diag(lam) U', the
    restricted log-likelihood is -1/2 sum of ln(1 + s^2 lam) - (U'r)^2 / (lam + 1 / s^2). s is its
    largest size within `DROP` of the best. Of the estimate F D c, c about E[c c' | y, s]: what the
    rows show of the drift is in it as it is, and what they hide as large as s.
    """
    order = np.concatenate([train_order, held_out_order])
    if np.ptp(order) == 0:
        return None
    station = np.concatenate([train.station, held_out.station])
    found = rows_in_time(identification, train, train_order, held_out, held_out_order)
    of_rows, of_train = (
        _course(order, station, *some)
        for some in ((found.order, found.station), (train_order, train.station))
    )
    D = np.asarray(np.kron(of_rows, np.eye(3)), dtype=np.float64)  # (3 m, 6)
    beside, k = found.beside(shape, misfit, D), D.shape[1]
    square, unit = beside.square, found.noise_sd
    after = np.r_[np.arange(k), len(square) - 1]  # the drift and the residuals; between, numbers
    numbers = np.arange(k, len(square) - 1)
    across = square[np.ix_(numbers, after)]
    taken = across.T @ np.linalg.solve(square[np.ix_(numbers, numbers)], across)
    S = square[np.ix_(after, after)] - taken
    whole, own, r = square[:k, :k], S[:k, :k], S[:k, k]
    size, axes = np.linalg.eigh(whole)
    some = size > RANK_TOLERANCE * size[-1]  # rows at two times show nothing bent
    if size[-1] <= 0:
        return None
    root = axes[:, some] / np.sqrt(size[some])
    left = np.linalg.eigvalsh(root.T @ own @ root)
    hidden = float(1 - max(left[0], 0.0))
    if hidden < HIDDEN:
        return None
    lam, U = np.linalg.eigh(own)
    lam, r = np.maximum(lam, 0.0), U.T @ r
    squares = np.append(0.0, (unit * SIZES) ** 2)[:, None]
    gain = r**2 * squares / (1 + squares * lam) - np.log1p(squares * lam)
    value = 0.5 * gain.sum(axis=1)
    s2 = float(squares[np.flatnonzero(value >= value.max() - DROP)[-1], 0])
    if s2 == 0:
        return None
    each = s2 / (1 + s2 * lam)
    c = U * (each * r), U * np.sqrt(each)
    C = np.outer(c[0].sum(axis=1), c[0].sum(axis=1)) + c[1] @ c[1].T
    F = estimator_gain(identification, train)[:, :, :3]
    moved = np.einsum("mfa,mp->fpa", F, of_train).reshape(F.shape[1], -1)
    covariance = moved @ C @ moved.T
    J = predict(identification.model, train).rows[:, :3, identification.parameters.free_index]
    variance = np.einsum("mif,fg,mig->m", J, covariance, J, optimize=True)
    return SteadyDrift(
        float(np.sqrt(s2)), float(chdtrc(1, 2 * float(value.max())) / 2), hidden,
        float(np.sqrt(variance.mean())), of_all_numbers(identification, covariance),
    )  # fmt: skip


def _course(order: Index, station: Index, at: Index, seen_from: Index) -> Array:
    """How a drift goes (k, 2) at places `at` in time: straight, of mean square one, and bent.

    About its mean over all rows (m,) of a station, which stands somewhere of its own.
    """

    def course(order: Index) -> Array:
        t = 2 * (order - first) / (last - first) - 1
        return np.stack([np.sqrt(3) * t, BENT * np.sqrt(5) * (1.5 * t**2 - 0.5)], axis=1)

    first, last = order.min(), order.max()
    found = course(at)
    for one in np.unique(seen_from):
        found[seen_from == one] -= course(order[station == one]).mean(axis=0)
    return found
