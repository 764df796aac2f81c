"""Robust losses: derivatives, the fixed point of reweighting, honest covariance, named outliers."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from calib.arrays import Array
from calib.errors import InputError
from calib.geometry.frames import exp_so3
from calib.geometry.parameters import parameters_of
from calib.identification.identify import Status, identify
from calib.identification.outliers.scores import inspect, outliers
from calib.identification.prior import prior_rows, weak_prior
from calib.identification.robust import flattened, loss_weights, mean_loss, sandwich_factor, sizes
from calib.measurement.observations import POINT, POSE, Measurements
from calib.measurement.residual import linearize
from tests.reference import DEG, WEN24, pool_r, rigid_truth, tx60
from tests.sandwich import sandwich
from tests.truth.measuring import measured

POOL = pool_r()
ROBUST = ("huber", "cauchy")


def wrong(table: Measurements, rows: Array, rng: np.random.Generator) -> Measurements:
    """Some rows off by normal errors of 0.5 mm and 0.1 deg per axis."""
    position, rotation = table.position.copy(), table.rotation.copy()
    position[rows] += rng.normal(size=(len(rows), 3)) * 5e-4
    rotation[rows] = exp_so3(rng.normal(size=(len(rows), 3)) * 0.1 * DEG) @ rotation[rows]
    return replace(table, position=position, rotation=rotation)


def spoiled(seed: int, m: int = 61) -> tuple[Measurements, Measurements, Array]:
    """A clean table, the same with three gross errors, and their rows."""
    rng = np.random.default_rng(seed)
    clean = measured(rigid_truth(rng), POOL[100 : 100 + m], rng)
    bad = rng.choice(m, 3, replace=False)
    return clean, wrong(clean, bad, rng), bad


@pytest.mark.parametrize(
    ("loss", "size", "weight", "value"),
    [
        ("squared", 3.0, 1.0, 9.0),
        ("huber", 1.4, 1.0, 1.96),
        ("huber", 3.0, 0.5, 2.25 + 3 * 1.5),
        ("cauchy", 2.0, 0.5, 4 * np.log(2)),
        ("cauchy", 6.0, 0.1, 4 * np.log(10)),
    ],
)
def test_weights_and_losses_are_those_worked_out_by_hand(loss, size, weight, value):
    """Huber min(1, 1.5/s), Cauchy 1/(1 + (s/2)^2); the losses are their integrals over s^2."""
    assert loss_weights(np.array([size]), loss)[0] == pytest.approx(weight, rel=1e-12)
    assert mean_loss(np.array([size]), loss)[0] == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize("loss", ROBUST)
def test_a_weight_is_the_slope_of_the_loss_over_the_square(loss):
    s = np.linspace(0.05, 40, 999)
    s = s[np.abs(s - 1.5) > 1e-3]
    h = 1e-6 * s**2
    up, down = mean_loss(np.sqrt(s**2 + h), loss), mean_loss(np.sqrt(s**2 - h), loss)
    np.testing.assert_allclose((up - down) / (2 * h), loss_weights(s, loss), rtol=1e-7)


def flattened_by_hand(r, loss):
    """One observation (k,) shortened to the root of its loss, in plain algebra (complex step)."""
    t = (r @ r) / len(r)
    if loss == "huber":
        value = t if t.real < 1.5**2 else 3 * np.sqrt(t) - 1.5**2
    else:
        value = 4 * np.log(1 + t / 4)
    return r * np.sqrt(value / t)


@pytest.mark.parametrize("loss", ROBUST)
def test_derivative_of_the_flattened_rows_is_exact(loss):
    """Complex step through an independent formula; poses and points, small and huge residuals."""
    rng = np.random.default_rng(1)
    row_of = np.repeat(np.arange(6), [6, 3, 6, 3, 6, 6])
    r = rng.normal(size=30) * np.repeat([0.01, 0.3, 1, 3, 30, 1e4], [6, 3, 6, 3, 6, 6])
    A = rng.normal(size=(30, 4))
    found, J = flattened(r, A, row_of, loss)
    h = 1e-30
    for k in range(4):
        moved = [flattened_by_hand((r - 1j * h * A[:, k])[row_of == j], loss) for j in range(6)]
        np.testing.assert_allclose(-np.concatenate(moved).imag / h, J[:, k], rtol=1e-10, atol=1e-13)
        # log(1 + x) by hand loses the digits that a small x has below 1
        np.testing.assert_allclose(np.concatenate(moved).real, found, rtol=1e-10)
    assert found @ found == pytest.approx(
        float(np.bincount(row_of) @ mean_loss(sizes(r, row_of), loss)), rel=1e-12
    )


@pytest.mark.parametrize("loss", ROBUST)
def test_a_perfect_observation_is_left_as_it_is(loss):
    A = np.arange(12.0).reshape(6, 2)
    r, J = flattened(np.zeros(6), A, np.zeros(6, dtype=np.int64), loss)
    np.testing.assert_array_equal(r, 0)
    np.testing.assert_array_equal(J, A)


@pytest.mark.parametrize("loss", ROBUST)
def test_the_answer_is_the_fixed_point_of_reweighting(loss):
    """Plain least squares with the final weights frozen, as noise that much larger, stays there."""
    _, table, _ = spoiled(2)
    parameters = parameters_of(tx60())
    found = identify(tx60(), table, parameters, loss=loss)
    wider = replace(table, covariance=table.covariance / found.weights[:, None, None])
    again = identify(tx60(), wider, parameters)
    assert np.abs((again.step - found.step) / found.standard_uncertainty).max() < 1e-6
    # the certificate is that of the robust loss: its gradient, in standard deviations
    stack = linearize(found.model, table)
    A = stack.A[:, found.parameters.free_index]
    pull = A.T @ (found.weights[stack.row_of] * stack.r)
    assert np.abs(pull * found.standard_uncertainty).max() < 1e-6
    assert found.status is Status.CONVERGED


@pytest.mark.parametrize("loss", ROBUST)
def test_the_answer_is_the_minimum_that_scipy_finds(loss):
    """Straight down the loss with a quasi-Newton method from another start."""
    _, table, _ = spoiled(3, 20)
    parameters = parameters_of(tx60(), WEN24)
    found = identify(tx60(), table, parameters, loss=loss)
    sd = found.standard_uncertainty
    start = found.model

    def value(y: Array) -> tuple[float, Array]:
        stack = linearize(start.moved(parameters.expand(y * sd)), table)
        size = sizes(stack.r, stack.row_of)
        w = loss_weights(size, loss)[stack.row_of]
        A = stack.A[:, parameters.free_index] * sd
        return 6 * float(mean_loss(size, loss).sum()), -2 * A.T @ (w * stack.r)

    away = np.random.default_rng(4).normal(size=24)
    theirs = minimize(value, away, jac=True, method="BFGS", options={"gtol": 1e-7})
    assert found.trace[-1] == pytest.approx(value(np.zeros(24))[0], rel=1e-12)
    np.testing.assert_allclose(theirs.x, 0, atol=1e-4)


@pytest.mark.parametrize("loss", ROBUST)
def test_the_loss_never_rises(loss):
    found = identify(tx60(), spoiled(5)[1], parameters_of(tx60()), loss=loss)
    assert (np.diff(found.trace) <= 1e-9 * found.trace[:-1]).all()
    assert len(found.weights) == 61
    assert ((found.weights > 0) & (found.weights <= 1)).all()


def test_a_clean_table_gives_nearly_the_plain_answer():
    clean, _, _ = spoiled(6)
    parameters = parameters_of(tx60())
    plain = identify(tx60(), clean, parameters)
    np.testing.assert_array_equal(plain.weights, np.ones(61))
    for loss in ROBUST:
        found = identify(tx60(), clean, parameters, loss=loss)
        # efficiency 99 %: the answers differ by a tenth of an sd
        shift = np.abs(found.step - plain.step) / plain.standard_uncertainty
        assert shift.max() < 0.5
        ratio = found.standard_uncertainty / plain.standard_uncertainty
        assert (ratio > 0.999).all()
        assert (ratio < 1.1).all()
        assert found.lack_of_fit is None


@pytest.mark.parametrize("loss", ROBUST)
def test_three_gross_errors_in_61_poses_are_found_named_and_do_no_harm(loss):
    goals = pool_r(300, seed=99)
    errors = []
    for seed in range(8):
        rng = np.random.default_rng([7, seed])
        truth = rigid_truth(rng)
        clean = measured(truth, POOL[100:161], rng)
        bad = rng.choice(61, 3, replace=False)
        table = replace(wrong(clean, bad, rng), pose_id=np.arange(100, 161))
        parameters, there = parameters_of(tx60()), truth.poses(goals)[:, :3, 3]
        row = []
        for seen, how in ((clean, "squared"), (table, "squared"), (table, loss)):
            found = identify(tx60(), seen, parameters, loss=how)
            gap = found.model.poses(goals)[:, :3, 3] - there
            row.append(float(np.linalg.norm(gap, axis=1).mean()))
        errors.append(row)
        named = inspect(tx60(), found, table).sentences(table)
        for j in bad:
            assert any(f"pose {100 + j} (row {j}) does not fit" in s for s in named)
            assert any(f"pose {100 + j} (row {j}) does not fit" in s for s in found.notes)
        # what is left fits; the three do not spoil the test of the others
        assert found.p_value > 1e-3
        assert found.dof == 6 * (61 - len(named)) - 30
    clean_error, plain, robust = np.median(errors, axis=0)
    assert plain > 3 * clean_error
    assert robust < 1.2 * clean_error


def test_many_misfits_are_the_models_fault():
    """A table of another robot's noise: two fifths of the poses wrong are not outliers."""
    rng = np.random.default_rng(8)
    clean = measured(rigid_truth(rng), POOL[:40], rng)
    table = wrong(clean, np.arange(0, 40, 2), rng)
    found = identify(tx60(), table, parameters_of(tx60(), WEN24), loss="cauchy")
    assert found.p_value < 1e-3
    assert any("too many for gross errors" in note for note in found.notes)
    assert any("do not believe the intervals" in note for note in found.notes)


def test_the_covariance_of_a_weighted_fit_is_the_sandwich():
    """Against the matrices of the covariance room, raw rows, with a prior."""
    rng = np.random.default_rng(9)
    J, weights = rng.normal(size=(12, 6, 5)), rng.uniform(0.1, 1, 12)
    scatter, prior = rng.uniform(1, 3, 12), rng.normal(size=(5, 5))
    K = sandwich_factor(J.reshape(72, 5), np.repeat(np.arange(12), 6), weights, scatter, prior)
    eye = np.broadcast_to(np.eye(6), (12, 6, 6))
    expected = sandwich(
        J,
        weights[:, None, None] * eye,
        scatter[:, None, None] ** 2 * eye,
        prior_precision=prior.T @ prior,
    )
    np.testing.assert_allclose(K @ K.T, expected, rtol=1e-10, atol=1e-14)


def test_gross_errors_scatter_as_they_are_seen_to_in_the_covariance():
    """Huber keeps a part of them: the sandwich written out, rows of the table in turn."""
    _, table, bad = spoiled(21, m=40)
    found = identify(tx60(), table, parameters_of(tx60(), WEN24), loss="huber")
    at = linearize(found.model, table)
    A = at.A[:, [found.model.names.index(name) for name in found.names]]
    H, moved, blank = np.zeros((24, 24)), np.zeros((24, 24)), np.zeros((24, 24))
    suspect = inspect(tx60(), found, table).suspect
    assert set(bad) <= set(np.flatnonzero(suspect))
    for k, (rows, r) in enumerate(zip(A.reshape(40, 6, 24), at.r.reshape(40, 6), strict=True)):
        size = float(np.sqrt(np.mean(r**2)))
        weight = min(1.0, 1.5 / size)
        H += weight * rows.T @ rows
        blank += weight**2 * rows.T @ rows
        moved += (weight * (size if suspect[k] else 1.0)) ** 2 * rows.T @ rows
    wanted, as_stated = (np.linalg.solve(H, np.linalg.solve(H, M).T) for M in (moved, blank))
    u = np.sqrt(np.diag(wanted))
    # both by normal equations, of a condition whose square leaves nine digits
    np.testing.assert_allclose(
        found.covariance / np.outer(u, u), wanted / np.outer(u, u), atol=1e-9
    )
    assert (np.diag(wanted) > 1.02 * np.diag(as_stated)).any()


@pytest.mark.parametrize("with_prior", [False, True], ids=["data alone", "prior"])
@pytest.mark.parametrize("points", [False, True], ids=["poses", "poses and points"])
def test_outlier_score_is_what_the_fit_gains_without_the_observation(points, with_prior):
    """Leave one out for real, the prior kept: the linear fit redone without it."""
    rng = np.random.default_rng(13)
    table = measured(tx60(), POOL[:14], rng)
    if points:
        table = replace(table, kind=np.where(np.arange(14) % 2 == 0, POSE, POINT))
    parameters, model = parameters_of(tx60(), WEN24), tx60()
    stack = linearize(model, table)
    A = stack.A[:, parameters.free_index] * 1e-4
    prior = np.zeros((0, 24))
    if with_prior:
        rows = prior_rows(weak_prior(parameters), model, parameters).at(model)[1]
        prior = rows[:, parameters.free_index] * 1e-4 * 30  # tight enough to matter

    def best(keep: Array) -> Array:
        rows = np.concatenate([A[keep], prior])
        return np.linalg.lstsq(rows, np.concatenate([stack.r[keep], np.zeros(len(prior))]))[0]

    def cost(keep: Array) -> float:
        x = best(keep)
        return float(np.sum((stack.r[keep] - A[keep] @ x) ** 2) + np.sum((prior @ x) ** 2))

    everything = np.ones(len(A), dtype=bool)
    at_end = stack.r - A @ best(everything)
    lost = [cost(everything) - cost(stack.row_of != j) for j in range(14)]
    found = outliers(at_end, A, stack.row_of, prior=prior if with_prior else None)
    np.testing.assert_allclose(found.score, lost, rtol=1e-6)


def test_an_observation_of_no_weight_is_judged_by_the_others_alone():
    """Its score is its distance from the prediction of a fit that never saw it."""
    rng = np.random.default_rng(14)
    row_of, A = np.repeat(np.arange(9), 6), rng.normal(size=(54, 7))
    r0, weights = rng.normal(size=54), np.ones(9)
    weights[4] = 1e-12
    rest, own = row_of != 4, row_of == 4
    x = np.linalg.lstsq(A[rest], r0[rest])[0]
    gap = r0[own] - A[own] @ x
    spread = np.eye(6) + A[own] @ np.linalg.solve(A[rest].T @ A[rest], A[own].T)
    found = outliers(r0 - A @ x, A, row_of, weights=weights)
    assert found.score[4] == pytest.approx(float(gap @ np.linalg.solve(spread, gap)), rel=1e-9)
    equal = outliers(r0, A, row_of, weights=np.ones(9))
    np.testing.assert_allclose(equal.score, outliers(r0, A, row_of).score, rtol=1e-9)


def test_a_repeated_pose_is_named_with_its_visit():
    rng = np.random.default_rng(15)
    truth = rigid_truth(rng)
    table = measured(truth, np.tile(POOL[:20], (2, 1)), rng)
    table = replace(table, pose_id=np.tile(np.arange(20), 2), repeat=np.repeat([0, 1], 20))
    found = identify(tx60(), wrong(table, np.array([27]), rng), parameters_of(tx60()), loss="huber")
    assert any(s.startswith("pose 7 at visit 1 (row 27) does not fit") for s in found.notes)


def test_a_robust_fit_under_a_prior_counts_both():
    clean, table, bad = spoiled(16)
    parameters = parameters_of(tx60())
    prior = weak_prior(parameters)
    found = identify(tx60(), table, parameters, prior=prior, loss="cauchy")
    plain = identify(tx60(), clean, parameters, prior=prior)
    assert found.status is Status.CONVERGED
    assert found.rank == 42
    gap = np.abs(found.step - plain.step) / plain.standard_uncertainty
    # redundant numbers are held by the prior alone; the others by 58 of 61 poses
    assert gap.max() < 3
    named = inspect(tx60(), found, table)
    assert set(bad) <= set(np.flatnonzero(named.suspect))
    assert np.isfinite(found.log_evidence)


def test_unknown_losses_and_robust_paper_mode_are_refused():
    table, parameters = spoiled(17)[0], parameters_of(tx60(), WEN24)
    with pytest.raises(InputError, match="squared, huber, cauchy") as caught:
        identify(tx60(), table, parameters, loss="tukey")
    assert (caught.value.code, caught.value.field) == ("A3", "loss")
    with pytest.raises(InputError, match='use the mode "whitened"') as caught:
        identify(tx60(), table, parameters, mode="paper", loss="huber")
    assert caught.value.field == "loss"
    paper = identify(tx60(), table, parameters, mode="paper")
    with pytest.raises(InputError, match="ignores the noise") as caught:
        inspect(tx60(), paper, table)
    assert caught.value.field == "result"
