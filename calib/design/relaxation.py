"""Continuous relaxation: weights on the pool instead of a set, and the bounds they prove."""

from dataclasses import dataclass
from numbers import Real

import numpy as np

from calib.arrays import Array, frozen, require_count
from calib.design.borders import require_problem
from calib.design.problem import Problem
from calib.errors import refuse
from calib.information.criteria.base import Certifiable
from calib.information.criteria.whitened import grams
from calib.shown import Shown

ITERATIONS = 400
"""Largest number of steps at each order of sharpness."""
PATIENCE = 20
"""Number of steps after which progress is looked at."""
TOLERANCE = 1e-4
"""Stop if the figure is within this part of its bound, or if the bound improved by less than a
fifth of this in `PATIENCE` steps."""
LEAST = 1e-9
"""Least weight, relative to the mean, so that M(w) determines all numbers even if a goal needs few.
"""
PACKED_AT_ONCE = 2000
"""Blocks whose products are formed at once."""


@dataclass(frozen=True, slots=True, eq=False)
class Weights(Shown):
    """Weights on a pool in place of m poses, and an upper bound on the value of any m poses."""

    w: Array
    """(N,) weights, none negative, summing to m; none above one unless poses may repeat."""
    M: Array
    """(p, p) information of those weights, with that known before."""
    bound: float
    """No set of m poses has a larger value of the criterion; widened by rounding."""
    figure: float
    """Figure that corresponds to `bound`."""
    trace: Array
    """(t,) smallest bound after each step."""

    def __repr__(self) -> str:
        return f"Weights({len(self.w)} poses, {len(self.trace)} steps, limit {self.figure:.4g})"


class Grams:
    """Upper triangles of B_j'B_j of many blocks, so that sums over the pool are matrix products."""

    def __init__(self, blocks: Array) -> None:
        p = blocks.shape[2]
        self.upper = np.triu_indices(p)
        self.twice = np.where(self.upper[0] == self.upper[1], 1.0, 2.0)
        self.packed = np.empty((len(blocks), len(self.twice)))
        for start in range(0, len(blocks), PACKED_AT_ONCE):
            some = slice(start, start + PACKED_AT_ONCE)
            self.packed[some] = grams(blocks[some])[:, self.upper[0], self.upper[1]]

    def weighted_sum(self, w: Array) -> Array:
        """Sum (p, p) of w_j B_j'B_j."""
        p = int(self.upper[0][-1]) + 1
        M = np.zeros((p, p))
        M[self.upper] = w @ self.packed
        return np.asarray(M + M.T - np.diag(np.diagonal(M)))

    def traces(self, S: Array) -> Array:
        """tr(S B_j'B_j) (N,) for a symmetric S (p, p)."""
        return np.asarray(self.packed @ (S[self.upper] * self.twice))


def relaxation(
    problem: Problem,
    *,
    packed: Grams | None = None,
    iterations: int = ITERATIONS,
    tolerance: float = TOLERANCE,
) -> Weights:
    """Optimal weights on the pool, and a bound on the value of every set of m poses.

    Let M(w) = M0 + sum w_j G_j with G_j = B_j'B_j and any w >= 0, d_j = tr(S G_j), and
    top = tr(S M0) + the sum of the m largest d_j. No set without repeats exceeds

    - D: log det M(w) + p log(top / p), with S = M(w)^-1;
    - A, V: -phi^2 / top, with S = M^-1 C M^-1 and phi = tr(C M^-1);
    - G: the same, with any weighted mean C of the goal poses;
    - E: top, with any S = Z of trace one.

    With repeats the m largest become m times the largest. Each step multiplies w_j by d_j^e, e = 1
    for D and 1/2 for A and V, and rescales the weights to sum m; the smallest bound is kept.

    Parameters
    ----------
    problem : Problem
        Pool, number of poses and criterion.
    packed : Grams, optional
        Products of the poses that may be chosen, if already at hand: they do not depend on m.
    iterations : int
        Largest number of steps (per order of sharpness, for E and G); the bound holds after any.
    tolerance : float
        Relative difference of the figures of bound and weights at which to stop, times the `slack`
        of the criterion.

    Raises
    ------
    InputError
        A4: the criterion is O2, O4 or O5, which have no relaxation; A3: `tolerance` is negative.

    References
    ----------
    Silvey, Titterington and Torsney 1978 (multiplicative step); Joshi and Boyd 2009 (dual bounds).
    """
    require_problem(problem)
    criterion, iterations = problem.criterion, require_count("iterations", iterations)
    if not (isinstance(tolerance, Real) and 0 <= tolerance < np.inf):
        raise refuse("tolerance", tolerance, "zero or more", code="A3")
    if not isinstance(criterion, Certifiable):
        raise refuse(
            "criterion",
            criterion.name,
            "D, A, V, G or E",
            code="A4",
            message=f"{criterion.name} has no relaxation: it is not concave",
        )
    places, m, p = np.flatnonzero(problem.open), problem.m, problem.p
    products = Grams(problem.blocks[places]) if packed is None else packed
    cap = np.inf if problem.repeats else 1.0
    bound, trace, tolerance = np.inf, list[float](), tolerance * criterion.slack

    def weights(w: Array, M: Array) -> Weights:
        """The result, on the whole pool."""
        full = np.zeros(len(problem.pool))
        full[places] = w
        figure = criterion.figure_of_value(bound, p, problem.n_poses)
        return Weights(frozen(full), frozen(M), bound, figure, frozen(trace))

    w = best = np.full(len(places), m / len(places))
    for order in criterion.sharpness:
        recent = bound
        for step in range(1, iterations + 1):
            # sensitivity of the criterion to each pose
            M = problem.base + products.weighted_sum(w)
            S = criterion.dual(M, order)
            d = np.maximum(products.traces(S), 0.0)  # S has no negative eigenvalue: rounding
            # bound on every set
            top = float(np.einsum("ij,ij->", S, problem.base)) + _top(d, m, problem.repeats)
            proven = criterion.with_rounding(criterion.ceiling(M, S, top), M)
            if proven < bound:
                bound, best = proven, w
            trace.append(bound)
            # reached, stalled, or nothing to gain
            if criterion.efficiency(float(criterion.value_bounded(M)), bound, p) > 1 - tolerance:
                return weights(w, M)
            if step % PATIENCE == 0:
                if criterion.efficiency(bound, recent, p) > 1 - tolerance / 5:
                    break
                recent = bound
            if not d.any():
                break  # no pose adds anything at this M: every choice of weights is as good
            # multiplicative step
            w = _cap(w * d ** criterion.exponent(order), m, cap)
    return weights(best, problem.base + products.weighted_sum(best))


def _top(d: Array, m: int, repeats: bool) -> float:
    """Largest sum of m of the values d (N,), each taken once unless they may repeat."""
    if repeats:
        return m * float(d.max())
    return float(np.partition(d, len(d) - m)[len(d) - m :].sum())


def _cap(w: Array, m: int, cap: float) -> Array:
    """Weights proportional to w (N,), none above `cap`, summing to m."""
    w = np.maximum(w, LEAST * w.mean())
    w = w * (m / w.sum())
    # clip at the cap, share out what that leaves among the others, and again
    for _ in range(20):
        over = w >= cap
        free = w[~over].sum()
        if not over.any() or free <= 0:
            break
        factor = (m - cap * over.sum()) / free
        w = np.where(over, cap, w * factor)
        if factor <= 1 + 1e-12:
            break
    return np.asarray(w)
