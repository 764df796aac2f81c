"""The restricted likelihood of sizes of misfit, the scale of the noise profiled out.

Every size and every scale on a grid: many sizes share one pass over the rows, all scales one system
of numbers, or with a prior three.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index, frozen
from calib.uncertainty.statement.evidence import NoiseRepeats, PositionRows, reduced
from calib.uncertainty.statement.likelihood_systems import systems_of

STEP = float(np.log(1.15)) / 2
"""Logarithmic step of the sizes that are tried: 7 %."""
SMALLEST, LARGEST = 0.03, 1e4
"""Sizes tried, in standard deviations of the noise per axis; zero as well."""
AT_ONCE = 24
"""Sizes looked at together: most rows deny all but the first fifty."""
NODES = np.array([-3.0, 0.0, 3.0])
"""Scales of the noise at which the system of numbers is solved, in their standard deviations."""
HOPELESS = 30.0
"""Fall of the log-likelihood beyond which no larger size is looked at."""
WIDE, STRIDE = 200, 8
"""Numbers from which on every eighth size is tried first, then all about the best of these."""
DOUBT = 0.1
"""Standard deviation of the logarithm of the noise scale, where no repeats tell it."""


@dataclass(frozen=True, slots=True, eq=False)
class Likelihood:
    """Restricted log-likelihood of sizes of misfit, the scale of the noise profiled out."""

    size: Array
    """(g,) in stated standard deviations of the noise per axis; the first is zero."""
    value: Array
    """(g,) logarithm, up to a constant."""
    noise_scale: Array
    """(g,) most likely factor on the stated noise at each size."""

    def limit(self, drop: float) -> float:
        """Largest size within `drop` of the best, straight between grid points; inf if beyond."""
        level = self.value.max() - drop
        last = int(np.flatnonzero(self.value >= level)[-1])
        if last + 1 == len(self.size):
            return float(np.inf)
        ends = slice(last, last + 2)
        return float(np.interp(-level, -self.value[ends], self.size[ends]))


def likelihood(
    rows: PositionRows,
    unit: float,
    repeats: NoiseRepeats | None,
    before: PositionRows | None = None,
) -> Likelihood | None:
    """Restricted likelihood of sizes of misfit; None where the rows show no more than the numbers.

    Parameters
    ----------
    rows : PositionRows
        Of all poses.
    unit : float
        Stated noise per axis, in which sizes are counted [m].
    repeats : NoiseRepeats or None
        What repeats say of the scale of the noise; else it is known within `DOUBT`.
    before : PositionRows, optional
        Those of a prior, which no noise widens.

    References
    ----------
    V = g^2 (N + t^2 D), H = A'inv(V)A + Lambda0: with the size t counted in scaled noise, -2 l =
    ln|V| + ln|H| + y'Py + (what is known of g). Without a prior one system of numbers per t does,
    whatever g is; with one, ln|H| and g^2 y'Py are parabolas of ln g through `NODES` systems.
    """
    both = rows if before is None or not len(before.y) else rows.joined(before)
    A = reduced(both.A, None if before is None else before.A)
    n, freedom = len(rows.y), len(A) - A.shape[1]
    if freedom < 1:
        return None
    grid = Grid.of(repeats)
    t, log_g, reach = grid.t, grid.log_g, grid.reach
    lam = unit**2 * rows.lam
    nodes = grid.nodes if n < len(A) else np.zeros(1)
    systems = systems_of(np.column_stack([A, both.y]), lam, nodes)
    of_both = np.full((len(t), len(log_g)), -np.inf)

    def look(at: Index, many: int) -> None:
        """Fill in the rows of some sizes, ever larger ones, as long as these are not hopeless."""
        for start in range(0, len(at), many):
            part = at[start : start + many]
            logarithms = np.log1p(t[part, None] ** 2 * lam).sum(axis=1)
            values = grid.values(systems.eliminated(t[part]), n, A.shape[1])
            of_both[part] = values - logarithms[:, None] / 2 - grid.known
            value = of_both.max(axis=1)
            if value[part[-1]] < value[: part[-1]].max(initial=-np.inf) - HOPELESS:
                break  # larger ones are less likely still

    every = np.arange(len(t))
    if A.shape[1] > WIDE:
        look(every[::STRIDE], STRIDE // 2)
        peak = int(of_both.max(axis=1).argmax())
        near = every[max(0, peak - STRIDE - 2 * reach) :]
        look(near[np.isneginf(of_both[near, 0])], STRIDE)
    else:
        look(every, AT_ONCE)
    return grid.profile(of_both)


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Sizes and scales of the noise that are tried."""

    t: Array
    """(k,) sizes in scaled noise; the first is zero."""
    log_g: Array
    """(g,) logarithms of the scale, about its most likely one."""
    nodes: Array
    """(3,) of these, where a system with a prior is solved."""
    between: Array
    """(g, 3) what makes values at the scales of those at the nodes, by parabolas."""
    known: Array
    """(g,) what minus the log-likelihood has from what is known of the scale."""

    @classmethod
    def of(cls, repeats: NoiseRepeats | None) -> "Grid":
        """By what repeats say of the scale of the noise, else known within `DOUBT`."""
        center, sd = (0.0, DOUBT) if repeats is None else (repeats.log_scale, repeats.log_scale_sd)
        reach = int(np.ceil(5 * sd / STEP))
        log_g = center + STEP * np.arange(-reach, reach + 1.0)
        t = SMALLEST * np.exp(STEP * np.arange(-reach, _count() + reach))
        known = (log_g - center) ** 2 / (2 * sd**2) if repeats is None else repeats.against(log_g)
        powers, wanted = (np.vander(x, len(NODES)) for x in (NODES * sd, log_g - center))
        between = np.asarray(np.linalg.solve(powers.T, wanted.T).T)
        return cls(np.concatenate([[0.0], t]), log_g, center + NODES * sd, between, known)

    @property
    def reach(self) -> int:
        """Scales on either side of the most likely one."""
        return len(self.log_g) // 2

    def values(self, found: tuple[Array, Array], n: int, p: int) -> Array:
        """Log-likelihood (k, g) by size and scale but for ln|1 + t^2 lam| and what is `known`.

        `found` are ln|H| and y'Py (nodes, k) of n rows and p numbers; one node: without a prior.
        """
        logarithm, square = found
        less = np.exp(-2 * self.log_g)
        if len(logarithm) == 1:
            left = square[0, :, None] * less
            return np.asarray(-(logarithm[0, :, None] + 2 * (n - p) * self.log_g + left) / 2)
        square = square * np.exp(2 * self.nodes[:, None])
        quadratic = (self.between @ square).T * less
        return np.asarray(-((self.between @ logarithm).T + 2 * n * self.log_g + quadratic) / 2)

    def profile(self, of_both: Array) -> Likelihood:
        """The likelihood of sizes, from that of sizes in scaled noise and scales (k, g).

        Minus infinity where nobody looked.
        """
        # no more is known of these
        of_both = np.where(np.isneginf(of_both), of_both.max() - 2 * HOPELESS, of_both)
        # size = t g: equal steps in both logarithms, so that every size meets every scale there is
        scales, count = np.arange(len(self.log_g)), _count()
        place = np.arange(count)[:, None] + len(self.log_g) - scales
        of_size = np.concatenate([of_both[:1], of_both[place, scales]])
        size = SMALLEST * np.exp(STEP * np.arange(count) + self.log_g[self.reach])
        return Likelihood(
            frozen(np.concatenate([[0.0], size])),
            frozen(of_size.max(axis=1)),
            frozen(np.exp(self.log_g[of_size.argmax(axis=1)])),
        )


def _count() -> int:
    """Sizes tried beside zero."""
    return int(np.log(LARGEST / SMALLEST) / STEP) + 1
