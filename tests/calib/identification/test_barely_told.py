"""A reflector on the axis of the last joint: what its readings barely tell, a weak prior holds."""

from functools import cache

import numpy as np
import pytest

import calib
from calib.geometry.parameters import parameters_of
from calib.identification.identify import Status, identify
from calib.identification.prior import Prior, weak_prior
from calib.identification.untold.barely_told import barely_told
from tests.calib.kinds import ARMS

SD = 9e-6
NOMINAL = calib.RobotModel(ARMS["tx60"])
STOPPED = (5, 8, 27, 33, 37)
"""Draws whose fit without a prior stops at the iteration limit."""


def drawn(seed, reflector=(0.0, 0.0, 0.0)):
    """A true robot near the nominal one, readings of a reflector, and the poses held out."""
    rng = np.random.default_rng(seed)
    wrong = rng.normal(size=(6, 5)) * [4e-4, 1e-4, 1e-4, 4e-4, 4e-4]
    true = calib.RobotModel(calib.Chain(NOMINAL.chain.links + wrong, NOMINAL.chain.kinds))
    q = rng.uniform(-1.6, 1.6, (60, 6))
    xyz = (true.poses(q) @ [*reflector, 1.0])[:, :3]
    seen = calib.points(q, xyz + rng.normal(scale=SD, size=xyz.shape), sd=SD)
    return true, *seen.split(held_out=20, seed=seed)


@cache
def calibrated(seed):
    """The result for a draw, and what is judged of it."""
    _, train, test = drawn(seed)
    result = calib.calibrate(NOMINAL, train)
    return result, result.judge(test)


def bare(result, *, prior=None):
    """The fit of all numbers again, with this prior or none."""
    start = result.start.model
    return identify(start, result.measured, parameters_of(start, start.names), prior=prior)


@pytest.mark.slow
@pytest.mark.parametrize("seed", STOPPED)
def test_a_reflector_on_the_last_axis_is_calibrated_and_judged(seed):
    result, judged = calibrated(seed)
    found = result.identification
    assert bare(result).status is Status.LIMIT
    assert found.status is Status.CONVERGED
    assert set(found.prior.names) == {"theta5", "d5", "a5", "alpha5", "beta5"}
    assert "barely tell theta5" in found.notes[-1]
    assert judged.point is not None
    # known no worse than believed; without the prior theta5 was told to 13 deg
    u = dict(zip(found.names, found.standard_uncertainty, strict=True))
    for name, sd in zip(found.prior.names, found.prior.sd, strict=True):
        assert u[name] <= sd * (1 + 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("seed", STOPPED[:2])
def test_the_answer_is_that_of_a_prior_on_all_links(seed):
    test, (result, _) = drawn(seed)[2], calibrated(seed)
    start = result.start.model
    links = parameters_of(start, start.names[6:36])
    other = bare(result, prior=weak_prior(links, start))
    assert other.status is Status.CONVERGED
    points = [model.poses(test.q)[:, :3, 3] for model in (result.model, other.model)]
    # what the prior adds to numbers that readings tell is (9 um / 0.6 mm)^2 of their step
    assert np.linalg.norm(points[0] - points[1], axis=1).max() < SD / 20


@pytest.mark.slow
def test_the_stated_radius_holds_the_true_tool_points():
    inside = []
    for seed in STOPPED:
        true, (result, judged) = drawn(seed)[0], calibrated(seed)
        radius = judged.point.radius_mean
        q = np.random.default_rng(1000 + seed).uniform(-1.6, 1.6, (200, 6))
        error = true.poses(q)[:, :3, 3] - result.model.poses(q)[:, :3, 3]
        inside.append(np.mean(np.linalg.norm(error, axis=1) <= radius))
    # 95 % are promised of each robot; of 60 draws the worst holds 96.5 %
    assert min(inside) > 0.95


def test_a_fit_that_converges_is_left_alone():
    _, train, _ = drawn(5, (0.05, 0.01, 0.08))
    result = calib.calibrate(NOMINAL, train)
    same = bare(result)
    assert result.identification.prior is None
    assert np.array_equal(result.identification.step, same.step)
    start = result.start.model
    assert barely_told(same, parameters_of(start, start.names), start) is None


def test_what_somebody_believes_already_is_not_believed_anew():
    _, train, _ = drawn(5)
    start = calib.calibrate(NOMINAL, train).start.model
    free = parameters_of(start, start.names)
    own = Prior(np.zeros(1), np.array([50.0]), ("theta5",))
    found = identify(start, train, free, prior=own)
    held = barely_told(found, free, start)
    assert held is not None
    assert "theta5" not in held.names
    assert own.joined(held).names[0] == "theta5"
