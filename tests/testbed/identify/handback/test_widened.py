"""An arm far from nominal, read coarsely: the prior of its links is widened, and that is said."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib.geometry.frames import step_transform
from calib.geometry.model import RobotModel
from calib.measurement import tables
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.handback.states import hand_back_warnings
from testbed.robots.tolerances import usual_tolerances
from tests.calibrated import BASE, TOOL, robot, session_of
from tests.reference import DEG, pool_r

COARSE = 3e-4
"""Standard deviation of a camera's readings [m]."""


def truth(seed, mm=3.0, deg=0.5):
    """A TX60 whose link numbers have errors of this standard deviation."""
    rng, chain = np.random.default_rng(seed), robot().model.chain
    sd = np.array([deg * DEG, mm / 1e3, mm / 1e3, deg * DEG, deg * DEG])
    links = chain.links + sd * rng.standard_normal(chain.links.shape)
    placed = {"T_world_base": step_transform(BASE), "T_flange_tool": step_transform(TOOL)}
    return RobotModel(replace(chain, links=links, **placed))


def session(seed, **changes):
    """Fifty points of it, the noise as stated."""
    q = pool_r(50, seed=seed)
    noise = COARSE * np.random.default_rng(seed).standard_normal((50, 3))
    seen = truth(seed).poses(q)[:, :3, 3] + noise
    return session_of(tables.points(q, seen, sd=COARSE), model="choose", **changes)


@cache
def found(seed):
    return calibrate(robot(), session(seed), Options(train=25, seed=seed))


def missed(calibration, seed):
    """Errors at fresh poses [m]."""
    q = pool_r(50, seed=500 + seed)
    gap = calibration.fit.identification.model.poses(q) - truth(seed).poses(q)
    return np.linalg.norm(gap[:, :3, 3], axis=1)


@pytest.mark.parametrize("seed", [0, 1, pytest.param(2, marks=pytest.mark.study)])
def test_an_arm_far_from_nominal_is_found_to_the_noise_and_stated_so(seed):
    """Under the usual prior they were missed by 0.45, 0.52 and 0.92 mm, and now by 0.30 to 0.34."""
    calibration = found(seed)
    errors, radius = missed(calibration, seed), calibration.proof.point.radius_mean
    assert calibration.handback.widened
    # 25 poses of 0.3 mm per axis, 27 numbers: 0.3 mm sqrt(3 * 27 / 75) = 0.31 mm on average
    assert errors.mean() < 0.42e-3
    assert (errors <= radius).mean() >= 0.9
    assert radius < 3e-3


def test_the_report_says_how_wide_it_is_and_what_asked_for_that():
    text = next(text for text in hand_back_warnings(found(0)) if text.startswith("the links "))
    assert "(wider than usual, as the measurements ask: log evidence +" in text
    assert np.all(found(0).handback.tolerance >= usual_tolerances(6))
    assert np.any(found(0).handback.tolerance >= 2 * usual_tolerances(6))


def test_what_the_session_or_the_robot_states_is_never_widened():
    for arm, table in (
        (robot(), session(0, link_sd=usual_tolerances(6))),
        (replace(robot(), tolerances=usual_tolerances(6)), session(0)),
    ):
        calibration = calibrate(arm, table, Options(train=25, seed=0))
        assert not calibration.handback.widened
        np.testing.assert_array_equal(calibration.handback.tolerance, usual_tolerances(6))
