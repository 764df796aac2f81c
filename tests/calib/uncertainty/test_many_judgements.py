"""Judgements of many robots at once: each is the judgement of that robot alone."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.identification.ladders import ladders_of
from calib.identification.model_choice import extended_by, identify_extended
from calib.identification.prior import weak_prior
from calib.uncertainty.judgement import Circumstances, judge
from calib.uncertainty.many import sights as seeing
from calib.uncertainty.many.gains import gain_of_rows
from calib.uncertainty.many.judgements import judge_many
from calib.uncertainty.many.sights import alike
from calib.uncertainty.statement.applicability import lacking
from calib.uncertainty.tool_point import tool_statement
from tests.calib import kinds

TX60 = RobotModel(kinds.ARMS["tx60"])
LADDER = ladders_of(TX60)[0]
M, N, T = 29, 24, 6
ORDER = np.arange(M), M + np.arange(N)
REMEMBERS, STANDS_ELSEWHERE, COUNT = 1, 3, 5
"""Robots with noise that remembers, and with held-out rows in another frame."""


def robot(k):
    """Robot k, wrong in its geometry and by waves of half the noise: tables, and targets."""
    rng = np.random.default_rng(50 + k)
    true = TX60.moved(3e-4 * np.random.default_rng(k).normal(size=TX60.n_numbers))
    q = kinds.joints("tx60", rng, M + N)
    table = kinds.poses(true, q, rng)
    wave = kinds.NOISE * k / 2 * np.cos(3 * q[:, :3] + k)
    slow = rng.normal(size=(M + N, 3))
    for row in range(1, M + N):
        slow[row] = 0.8 * slow[row - 1] + 0.6 * slow[row]
    slow *= 1.5 * kinds.NOISE * (k == REMEMBERS)
    # noise of no round shape, another one in each row
    root = np.eye(3) + 0.5 * rng.normal(size=(M + N, 3, 3)) / np.sqrt(3)
    covariance = table.covariance.copy()
    covariance[:, :3, :3] = root @ covariance[:, :3, :3] @ np.swapaxes(root, 1, 2)
    moved = table.position + wave + slow
    table = replace(table, position=moved, covariance=covariance)
    train, test = table.rows(ORDER[0]), table.rows(ORDER[1])
    if k == STANDS_ELSEWHERE:
        test = replace(test, position=test.position + 40 * kinds.NOISE)
    return train, test, kinds.joints("tx60", rng, T)


def fitted(train, model):
    """Geometry alone, or with joint terms or springs under their prior."""
    parameters = parameters_of(TX60)
    if model == "terms":
        return identify_extended(TX60, train, parameters)
    if model == "geometry":
        return identify(TX60, train, parameters)
    levels = [next(level for level in LADDER.levels if level.name == model)]
    return extended_by(TX60, train, parameters, levels, prior=weak_prior(parameters))[1]


@pytest.mark.slow
@pytest.mark.parametrize(
    "model",
    [
        "geometry",
        "terms",
        pytest.param("springs", marks=pytest.mark.study),
        "sag and bearings on a tilted base",
    ],
)
def test_of_many_each_is_judged_as_alone(model, monkeypatch):
    """To 1e-9: the same sums in another order, of covariances of condition 1e6."""
    monkeypatch.delattr(seeing, "_of_one")  # nothing is left to one robot after the other
    trains, tests, targets = zip(*map(robot, range(COUNT)), strict=True)
    fits = [fitted(train, model) for train in trains]
    keys = {alike(*one, 0.95) for one in zip(fits, trains, tests, strict=True)}
    assert len(keys) == 1
    assert None not in keys
    found = judge_many(fits, trains, tests, targets)
    assert np.flatnonzero(found.alone).tolist() == [STANDS_ELSEWHERE]
    drifted = []
    for k, (fit, train, test, q) in enumerate(zip(fits, trains, tests, targets, strict=True)):
        one = judge(fit, test, train=train, circumstances=Circumstances(order=ORDER))
        drifted.append(one.drifting.drift is not None)
        near = {"rtol": 1e-9, "atol": 0.0}
        np.testing.assert_allclose(found.held_out_p[k], one.held_out.p_value, **near)
        np.testing.assert_allclose(found.conformal[k], one.conformal.radius, **near)
        size = np.abs(one.discrepancy.covariance).max() + 1e-12
        np.testing.assert_allclose(
            found.discrepancy[k] / size, one.discrepancy.covariance / size, atol=1e-9
        )
        bare = tool_statement(fit.model, q, fit.full_covariance)
        np.testing.assert_allclose(found.position[k], bare.position, rtol=0, atol=1e-14)
        of_axes = found.bare[k] / np.linalg.norm(bare.covariance, axis=(1, 2))[:, None, None]
        plain = bare.covariance / np.linalg.norm(bare.covariance, axis=(1, 2))[:, None, None]
        np.testing.assert_allclose(of_axes, plain, rtol=0, atol=1e-9)
        if k == STANDS_ELSEWHERE:
            assert one.frame.found
            continue
        assert not one.frame.found
        assert found.drift_p[k] == pytest.approx(one.drifting.p_value, nan_ok=True)
        applies, stated = one.belief.proven.applies(q), one.belief.regions(q)
        np.testing.assert_allclose(found.applies[k].transfer, applies.transfer, **near)
        np.testing.assert_allclose(found.applies[k].leverage, applies.leverage, **near)
        np.testing.assert_array_equal(found.applies[k].beyond, applies.beyond)
        np.testing.assert_allclose(found.factor[k], stated.factor, **near)
        size = np.linalg.norm(stated.covariance, axis=(1, 2))[:, None, None]
        np.testing.assert_allclose(
            found.believed[k] / size, stated.covariance / size, rtol=0, atol=1e-9
        )
    assert drifted[REMEMBERS]
    assert not all(drifted)


def test_a_steady_drift_that_sorted_poses_hide_is_in_the_region_of_each_as_alone():
    """To 1e-9, as above; robots of the same poses, sorted by the first joint over both tables."""
    rng = np.random.default_rng(7)
    q = kinds.joints("tx60", rng, M + N)
    q = q[np.argsort(q[:, 0])]
    trains, tests = [], []
    for k in range(2):
        true = TX60.moved(3e-4 * np.random.default_rng(k).normal(size=TX60.n_numbers))
        table = kinds.poses(true, q, rng)
        slow = k * 10 * kinds.NOISE * np.linspace(-0.5, 0.5, M + N)[:, None] * [0.5, 1.0, 0.2]
        table = replace(table, position=table.position + slow)
        trains.append(table.rows(ORDER[0]))
        tests.append(table.rows(ORDER[1]))
    targets = [kinds.joints("tx60", rng, T)] * 2
    fits = [fitted(train, "geometry") for train in trains]
    found = judge_many(fits, trains, tests, targets)
    asked = 0
    for k, (fit, train, test) in enumerate(zip(fits, trains, tests, strict=True)):
        one = judge(fit, test, train=train, circumstances=Circumstances(order=ORDER))
        assert one.drifting.void
        if found.alone[k]:
            continue
        asked += 1
        assert one.drifting.steady is not None
        stated = one.belief.regions(targets[k])
        size = np.linalg.norm(stated.covariance, axis=(1, 2))[:, None, None]
        np.testing.assert_allclose(
            found.believed[k] / size, stated.covariance / size, rtol=0, atol=1e-9
        )
    assert asked


def test_what_is_no_plain_table_goes_alone():
    train, test, _ = robot(0)
    fit = fitted(train, "geometry")
    assert alike(fit, train, test, 0.95) is not None
    assert alike(fit, train, test, 0.99) is None  # too few held-out poses for that radius
    again = replace(test, pose_id=np.repeat(np.arange(N // 2), 2))
    assert alike(fit, train, again, 0.95) is None
    bent = fitted(train, "springs")
    springs = bent.model.joint_errors.springs
    own = replace(springs, weight=replace(springs.weight, payload=(1.0, 0.0, 0.0, 0.0)))
    other = replace(bent.model, joint_errors=replace(bent.model.joint_errors, springs=own))
    loaded = alike(replace(bent, model=other), train, test, 0.95)
    assert alike(bent, train, test, 0.95) != loaded
    robust = identify(TX60, train, parameters_of(TX60), loss="huber")
    assert alike(robust, train, test, 0.95) is None


def test_robots_that_lack_other_springs_do_not_go_together():
    """Gravity turns the first joint of an arm only where that is found off the vertical."""
    arm, rng = RobotModel(kinds.ARMS["iiwa"]), np.random.default_rng(7)
    train, test = (kinds.poses(arm, kinds.joints("iiwa", rng, m), rng) for m in (M, N))
    leaning = identify(arm, train, parameters_of(arm))
    upright = replace(leaning, model=arm)
    springs = [{*lacking(fit.model).names} for fit in (leaning, upright)]
    assert springs[0] - springs[1] == {"spring1.z"}
    assert alike(leaning, train, test, 0.95) != alike(upright, train, test, 0.95)


def test_springs_that_models_lack_are_those_of_each():
    """Of an arm whose sag no waves are: they weigh the links that were identified."""
    arm, rng = RobotModel(kinds.ARMS["iiwa"]), np.random.default_rng(6)
    fits, tables = [], []
    for _ in range(2):
        true = arm.moved(3e-3 * rng.normal(size=arm.n_numbers))
        tables.append(kinds.poses(true, kinds.joints("iiwa", rng, M), rng))
        fits.append(identify(arm, tables[-1], parameters_of(arm)))
    targets = [kinds.joints("iiwa", rng, T) for _ in fits]
    given = fits, tables, tables, targets
    both, second = seeing.sights(*given), seeing.sights(*(one[1:] for one in given))
    assert any(name.startswith("spring") for name in lacking(arm).names)
    for one, other in ((both.train, second.train), (both.there, second.there)):
        np.testing.assert_array_equal(one.unheld[1], other.unheld[0])


def test_no_bit_of_a_judgement_hangs_on_the_others():
    trains, tests, targets = zip(*map(robot, range(3)), strict=True)
    given = [fitted(train, "terms") for train in trains], trains, tests, targets
    together = judge_many(*given)
    parts = [judge_many(*(one[some] for one in given)) for some in (slice(1), slice(1, None))]
    for name in ("held_out_p", "conformal", "discrepancy", "bare", "believed", "factor", "drift_p"):
        both = np.concatenate([getattr(part, name) for part in parts])
        np.testing.assert_array_equal(getattr(together, name), both)


@pytest.mark.parametrize("f", [20, 60])
@pytest.mark.parametrize("independent", [True, False])
def test_estimates_of_few_and_of_many_numbers_follow_their_rows(f, independent):
    """By numbers, and where these are more than the rows, by rows."""
    rng, R, m = np.random.default_rng(7), 2, 6
    A, root = rng.normal(size=(R, m, 6, f)), np.eye(6) + rng.normal(size=(R, m, 6, 6)) / 5
    N, shape = root @ np.swapaxes(root, 2, 3), np.diag(rng.uniform(1, 9, f))
    if not independent:
        shape = shape + 0.1 * np.ones((f, f))
    found = gain_of_rows(A, N, np.tile(shape, (R, 1, 1)))
    for k in range(R):
        rows, W = A[k].reshape(6 * m, f), np.zeros((6 * m, 6 * m))
        for j in range(m):
            W[6 * j : 6 * j + 6, 6 * j : 6 * j + 6] = np.linalg.solve(N[k, j], np.eye(6))
        plain = np.linalg.solve(rows.T @ W @ rows + shape, rows.T @ W)
        np.testing.assert_allclose(found[k], plain, rtol=0, atol=1e-13)
