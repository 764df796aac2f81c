"""Simulation-based calibration: where does the true value lie among draws of what is stated?"""

import numpy as np
from scipy import stats

from calib.arrays import Array
from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.identification.joint_models import extended_model, extended_parameters
from calib.identification.prior import weak_prior
from tests.reference import pool_r, tx60
from tests.truth.measuring import measured

DRAWS = 99
"""So that a rank is one of 100 values."""
BINS = 10


def prior_ranks(replications: int, poses: int, seed: int, *shrunk: float) -> list[Array]:
    """Ranks (K, f) of truths drawn from the weak prior among draws from each posterior.

    First those of what the product states, then those with its standard uncertainties times each
    factor in `shrunk`.

    References
    ----------
    Talts et al. 2018 (arXiv 1804.06788): uniform on 0 to `DRAWS` if the posterior is right.
    """
    nominal = tx60()
    wide = extended_model(nominal)
    table = extended_parameters(nominal, wide, parameters_of(nominal))
    prior, pool = weak_prior(table, wide), pool_r()
    factors = (1.0, *shrunk)
    ranks = [np.zeros((replications, table.n_free), dtype=int) for _ in factors]
    for k in range(replications):
        rng = np.random.default_rng([seed, k])
        true = prior.sd * rng.standard_normal(table.n_free)
        q = pool[rng.choice(len(pool), poses, replace=False)]
        found = identify(wide, measured(wide.moved(true), q, rng), table, prior=prior)
        root = np.linalg.cholesky(found.covariance)
        errors = rng.standard_normal((DRAWS, table.n_free)) @ root.T
        for factor, below in zip(factors, ranks, strict=True):
            below[k] = (found.step + factor * errors < true).sum(axis=0)
    return ranks


def evenness(ranks: Array) -> Array:
    """Chi-square p-value (f,) of the ranks (K, f) of each number in ten equal bins."""
    counts = np.array([np.bincount(row * BINS // (DRAWS + 1), minlength=BINS) for row in ranks.T])
    return stats.chisquare(counts, axis=1).pvalue
