"""The solver alone: certified problems of NIST, laws of least squares, honest ends."""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from calib.arrays import Array
from calib.errors import InputError
from calib.geometry.frames import exp_so3
from calib.identification.least_squares import Solution, Status, solve
from calib.identification.tangent import (
    System,
    column_norms,
    covariance_factor,
    normal_plane,
    tangent_plane,
)

STRD = Path(__file__).resolve().parents[4] / "shared" / "reference" / "strd"


def relative_offset(r, A):
    """Certificate of a point, its columns scaled by their own norms."""
    return tangent_plane(r, A, column_norms(A)).certificate


def two_peaks(b, x):
    return (
        b[0] * np.exp(-b[1] * x)
        + b[2] * np.exp(-(((x - b[3]) / b[4]) ** 2))
        + b[5] * np.exp(-(((x - b[6]) / b[7]) ** 2))
    )


def decays(b, x):
    return sum(b[k] * np.exp(-b[k + 1] * x) for k in (0, 2, 4))


def rational(numerator):
    """Polynomial of that many coefficients over 1 + x (remaining coefficients)."""

    def model(b, x):
        top = sum(c * x**k for k, c in enumerate(b[:numerator]))
        return top / (1 + sum(c * x ** (k + 1) for k, c in enumerate(b[numerator:])))

    return model


def seasons(b, x):
    periods = ((12.0, 1, 2), (b[3], 4, 5), (b[6], 7, 8))
    return b[0] + sum(
        b[i] * np.cos(2 * np.pi * x / period) + b[j] * np.sin(2 * np.pi * x / period)
        for period, i, j in periods
    )


MODELS = {
    "Bennett5": lambda b, x: b[0] * (b[1] + x) ** (-1 / b[2]),
    "BoxBOD": lambda b, x: b[0] * (1 - np.exp(-b[1] * x)),
    "Chwirut1": lambda b, x: np.exp(-b[0] * x) / (b[1] + b[2] * x),
    "Chwirut2": lambda b, x: np.exp(-b[0] * x) / (b[1] + b[2] * x),
    "DanWood": lambda b, x: b[0] * x ** b[1],
    "ENSO": seasons,
    "Eckerle4": lambda b, x: b[0] / b[1] * np.exp(-0.5 * ((x - b[2]) / b[1]) ** 2),
    "Gauss1": two_peaks,
    "Gauss2": two_peaks,
    "Gauss3": two_peaks,
    "Hahn1": rational(4),
    "Kirby2": rational(3),
    "Lanczos1": decays,
    "Lanczos2": decays,
    "Lanczos3": decays,
    "MGH09": lambda b, x: b[0] * (x**2 + b[1] * x) / (x**2 + b[2] * x + b[3]),
    "MGH10": lambda b, x: b[0] * np.exp(b[1] / (x + b[2])),
    "MGH17": lambda b, x: b[0] + b[1] * np.exp(-b[3] * x) + b[2] * np.exp(-b[4] * x),
    "Misra1a": lambda b, x: b[0] * (1 - np.exp(-b[1] * x)),
    "Misra1b": lambda b, x: b[0] * (1 - (1 + b[1] * x / 2) ** -2),
    "Misra1c": lambda b, x: b[0] * (1 - (1 + 2 * b[1] * x) ** -0.5),
    "Misra1d": lambda b, x: b[0] * b[1] * x / (1 + b[1] * x),
    "Nelson": lambda b, x: b[0] - b[1] * x[0] * np.exp(-b[2] * x[1]),
    "Rat42": lambda b, x: b[0] / (1 + np.exp(b[1] - b[2] * x)),
    "Rat43": lambda b, x: b[0] / (1 + np.exp(b[1] - b[2] * x)) ** (1 / b[3]),
    "Roszman1": lambda b, x: b[0] - b[1] * x - np.arctan(b[2] / (x - b[3])) / np.pi,
    "Thurber": rational(4),
}


def read(name: str) -> tuple[Array, Array, Array]:
    """x, y and the table (p, 4): two starts, certified value, certified standard deviation."""
    text = (STRD / f"{name}.dat").read_text()
    table = re.findall(r"^\s*b\d+\s*=\s*(\S+)\s+(\S+)\s+(\S+)\s+(\S+)", text, re.MULTILINE)
    rows = text[text.rindex("Data:") :].splitlines()[1:]
    data = np.array([line.split() for line in rows if line.strip()], dtype=float)
    y = np.log(data[:, 0]) if name == "Nelson" else data[:, 0]
    return data[:, 1:].T.squeeze(), y, np.array(table, dtype=float)


def problem(name: str):
    """Function b -> residual and exact derivative (by complex step), and the certified table."""
    x, y, table = read(name)
    model = MODELS[name]

    def evaluate(b):
        h = 1e-20 * np.maximum(1, np.abs(b))
        columns = [model(b + 1j * step, x).imag / step.sum() for step in np.diag(h)]
        return y - model(b, x), np.transpose(columns)

    return evaluate, table


@cache
def fit(name: str, start: int) -> tuple[Solution[Array], Array]:
    """Solution and certified table."""
    evaluate, table = problem(name)
    return solve(
        evaluate, table[:, start], move=np.add, reach=np.abs(table[:, start]), most=20000
    ), table


def digits(value: Array, certified: Array) -> float:
    """Agreeing decimal digits of the worst entry, 16 at most."""
    return float(-np.log10(np.abs(value / certified - 1).max(initial=1e-16)))


def line(x: Array) -> tuple[Array, Array]:
    """Three heights over a straight line: intercept and slope, worked out by hand."""
    t, y = np.array([0.0, 1.0, 2.0]), np.array([1.0, 3.0, 4.0])
    return y - x[0] - x[1] * t, np.stack([np.ones(3), t], -1)


def valley(x: Array) -> tuple[Array, Array]:
    """Rosenbrock's curved valley with a hill of residual added: no exact fit."""
    prediction = np.array([10 * (x[1] - x[0] ** 2), x[0], 0.1 * x[0] * x[1]])
    J = np.array([[-20 * x[0], 10.0], [1.0, 0.0], [0.1 * x[1], 0.1 * x[0]]])
    return np.array([0.0, 1.0, 2.0]) - prediction, J


needs_files = pytest.mark.skipif(
    not STRD.is_dir(), reason="needs the NIST StRD files in ../shared/reference"
)


@needs_files
@pytest.mark.parametrize("start", [0, 1], ids=["far start", "near start"])
@pytest.mark.parametrize("name", MODELS)
def test_certified_nist_problems_are_solved_to_six_digits(name, start):
    solution, table = fit(name, start)
    assert solution.status is Status.CONVERGED
    assert digits(solution.x, table[:, 2]) >= 6
    if name == "Lanczos1":
        return  # the data are the exact model, rounded: its certified sd is below float64
    K, r = covariance_factor(solution.jacobian), solution.residual
    variance = r @ r / (len(r) - len(solution.x))
    assert digits(np.sqrt(variance * np.square(K).sum(1)), table[:, 3]) >= 6


@needs_files
def test_certified_nist_problems_are_solved_to_ten_digits_on_average():
    """54 starts: all to six digits, the mean at least ten, standard deviations of 52 to six."""
    values, deviations = [], []
    for name in MODELS:
        for start in (0, 1):
            solution, table = fit(name, start)
            values.append(digits(solution.x, table[:, 2]))
            K, r = covariance_factor(solution.jacobian), solution.residual
            variance = r @ r / (len(r) - len(solution.x))
            deviations.append(digits(np.sqrt(variance * np.square(K).sum(1)), table[:, 3]))
    assert len(values) == 54
    assert min(values) >= 6
    assert np.mean(values) >= 10
    assert sum(d >= 6 for d in deviations) == 52


@needs_files
@pytest.mark.parametrize("name", ["Hahn1", "MGH09", "Thurber"])
def test_a_false_success_is_caught_by_the_certificate(name):
    """scipy's defaults call these far starts solved; our certificate of the same points does not.

    It asks what the parameters could still explain, not whether the last step was short.
    """
    evaluate, table = problem(name)
    theirs = least_squares(lambda b: -evaluate(b)[0], table[:, 0])
    assert theirs.success
    assert digits(theirs.x, table[:, 2]) < 6
    assert relative_offset(*evaluate(theirs.x)) > 1e-6


def test_a_fit_led_astray_by_a_wrong_derivative_is_not_called_converged():
    """One column with the wrong sign: the steps lead astray, and where they end is not believed."""

    def evaluate(x):
        r, A = valley(x)
        return r, A * [-1.0, 1.0]

    assert solve(evaluate, np.array([-1.2, 1.0]), move=np.add).status is not Status.CONVERGED


def test_a_straight_line_is_fitted_in_one_step():
    solution = solve(line, np.array([50.0, -70.0]), move=np.add)
    np.testing.assert_allclose(solution.x, [7 / 6, 3 / 2], rtol=1e-12)
    assert solution.status is Status.CONVERGED
    # the second step only finds that nothing is left
    assert solution.iterations <= 2


class Asked:
    """A derivative that counts how often its products are asked for."""

    count = 0

    def __init__(self, dense: Array) -> None:
        self.dense = dense

    def products(self, r: Array) -> tuple[Array, Array]:
        Asked.count += 1
        return self.dense.T @ self.dense, r @ self.dense


def test_a_step_that_raises_the_sum_of_squares_is_refused_without_its_tangent_plane():
    squares = []

    def evaluate(x: Array) -> System:
        r, A = valley(x)
        squares.append(float(r @ r))
        return System(r, Asked(A))

    Asked.count = 0
    found = solve(evaluate, np.array([-1.2, 1.0]), move=np.add)
    plain = solve(valley, np.array([-1.2, 1.0]), move=np.add)
    np.testing.assert_array_equal(found.trace, plain.trace)
    assert max(squares[1:]) > squares[0]
    assert Asked.count < len(squares)


def test_answer_is_that_of_scipy_in_a_curved_valley():
    ours = solve(valley, np.array([-1.2, 1.0]), move=np.add, reach=np.ones(2))
    theirs = least_squares(
        lambda x: -valley(x)[0],
        [-1.2, 1.0],
        lambda x: valley(x)[1],
        method="lm",
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
    )
    np.testing.assert_allclose(ours.x, theirs.x, rtol=1e-8)
    assert ours.certificate < 1e-6


@pytest.mark.parametrize("factor", [1e-9, 1e7])
def test_units_of_the_unknowns_do_not_matter(factor):
    """Columns are scaled: the path is the same in mm or km, to rounding."""
    unit = np.array([factor, 1.0])

    def rescaled(x):
        r, A = valley(x * unit)
        return r, A * unit

    plain = solve(valley, np.array([-1.2, 1.0]), move=np.add, reach=np.ones(2))
    other = solve(rescaled, np.array([-1.2, 1.0]) / unit, move=np.add, reach=1 / unit)
    np.testing.assert_allclose(other.x * unit, plain.x, rtol=1e-9)
    assert other.iterations == plain.iterations


def test_sum_of_squares_never_rises_and_every_step_is_reported():
    told = []
    solution = solve(
        valley, np.array([-1.2, 1.0]), move=np.add, report=lambda k, cost: told.append((k, cost))
    )
    # near the end a step may cost one rounding of the sum
    assert (np.diff(solution.trace) <= 1e-12 * solution.trace[:-1]).all()
    assert told == list(enumerate(solution.trace.tolist()))[1:]


def test_the_unknown_may_be_a_rotation_moved_by_multiplication():
    truth, v = exp_so3(np.array([0.4, -1.0, 2.0])), np.eye(3)

    def evaluate(R):
        seen, said = (truth @ v).T, (R @ v).T
        J = [np.cross(axis, said) for axis in np.eye(3)]  # d(Exp(w) R v) = w x (R v)
        return (seen - said).ravel(), np.stack([j.ravel() for j in J], -1)

    solution = solve(evaluate, np.eye(3), move=lambda R, step: exp_so3(step) @ R)
    np.testing.assert_allclose(solution.x, truth, atol=1e-13)
    assert solution.status is Status.CONVERGED


def test_unknowns_that_cannot_be_told_apart_are_never_called_converged():
    def evaluate(x):
        r, A = line(np.array([x[0] + x[2], x[1]]))
        return r, np.column_stack([A, A[:, 0]])

    solution = solve(evaluate, np.zeros(3), move=np.add)
    assert solution.status is Status.DEFICIENT
    assert "free fewer" in solution.status.value


def test_stopping_early_says_so():
    solution = solve(valley, np.array([-1.2, 1.0]), move=np.add, most=2)
    assert (solution.status, solution.iterations) == (Status.LIMIT, 2)


FAR_UP = np.array([0.4, 0.3])
"""From where steps end well inside these limits, whatever the last digits of a library are."""


def level_valley(rows):
    """(1 - xy)^2 + x^2 + y^2, which rises as the fourth power along x = y, in single precision.

    Each undamped step leaves most of the way, and from x = 0.01 on the sum is level to rounding.
    Rows of zeros make the same place weigh more: the certificate is |Q1'r| / sqrt(p / (n - p)).
    """

    def evaluate(x):
        r, A = np.zeros(rows), np.zeros((rows, 2))
        r[:3], A[:3] = [1.0 - x[0] * x[1], -x[0], -x[1]], [[x[1], x[0]], [1.0, 0.0], [0.0, 1.0]]
        return r.astype(np.float32).astype(np.float64), A

    return evaluate


@pytest.mark.parametrize("rows", [8, 103])
def test_a_slow_approach_that_ends_level_to_rounding_has_converged_by_its_wider_certificate(rows):
    """Between 1e-6, which any other fit must meet, and 1e-4."""
    found = solve(level_valley(rows), FAR_UP, move=np.add)
    assert 1e-6 < found.certificate < 1e-4
    assert found.status is Status.CONVERGED
    # a longer search finds no lower sum in any direction: scipy's, from there
    other = least_squares(lambda x: level_valley(rows)(x)[0], found.x, xtol=1e-15, diff_step=1e-3)
    assert found.trace[-1] <= 2 * other.cost * (1 + 1e-7)


@pytest.mark.parametrize(
    ("rows", "start"),
    [
        (200_003, FAR_UP),  # the same end, 180 times less certain
        (8, np.array([0.5, 0.5])),  # rounding stops it on the way, at 2e-4
    ],
)
def test_a_slow_approach_that_ends_elsewhere_has_not_converged(rows, start):
    found = solve(level_valley(rows), start, move=np.add)
    assert found.status is Status.STALLED
    assert found.certificate > 1e-4


def test_one_step_before_the_end_nobody_knows_that_it_is_one():
    steps = solve(level_valley(8), FAR_UP, move=np.add).iterations
    found = solve(level_valley(8), FAR_UP, move=np.add, most=steps - 1)
    assert found.status is Status.LIMIT
    assert found.certificate < 1e-5


def test_a_fit_that_comes_at_once_is_not_called_converged_by_the_certificate_of_a_slow_one():
    """A line whose residual is rounded to 1e-5: there after one step, at 4.5e-6."""
    rng = np.random.default_rng(0)
    A, y = rng.normal(size=(40, 3)), rng.normal(size=40)
    found = solve(lambda x: (np.round(y - A @ x, 5), A), np.ones(3), move=np.add)
    assert (found.status, found.iterations) == (Status.STALLED, 1)
    assert 1e-6 < found.certificate < 1e-4


def test_certificate_is_the_angle_between_residual_and_tangent_plane():
    """By projection with numpy's own least squares instead of an orthonormal basis."""
    rng = np.random.default_rng(1)
    r, A = rng.normal(size=20), rng.normal(size=(20, 4)) * [1, 1e-3, 1e4, 1]
    inside = (A / [1, 1e-3, 1e4, 1]) @ np.linalg.lstsq(A / [1, 1e-3, 1e4, 1], r)[0]
    expected = np.sqrt((inside @ inside / 4) / ((r - inside) @ (r - inside) / 16))
    assert relative_offset(r, A) == pytest.approx(expected, rel=1e-12)
    assert relative_offset(1e-9 * r, A) == pytest.approx(1e-9 * np.linalg.norm(inside), rel=1e-12)


@pytest.mark.parametrize("apart", [1e-7, 1e-10])
def test_the_covariance_factor_of_columns_that_are_nearly_one_makes_them_orthonormal(apart):
    """A K has orthonormal columns, as K' A'A K = 1, to rounding times the condition."""
    A = np.random.default_rng(0).normal(size=(40, 4)) * [1.0, 1e3, 1e-3, 1.0]
    A[:, 3] = A[:, 0] + apart * A[:, 3]
    B = A @ covariance_factor(A)
    assert np.abs(B.T @ B - np.eye(4)).max() < 40 * 2.2e-16 / apart


def test_covariance_factor_inverts_the_normal_matrix():
    A = np.random.default_rng(2).normal(size=(20, 4)) * [1, 1e-3, 1e4, 1]
    K = covariance_factor(A)
    np.testing.assert_allclose(K @ K.T @ (A.T @ A), np.eye(4), atol=1e-6)  # units spread by 1e7


def correlated(condition):
    """Residual and four columns of that condition, each in units of its own."""
    rng = np.random.default_rng(3)
    U, V = (np.linalg.qr(rng.normal(size=shape))[0] for shape in ((30, 4), (4, 4)))
    A = (U * np.geomspace(1.0, 1 / condition, 4)) @ V * [1, 1e-3, 1e4, 1]
    return rng.normal(size=30), A


@pytest.mark.parametrize("radius", [np.inf, 0.3], ids=["plain", "damped"])
def test_normal_equations_lead_where_the_rows_do(radius):
    r, A = correlated(1e3)
    cheap, sure = normal_plane(System(r, A)), tangent_plane(r, A, column_norms(A))
    assert (cheap.orthogonal, sure.orthogonal) == (False, True)
    assert cheap.offset == pytest.approx(sure.offset, rel=1e-9)
    for here, there in zip(cheap.step(radius), sure.step(radius), strict=True):
        np.testing.assert_allclose(here, there, rtol=1e-8)


def test_normal_equations_are_left_where_they_lose_digits_or_fail():
    for condition in (1e7, 1e12):
        r, A = correlated(condition)
        assert normal_plane(System(r, A)).orthogonal
    assert normal_plane(System(r, A[:, [0, 0]])).deficient
    assert normal_plane(System(np.full(30, np.nan), A)) is None


def test_a_fit_is_certified_and_its_covariance_taken_from_the_rows_themselves():
    found = solve(valley, np.array([-1.2, 1.0]), move=np.add)
    assert found.end.orthogonal
    np.testing.assert_array_equal(found.factor, covariance_factor(found.jacobian))


def test_steps_into_the_undefined_are_taken_back():
    def evaluate(x):
        root = np.sqrt(x[0])  # nan left of zero, where the first full step leads
        return np.array([0.1 - root, 0.0]), np.array([[0.5 / root], [0.0]])

    solution = solve(evaluate, np.array([4.0]), move=np.add)
    assert solution.x[0] == pytest.approx(0.01, rel=1e-9)


def test_a_start_that_cannot_be_computed_is_refused():
    with pytest.raises(InputError, match="not finite at the start"):
        solve(lambda _: (np.array([np.nan]), np.ones((1, 1))), np.zeros(1), move=np.add)


def test_more_unknowns_than_rows_are_refused():
    with pytest.raises(InputError, match="1 rows for 2 unknowns"):
        solve(lambda _: (np.ones(1), np.ones((1, 2))), np.zeros(2), move=np.add)


def test_rounding_of_a_large_prediction_does_not_stall_the_fit():
    # 3e6 stands for 3 m in units of 1 um of noise: each residual is rounded by 5e-10, so the sum of
    # squares is level to 1e-11 only; judged by it alone, certificates ended at 2e-7
    t = np.linspace(0.0, 3.0, 100)
    for seed in range(40):
        noise = np.random.default_rng(seed).normal(size=100)
        seen = 3e6 + 1e4 * np.exp(-0.7 * t) * np.cos(2.0 * t) + noise

        def evaluate(x, seen=seen):
            a, b, w = x
            fading, wave = np.exp(-b * t), np.cos(w * t)
            A = np.stack(
                [fading * wave, -a * t * fading * wave, -a * t * fading * np.sin(w * t)], axis=1
            )
            return seen - (3e6 + a * fading * wave), A

        found = solve(evaluate, np.array([8e3, 0.5, 1.9]), move=lambda x, step: x + step)
        assert found.status is Status.CONVERGED
        assert found.certificate < 1e-8
