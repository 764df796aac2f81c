"""One radius for people: what it holds, at poses drawn like those stated, by Monte Carlo."""

from dataclasses import replace

import numpy as np
import pytest

from calib.identification.identify import identify
from calib.measurement.observations import joined
from calib.measurement.prediction import predict
from calib.uncertainty.circumstances import Circumstances, measured_noise
from calib.uncertainty.proven_belief import stated_radius
from calib.uncertainty.regions import coverage_factor
from calib.uncertainty.statement.applicability import REFUSED, proven_at
from calib.uncertainty.statement.believe import believe
from calib.uncertainty.statement.distance import distance_radius
from calib.uncertainty.statement.left_out import left_out_covariance, left_out_growth
from calib.uncertainty.statement.stated_point import (
    StatedPoint,
    common_radius,
    stated_point,
    widened,
)
from calib.uncertainty.tool_point import ToolStatement
from tests.calib.uncertainty.statement.test_belief import campaign


def statement(S, factor=None, probability=0.95):
    """Regions of covariances S (N, 3, 3) about the origin."""
    factor = coverage_factor(3, probability) if factor is None else factor
    return ToolStatement(np.zeros((len(S), 3)), S, factor, probability)


def test_one_pose_has_the_radius_of_its_own():
    S = np.diag([16.0, 9.0, 4.0])[None] * 1e-12
    # the specification's number, in um
    assert 1e6 * common_radius(statement(S)) == pytest.approx(9.013, abs=5e-4)
    assert common_radius(statement(np.repeat(S, 4, axis=0))) == pytest.approx(
        distance_radius(S)[0], rel=1e-6
    )
    double = statement(S, factor=2 * coverage_factor(3))
    assert common_radius(double) == pytest.approx(2 * distance_radius(S)[0], rel=1e-6)


@pytest.mark.parametrize("probability", [0.8, 0.95])
def test_the_common_radius_holds_points_at_poses_that_differ(probability):
    rng = np.random.default_rng(1)
    root = rng.normal(size=(30, 3, 3)) * rng.lognormal(size=(30, 1, 1)) * 1e-5
    stated = statement(root @ np.swapaxes(root, 1, 2), 3.1, probability)
    radius = common_radius(stated)
    draws = 20_000
    roots = np.linalg.cholesky(widened(stated))
    e = np.einsum("nij,nkj->nki", roots, rng.normal(size=(30, draws, 3)))
    inside = (np.linalg.norm(e, axis=2) <= radius).mean()
    # 600,000 draws: standard error 3e-4 to 6e-4
    assert inside == pytest.approx(probability, abs=4 * np.sqrt(0.25 / (30 * draws)))


def test_words_and_figures_of_a_robot():
    _, fit, train, held_out = campaign(np.random.default_rng(1), 15e-6)
    belief = believe(fit, train, held_out)
    target = np.array([0.05, 0.0, 0.1])
    point = stated_point(belief, held_out.q, target=target, held_out=True)
    regions = belief.regions(held_out.q, target=target)
    u = np.sqrt(np.trace(widened(regions), axis1=1, axis2=2))
    assert point.u_mean == pytest.approx(np.sqrt((u**2).mean()), rel=1e-12)
    # between a line and a ball of that size: 1.96 and 1.614 standard uncertainties
    assert 1.55 * point.u_mean < point.radius_mean < 1.97 * point.u_mean
    assert "95 % probability (3-D radius, poses like the 20 held out)" in point.sentence
    assert point.move_sentence == ""
    move = stated_point(
        belief, held_out.q, target=target, held_out=True, repeatability=np.full(6, 40e-6),
        told_by="repeats",
    )  # fmt: skip
    assert move.u_mean == point.u_mean
    assert move.u_move > np.sqrt(point.u_mean**2 + (20e-6) ** 2)
    assert "repeats" in move.move_sentence


@pytest.mark.parametrize(
    ("radius", "said"),
    [
        (2.5e-5, "25.0 um"), (2.503e-5, "25.0 um"), (5e-7, "0.500 um"), (9.996e-6, "10.0 um"),
        (9.996e-5, "100 um"), (1.234e-4, "123 um"), (9.994e-4, "999 um"), (9.997e-4, "1.00 mm"),
        (2.3456e-3, "2.35 mm"), (0.0341, "34.1 mm"),
    ],
)  # fmt: skip
def test_a_radius_has_three_digits_whether_or_not_the_last_is_a_zero(radius, said):
    point = StatedPoint(radius / 2, radius, radius / 2, radius, 0.95, 20, True, "repeats")
    assert f"lies within {said} of" in point.sentence
    assert f"ends within {said} of" in point.move_sentence


def test_held_out_poses_beyond_the_radius_too_often_for_chance_widen_it():
    _, fit, train, held_out = campaign(np.random.default_rng(1), 15e-6)
    belief = believe(fit, train, held_out)
    more = {"target": np.zeros(3), "held_out": True}
    plain = stated_point(belief, held_out.q, **more)
    guarded = stated_point(belief, held_out.q, **more, measured=held_out)
    assert guarded.radius_mean == plain.radius_mean
    # of seventeen within, one by chance beyond too, the chance is .0755; of fifteen .0026
    away = np.array([10 * plain.radius_mean, 0.0, 0.0])
    for count, grows in ((2, False), (5, True)):
        far = np.where(np.arange(20)[:, None] < count, away, 0.0)
        off = replace(held_out, position=held_out.position + far)
        found = stated_point(belief, held_out.q, **more, measured=off)
        assert (found.radius_mean > plain.radius_mean) == grows
    missed = np.sort(np.linalg.norm(predict(belief.model, off).residual[:, :3], axis=1))
    # all of twenty have to be within; noise is a small part of what they missed by
    assert 0.5 * missed[-1] < found.radius_mean < missed[-1]
    # several rows of a pose count once, and all that is said of the point grows alike
    both = stated_point(belief, held_out.q, **more, measured=joined([off, off]))
    assert both.radius_mean == pytest.approx(found.radius_mean, rel=1e-9)
    assert found.u_mean / plain.u_mean == pytest.approx(found.radius_mean / plain.radius_mean)
    moves = stated_point(belief, held_out.q, **more, measured=off, repeatability=np.full(6, 4e-5))
    one = stated_point(belief, held_out.q, **more, repeatability=np.full(6, 4e-5))
    assert moves.radius_move / one.radius_move == pytest.approx(
        moves.radius_mean / one.radius_mean, rel=1e-12
    )


def test_a_radius_that_held_out_errors_widen_is_their_quantile_less_the_noise():
    """By the 39th of 40 errors, and three standard deviations of the noise taken off in squares."""
    _, fit, train, held_out = campaign(np.random.default_rng(7), 0.0, n=40)
    belief = believe(fit, train, held_out)
    more = {"target": np.zeros(3), "held_out": True}
    plain = stated_point(belief, held_out.q, **more)
    # each of ten moved by an amount of its own, far beyond a noise twenty times as large
    steps = np.where(np.arange(40) < 10, 100.0 + 10.0 * np.arange(40), 0.0)
    away = steps[:, None] * np.array([plain.radius_mean, 0.0, 0.0])
    off = replace(held_out, position=held_out.position + away, covariance=400 * held_out.covariance)
    found = stated_point(belief, held_out.q, **more, measured=off)
    missed = np.sort(np.linalg.norm(predict(belief.model, off).residual[:, :3], axis=1))
    variance = np.trace(off.covariance[:, :3, :3], axis1=1, axis2=2).mean() / 3
    expected = np.sqrt(missed[38] ** 2 - coverage_factor(3) ** 2 * variance)
    assert found.radius_mean == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("m", "most"), [(10, 1.6), (20, 1.25), (40, 1.12)])
def test_without_held_out_poses_the_radius_is_that_of_further_poses_like_those_identified_from(
    m, most
):
    """Numbers follow the noise of their own poses: against many other poses, drawn alike."""
    alone, stated, further = [], [], []
    for robot in range(16):
        _, fit, train, others = campaign(np.random.default_rng([robot, 77]), 0.0, m=m, n=200)
        belief = believe(fit, train)
        belief = replace(belief, misfit=replace(belief.misfit, upper=0.0))  # the noise alone
        nothing, known = others.rows([]), Circumstances()
        quiet = measured_noise(fit.model, train, nothing, known)
        found = stated_radius(belief, fit, train, nothing, None, known, quiet)
        plain = {"target": (0.0, 0.0, 0.0), "held_out": False}
        stated.append(found.u_mean**2)
        alone.append(stated_point(belief, train.q, **plain).u_mean ** 2)
        further.append(stated_point(belief, others.q, **plain).u_mean ** 2)
    # a pose left out leaves one less to identify from: never too small, soon not much too large
    assert 1.0 < np.mean(stated) / np.mean(further) < most
    assert np.mean(alone) / np.mean(further) < 0.9


def test_what_a_pose_adds_is_what_is_missing_without_it():
    """Against an identification from all other poses, and what is proven by it."""
    _, fit, train, _ = campaign(np.random.default_rng(5), 0.0, m=16)
    proven = proven_at(fit, train, train.q)
    growth = left_out_growth(fit, train, proven)
    _, J = fit.model.poses_and_jacobian(train.q)
    more = left_out_covariance(fit, train, J[:, :3])
    again = identify(fit.model, train.rows(train.pose_id != 3), fit.parameters)
    there = J[train.pose_id == 3][0, :3]
    grown = there @ (again.full_covariance - fit.full_covariance) @ there.T
    # each is linearized where its own fit ends
    np.testing.assert_allclose(more[3], grown, rtol=0, atol=1e-3 * np.abs(grown).max())
    left = proven_at(again, train.rows(train.pose_id != 3), train.q).left(train.q[3:4])
    larger = float((left[:2, 0] / proven.usual[:2]).max())
    assert growth[3] == pytest.approx(min(larger, REFUSED), rel=1e-3)
    assert 1 < growth[3] < REFUSED


def test_a_misfit_grows_at_poses_left_out_as_it_does_at_others_drawn_alike():
    """By what no number holds, whatever was read; robots are the unit."""
    ratios, further = [], []
    for robot in range(6):
        _, fit, train, others = campaign(np.random.default_rng([robot, 78]), 0.0, m=30, n=200)
        proven = proven_at(fit, train, train.q)
        there = np.minimum(proven.applies(others.q).growth, REFUSED)
        ratios.append(left_out_growth(fit, train, proven).mean() / there.mean())
        further.append(there.mean())
    assert np.mean(further) > 1.5  # at the poses themselves it is one
    # heavy tails: robots of one kind scatter by a fifth
    assert abs(np.mean(ratios) - 1) < 3 * np.std(ratios, ddof=1) / np.sqrt(len(ratios))
