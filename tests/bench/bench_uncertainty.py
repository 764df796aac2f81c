"""Speed of the Monte Carlo propagation, beside the plain loop; run by hand.

``pytest tests/bench/bench_uncertainty.py --benchmark-only``, one thread. Aim: 10 000 draws at 51
poses within 0.5 s.
"""

import numpy as np
import pytest

from calib.uncertainty.monte_carlo import (
    distance_spread,
    independent_draws,
    point_spread,
    propagate,
)
from testbed.studies.wen2022 import paper
from tests.reference import pool_r, tx60

MODEL, Q = tx60(), pool_r(51)
STANDARD = np.zeros(MODEL.n_numbers)
STANDARD[[MODEL.names.index(name) for name in paper.PARAMETERS]] = paper.table3("u_best")


@pytest.mark.benchmark(group="tool points")
def test_propagate_10000_draws_51_poses(benchmark):
    steps = independent_draws(STANDARD, 10_000, np.random.default_rng(0))
    benchmark(propagate, MODEL, Q, steps)


@pytest.mark.benchmark(group="tool points")
def test_plain_loop_100_draws_51_poses(benchmark):
    steps = independent_draws(STANDARD, 100, np.random.default_rng(0))
    benchmark(lambda: [MODEL.moved(step).poses(Q) for step in steps])


@pytest.mark.benchmark(group="monte carlo")
def test_paper_form_10000_draws_51_poses(benchmark):
    benchmark(distance_spread, MODEL, Q, STANDARD, np.random.default_rng(0))


@pytest.mark.benchmark(group="monte carlo")
def test_correlated_form_10000_draws_51_poses(benchmark):
    benchmark(point_spread, MODEL, Q, np.diag(STANDARD**2), np.random.default_rng(0))
