"""How long one fit takes: 29 poses, reduction included (bar: 10 ms); run with --benchmark-only."""

import numpy as np
import pytest

from calib.geometry.parameters import parameters_of
from calib.identification.fit_each import fit_each
from calib.identification.identify import identify
from calib.identification.joint_models import extended_model
from calib.identification.prior import weak_prior
from calib.measurement.residual import linearize
from tests.reference import WEN24, pool_r, rigid_truth, tx60
from tests.truth.measuring import measured

TABLE = measured(rigid_truth(np.random.default_rng(1)), pool_r()[:29], np.random.default_rng(2))


@pytest.mark.parametrize(
    ("free", "mode"),
    [(WEN24, "whitened"), (None, "whitened"), (WEN24, "paper")],
    ids=["24", "42 reduced to 30", "paper 24"],
)
def test_one_fit_of_29_poses(benchmark, free, mode):
    parameters = parameters_of(tx60(), free)
    result = benchmark(identify, tx60(), TABLE, parameters, mode=mode)
    assert result.status.name == "CONVERGED"


def test_one_extended_fit_of_29_poses(benchmark):
    """69 numbers under a prior: more columns, the same steps."""
    wide = extended_model(tx60())
    parameters = parameters_of(wide)
    result = benchmark(identify, wide, TABLE, parameters, prior=weak_prior(parameters, wide))
    assert result.status.name == "CONVERGED"


@pytest.mark.parametrize("loss", ["huber", "cauchy"])
def test_one_robust_fit_of_29_poses(benchmark, loss):
    result = benchmark(identify, tx60(), TABLE, parameters_of(tx60()), loss=loss)
    assert result.status.name == "CONVERGED"


def test_one_residual_and_jacobian_of_29_poses(benchmark):
    benchmark(linearize, tx60(), TABLE)


SETS = [
    measured(
        rigid_truth(np.random.default_rng(k)),
        pool_r()[np.random.default_rng(k).choice(1000, 61, replace=False)],
        np.random.default_rng(k),
    )
    for k in range(20)
]
"""Tables of 61 poses of their own each, of as many robots."""


@pytest.mark.benchmark(group="20 sets of 61 poses")
@pytest.mark.parametrize("mode", ["paper", "whitened"])
def test_many_sets_fitted_each(benchmark, mode):
    """About half the time of one `identify` after the other: no reduction, no statistics."""
    fits = benchmark(fit_each, tx60(), SETS, parameters_of(tx60(), WEN24), mode=mode)
    assert fits.converged.all()


@pytest.mark.benchmark(group="20 sets of 61 poses")
@pytest.mark.parametrize("mode", ["paper", "whitened"])
def test_many_sets_identified_one_by_one(benchmark, mode):
    parameters = parameters_of(tx60(), WEN24)
    benchmark(lambda: [identify(tx60(), table, parameters, mode=mode) for table in SETS])
