"""The compiled loops beside plain forms; run by hand with --benchmark-only.

Bar: 1e5 virtual calibrations (noise, identification, covariance) within 1 s on one thread.
Limits: 900 flop and 96 bytes per pose of a gradient. Naive forms are smaller: scale them by the
draws in their names.
"""

import numpy as np
import pytest

from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.measurement import tables
from calib.uncertainty.bootstrap import bootstrap
from calib.uncertainty.monte_carlo import point_spread
from calib.uncertainty.tool_point import propagate
from tests.calib.uncertainty.test_monte_carlo import calibration_covariance
from tests.reference import SIGMA_POSITION, SIGMA_ROTATION, WEN24, pool_r, tx60
from tests.truth.measuring import measured

C, Q, MODEL = calibration_covariance(), pool_r(50), tx60()
PLAN = tables.poses(pool_r()[:29], MODEL.poses(pool_r()[:29]), sd=(SIGMA_POSITION, SIGMA_ROTATION))
PARAMETERS = parameters_of(MODEL, WEN24)


@pytest.mark.benchmark(group="propagation")
def test_numpy_20000_draws_of_50_poses(benchmark):
    steps = np.random.default_rng(0).multivariate_normal(np.zeros(42), C, 20_000)

    def moments():
        e = propagate(MODEL, Q, steps) - MODEL.poses(Q)[:, :3, 3]
        return e.mean(axis=0), np.einsum("mni,mnj->nij", e, e)

    benchmark(moments)


@pytest.mark.benchmark(group="propagation")
def test_plain_loop_100_draws_of_50_poses(benchmark):
    steps = np.random.default_rng(0).multivariate_normal(np.zeros(42), C, 100)
    benchmark(lambda: [MODEL.moved(step).poses(Q) for step in steps])


@pytest.mark.benchmark(group="propagation")
def test_compiled_1e6_draws_of_50_poses(benchmark):
    """Draws and moments included: at most 1.0 s."""
    rounds = {"rounds": 5, "warmup_rounds": 1, "iterations": 1}
    benchmark.pedantic(
        lambda: point_spread(MODEL, Q, C, np.random.default_rng(0), draws=1_000_000), **rounds
    )


@pytest.mark.benchmark(group="end to end")
@pytest.mark.parametrize("threads", [1, 2])
def test_a_hundred_thousand_virtual_calibrations(benchmark, threads):
    def run():
        made = bootstrap(
            MODEL, PLAN, PARAMETERS, np.random.default_rng(0), replicates=100_000, threads=threads
        )
        return made.empirical

    benchmark.pedantic(run, rounds=5, warmup_rounds=1)


@pytest.mark.benchmark(group="end to end")
def test_plain_loop_20_virtual_calibrations(benchmark):
    def run():
        rng = np.random.default_rng(0)
        return [
            identify(MODEL, measured(MODEL, PLAN.q, rng), PARAMETERS).covariance for _ in range(20)
        ]

    benchmark.pedantic(run, rounds=5, warmup_rounds=1)
