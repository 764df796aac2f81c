"""The robot that is handed out: the same poses as the one identified, and none lies nearer."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from testbed.identify.handback.least_moved import least_moved
from testbed.identify.handback.states import handed_robot
from testbed.robots.tolerances import usual_tolerances
from tests.calibrated import real, robot, sound
from tests.reference import pool_r

TOLERANCE = usual_tolerances(6)
FITS = [(sound, 0), (real, 0), (real, 1)]


def away(model):
    """Distance from nominal in tolerances, links alone."""
    return np.linalg.norm((model.chain.links - robot().model.chain.links) / TOLERANCE)


@pytest.mark.parametrize(("found", "k"), FITS)
def test_it_has_the_same_poses_and_lies_nearer_or_as_near(found, k):
    fit = found().fits[k]
    identified, handed = fit.identification.model, handed_robot(found(), fit).model
    q = pool_r(50, seed=3)
    # products of some twenty matrices of numbers below three
    np.testing.assert_allclose(handed.poses(q), identified.poses(q), atol=1e-13)
    assert away(handed) <= away(identified) * (1 + 1e-9)
    assert np.array_equal(handed.joint_errors.coefficients, identified.joint_errors.coefficients)


def test_no_robot_of_the_same_poses_lies_nearer():
    """Random steps, brought back to the same poses by another solver: none lies nearer."""
    handed = handed_robot(sound()).model
    q, near = pool_r(30, seed=4), away(handed)
    wanted, rng = handed.poses(q), np.random.default_rng(1)
    widths = np.concatenate([np.full(6, 1e-3), TOLERANCE.ravel(), np.full(6, 1e-3)])

    def lacks(step):
        return ((handed.moved(step).poses(q) - wanted)[:, :3]).ravel()

    for _ in range(3):
        start = widths * rng.normal(size=len(widths))
        found = least_squares(lacks, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        assert np.abs(found.fun).max() < 1e-9
        assert np.linalg.norm(found.x[6:36] / TOLERANCE.ravel()) > 0.1  # another robot indeed
        assert away(handed.moved(found.x)) >= near * (1 - 1e-9)


def test_what_two_numbers_share_is_split_by_their_tolerances():
    """d2 and d3 of parallel axes: their sum is known, and each takes by its variance."""
    fit = sound().fit.identification
    sum_moved = (fit.model.chain.links - robot().model.chain.links)[1:3, 1].sum()
    wide = TOLERANCE.copy()
    wide[1, 1] *= 2
    links = least_moved(robot().model.chain, fit, wide, robot().limits).model.chain.links
    d2, d3 = (links - robot().model.chain.links)[1:3, 1]
    # 0.1 deg between the axes leaves some 1e-3 of a shift to others
    assert d2 + d3 == pytest.approx(sum_moved, rel=5e-3)
    assert d2 / d3 == pytest.approx(4.0, rel=0.02)


def test_its_covariance_is_that_of_the_estimate_moved_the_same_way():
    """Poses scatter by it as they do by the covariance of the fit: J C J'."""
    fit = sound().fit.identification
    handed = least_moved(robot().model.chain, fit, TOLERANCE, robot().limits)
    q, spreads = pool_r(10, seed=5), []
    for model, C in ((fit.model, fit.full_covariance), (handed.model, handed.covariance)):
        _, J = model.poses_and_jacobian(q)
        spreads.append(J @ C @ np.swapaxes(J, 1, 2))
    # d3 stood for d2 and d3: each has half of its deviation, and theta1 is the base's again
    sd = dict(zip(fit.parameters.names, np.sqrt(np.diag(handed.covariance)), strict=True))
    u = dict(zip(fit.names, fit.standard_uncertainty, strict=True))
    assert sd["d2"] == pytest.approx(u["d3"] / 2, rel=0.01)
    assert sd["d3"] == pytest.approx(u["d3"] / 2, rel=0.01)
    assert sd["theta1"] == 0.0
    # the two sets of numbers differ by 1e-3 of a turn
    np.testing.assert_allclose(*spreads, atol=5e-3 * np.abs(spreads[0]).max())


def test_what_the_session_held_is_not_moved():
    fit = sound().fit.identification
    kept = [name for name in fit.reduction.kept if name not in ("d3", "base.z")]
    dropped = [name for name in fit.reduction.dropped if name not in ("d1", "d2")]
    held = replace(fit, reduction=replace(fit.reduction, kept=tuple(kept), dropped=tuple(dropped)))
    links = least_moved(robot().model.chain, held, TOLERANCE, robot().limits).model.chain.links
    np.testing.assert_array_equal(links[:3, 1], fit.model.chain.links[:3, 1])
