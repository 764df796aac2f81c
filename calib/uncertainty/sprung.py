"""Virtual calibrations of an arm that gives way: what they find where linear estimates would fall.

A spring bends by its compliance times its load. Measurements tell the products, and leave to the
prior how each is shared between compliance and moments: along that valley the numbers wander far,
and tool points hardly. Draws from a covariance leave the valley, calibrations stay in it.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from calib.arrays import Array, Bool, Index, frozen
from calib.identification.prior import prior_rows
from calib.identification.result import Identification
from calib.measurement.observations import Measurements
from calib.measurement.prediction import mount, perfect, predict_at
from calib.measurement.residual import linearize, table_whiteners
from calib.shown import Shown

UNFELT = 1e-4
"""Products whose scatter moves no row by more of a standard deviation are left out."""
SETTLED = 0.01
"""Length of the last step of a calibration, in standard deviations."""
MOST_STEPS = 40
"""Steps of each, halved ones counted."""
ENTRIES = 4_000_000
"""Numbers of the slopes that are held at once."""


class Settled(NamedTuple):
    """What virtual calibrations found."""

    steps: Array
    """(M, P) from the model [m, rad; kg, kg m]."""
    late: int
    """So many took more than the steps allowed."""


@dataclass(frozen=True, slots=True, eq=False)
class Valley(Shown):
    """The calibration of an arm on springs, linear but for the products of their numbers."""

    free: Index
    """(f,) places of the numbers estimated: linear ones, p compliances, k moments."""
    factor: Array
    """(r, f + p k) triangle of the whitened rows: numbers, then products, those of a compliance
    one after the other. Rows beyond f are told by products alone."""
    springs: tuple[int, int]
    """p and k."""

    def __repr__(self) -> str:
        return f"Valley({len(self.free)} numbers, {self.springs[0]} springs)"

    def settled(self, steps: Array, rng: np.random.Generator) -> Settled:
        """The answers of calibrations whose linear estimates are `steps` (M, P).

        Each minimizes |F (x; w(x)) - F (x0; 0) - e|^2, x0 its linear estimate, w the products of
        what its compliances and moments change, and e the noise that no linear estimate shows.

        References
        ----------
        Randomize, then optimize: Bardsley et al. 2014, SIAM Journal on Scientific Computing 36(4);
        linear numbers eliminated: Golub & Pereyra 1973.
        """
        p, k = self.springs
        first, out, late = len(self.free) - p - k, steps.copy(), 0
        own = self.factor[first:, first:]
        block = max(1, ENTRIES // (len(own) * (p + k)))
        for start in range(0, len(steps), block):
            found = steps[start : start + block, self.free]
            linear = found[:, first:]
            aim = linear @ own[:, : p + k].T
            aim[:, p + k :] += rng.standard_normal((len(found), len(own) - p - k))
            sprung, far = _descended(own, p, linear, aim)
            late += int(far.sum())
            change = np.hstack([sprung - linear, _products(sprung, p)])
            back = solve_triangular(
                self.factor[:first, :first], self.factor[:first, first:] @ change.T
            )
            found[:, :first] -= back.T
            found[:, first:] = sprung
            out[start : start + block, self.free] = found
        return Settled(out, late)


def valley(identification: Identification, measurements: Measurements) -> Valley | None:
    """The calibration that was done, about its answer; None where no products were estimated.

    Parameters
    ----------
    identification : Identification
        Its springs weigh the arm as it stands stiff.
    measurements : Measurements
        What it was identified from; the measured values are not used.
    """
    model, springs = identification.model, identification.model.joint_errors.springs
    if springs is None:
        return None
    own, loads = springs.names[: len(springs.load)], springs.names[len(springs.load) :]
    give = [i for i, name in enumerate(own) if name in identification.names]
    push = [i for i, name in enumerate(loads[: int(springs.free.sum())])
            if name in identification.names]  # fmt: skip
    if not give or not push:
        return None
    sprung = (*(own[i] for i in give), *(loads[i] for i in push))
    names = (*(name for name in identification.names if name not in sprung), *sprung)
    free = np.array([model.names.index(name) for name in names])
    plan = perfect(model, measurements)
    whitening = table_whiteners(plan)
    stack = linearize(model, plan, whitening=whitening)
    T, J, bends = model.poses_and_bends(plan.q, plan.conditions)
    per_moment = springs.torques(plan.q, plan.conditions.moments)[1][:, give][:, :, push]
    turned = bends[:, :, springs.places[give]] / springs.load[give]
    whole = np.concatenate(
        [J, (turned[..., None] * per_moment[:, None]).reshape(len(J), 6, -1)], axis=2
    )
    mount(T, whole, model, plan)
    seen = predict_at(T, whole, model.fixtures, model.first_fixture, plan)
    products = (whitening @ seen.rows[:, :, J.shape[2] :])[seen.filled]
    rows = np.hstack([stack.A[:, free], products])
    if len(identification.weights):
        rows *= np.sqrt(identification.weights)[stack.row_of, None]
    if identification.prior is not None:
        belief = prior_rows(identification.prior, model, identification.parameters).at(model)[1]
        rows = np.vstack([rows, np.pad(belief[:, free], ((0, 0), (0, products.shape[1])))])
    sd = np.sqrt(np.diag(identification.full_covariance))[free]
    factor = np.asarray(np.linalg.qr(rows, mode="r"))
    return _told(Valley(free, factor, (len(give), len(push))), sd)


def _told(whole: Valley, sd: Array) -> Valley:
    """The same with those rows of products alone that draws of the numbers (f,) move at all."""
    p, k = whole.springs
    f = len(whole.free)
    size = np.outer(sd[f - p - k : f - k], sd[f - k :]).ravel()
    _, told, along = np.linalg.svd(whole.factor[f:, f:] * size, full_matrices=False)
    kept = told > UNFELT
    rest = told[kept, None] * along[kept] / np.where(size > 0, size, 1.0)
    rest = np.hstack([np.zeros((len(rest), f)), rest])
    return replace(whole, factor=frozen(np.vstack([whole.factor[:f], rest])))


def _products(x: Array, p: int) -> Array:
    """Products (M, p k) of what numbers (M, p + k) change of compliances and moments."""
    return np.asarray((x[:, :p, None] * x[:, None, p:]).reshape(len(x), -1))


def _descended(own: Array, p: int, start: Array, aim: Array) -> tuple[Array, Bool]:
    """Numbers (M, p + k) that minimize |own (x; w(x)) - aim|^2, and which (M,) did not settle."""
    x, share = start.copy(), np.ones(len(start))
    left = aim - np.hstack([x, _products(x, p)]) @ own.T
    loss = np.square(left).sum(axis=1)
    some = np.arange(len(x))
    for _ in range(MOST_STEPS):
        if not len(some):
            break
        D = _slopes(own, p, x[some])
        pull = np.einsum("Mrs,Mr->Ms", D, left[some], optimize=True)
        step = np.linalg.solve(np.swapaxes(D, 1, 2) @ D, pull[..., None])[..., 0]
        tried = x[some] + share[some, None] * step
        after = aim[some] - np.hstack([tried, _products(tried, p)]) @ own.T
        lower = np.square(after).sum(axis=1)
        better = lower <= loss[some]
        at = some[better]
        x[at], left[at], loss[at] = tried[better], after[better], lower[better]
        share[some] = np.where(better, np.minimum(1.0, 2 * share[some]), share[some] / 2)
        some = some[(step * pull).sum(axis=1) > SETTLED**2]
    late = np.zeros(len(x), dtype=np.bool_)
    late[some] = True
    return x, late


def _slopes(own: Array, p: int, x: Array) -> Array:
    """Slopes (M, r, p + k) of own (x; w(x)) by x."""
    k = x.shape[1] - p
    products = own[:, p + k :].reshape(len(own), p, k)
    by_give = np.einsum("rpk,Mk->Mrp", products, x[:, p:], optimize=True)
    by_push = np.einsum("rpk,Mp->Mrk", products, x[:, :p], optimize=True)
    return np.asarray(own[:, : p + k] + np.concatenate([by_give, by_push], axis=2))
