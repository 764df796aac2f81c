"""Whether cycles lie further out than normal scatter, which the limits of RP take: one, or many."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import betaincc

from calib.arrays import Array, Bool
from calib.errors import refuse
from calib.measurement.cycles import cycles_of

SURE = 0.001
"""Chance, all cycles together, of one that strays so far, below which it is named."""
DRAWS = 4000
"""Normal samples that tell how large a kurtosis chance makes."""
MOST = 100
"""Cycles of a sample, and samples, beyond which the mean of their kurtosis spreads no wider."""
FEWEST = 8
"""Cycles below which one of them spans what is called scatter."""
FLAT = 1e-13
"""Least over largest square sum of deviations below which a direction has none but rounding: a shot
that missed by 10 m among cycles that scatter by 10 um is above it."""


@dataclass(frozen=True, slots=True)
class StrayingCycle:
    """The cycle that lies furthest out for the scatter of its pose."""

    pose: int
    cycle: int
    p_value: float
    """Chance of one so far out among all cycles, if their scatter is normal; nan where nothing
    tells."""

    @property
    def strays(self) -> bool:
        """Whether chance alone would hardly do that."""
        return self.p_value < SURE


def straying_cycle(position: ArrayLike) -> StrayingCycle:
    """The cycle furthest out, of e poses visited n times each (e, n, 3) [m].

    References
    ----------
    n d^2 / (n - 1)^2 of a normal sample is Beta(3/2, (n - 4)/2), d^2 = (x - m)' inv(S) (x - m) with
    its own mean and covariance: Gnanadesikan and Kettenring 1972. Bonferroni over all cycles.
    """
    white, whole = _white(position)
    n = white.shape[1]
    if not whole.any():
        return StrayingCycle(0, 0, float("nan"))
    share = np.clip(n * np.square(white).sum(axis=2) / (n - 1), 0.0, 1.0)
    e, k = np.unravel_index(int(share.argmax()), share.shape)
    each = float(betaincc(1.5, (n - 4) / 2, share[e, k]))
    return StrayingCycle(int(e), int(k), min(1.0, each * n * int(whole.sum())))


@dataclass(frozen=True, slots=True)
class CycleTails:
    """How much of the scatter is that of few cycles far out, all poses together."""

    kurtosis: float
    """Mean fourth power of distances, over that of normal scatter; nan where nothing tells."""
    p_value: float
    """Chance of so large a one, if the scatter is normal."""

    @property
    def long(self) -> bool:
        """Whether normal scatter would hardly do that."""
        return self.p_value < SURE


def long_tails(position: ArrayLike) -> CycleTails:
    """Whether e poses visited n times each (e, n, 3) [m] scatter with longer tails than normal.

    References
    ----------
    The kurtosis of Mardia 1974, with its exact mean and variance; the shape of its distribution by
    simulation. Poses that scatter together, cycle by cycle, count as fewer.
    """
    white, whole = _white(position)
    n = white.shape[1]
    if not whole.any():
        return CycleTails(float("nan"), float("nan"))
    white = white[whole]
    e = len(white)
    # mean square correlation of two poses, less what chance gives it
    products = np.einsum("eki,eli->kl", white, white)
    other = (np.square(products).sum() - 3 * e) / (3 * e * max(e - 1, 1)) - 3 / (n - 1)
    apart = int(np.clip(e / (1 + (e - 1) * max(float(other), 0.0)), 1, MOST))
    found = float(_kurtosis(white).mean())
    normal = _normal_kurtosis(min(n, MOST))
    pick = np.random.default_rng(9283).integers(0, DRAWS, (DRAWS, apart))
    p = (1 + int((normal[pick].mean(axis=1) >= found).sum())) / (DRAWS + 1)
    mean, sd = _moments(n)
    return CycleTails((mean + sd * found) / mean, p)


def _white(position: ArrayLike) -> tuple[Array, Bool]:
    """Deviations (e, n, 3) from the mean, equal in all directions with squares that sum to one.

    Zero of poses that do not scatter in all directions, or of too few cycles; (e,) the others.
    """
    x = cycles_of(position)
    if x.ndim != 3:
        raise refuse("position", x.shape, "(e, n, 3) positions", code="A3")
    away = x - x.mean(axis=1, keepdims=True)
    values, vectors = np.linalg.eigh(np.swapaxes(away, 1, 2) @ away)
    whole = (values[:, 0] > FLAT * values[:, 2]) & (x.shape[1] >= FEWEST)
    root = np.sqrt(np.where(whole[:, None], values, 1.0))[:, None]
    return np.where(whole[:, None, None], away @ vectors / root, 0.0), whole


def _kurtosis(white: Array) -> Array:
    """Kurtosis (e,) less its mean if scatter is normal, over its standard deviation then."""
    n = white.shape[1]
    mean, sd = _moments(n)
    fourth = n * np.square(np.square(white).sum(axis=2)).sum(axis=1)
    return np.asarray((fourth - mean) / sd)


def _moments(n: int) -> tuple[float, float]:
    """Mean and standard deviation of the kurtosis of n normal points."""
    variance = 120 * (n - 3) * (n - 4) * (n - 2) / ((n + 1) ** 2 * (n + 3) * (n + 5))
    return 15 * (n - 1) / (n + 1), float(np.sqrt(variance))


@lru_cache(maxsize=2)
def _normal_kurtosis(n: int) -> Array:
    """The kurtosis (k,) of samples of n normal points, as `_kurtosis` gives it."""
    x = np.random.default_rng(9283).standard_normal((DRAWS, n, 3))
    return _kurtosis(_white(x)[0])
