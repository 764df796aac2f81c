"""Whether single cycles stray further than normal scatter does, which the limits of RP take."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import betaincc

from calib.errors import refuse
from calib.measurement.cycles import cycles_of

SURE = 0.001
"""Chance, all cycles together, of one that strays so far, below which it is named."""
FEWEST = 8
"""Cycles below which one of them spans what is called scatter."""


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
    x = cycles_of(position)
    if x.ndim != 3:
        raise refuse("position", x.shape, "(e, n, 3) positions", code="A3")
    n = x.shape[1]
    away = x - x.mean(axis=1, keepdims=True)
    S = np.swapaxes(away, 1, 2) @ away / (n - 1)
    values = np.linalg.eigvalsh(S)
    whole = values[:, 0] > 1e-9 * values[:, 2]
    if n < FEWEST or not whole.any():
        return StrayingCycle(0, 0, float("nan"))
    S = np.where(whole[:, None, None], S, np.eye(3))
    white = np.linalg.solve(S, np.swapaxes(away, 1, 2))
    square = np.where(whole[:, None], (np.swapaxes(away, 1, 2) * white).sum(axis=1), 0.0)
    share = np.clip(n * square / (n - 1) ** 2, 0.0, 1.0)
    e, k = np.unravel_index(int(share.argmax()), share.shape)
    each = float(betaincc(1.5, (n - 4) / 2, share[e, k]))
    return StrayingCycle(int(e), int(k), min(1.0, each * n * int(whole.sum())))
