"""Type B inputs and the budget by source: against the full formula, simulation and arithmetic."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.parameters import parameters_of
from calib.measurement import tables
from calib.measurement.noise import with_joint_noise
from calib.measurement.tables import covariances_of_sd
from calib.uncertainty.budget import Contribution, RowNoise, budget, effective_dof
from calib.uncertainty.refit import freeze, refit
from calib.uncertainty.type_b import CommonInput, common_inputs, estimator_maps, type_b_covariance
from tests.reference import READABLE30, SIGMA_POSITION, SIGMA_ROTATION, TOOL6, WEN24, pool_r, tx60

SIGMA_Q = np.full(6, 14.5e-6)


def plan(m=29):
    """Plan whose covariance is tracker noise plus joint repeatability, and the two parts."""
    q = pool_r()[:m]
    tracker = covariances_of_sd((SIGMA_POSITION, SIGMA_ROTATION), 6, m)
    both = with_joint_noise(tx60(), q, tracker, SIGMA_Q)
    table = tables.poses(q, tx60().poses(q), sd=both)
    noise = (RowNoise("tracker noise", tracker), RowNoise("joints", both - tracker, 9))
    return table, noise


def target_offset(table, sd=2.5e-6):
    """The target is not where it should be on the tool: one column per tool axis."""
    B = np.zeros((len(table), 6, 3))
    B[:, :3] = table.rotation
    return CommonInput("target offset", B, np.eye(3) * sd**2)


def test_noise_parts_sum_to_the_covariance_of_the_fit():
    table, noise = plan()
    start = freeze(tx60(), table, parameters_of(tx60(), WEN24))
    whole = budget(start, noise)
    assert whole.names == ("tracker noise", "joints")
    u = np.sqrt(np.diag(start.covariance))
    assert np.abs((whole.covariance - start.covariance) / np.outer(u, u)).max() < 1e-9
    assert whole.combined == pytest.approx(u, rel=1e-9)
    assert np.square(whole.standard).sum(axis=0) == pytest.approx(u**2, rel=1e-9)


def test_with_a_prior_the_parts_sum_to_the_posterior():
    table, noise = plan(6)
    prior = np.diag(np.full(24, 1e7))
    start = freeze(tx60(), table, parameters_of(tx60(), WEN24), prior_precision=prior)
    whole = budget(start, noise)
    assert whole.names[-1] == "prior"
    assert whole.combined == pytest.approx(np.sqrt(np.diag(start.covariance)), rel=1e-9)


def test_a_common_input_moves_the_estimate_as_its_sensitivity_says():
    """Shift every target by one offset, fit again with the compiled loop: F B b."""
    table, _ = plan()
    start = freeze(tx60(), table, parameters_of(tx60(), WEN24))
    own, b = target_offset(table), np.array([2e-6, -1e-6, 3e-6])
    shifted = table.position + np.einsum("mij,j->mi", own.sensitivity[:, :3], b)
    fit = refit(start, shifted[None], table.rotation[None], steps=3)
    expected = np.einsum("mfr,mrk,k->f", estimator_maps(start), own.sensitivity, b)
    u = np.sqrt(np.diag(start.covariance))
    assert np.abs((fit.steps[0] - expected) / u).max() < 1e-3  # first order in 3 um
    assert np.abs(expected / u).max() > 0.05


def test_a_target_offset_is_exactly_a_step_of_the_tool_and_more_poses_do_not_shrink_it():
    for m in (25, 100):
        table, noise = plan(m)
        start = freeze(tx60(), table, parameters_of(tx60(), READABLE30))
        made = budget(start, noise, common=[target_offset(table)])
        expected = np.where([name in TOOL6[:3] for name in READABLE30], 2.5e-6, 0.0)
        assert made.standard[2] == pytest.approx(expected, abs=1e-15)
        if m == 25:
            few = made
    ratio = few.standard[0] / made.standard[0]
    assert np.median(ratio) == pytest.approx(2.0, rel=0.2)  # sqrt(4); the poses differ


def test_type_b_covariance_equals_drawing_the_inputs():
    table, _ = plan()
    start = freeze(tx60(), table, parameters_of(tx60(), WEN24))
    scale = np.zeros((29, 6, 1))
    scale[:, :3, 0] = table.position
    B = np.concatenate([target_offset(table).sensitivity, scale], axis=2)
    inputs = common_inputs(["target offset"] * 3 + ["scale"], B, [4e-12, 4e-12, 4e-12, 1e-12])
    assert [own.name for own in inputs] == ["target offset", "scale"]
    C = type_b_covariance(start, inputs)
    rng, N = np.random.default_rng(0), 4000
    b = rng.standard_normal((N, 4)) * [2e-6, 2e-6, 2e-6, 1e-6]
    draws = np.einsum("mfr,mrk,nk->nf", estimator_maps(start), B, b)
    ratio = draws.std(axis=0, ddof=1) / np.sqrt(np.diag(C))
    assert np.abs(ratio - 1).max() < 4 / np.sqrt(2 * N)
    assert budget(start, (), common=inputs).covariance == pytest.approx(C, rel=1e-9)


def test_the_budget_at_the_tool_adds_up_and_agrees_with_drawing():
    table, noise = plan()
    start = freeze(tx60(), table, parameters_of(tx60(), WEN24))
    whole = budget(start, noise, common=[target_offset(table)])
    q = pool_r(5, seed=99)
    tool = whole.at_tool(tx60(), q)
    assert tool.share.sum(axis=0) == pytest.approx(np.ones(5), rel=1e-12)
    L = np.linalg.cholesky(whole.covariance)
    rng, N = np.random.default_rng(1), 4000
    J = tx60().poses_and_jacobian(q)[1][:, :3][:, :, whole.parameters.free_index]
    drawn = np.einsum("nip,mp->mni", J, rng.standard_normal((N, 24)) @ L.T)
    u = np.sqrt(drawn.var(axis=0, ddof=1).sum(axis=1))
    assert tool.combined == pytest.approx(u, rel=4 / np.sqrt(2 * N))


def test_effective_degrees_of_freedom_by_hand():
    # (9 + 16)^2 / (81 / 3 + 256 / 8) = 625 / 59
    assert effective_dof([3, 4], [3, 8]) == pytest.approx(625 / 59)
    assert effective_dof([3, 4], [np.inf, np.inf]) == np.inf
    assert effective_dof([0, 4], [3, np.inf]) == np.inf
    table, noise = plan()
    start = freeze(tx60(), table, parameters_of(tx60(), WEN24))
    whole = budget(start, noise)
    own = whole.standard
    assert whole.degrees_of_freedom == pytest.approx(
        whole.combined**4 / (own[1] ** 4 / 9), rel=1e-9
    )
    assert (whole.expanded() > 1.95 * whole.combined).all()
    repeated = replace(whole, sources=(Contribution("repeats", whole.covariance, 9.0),))
    # Student table
    assert repeated.expanded() == pytest.approx(2.262157 * whole.combined, rel=1e-6)


def test_bad_sources_are_refused():
    table, noise = plan(8)
    start = freeze(tx60(), table, parameters_of(tx60(), WEN24))
    with pytest.raises(InputError, match="no source"):
        budget(start, ())
    with pytest.raises(InputError, match='"short" has 7 rows'):
        budget(start, noise, common=[CommonInput("short", np.ones((7, 6, 1)), [[1e-12]])])
    with pytest.raises(InputError, match="eigenvalue"):
        CommonInput("odd", np.ones((8, 6, 2)), [[1.0, 2.0], [2.0, 1.0]])
    with pytest.raises(InputError, match="degrees of freedom"):
        CommonInput("odd", np.ones((8, 6, 1)), [[1.0]], 0)
    with pytest.raises(InputError, match="none negative"):
        common_inputs(["a"], np.ones((8, 6, 1)), [-1.0])
    with pytest.raises(InputError, match="eigenvalue"):
        budget(start, [RowNoise("bad", np.broadcast_to(-np.eye(6), (8, 6, 6)))])
    with pytest.raises(InputError, match="above zero"):
        effective_dof([1, 2], [3, 0])
