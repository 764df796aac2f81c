"""The covariance of an estimate under any weights, against brute force and special cases."""

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.jacobian import matrix_rows
from calib.information.propagation import point_uncertainty, tool_covariance
from calib.uncertainty.covariance import (
    common_input_covariance,
    correlation,
    covariance_factor,
    matrix_row_weights,
    standard_uncertainty,
)
from tests.reference import SIGMA_POSITION, SIGMA_ROTATION, WEN24, pool_r, tx60
from tests.sandwich import estimator, sandwich

MODEL = tx60()
FREE = [MODEL.names.index(name) for name in WEN24]


def random_set(m, seed=0):
    return pool_r()[np.random.default_rng(seed).permutation(1000)[:m]]


def problem(m=29, seed=0):
    """Jacobian (m, 6, 24) of random poses, and the covariance of the `paper` tracker."""
    J = MODEL.poses_and_jacobian(random_set(m, seed))[1][:, :, FREE]
    variances = [SIGMA_POSITION**2] * 3 + [SIGMA_ROTATION**2] * 3
    return J, np.broadcast_to(np.diag(variances), (m, 6, 6))


def inverse_of(blocks):
    return np.linalg.solve(blocks, np.broadcast_to(np.eye(blocks.shape[-1]), blocks.shape))


def in_units_of(covariance, reference):
    """Covariance with every number in units of its standard uncertainty in `reference`."""
    u = standard_uncertainty(reference)
    return covariance / np.outer(u, u)


def full(covariance):
    C = np.zeros((MODEL.n_numbers, MODEL.n_numbers))
    C[np.ix_(FREE, FREE)] = covariance
    return C


def test_with_the_right_weights_the_sandwich_is_the_inverse_information():
    J, sigma = problem()
    weight = inverse_of(sigma)
    M = np.einsum("mrf,mrs,msg->fg", J, weight, J)
    C = sandwich(J, weight, sigma)
    # C M mixes 1 m and 1 rad: entries of the product carry up to 1e3 of unit ratio, condition 1e2
    np.testing.assert_allclose(C @ M, np.eye(24), atol=1e-8)


def test_six_weighted_rows_give_the_covariance_of_the_paper_twelve_unweighted_rows():
    q = random_set(29)
    T, J = MODEL.poses_and_jacobian(q)
    _, sigma = problem()
    H = matrix_rows(T, J[:, :, FREE])
    H[:, 9:] *= 1e3  # position rows in mm
    spin = np.zeros((29, 6, 6))  # the six unit errors as columns
    spin[:] = np.eye(6)
    B = matrix_rows(T, spin)
    B[:, 9:] *= 1e3
    # twelve rows by the plain normal equations, columns scaled to condition 10
    scale = np.linalg.norm(H.reshape(-1, 24), axis=0)
    A = (H / scale).reshape(-1, 24)
    F = np.linalg.solve(A.T @ A, A.T) / scale[:, None]
    rows = B @ sigma @ np.swapaxes(B, 1, 2)
    blocks = F.reshape(24, 29, 12)
    expected = np.einsum("fmr,mrs,gms->fg", blocks, rows, blocks)
    C = sandwich(J[:, :, FREE], matrix_row_weights(29), sigma)
    np.testing.assert_allclose(in_units_of(C, C), in_units_of(expected, C), atol=1e-10)


def test_the_sandwich_is_what_repeated_noise_does_to_the_estimate():
    J, sigma = problem()
    F, _ = estimator(J, matrix_row_weights(29))
    rng = np.random.default_rng(1)
    noise = rng.standard_normal((20_000, 29, 6)) * np.sqrt(np.diag(sigma[0]))
    found = np.cov(np.einsum("mfr,kmr->kf", F, noise, optimize=True).T)
    C = sandwich(J, matrix_row_weights(29), sigma)
    # a sample (co)variance of N = 20 000 scatters by sqrt(2 / N) = .01 at most; 300 entries
    np.testing.assert_allclose(in_units_of(found, C), in_units_of(C, C), atol=0.045)


def test_no_weights_beat_the_inverse_covariance():
    J, sigma = problem()
    best = sandwich(J, inverse_of(sigma), sigma)
    paper = sandwich(J, matrix_row_weights(29), sigma)
    # Gauss-Markov: the difference has no negative direction
    assert np.linalg.eigvalsh(in_units_of(paper - best, best))[0] > -1e-9
    assert standard_uncertainty(paper).mean() > standard_uncertainty(best).mean()


@pytest.mark.parametrize("m", [29, 61])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_known_correlations_appear_and_dropping_them_inflates_the_tool_point(m, seed):
    J, sigma = problem(m, seed)
    goals = pool_r(200, 99)
    # rho(theta3, a3), rho(alpha3, d3), and how much independence overstates u_3D
    cases = ((inverse_of(sigma), -0.87, 0.89, 2.0), (matrix_row_weights(m), -0.97, 0.96, 3.0))
    for weight, theta_a, alpha_d, inflation in cases:
        C = sandwich(J, weight, sigma)
        rho = correlation(C)
        at = WEN24.index
        # the pose set moves them by about .02
        assert rho[at("theta3"), at("a3")] == pytest.approx(theta_a, abs=0.04)
        assert rho[at("alpha3"), at("d3")] == pytest.approx(alpha_d, abs=0.04)
        # no other pair is as strongly correlated
        strongest = np.argsort(-np.abs(np.triu(rho, 1)), axis=None)[:2]
        pairs = np.stack(np.unravel_index(strongest, rho.shape), axis=1)
        named = {frozenset(WEN24[i] for i in pair) for pair in pairs}
        assert named == {frozenset({"theta3", "a3"}), frozenset({"alpha3", "d3"})}
        true, independent = (
            point_uncertainty(tool_covariance(MODEL, goals, full(c))).mean()
            for c in (C, np.diag(np.diag(C)))
        )
        assert independent / true == pytest.approx(inflation, rel=0.06)


def test_a_prior_with_the_right_weights_gives_the_posterior_covariance():
    J, sigma = problem(3)  # too few poses for 24 numbers
    weight = inverse_of(sigma)
    prior = np.diag(np.where([MODEL.is_length[i] for i in FREE], 0.6e-3, np.deg2rad(0.1)) ** -2.0)
    M = np.einsum("mrf,mrs,msg->fg", J, weight, J) + prior
    C = sandwich(J, weight, sigma, prior_precision=prior)
    np.testing.assert_allclose(C @ M, np.eye(24), atol=1e-7)


def test_a_shared_offset_does_not_average_out():
    # every pose sees the same tool offset: what it adds to the tool point stays, noise shrinks
    S = np.diag([2.5e-6**2] * 3)
    shared, noise = [], []
    for m in (30, 480):
        q = random_set(m)
        T, J = MODEL.poses_and_jacobian(q)
        J = J[:, :, FREE]
        _, sigma = problem(m)
        F, _ = estimator(J, inverse_of(sigma))
        B = np.concatenate([T[:, :3, :3], np.zeros((m, 3, 3))], axis=1)
        goals = pool_r(100, 99)
        shared.append(
            point_uncertainty(
                tool_covariance(MODEL, goals, full(common_input_covariance(F, B, S)))
            ).mean()
        )
        noise.append(
            point_uncertainty(
                tool_covariance(MODEL, goals, full(sandwich(J, inverse_of(sigma), sigma)))
            ).mean()
        )
    assert noise[1] / noise[0] == pytest.approx(0.25, rel=0.15)  # sqrt(30 / 480), sets differ
    assert shared[1] / shared[0] == pytest.approx(1.0, rel=0.15)


def test_a_common_input_equals_fully_correlated_noise():
    J, sigma = problem(6)
    F, _ = estimator(J, inverse_of(sigma))
    B, S = np.random.default_rng(0).normal(size=(6, 6, 2)), np.array([[2.0, 0.5], [0.5, 1.0]])
    rows = B.reshape(36, 2)
    G = np.moveaxis(F, 1, 0).reshape(24, 36)
    expected = G @ (rows @ S @ rows.T) @ G.T
    found = common_input_covariance(F, B, S)
    np.testing.assert_allclose(
        in_units_of(found, expected), in_units_of(expected, expected), atol=1e-9
    )


def test_the_factor_rebuilds_the_covariance_fixed_and_dependent_numbers_included():
    L = np.random.default_rng(0).normal(size=(5, 5))
    regular = np.zeros((7, 7))
    regular[np.ix_([0, 2, 3, 4, 6], [0, 2, 3, 4, 6])] = L @ L.T
    singular = np.zeros((7, 7))
    singular[:5, :5] = L[:, :3] @ L[:, :3].T  # three sources move five numbers
    for C in (regular, singular, np.zeros((7, 7))):
        root = covariance_factor(C)
        np.testing.assert_allclose(root @ root.T, C, atol=1e-14 * max(1.0, np.abs(C).max()))
    np.testing.assert_array_equal(np.triu(covariance_factor(regular), 1), 0.0)


def test_the_factor_does_not_care_about_units():
    C = sandwich(*problem()[:1], inverse_of(problem()[1]), problem()[1])
    unit = np.where([MODEL.is_length[i] for i in FREE], 1e3, 180 / np.pi)
    np.testing.assert_allclose(
        covariance_factor(C * np.outer(unit, unit)) / unit[:, None],
        covariance_factor(C),
        atol=1e-12 * standard_uncertainty(C).max(),
    )


@pytest.mark.parametrize(
    ("C", "message"),
    [
        ([[1.0, 2.0], [2.0, 1.0]], "eigenvalue -1"),
        ([[1.0, 0.5], [0.4, 1.0]], "differ"),
        ([[-1.0, 0.0], [0.0, 1.0]], "eigenvalue"),
        ([[0.0, 1.0], [1.0, 1.0]], "correlated but has no variance"),
    ],
)
def test_a_matrix_that_is_no_covariance_is_refused_by_its_eigenvalue(C, message):
    with pytest.raises(InputError, match=message):
        covariance_factor(np.array(C))


def test_a_fixed_number_is_correlated_with_itself_only():
    np.testing.assert_array_equal(correlation(np.diag([4.0, 0.0])), np.eye(2))
