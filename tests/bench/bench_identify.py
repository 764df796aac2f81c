"""How long one fit takes: 29 poses, reduction included (bar: 4 ms); run with --benchmark-only."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.joint_errors import JointErrors, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters, parameters_of
from calib.identification.fit_each import fit_each
from calib.identification.identify import identify
from calib.identification.joint_models import extended_model
from calib.identification.prior import PriorRows, prior_rows, weak_prior
from calib.identification.start.start import start_frames
from calib.identification.tangent import System, column_norms, normal_plane
from calib.measurement.observations import Measurements
from calib.measurement.residual import linearize, table_whiteners
from calib.measurement.term_rows import TermRows
from tests.calib import kinds
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


@pytest.mark.parametrize("kind", ["poses", "one point"])
def test_frames_of_2700_poses_from_nothing(benchmark, kind):
    """Less than a third of a second."""
    rng = np.random.default_rng(12)
    _, nominal, table, _ = kinds.measured(kind, "ur10", kinds.joints("ur10", rng, 2700), rng)
    benchmark(start_frames, nominal, table)


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


def mapped(poses: int) -> tuple[RobotModel, Measurements, Parameters, PriorRows]:
    """An arm with waves 1 to 32 of every joint, a table, and its numbers with what is believed."""
    model = replace(tx60(), joint_errors=JointErrors(harmonic_terms(6, tuple(range(1, 33)))))
    table = measured(
        rigid_truth(np.random.default_rng(1)), pool_r()[:poses], np.random.default_rng(2)
    )
    free = parameters_of(model)
    return model, table, free, prior_rows(weak_prior(free, model), model, free)


@pytest.mark.benchmark(group="one step of 426 numbers from 400 poses")
@pytest.mark.parametrize("way", ["columns and singular values", "columns", "joints"])
def test_a_step_of_a_joint_map(benchmark, way):
    """Naive first; a triangle costs a sixth of it, the products of joints a seventeenth."""
    model, table, free, believed = mapped(400)
    rows = TermRows.of(model, table, table_whiteners(table), free)
    columns = np.arange(free.n_free)

    def step():
        own = believed.beside(model, columns)
        if way == "joints":
            r, A, _ = rows.at(model)
            return normal_plane(System(r, rows.by_joint(A), own)).step(np.inf)[0]
        stack = linearize(model, table)
        system = System(stack.r, stack.A, own)
        if way == "columns":
            return normal_plane(system).step(np.inf)[0]
        r, A = system.whole
        scale = column_norms(A)
        U, s, Vt = np.linalg.svd(A / scale, full_matrices=False)
        return Vt.T @ (U.T @ r / s) / scale

    assert np.isfinite(benchmark(step)).all()
