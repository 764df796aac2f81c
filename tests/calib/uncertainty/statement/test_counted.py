"""Held-out errors, counted: against the binomial law, the definition of a region, and the truth."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, chi2

from calib.uncertainty.judgement import Circumstances, judge
from calib.uncertainty.many.judgements import judge_many
from calib.uncertainty.regions import mahalanobis_squared
from calib.uncertainty.statement.believe import believe
from calib.uncertainty.statement.counted import CONFIDENCE, counted, counted_rank, enclosing_sizes
from tests.calib import kinds
from tests.calib.uncertainty.statement.test_belief import campaign


@pytest.fixture(scope="module")
def shot_wrong():
    """A robot that bends, its fit and rows; of a hundred held-out shots one is wrong by 1 mm."""
    rng = np.random.default_rng(7)
    true, fit, train, held_out = campaign(rng, 15e-6, m=50, n=100)
    seen = held_out.position.copy()
    seen[40] += [6e-4, -8e-4, 0]
    return true, fit, train, held_out, replace(held_out, position=seen)


def test_the_error_at_the_rank_bounds_the_share_with_the_stated_confidence_and_none_before_it():
    for n in (59, 92, 93, 124, 400):
        rank = counted_rank(n)
        # fewer than r of n errors are below the quantile: then the r-th is above it
        assert binom.cdf(rank - 1, n, 0.95) >= CONFIDENCE > binom.cdf(rank - 2, n, 0.95)
    assert [counted_rank(n) for n in (0, 1, 58)] == [0, 0, 0]
    assert counted_rank(59) == 59
    assert counted_rank(22, 0.9) == 0 < counted_rank(29, 0.9)


def test_the_smallest_region_around_an_error_has_it_on_its_edge():
    rng = np.random.default_rng(3)
    A = rng.normal(size=(2, 40, 3, 3))
    known, hidden = A @ np.swapaxes(A, 2, 3)
    errors = rng.normal(size=(40, 3)) * np.geomspace(0.1, 30, 40)[:, None]
    size = enclosing_sizes(errors, known, hidden)
    S, square = known + size[:, None, None] ** 2 * hidden, chi2.ppf(0.95, 3)
    of_ellipsoid = mahalanobis_squared(errors, S) / square
    of_ball = 3 * (errors**2).sum(axis=1) / np.trace(S, axis1=1, axis2=2) / square
    needed = np.maximum(of_ellipsoid, of_ball)
    assert needed.max() <= 1 + 1e-9
    # 40 halvings of the largest variance that is tried
    np.testing.assert_allclose(needed[size > 1e-3], 1, atol=1e-6)
    assert 5 < (size > 1e-3).sum() < 40


def test_a_wrong_shot_among_a_hundred_held_out_poses_does_not_widen_the_region(shot_wrong):
    true, fit, train, held_out, shot = shot_wrong
    calm, found = judge(fit, held_out, train=train), judge(fit, shot, train=train)
    likely = believe(fit, train, shot)
    # the likelihood takes one shot for a misfit of all poses
    assert likely.misfit.upper > 3 * calm.belief.misfit.upper
    assert found.belief.misfit.upper < likely.misfit.upper / 2
    # 99 of 100 errors are held, by a region that is not shaped like them
    assert found.point.radius_mean < 1.5 * np.sort(found.held_out.distance)[-2]
    assert "counting the held-out errors shows" in found.summary()
    assert "counting" not in calm.summary()
    q = kinds.joints("tx60", np.random.default_rng(8), 200)
    assert found.belief.regions(q).holds(true.poses(q)[:, :3, 3]).mean() >= 0.95


def test_what_all_readings_share_leaves_the_counted_misfit_as_it_is(shot_wrong):
    """No held-out error shows it, and room for it is none for a misfit: 92 % were held, not 95."""
    _, fit, train, _, shot = shot_wrong
    P = fit.model.n_numbers
    shared = np.diag(np.where(np.arange(P) < 3, 100e-6, 0.0) ** 2)  # of the place of the base
    alone, both = (
        judge(fit, shot, train=train, circumstances=Circumstances(shared=S)).belief
        for S in (None, shared)
    )
    assert both.misfit.upper == pytest.approx(alone.misfit.upper, rel=1e-9)


def test_held_out_poses_that_are_few_or_designed_bound_nothing_by_their_number(shot_wrong):
    _, fit, train, _, shot = shot_wrong
    few = shot.rows(np.arange(58))
    for belief, rows in (
        (believe(fit, train, few), few),
        (believe(fit, train, shot, drawn=False), shot),
        (believe(fit, train), None),
    ):
        assert counted(belief, rows) is belief


def test_of_many_robots_each_is_counted_as_alone(shot_wrong):
    """To 1e-9, as all else; see `test_many_judgements`."""
    _, fit, train, held_out, shot = shot_wrong
    q, m, n = train.q[:2], len(train), len(shot)
    found = judge_many([fit] * 2, [train] * 2, [held_out, shot], [q] * 2)
    assert not found.alone.any()
    for k, test in enumerate((held_out, shot)):
        ordered = Circumstances(order=(np.arange(m), m + np.arange(n)))
        one = judge(fit, test, train=train, circumstances=ordered).belief.regions(q)
        assert found.factor[k] == pytest.approx(one.factor, rel=1e-9)
        size = np.linalg.norm(one.covariance, axis=(1, 2))[:, None, None]
        np.testing.assert_allclose(found.believed[k] / size, one.covariance / size, atol=1e-9)
