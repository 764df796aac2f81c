"""Random steps of the parameters: independent, or with their full covariance."""

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, check
from calib.errors import InputError
from calib.uncertainty.covariance import covariance_factor


def independent_draws(standard: ArrayLike, draws: int, rng: np.random.Generator) -> Array:
    """Steps (M, P): every number normal about zero with its own u (P,), no correlation [m, rad]."""
    (standard,) = check("k", standard=standard)
    if (standard < 0).any():
        raise InputError(
            f"standard[{int(np.argmin(standard))}] is negative",
            code="A3",
            field="standard",
            value=float(standard.min()),
            allowed="zero (fixed) or more",
        )
    moving = np.flatnonzero(standard)
    steps = np.zeros((_checked(draws), len(standard)))
    steps[:, moving] = rng.standard_normal((draws, len(moving))) * standard[moving]
    return steps


def correlated_draws(covariance: ArrayLike, draws: int, rng: np.random.Generator) -> Array:
    """Steps (M, P), normal about zero with the full covariance (P, P) [m, rad]."""
    L = covariance_factor(np.asarray(covariance, dtype=np.float64))
    moving = np.flatnonzero(L.any(axis=1))
    steps = np.zeros((_checked(draws), len(L)))
    steps[:, moving] = rng.standard_normal((draws, len(moving))) @ L[np.ix_(moving, moving)].T
    return steps


def _checked(draws: int) -> int:
    """At least two draws: a standard deviation needs them."""
    if draws < 2:
        raise InputError(
            f"draws is {draws}", code="A3", field="draws", value=draws, allowed="2 or more"
        )
    return draws
