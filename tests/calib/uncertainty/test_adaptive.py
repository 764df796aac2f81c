"""Adaptive Monte Carlo and the validation verdict on the worked examples of JCGM 101, 102, GUM.

Reference values: inputs as restated in CRAN `propagate` (man/propagate.Rd) and in suncal's tests;
closed form where exact, else 2e7 draws; they agree with the printed tables to the printed digits.
"""

import dataclasses

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.parameters import parameters_of
from calib.uncertainty.adaptive import adaptive, fewest_draws
from calib.uncertainty.budget import Budget, Contribution, effective_dof
from calib.uncertainty.regions import coverage_factor
from calib.uncertainty.validation import first_order, validate
from tests.reference import tx60

R3 = np.sqrt(3)


def normals(n, rng):
    """JCGM 101, 9.2.2."""
    return rng.standard_normal((n, 4)).sum(axis=1, keepdims=True)


def rectangles(n, rng):
    """JCGM 101, 9.2.3."""
    return rng.uniform(-R3, R3, (n, 4)).sum(axis=1, keepdims=True)


def one_wide(n, rng):
    """JCGM 101, 9.2.4 with one rectangle ten times wider."""
    return (rng.uniform(-R3, R3, (n, 4)) * [1, 1, 1, 10]).sum(axis=1, keepdims=True)


def mass_model(x):
    """JCGM 101, 9.3 [mg]."""
    gain = 1 + (x[:, 2] - 1.2) * (1 / x[:, 3] - 1 / x[:, 4])
    return ((x[:, 0] + x[:, 1]) * gain - 100_000)[:, None]


def mass(n, rng):
    return mass_model(
        np.stack(
            [
                rng.normal(100_000, 0.05, n),
                rng.normal(1.234, 0.02, n),
                rng.uniform(1.1, 1.3, n),
                rng.uniform(7000, 9000, n),
                rng.uniform(7950, 8050, n),
            ],
            axis=1,
        )
    )


MASS = np.array([1.234, 0.07547])
"""Mean and u: 2e7 draws."""


def loss(x1, r):
    """JCGM 101, 9.4: comparison loss X1^2 + X2^2 in 1e-6, u = 0.005 each, correlation r."""

    def sample(n, rng):
        z = rng.standard_normal((2, n))
        first = x1 + 0.005 * z[0]
        second = 0.005 * (r * z[0] + np.sqrt(1 - r * r) * z[1])
        return 1e6 * (first**2 + second**2)[:, None]

    return sample


def gauge_model(x):
    """JCGM 101, 9.5 [nm]."""
    Ls, D, d1, d2, expansion, t0, De, da, dt = x.T
    return (Ls + D + d1 + d2 - Ls * (da * (t0 + De) + expansion * dt) - 5e7)[:, None]


def gauge(n, rng):
    def curved(a, b, d):
        low = a - d + 2 * d * rng.random(n)
        return low + (a + b - 2 * low) * rng.random(n)

    return gauge_model(
        np.stack(
            [
                50000623 + 25 * rng.standard_t(18, n),
                215 + 6 * rng.standard_t(24, n),
                4 * rng.standard_t(5, n),
                7 * rng.standard_t(8, n),
                rng.uniform(9.5e-6, 13.5e-6, n),
                rng.normal(-0.1, 0.2, n),
                0.5 * np.sin(2 * np.pi * rng.random(n)),
                curved(-1e-6, 1e-6, 0.1e-6),
                curved(-0.050, 0.050, 0.025),
            ],
            axis=1,
        )
    )


@pytest.mark.parametrize(
    ("sample", "u", "end"),
    [
        (normals, 2.0, 3.919928),
        (rectangles, 2.0, 2 * R3 * (2 - (3 / 5) ** 0.25)),
        (one_wide, np.sqrt(103), 17.0158),
    ],
    ids=["9.2.2", "9.2.3", "9.2.4"],
)
def test_sums_of_jcgm_101(sample, u, end):
    run = adaptive(sample, np.random.default_rng(1), digits=2, finer=5)
    # the run stops at a fifth of delta in two standard errors; twice that for six outputs in all
    assert run.stable
    of_mean, of_u, _, of_factor = run.tolerance
    assert of_u == pytest.approx(0.01 if u < 3 else 0.1)
    assert (run.mean[0], run.standard[0]) == pytest.approx((0, u), abs=2 * of_mean)
    # symmetric: the region of one output is the interval that both tails leave
    assert run.factor == pytest.approx(end / u, abs=2 * of_factor)


@pytest.mark.parametrize(
    ("sample", "u", "digits", "outcome"),
    [
        (normals, 2.0, 2, "validated"),
        (rectangles, 2.0, 2, "validated"),  # the factor differs by .020 of .05
        (rectangles, 2.0, 3, "not validated"),
        (one_wide, np.sqrt(103), 2, "not validated"),
    ],
)
def test_the_verdicts_on_sums_of_jcgm_101(sample, u, digits, outcome):
    finer = 5 if digits == 2 else 1
    run = adaptive(sample, np.random.default_rng(2), digits=digits, finer=finer, most=3_000_000)
    verdict = validate([0.0], [[u**2]], run, digits=digits)
    assert verdict.outcome == outcome
    assert verdict.validated is (outcome == "validated")
    assert outcome in verdict.sentence


def test_mass_of_jcgm_101_and_that_first_order_is_not_validated_for_it():
    run = adaptive(mass, np.random.default_rng(3))
    assert run.tolerance[:2] == pytest.approx(0.0005)
    # 4 standard errors
    assert (run.mean[0], run.standard[0]) == pytest.approx(MASS, abs=2 * run.tolerance[0])
    U = np.diag([0.05**2, 0.02**2, 0.01 / 3, 1e6 / 3, 2500 / 3])
    line = first_order(mass_model, [100_000, 1.234, 1.2, 8000, 8000], U)
    assert line.value[0] == pytest.approx(1.234, abs=1e-9)
    assert line.standard[0] == pytest.approx(0.053852, abs=5e-7)
    for digits in (1, 2):
        assert validate(line.value, line.covariance, run, digits=digits).outcome == "not validated"


@pytest.mark.parametrize(
    ("x1", "r", "mean", "u"),
    [
        (0.0, 0.0, 50.0, 50.0),
        (0.010, 0.0, 150.0, 111.803399),
        (0.050, 0.0, 2550.0, 502.493781),
        (0.0, 0.9, 50.0, 67.2681),
        (0.010, 0.9, 150.0, 120.52),
        (0.050, 0.9, 2550.0, 504.505),
    ],
)
def test_comparison_loss_of_jcgm_101(x1, r, mean, u):
    run = adaptive(loss(x1, r), np.random.default_rng(4))
    assert (run.mean[0], run.standard[0]) == pytest.approx((mean, u), abs=2 * run.tolerance[0])


def test_comparison_loss_at_zero_first_order_sees_nothing():
    line = first_order(lambda x: (x**2).sum(axis=1), [0.0, 0.0], np.eye(2) * 0.005**2)
    assert line.standard[0] < 1e-12
    with pytest.raises(InputError, match="standard uncertainty above zero"):
        validate([0.0], [[0.0]], adaptive(loss(0.0, 0.0), np.random.default_rng(0), digits=1))


def test_gauge_block_of_jcgm_101():
    run = adaptive(gauge, np.random.default_rng(5), probability=0.99)
    tolerance = 2 * run.tolerance[0]
    assert (run.mean[0], run.standard[0]) == pytest.approx((838.0, 35.81), abs=tolerance)
    assert round(run.standard[0]) == 36  # as published
    # the published first-order u
    assert validate([838.0], [[32.0**2]], run).outcome == "not validated"


@pytest.mark.parametrize(
    ("re", "r", "magnitude", "phase"),
    [
        (0.001, 0.0, (0.0126, 0.0066), (0.0, 1.744)),
        (0.001, 0.9, (0.0117, 0.0080), (-0.557, 1.599)),
        (0.01, 0.0, (0.0155, 0.0078), (0.0, 1.117)),
        (0.01, 0.9, (0.0153, 0.0081), (-0.343, 0.903)),
        (0.1, 0.0, (0.1005, 0.0100), (0.0, 0.1005)),
    ],
)
def test_magnitude_and_phase_of_jcgm_102(re, r, magnitude, phase):
    def sample(n, rng):
        z = rng.standard_normal((2, n))
        x = re + 0.01 * z[0]
        y = 0.01 * (r * z[0] + np.sqrt(1 - r * r) * z[1])
        return np.stack([np.hypot(x, y), np.arctan2(y, x)], axis=1)

    run = adaptive(sample, np.random.default_rng(6))
    assert run.stable
    assert (run.mean[0], run.standard[0]) == pytest.approx(magnitude, abs=1.5e-4)
    # printed to three decimals, from 4e6 draws
    assert (run.mean[1], run.standard[1]) == pytest.approx(
        phase, abs=5e-4 + 2 * float(run.tolerance[1])
    )
    line = first_order(
        lambda x: np.stack([np.hypot(*x.T), np.arctan2(x[:, 1], x[:, 0])], axis=1),
        [re, 0.0],
        1e-4 * np.array([[1, r], [r, 1]]),
    )
    verdict = validate(line.value, line.covariance, run)
    assert verdict.outcome == ("not validated" if re < 0.1 else verdict.outcome)


def test_a_normal_vector_is_validated_and_has_the_chi_square_factor():
    U = np.array([[4.0, 1.2, 0.0], [1.2, 1.0, 0.3], [0.0, 0.3, 2.25]])
    L = np.linalg.cholesky(U)
    run = adaptive(
        lambda n, rng: rng.standard_normal((n, 3)) @ L.T, np.random.default_rng(7), finer=5
    )
    assert run.stable
    assert run.factor == pytest.approx(2.795483, abs=0.02)  # a fifth of .05, doubled
    rho = U / np.sqrt(np.outer(np.diag(U), np.diag(U)))
    assert run.largest_eigenvalue == pytest.approx(np.linalg.eigvalsh(rho)[-1], abs=0.02)
    assert validate(np.zeros(3), U, run).outcome == "validated"
    assert validate([0, 0, 0.2], U, run).outcome == "not validated"
    coarse = dataclasses.replace(run, error=np.minimum(run.error * 4, run.tolerance * 2))
    assert validate(np.zeros(3), U, coarse).outcome == "undecided"


def test_gum_h1_and_the_effective_degrees_of_freedom():
    # standard; comparator; 0.58e-6/K at -0.1 K; 11.5e-6/K times 0.029 K: 25, 9.7, 2.9, 16.7 nm
    u = [25, np.sqrt(5.8**2 + 3.9**2 + 6.7**2), 50000623 * 0.58e-7, 50000623 * 11.5e-6 * 0.029]
    nu = [18, 25.6, 50, 2]
    assert int(effective_dof(u, nu)) == 16
    parts = [
        Contribution(str(k), np.array([[x**2]]), n)
        for k, (x, n) in enumerate(zip(u, nu, strict=True))
    ]
    whole = Budget(parameters_of(tx60(), ["a2"]), tuple(parts))
    assert whole.combined == pytest.approx(31.71, abs=0.005)
    assert whole.expanded(0.99).round() == 93


def test_gum_h2_with_correlated_inputs():
    V = [5.007, 4.994, 5.005, 4.990, 4.999]
    current = np.array([19.663, 19.639, 19.640, 19.685, 19.678]) * 1e-3
    phi = [1.0456, 1.0438, 1.0468, 1.0428, 1.0433]
    data = np.array([V, current, phi])

    def impedance(x):
        Z = x[:, 0] / x[:, 1]
        return np.stack([Z * np.cos(x[:, 2]), Z * np.sin(x[:, 2]), Z], axis=1)

    line = first_order(impedance, data.mean(axis=1), np.cov(data) / 5)
    assert line.value == pytest.approx([127.73216993, 219.84651191, 254.25970195], rel=1e-9)
    assert line.standard == pytest.approx([0.07107141, 0.29558168, 0.23633613], abs=1e-5)
    rho = line.correlation
    assert [rho[0, 1], rho[0, 2], rho[1, 2]] == pytest.approx(
        [-0.58842978, -0.48525922, 0.99251165], abs=1e-5
    )


def within(seeds, first=0):
    """(seeds, 2) whether mean and u lie within the tolerance."""
    found = []
    for seed in range(first, first + seeds):
        run = adaptive(mass, np.random.default_rng([3, seed]))
        got = np.array([run.mean[0], run.standard[0]])
        found.append(np.abs(got - MASS) <= run.tolerance[:2])
    return np.array(found)


@pytest.mark.slow
def test_the_adaptive_procedure_keeps_its_tolerance_in_most_runs():
    # 94 % expected; 19 or fewer of 24 has a chance of 1 % at 94 %, once in 16 000 at 97 %
    assert (within(24).sum(axis=0) >= 19).all()


@pytest.mark.study
def test_the_adaptive_procedure_keeps_its_tolerance_in_89_percent_of_200_seeds():
    assert (within(200).mean(axis=0) >= 0.89).all()


def test_a_run_cut_short_says_so():
    run = adaptive(mass, np.random.default_rng(0), most=30_000)
    assert not run.stable
    assert "allow more draws" in run.sentence
    assert run.draws == 30_000
    assert validate([1.234], [[0.0757**2]], run).outcome in ("undecided", "not validated")


def test_first_order_of_a_quadratic_is_exact():
    """Five points: derivatives of polynomials up to the fourth degree carry rounding only."""
    line = first_order(
        lambda x: np.stack([x[:, 0] ** 4 + x[:, 1], x[:, 0] * x[:, 1]], axis=1),
        [2.0, 3.0],
        np.diag([0.01, 0.0]),
    )
    assert line.sensitivity == pytest.approx(np.array([[32.0, 0.0], [3.0, 0.0]]), rel=1e-9)
    assert line.covariance == pytest.approx(np.array([[10.24, 0.96], [0.96, 0.09]]), rel=1e-9)


def test_draws_too_few_for_the_asked_coverage_are_refused():
    assert [fewest_draws(p) for p in (0.95, 0.99, 0.9999)] == [2000, 10_000, 1_000_000]
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="at least 2000"):
        adaptive(normals, rng, batch=1999)
    with pytest.raises(InputError, match="at least 10000"):
        adaptive(normals, rng, probability=0.99, batch=9999)
    with pytest.raises(InputError, match="two batches"):
        adaptive(normals, rng, probability=0.9999, most=1_500_000)
    with pytest.raises(InputError, match="digits is 0"):
        adaptive(normals, rng, digits=0)
    with pytest.raises(InputError, match="probability is 1"):
        adaptive(normals, rng, probability=1.0)
    with pytest.raises(InputError, match="does not scatter"):
        adaptive(lambda n, _: np.ones((n, 1)), rng)
    with pytest.raises(InputError, match="sample has shape"):
        adaptive(lambda n, _: np.ones((n + 1, 1)), rng)
    with pytest.raises(InputError, match="must be finite"):
        adaptive(lambda n, _: np.full((n, 1), np.nan), rng)
    with pytest.raises(InputError, match="depend on each other"):
        adaptive(lambda n, r: np.repeat(r.standard_normal((n, 1)), 2, 1), rng)


@pytest.mark.parametrize(
    ("off", "error", "outcome"),
    [(0.055, 0.02, "undecided"), (0.055, 0.004, "not validated"), (0.045, 0.004, "validated")],
)
def test_a_difference_within_the_error_of_monte_carlo_is_not_held_against_first_order(
    off, error, outcome
):
    """Two digits of u = 1: the tolerance is 0.05, and Monte Carlo has to be known to 0.01."""
    run = adaptive(lambda M, rng: rng.standard_normal((M, 1)), np.random.default_rng(0), digits=1)
    exact = dataclasses.replace(
        run, mean=np.zeros(1), covariance=np.eye(1), factor=coverage_factor(1),
        error=np.full(4, error),
    )  # fmt: skip
    assert validate([off], [[1.0]], exact).outcome == outcome
