"""End-to-end bootstrap and batched fits: against single fits, the stated covariance, and theory."""

import numpy as np
import pytest
from scipy import stats

from calib.errors import InputError
from calib.geometry.joint_errors import JointErrors, gravity_terms, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.measurement import tables
from calib.uncertainty.bootstrap import Bootstrap, bootstrap
from calib.uncertainty.parallel import in_batches
from calib.uncertainty.refit import SETTLED, freeze, refit
from tests.reference import DEG, READABLE30, WEN24, pool_r, rigid_truth, tx60
from tests.truth.measuring import measured

Q = pool_r()[:29]


def identified(free=WEN24, seed=1):
    truth = rigid_truth(np.random.default_rng(seed))
    table = measured(truth, Q, np.random.default_rng(seed + 1))
    return table, identify(tx60(), table, parameters_of(tx60(), free))


@pytest.mark.parametrize("free", [WEN24, READABLE30], ids=["24", "30 with base and tool"])
def test_batched_fits_equal_single_ones(free):
    table, fit = identified(free)
    others = [measured(fit.model, Q, np.random.default_rng(100 + k)) for k in range(10)]
    start = freeze(fit.model, table, fit.parameters)
    many = refit(
        start,
        np.stack([other.position for other in others]),
        np.stack([other.rotation for other in others]),
    )
    assert many.converged.all()
    for k, other in enumerate(others):
        one = identify(fit.model, other, fit.parameters)
        gap = np.abs(many.steps[k] - one.step) / one.standard_uncertainty
        assert gap.max() < 1e-6  # the bar; two steps leave 5e-8
        assert many.chi_square[k] == pytest.approx(one.chi_square, rel=1e-9)


def test_fits_from_the_nominal_robot_need_some_more_steps():
    table, fit = identified(READABLE30)
    start = freeze(tx60(), table, fit.parameters)
    gaps = []
    for steps in (1, 2, 4):
        one = refit(start, table.position[None], table.rotation[None], steps=steps)
        gaps.append(np.abs((one.steps[0] - fit.step) / fit.standard_uncertainty).max())
        assert bool(one.converged[0]) is (steps == 4)
    # each step leaves about a thousandth: the nonlinearity of the error of the nominal robot
    assert gaps[1] < 0.01 * gaps[0]
    assert gaps[2] < 1e-6


def test_the_bootstrap_scatters_as_the_covariance_says():
    table, fit = identified()
    result = bootstrap(fit.model, table, fit.parameters, np.random.default_rng(0), replicates=4000)
    N = result.replicates
    assert N == 4000
    assert result.unconverged == 0
    assert np.abs(result.ratio - 1).max() <= 4 / np.sqrt(2 * N)
    assert np.abs(result.bias).max() <= 4 / np.sqrt(N)
    assert result.agrees
    # the curvature at zero residual against the one with the residual of this fit
    assert result.covariance == pytest.approx(fit.covariance, rel=1e-5, abs=1e-20)
    squares = np.einsum(
        "nf,nf->n", result.estimates, np.linalg.solve(fit.covariance, result.estimates.T).T
    )
    assert stats.kstest(squares, stats.chi2(24).cdf).pvalue > 1e-3
    assert stats.kstest(result.chi_square, stats.chi2(result.dof).cdf).pvalue > 1e-3
    # chi-square and estimate are independent in a sound fit
    assert abs(np.corrcoef(squares, result.chi_square)[0, 1]) < 4 / np.sqrt(N)


def test_bits_do_not_depend_on_threads_and_a_new_call_draws_anew():
    table, fit = identified()
    args = (fit.model, table, fit.parameters)
    runs = [
        bootstrap(*args, np.random.default_rng(5), replicates=1100, threads=threads)
        for threads in (1, 2, 3)
    ]
    for run in runs[1:]:
        assert np.array_equal(run.estimates, runs[0].estimates)
        assert np.array_equal(run.chi_square, runs[0].chi_square)
    assert len(runs[0].estimates) == 1100
    rng = np.random.default_rng(5)
    first, second = (bootstrap(*args, rng, replicates=100) for _ in range(2))
    assert not np.array_equal(first.estimates, second.estimates)
    assert np.array_equal(first.estimates, runs[0].estimates[:100])  # same first chunk stream


@pytest.mark.parametrize("threads", [1, 3])
def test_what_one_chunk_draws_never_moves_another(threads):
    def work(stream, count):
        stream.standard_normal(7 * count)
        return count, stream.standard_normal()

    got = in_batches(work, np.random.default_rng(2), 25, size=10, threads=threads)
    assert [count for count, _ in got] == [10, 10, 5]
    for (count, value), stream in zip(got, np.random.default_rng(2).spawn(3), strict=True):
        assert value == stream.standard_normal(7 * count + 1)[-1]


def test_no_two_replicates_are_alike():
    table, fit = identified()
    run = bootstrap(fit.model, table, fit.parameters, np.random.default_rng(5), replicates=1100)
    assert len(np.unique(run.estimates[:, 0])) == 1100


def test_joint_terms_under_a_prior_scatter_as_data_and_prior_together_say():
    terms = (*gravity_terms(6), *harmonic_terms(6))
    model = RobotModel(tx60().chain, JointErrors(terms, np.full(len(terms), 2e-3 * DEG)))
    free = [*WEN24, *model.joint_errors.names]
    parameters = parameters_of(model, free)
    table = tables.poses(Q, model.poses(Q), sd=(17.5e-6, 0.011 * DEG))
    sd = np.array([0.6e-3 if length else 0.1 * DEG for length in np.array(model.is_length)])
    sd[-27:] = 0.02 * DEG
    prior = np.diag(1 / sd[parameters.free_index] ** 2)
    run = bootstrap(
        model, table, parameters, np.random.default_rng(1), replicates=3000, prior_precision=prior
    )
    assert run.agrees, run.sentence
    # many of the 51 numbers are known from the prior alone: without its scatter they would not move
    assert (np.sqrt(np.diag(run.covariance))[-27:] > 0.1 * 0.02 * DEG).any()


def test_a_covariance_twice_too_small_is_noticed():
    table, fit = identified()
    run = bootstrap(fit.model, table, fit.parameters, np.random.default_rng(0), replicates=500)
    tight = Bootstrap(run.names, run.estimates, run.chi_square, run.covariance / 4, run.dof, 0)
    assert not tight.agrees
    assert "do not scatter" in tight.sentence
    stuck = Bootstrap(run.names, run.estimates, run.chi_square, run.covariance, run.dof, 6)
    assert not stuck.agrees
    assert stuck.sentence.startswith("6 of 500")
    # a few do not decide: they are counted in the scatter all the same
    few = Bootstrap(run.names, run.estimates, run.chi_square, run.covariance, run.dof, 5)
    assert few.agrees
    assert few.sentence.endswith("; 5 of them did not converge")


def test_fits_that_two_steps_leave_unsettled_take_more():
    """Poses much alike: a number is known to a quarter of a degree, and propagation is linear."""
    q = Q[0] + 0.25 * np.random.default_rng(3).uniform(-1, 1, (60, 6))
    table = tables.poses(q, tx60().poses(q), sd=(3e-4, 3e-3))
    free = parameters_of(tx60(), WEN24)
    one, two, more = (
        bootstrap(tx60(), table, free, np.random.default_rng(0), replicates=200, steps=steps)
        for steps in (1, 2, 20)
    )
    for run in (one, two):  # one step does not do, not even four: these are fitted one by one
        assert run.unconverged == 0
        assert run.agrees
        gap = np.abs(run.estimates - more.estimates) / np.sqrt(np.diagonal(run.covariance))
        assert gap.max() < SETTLED  # what the last step of a fit may still be long


def hardly_told():
    """A point beside the last axis: its readings hardly tell what joint 5 does, or how far it is.

    Over what is uncertain of these the curvature changes, and the one at the model leads nowhere.
    """
    rng = np.random.default_rng(5)
    q, arm = rng.uniform(-1.5, 1.5, (40, 6)), tx60()
    arm = arm.moved(rng.normal(scale=2e-4, size=arm.n_numbers))  # else nothing tells it at all
    table = tables.points(q, arm.poses(q)[:, :3, 3], sd=1e-5)
    fit = identify(arm, table, parameters_of(arm))
    assert fit.reduction.condition > 1e3
    return table, fit


def test_fits_that_run_away_end_at_numbers_and_are_no_answers():
    """Each step is longer than the last one, until nothing can hold it; nobody is warned."""
    table, fit = hardly_told()
    start = freeze(fit.model, table, fit.parameters)
    rng = np.random.default_rng(0)
    noisy = table.position + rng.normal(scale=1e-5, size=(20, *table.position.shape))
    many = refit(start, noisy, np.tile(np.eye(3), (20, 40, 1, 1)), steps=20)
    assert not many.converged.all()
    assert np.isfinite(many.steps).all()
    assert np.isfinite(many.chi_square).all()


@pytest.mark.slow
def test_fits_that_do_not_settle_are_fitted_one_by_one():
    """Where the loops had left it, no statement was believed: "linear propagation does not hold".

    It does for all numbers but the one that is bent, and there the virtual calibrations tell.
    """
    table, fit = hardly_told()
    run = bootstrap(fit.model, table, fit.parameters, np.random.default_rng(1), replicates=100)
    assert run.unconverged == 0
    ratio, sampled = run.ratio, 4 / np.sqrt(2 * 100)
    straight = np.array([name != "tool.z" for name in run.names])
    assert np.abs(ratio[straight] - 1).max() < sampled
    assert ratio[~straight] > 1 + sampled
    assert not run.agrees
    assert "tool.z by a factor" in run.sentence
    # chi-square of 100 exact fits: mean and 4 sd of the mean
    assert abs(run.chi_square.mean() - run.dof) < 4 * np.sqrt(2 * run.dof / 100)


def test_zero_noise_is_refused():
    table = tables.poses(Q, tx60().poses(Q), sd=np.zeros((29, 6, 6)))
    with pytest.raises(InputError, match="not positive definite"):
        bootstrap(tx60(), table, parameters_of(tx60(), WEN24), np.random.default_rng(0))


def test_bad_requests_are_refused():
    table, fit = identified()
    args = (fit.model, table, fit.parameters, np.random.default_rng(0))
    with pytest.raises(InputError, match="replicates is 99"):
        bootstrap(*args, replicates=99)
    with pytest.raises(InputError, match="threads is 0"):
        bootstrap(*args, threads=0)
    with pytest.raises(InputError, match="eigenvalue"):
        bootstrap(*args, prior_precision=-np.eye(24))
    with pytest.raises(InputError, match="rank 30"):
        bootstrap(fit.model, table, parameters_of(tx60()), np.random.default_rng(0))


@pytest.mark.parametrize(("ratio", "agrees"), [(0.81, True), (1.19, True), (1.21, False)])
def test_a_scatter_agrees_within_four_standard_errors(ratio, agrees):
    """Of 200 replicates a standard deviation is known to 5 %."""
    z = np.random.default_rng(0).normal(size=(200, 1))
    z = (z - z.mean()) / z.std(ddof=1)
    found = Bootstrap(("a",), ratio * z, np.ones(200), np.eye(1), 10, 0)
    assert found.agrees is agrees
