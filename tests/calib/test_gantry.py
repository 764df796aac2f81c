"""A robot whose joints all slide: calibrated and judged as arms are, alone and among many."""

from dataclasses import replace

import numpy as np
import pytest

import calib
from calib.geometry.chain import Chain
from calib.uncertainty.circumstances import Circumstances
from calib.uncertainty.many.judgements import judge_many
from calib.uncertainty.many.sights import alike
from calib.uncertainty.statement.applicability import lacking
from calib.uncertainty.statement.places import PLACES
from tests.calib.kinds import NOISE, OFFSET, points, poses
from tests.reference import DEG

SLIDES = ("prismatic",) * 3
SQUARE = [[0, 0, 0, 90 * DEG, 0], [90 * DEG, 0, 0, 90 * DEG, 0], [0, 0.1, 0, 0, 0]]
TURNED = [
    [0, 0.3, 0.1, 90 * DEG, 0],
    [100 * DEG, 0.1, 0.05, 80 * DEG, 0],
    [6 * DEG, 0.1, 0.02, 17 * DEG, 0],
]
"""Slides that stand ten degrees off their right angles, beside each other, the last one turned."""
GANTRIES = [calib.RobotModel(Chain(links, SLIDES)) for links in (SQUARE, TURNED)]
M, N = 35, 25


def bent(q, size, phase):
    """How far (m, 3) rails that are not straight move the tool [m]."""
    return size * np.cos(7 * q + phase)


def campaign(model, see, robot, size):
    """The true robot, its rails, and what was measured of them: to identify from, and held out."""
    rng = np.random.default_rng([robot, 3])
    true, phase = model.moved(3e-4 * rng.normal(size=model.n_numbers)), rng.uniform(0, 6, 3)
    q = rng.uniform(0, 1, (M + N, 3))
    table = see(true, q, rng)
    table = replace(table, position=table.position + bent(q, size, phase))
    return true, phase, table.rows(np.arange(M)), table.rows(np.arange(M, M + N)), rng


@pytest.mark.slow
@pytest.mark.parametrize(
    ("size", "see", "model", "robots"),
    [
        pytest.param(size, see, model, 24 if whole else 8, marks=[pytest.mark.study] * whole)
        for whole in (False, True)
        for size in (1.0, 3.0)
        for see in (poses, points)
        for model in GANTRIES
        # of the eight a half in which each level of one meets each of another
        if whole or (size == 3.0) ^ (see is poses) ^ (model is GANTRIES[1])
    ],
)
def test_the_region_of_a_gantry_holds_the_true_points(size, see, model, robots):
    """Of rails that bend by the noise, and by three times that."""
    held, radius, inside = [], [], []
    target = (0.0, 0.0, 0.0) if see is poses else OFFSET
    for robot in range(robots):
        true, phase, train, test, rng = campaign(model, see, robot, size * NOISE)
        judged = calib.calibrate(model, train).judge(test)
        assert judged.trust.believe == "region"
        q = rng.uniform(0, 1, (100, 3))
        T = true.poses(q)
        there = T[:, :3, 3] + T[:, :3, :3] @ np.array(target) + bent(q, size * NOISE, phase)
        held.append(judged.belief.regions(q, target=target).holds(there).mean())
        radius.append(judged.point.radius_mean)
        inside.append((judged.belief.proven.applies(q).place == PLACES[0]).mean())
    # the robot is the unit; 95 % promised
    assert np.mean(held) >= 0.95
    # at most twice the radius of who knows the links and the size of these waves
    assert np.mean(radius) <= 2 * 2.7955 * size * NOISE / np.sqrt(2)
    # targets are drawn as the held-out poses were: only the corners are at the edge
    assert np.mean(inside) > 0.8


def test_a_gantry_has_no_joint_error_beyond_it_and_its_foot_may_yield():
    model = GANTRIES[1]
    assert lacking(model).names == model.names
    *_, train, test, rng = campaign(model, poses, 0, 0.0)
    proven = calib.calibrate(model, train).judge(test).belief.proven
    assert proven.usual[0] == 0
    q = rng.uniform(0, 1, (50, 3))
    reach = proven.applies(q)
    np.testing.assert_array_equal(reach.transfer, proven.left(q)[1] / proven.usual[1])
    assert reach.transfer.max() > 1
    assert (proven.applies(q + 5.0).place == "outside").all()


def test_gantries_among_many_are_judged_as_alone():
    """To 1e-9: the same sums in another order."""
    model, found = GANTRIES[1], [campaign(GANTRIES[1], poses, k, NOISE) for k in range(4)]
    trains, tests = [one[2] for one in found], [one[3] for one in found]
    fits = [calib.calibrate(model, train).identification for train in trains]
    keys = {alike(*one, 0.95) for one in zip(fits, trains, tests, strict=True)}
    assert len(keys) == 1
    assert None not in keys
    q = np.random.default_rng(1).uniform(-0.1, 1.1, (8, 3))
    together = judge_many(fits, trains, tests, [q] * 4)
    assert not together.alone.any()
    for k, (fit, train, test) in enumerate(zip(fits, trains, tests, strict=True)):
        # many robots are always judged in the order of their rows
        known = Circumstances(order=(np.arange(M), M + np.arange(N)))
        one = calib.judge(fit, test, train=train, circumstances=known).belief
        reach, stated = one.proven.applies(q), one.regions(q)
        np.testing.assert_allclose(together.applies[k].transfer, reach.transfer, rtol=1e-9)
        np.testing.assert_allclose(together.applies[k].leverage, reach.leverage, rtol=1e-9)
        np.testing.assert_array_equal(together.applies[k].beyond, reach.beyond)
        assert together.factor[k] == pytest.approx(stated.factor, rel=1e-9)
        size = np.linalg.norm(stated.covariance, axis=(1, 2))[:, None, None]
        np.testing.assert_allclose(
            together.believed[k] / size, stated.covariance / size, rtol=0, atol=1e-9
        )
