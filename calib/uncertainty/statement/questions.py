"""Tests together: several questions asked of the same readings, and one answer on them.

No test sees a misfit below the noise: what is not refuted is not proven. A single small p among
several is no surprise, and two that are each harmless may together be none.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.special import chdtrc

from calib.arrays import LATER

LEVEL = 0.01
"""Chance that any of the questions is answered wrongly where nothing is wrong."""
AGREES = 0.05
"""Combined p-value below which nobody writes that readings agree."""


@dataclass(frozen=True, slots=True)
class Questions:
    """What was asked, and the p-value of each answer."""

    names: tuple[str, ...]
    p_values: tuple[float, ...]
    combined: float
    """Of residuals and held-out errors together, without a model of the misfit."""
    untold: Annotated[tuple[str, ...], LATER] = ()
    """Names of those that something else answers as well, so that nothing is said of them."""

    @property
    def adjusted(self) -> tuple[float, ...]:
        """p-values that may be compared with one level for all.

        References
        ----------
        Holm 1979: the k-th smallest of n by n - k + 1, never falling.
        """
        p = np.array(self.p_values)
        order = np.argsort(p, kind="stable")
        adjusted = np.empty(len(p))
        grown = p[order] * np.arange(len(p), 0, -1)
        adjusted[order] = np.minimum(np.maximum.accumulate(grown), 1.0)
        return tuple(float(value) for value in adjusted)

    @property
    def said(self) -> tuple[str, ...]:
        """Names of the questions whose answer is no chance at `LEVEL`, and nothing else."""
        pairs = zip(self.names, self.adjusted, strict=True)
        return tuple(name for name, p in pairs if p < LEVEL and name not in self.untold)

    @property
    def agree(self) -> bool:
        """Whether nothing speaks against the stated noise alone: no proof that it is right."""
        return self.combined >= AGREES and min(self.p_values, default=1.0) >= LEVEL


def fisher(p_values: list[float]) -> float:
    """One p-value of independent ones.

    References
    ----------
    Fisher 1932: -2 sum ln p is chi-square with 2 n degrees of freedom.
    """
    if not p_values:
        return 1.0
    with np.errstate(divide="ignore"):
        square = -2 * float(np.log(p_values).sum())
    return float(chdtrc(2 * len(p_values), square))
