"""Whether cycles follow their neighbors, and what limits then are: those of fewer cycles."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, frozen
from calib.errors import refuse
from calib.measurement.cycles import cycles_of
from calib.measurement.iso9283 import IsoFigure
from calib.measurement.iso_drift import DRAWS, orders_of

SURE = 0.01
"""Chance of cycles as alike as these in any order, below which they count as following each other:
one good test in a hundred."""
FEWEST = 10
"""Cycles below which nobody can tell."""
SETTLED = 60
"""Steps, each half of the way, after which a sum that allows for itself no longer moves."""
LARGEST = 0.98
"""Of what a cycle keeps: more of them would be one cycle."""


@dataclass(frozen=True, slots=True)
class CycleMemory:
    """How much of a deviation from the mean the next cycle keeps, and what that does to limits.

    References
    ----------
    var(mean) = (sigma^2 / n) V and E s^2 = sigma^2 (n - V) / (n - 1), V = 1 + 2 sum_k (1 - k/n) r_k
    with r_k = kept^k of AR(1). The degrees of freedom of s^2 follow from the same sum of kept^2.
    Bartlett 1946; the bias of the lag-one correlation, -(1 + 4 kept) / n: Kendall 1954.
    """

    kept: float
    """Share of a deviation, zero where chance explains what there is."""
    p_value: float
    """Chance of cycles so alike to their neighbors, in any order; nan of too few cycles."""
    cycles: int
    drawn_out: float = 1.0
    """V of the correlations at all lags: larger than that of AR(1) where a robot wanders slowly
    below noise that each reading has of its own."""

    @property
    def worth(self) -> float:
        """How many independent cycles tell the mean as well."""
        return self.cycles / self._inflation

    @property
    def shrunk(self) -> float:
        """Part of the variance that the scatter of these cycles shows."""
        return (self.cycles - self._inflation) / (self.cycles - 1)

    @property
    def freedom_of_mean(self) -> float:
        """Degrees of freedom of the uncertainty of a mean."""
        if not self.kept:
            return self.cycles - 1.0
        return max(min(self.freedom(self.cycles - 1), self.worth - 1), 1.0)

    def freedom(self, dof: int) -> float:
        """Degrees of freedom of a scatter that has `dof` where cycles are independent."""
        own = self.cycles / self._sum(self.kept**2) - 1
        return max(dof * own / (self.cycles - 1), 1.0)

    def of_mean(self, figure: IsoFigure, shared: ArrayLike = 0.0) -> IsoFigure:
        """A figure of barycenters with the uncertainty that these cycles leave.

        `shared` is the part of it that is the instrument's, which no order changes.
        """
        if not self.kept:
            return figure
        common = np.square(shared)
        own = np.maximum(figure.uncertainty**2 - common, 0.0)
        more = self.cycles / (self.worth * self.shrunk)
        u = np.sqrt(own * more + common)
        # as much wider as u: of what is shared across the figure that is too much
        wide = u / np.where(u > 0, figure.uncertainty, 1.0)
        return replace(
            figure, uncertainty=frozen(u), floor=frozen(figure.floor * np.sqrt(more)),
            around=None if figure.around is None else frozen(figure.around * wide),
            sideways=None if figure.sideways is None else frozen(figure.sideways * wide),
        )  # fmt: skip

    def of_scatter(self, figure: IsoFigure) -> IsoFigure:
        """A figure of scatter with the uncertainty that these cycles leave."""
        if not self.kept:
            return figure
        fewer = (self.cycles - 1) / (self.freedom(self.cycles - 1) * self.shrunk)
        return replace(figure, uncertainty=frozen(figure.uncertainty * np.sqrt(fewer)))

    @property
    def sentence(self) -> str:
        """The result in words; empty where the order tells nothing."""
        if not self.kept:
            return ""
        return (
            f"successive cycles are correlated (p = {self.p_value:.3f}, correlation "
            f"{self.kept:.2f}): the limits are wider, because {self.cycles} such cycles determine "
            f"the means only as well as about {self.worth:.2g} independent ones; pauses between "
            "cycles, or more of them, narrow the limits"
        )

    @property
    def _inflation(self) -> float:
        """V, the larger of both."""
        return max(self._sum(self.kept), self.drawn_out)

    def _sum(self, kept: float) -> float:
        """V of AR(1), at least one."""
        lag = np.arange(1, self.cycles)
        return 1.0 + 2.0 * float(((1 - lag / self.cycles) * kept**lag).sum())


def cycle_memory(position: ArrayLike) -> CycleMemory:
    """Ask whether cycles in the order of time are more like their neighbors than chance makes them.

    Parameters
    ----------
    position : (e, n, 3) array_like
        Attained positions of e poses [m].

    Notes
    -----
    Without memory any order of whole cycles is as likely as the measured one, as in
    `iso_drift.drift`. Every pose and axis counts alike.
    """
    x = cycles_of(position)
    if x.ndim != 3:
        raise refuse("position", x.shape, "(e, n, 3) positions", code="A3")
    n = x.shape[1]
    away = x - x.mean(axis=1, keepdims=True)
    size = np.sqrt((away**2).mean(axis=1, keepdims=True))
    away = np.where(size > 0, away / np.where(size > 0, size, 1.0), 0.0)
    square = float((away**2).sum())
    if n < FEWEST or not square:
        return CycleMemory(0.0, float("nan"), n)
    products = np.einsum("eki,eli->kl", away, away) / square
    orders = orders_of(n, DRAWS)
    alike = products[orders[:, 1:], orders[:, :-1]].sum(axis=1)
    p = float((alike >= alike[0] - 1e-12).mean())
    kept = float((alike[0] + 1 / n) / (1 - 4 / n))
    if p >= SURE or kept <= 0:
        return CycleMemory(0.0, p, n)
    lags = np.array([np.trace(products, k) for k in range(n)])
    return CycleMemory(min(kept, LARGEST), p, n, _sum_of_lags(lags))


def _sum_of_lags(correlation: Array) -> float:
    """V of sums of products (n,) at each lag, over that at lag zero.

    Pairs of lags count as long as they are positive, none more than the one before: the initial
    monotone sequence of Geyer 1992. Deviations from the mean of the cycles make each lag smaller by
    (1 - k/n) V/n, and half of the cycles is the most that so few can tell.
    """
    n, V = len(correlation), 1.0
    part = 1 - np.arange(n) / n
    for _ in range(SETTLED):
        lags = (correlation + part * V / n)[1 : n - 1 + n % 2]
        pairs = np.minimum.accumulate(lags[::2] + lags[1::2])
        V = (V + min(1 + 2 * float(pairs[pairs > 0].sum()), n / 2)) / 2
    return V


def wider(value: Array, memory: CycleMemory | None) -> Array:
    """A scatter as endlessly many cycles would show it, of those that there are."""
    return value if memory is None else np.asarray(value / np.sqrt(memory.shrunk))
