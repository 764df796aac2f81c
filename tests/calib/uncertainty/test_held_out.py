"""Held-out poses, discrepancy and the conformal radius: attained content, arithmetic, refusals."""

import numpy as np
import pytest
from scipy import stats

from calib.errors import InputError
from calib.geometry.parameters import parameters_of
from calib.held_out_counts import fewest_poses
from calib.identification.identify import identify
from calib.uncertainty.conformal import conformal
from calib.uncertainty.discrepancy import discrepancy
from calib.uncertainty.held_out import HeldOut, held_out
from tests.reference import WEN24, pool_r, rigid_truth, tx60
from tests.truth.measuring import measured

G = pool_r(60, seed=99)


def fitted(seed=1, m=29):
    rng = np.random.default_rng(seed)
    truth = rigid_truth(rng)
    fit = identify(tx60(), measured(truth, pool_r()[:m], rng), parameters_of(tx60(), WEN24))
    return truth, fit, rng


def test_the_chi_square_of_held_out_errors_counts_their_shared_parameter_error():
    truth, fit, rng = fitted()
    table = measured(truth, G, rng)
    found = held_out(fit.model, fit.full_covariance, table, pool_r()[:29])
    J = fit.model.poses_and_jacobian(G)[1][:, :3].reshape(180, -1)
    V = J @ fit.full_covariance @ J.T + np.eye(180) * table.covariance[0, 0, 0]
    e = found.error.ravel()
    assert found.chi_square == pytest.approx(e @ np.linalg.solve(V, e), rel=1e-6)
    assert found.p_value == pytest.approx(stats.chi2(180).sf(found.chi_square), rel=1e-9)
    assert found.error == pytest.approx(table.position - fit.model.poses(G)[:, :3, 3], abs=1e-15)
    assert found.distance == pytest.approx(np.sqrt((found.error**2).sum(axis=1)))


@pytest.mark.slow
def test_held_out_p_values_are_uniform_for_a_sound_model():
    p = []
    for seed in range(60):
        truth, fit, rng = fitted(seed)
        table = measured(truth, G[:20], rng)
        p.append(held_out(fit.model, fit.full_covariance, table, pool_r()[:29]).p_value)
    assert stats.kstest(p, "uniform").pvalue > 1e-3


def test_a_pose_used_for_the_identification_is_refused_by_number():
    truth, fit, rng = fitted()
    q = np.concatenate([G[:3], pool_r()[7:8] + 1e-12])
    with pytest.raises(InputError, match="validation pose 3 is pose 7 of the identification"):
        held_out(fit.model, fit.full_covariance, measured(truth, q, rng), pool_r()[:29])


def test_validation_noise_that_is_zero_and_negative_covariance_are_refused():
    truth, fit, rng = fitted()
    table = measured(truth, G, rng)
    flat = type(table)(
        **{n: getattr(table, n) for n in table.__slots__} | {"covariance": np.zeros((60, 6, 6))}
    )
    with pytest.raises(InputError, match="not positive definite"):
        held_out(fit.model, fit.full_covariance, flat, pool_r()[:29])
    with pytest.raises(InputError, match=r"eigenvalue|variance"):
        held_out(fit.model, -fit.full_covariance, table, pool_r()[:29])


def made(errors, predicted=0.0, measured_=0.0, p_value=0.0):
    n = len(errors)
    eye = np.broadcast_to(np.eye(3), (n, 3, 3))
    return HeldOut(np.asarray(errors), eye * predicted, eye * measured_, 1.0, p_value)


def test_the_discrepancy_is_what_was_put_in():
    rng, n = np.random.default_rng(0), 40_000
    S = np.array([[4.0, 1.0, 0], [1.0, 2.0, 0], [0, 0, 1.0]])
    errors = rng.multivariate_normal(np.zeros(3), S + 3 * np.eye(3), n)
    found = discrepancy(made(errors, 1.0, 2.0))
    # sd of a variance of 7 from 40 000 draws: 7 sqrt(2/n) = .05
    assert found.covariance == pytest.approx(S, abs=0.2)
    assert "approximate" in found.sentence


def test_no_discrepancy_is_zero_in_its_negative_directions():
    errors = np.random.default_rng(0).standard_normal((40, 3)) * [1.0, 0.1, 0.1]
    found = discrepancy(made(errors, 0.25, 0.0))
    values = np.linalg.eigvalsh(found.covariance)
    assert values[0] > -1e-15
    assert (np.linalg.eigvalsh(found.raw)[:2] < 0).all()
    assert values[:2] == pytest.approx([0, 0], abs=1e-12)
    none = discrepancy(made(errors * 0.01, 1.0))
    assert not none.covariance.any()
    assert "no error beyond" in none.sentence


def test_a_discrepancy_that_chance_makes_likely_is_not_claimed():
    errors = np.random.default_rng(0).standard_normal((30, 3))
    shown, likely = (discrepancy(made(errors, 0.9, p_value=p)) for p in (0.01, 0.62))
    assert "that the model does not explain" in shown.sentence
    np.testing.assert_array_equal(shown.covariance, likely.covariance)
    assert likely.sentence == (
        "30 held-out poses show no more error than parameters and measurements make likely "
        "(p = 0.62)"
    )


@pytest.mark.parametrize("n", [12, 40])
def test_the_factor_is_hotellings(n):
    rng, N = np.random.default_rng(3), 20_000
    e = rng.standard_normal((N, n, 3))
    S = np.swapaxes(e, 1, 2) @ e / n
    new = rng.standard_normal((N, 3))
    square = np.einsum("ni,ni->n", new, np.linalg.solve(S, new[..., None])[..., 0])
    k = discrepancy(made(e[0])).factor(0.95)
    assert np.mean(square <= k**2) == pytest.approx(0.95, abs=4 * np.sqrt(0.0475 / N))


def test_a_discrepancy_from_nine_poses_is_refused():
    with pytest.raises(InputError, match="9 validation poses"):
        discrepancy(made(np.ones((9, 3))))


@pytest.mark.parametrize(("n", "k"), [(19, 19), (20, 20), (38, 38), (39, 38), (40, 39), (99, 95)])
def test_the_conformal_radius_is_the_kth_smallest(n, k):
    distance = np.random.default_rng(n).permutation(np.arange(1.0, n + 1))
    found = conformal(distance)
    assert (found.rank, found.radius) == (k, float(k))


@pytest.mark.parametrize(("probability", "n"), [(0.5, 1), (0.9, 9), (0.95, 19), (0.99, 99)])
def test_fewest_poses(probability, n):
    assert fewest_poses(probability) == n
    assert conformal(np.ones(n), probability=probability).rank == n
    with pytest.raises(InputError, match=f"at least {n}"):
        conformal(np.ones(n - 1), probability=probability)


def test_fewer_than_19_poses_cannot_promise_95_percent():
    with pytest.raises(InputError, match=r"18 validation poses for 95 %; expected at least 19"):
        conformal(np.ones(18))
    with pytest.raises(InputError, match="none negative"):
        conformal(-np.ones(19))
    with pytest.raises(InputError, match="probability is 1"):
        conformal(np.ones(19), probability=1)


def test_the_radius_holds_95_percent_of_any_error_on_average_and_its_range_is_beta():
    """Heavy tails, no moments: content of a radius is known from the distribution itself."""
    rng, n, N = np.random.default_rng(4), 40, 4000
    radii = [conformal(np.abs(rng.standard_cauchy(n))) for _ in range(N)]
    content = 2 * stats.cauchy.cdf([found.radius for found in radii]) - 1
    law = stats.beta(39, 2)
    assert np.mean(content) == pytest.approx(39 / 41, abs=4 * law.std() / np.sqrt(N))
    assert stats.kstest(content, law.cdf).pvalue > 1e-3
    assert radii[0].content_range() == pytest.approx(law.ppf([0.025, 0.975]), abs=1e-9)
