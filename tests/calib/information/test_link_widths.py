"""Widths of the prior of links: wider where an arm is far from nominal, else as given."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.frames import step_transform
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.climbing import ASKED
from calib.identification.folds import parts_of
from calib.identification.identify import identify
from calib.identification.ladders import ladders_of
from calib.identification.link_widths import USUAL, link_widths
from calib.identification.prior import Prior, weak_prior
from calib.measurement import tables
from calib.measurement.residual import linearize
from tests.reference import DEG, SIGMA_POSITION, pool_r, tx60

PARAMETERS = parameters_of(tx60())
PRIOR = weak_prior(PARAMETERS)
LINKS = PARAMETERS.names[6:36]


def arm(seed, mm, deg):
    """A TX60 whose lengths and angles have errors of this standard deviation."""
    rng, chain = np.random.default_rng(seed), tx60().chain
    sd = np.array([deg * DEG, mm / 1e3, mm / 1e3, deg * DEG, deg * DEG])
    links = chain.links + sd * rng.standard_normal(chain.links.shape)
    tool = step_transform(np.array([1e-3, -5e-4, 2e-4, 0, 0, 0]))
    return RobotModel(replace(chain, links=links, T_flange_tool=tool))


def points(truth, seed, poses=30, noise=1.0):
    """Readings of one point, with `noise` times the stated scatter."""
    q = pool_r(poses, seed=seed)
    rng = np.random.default_rng(seed)
    seen = truth.poses(q)[:, :3, 3] + noise * SIGMA_POSITION * rng.standard_normal((poses, 3))
    return tables.points(q, seen, sd=SIGMA_POSITION)


def log_density(y, A, s):
    """Of y ~ N(0, s^2 1 + A A')."""
    C = s**2 * np.eye(len(y)) + A @ A.T
    return -(np.linalg.slogdet(C)[1] + y @ np.linalg.solve(C, y)) / 2


def found_of(table, prior=PRIOR):
    near = identify(tx60(), table, PARAMETERS, prior=prior).model
    part = parts_of(table, np.random.default_rng(0))
    return link_widths(
        tx60(), near, table, PARAMETERS, ladders_of(tx60()), part, prior=prior, links=LINKS
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("noise", [1.0, 3.0])
def test_links_as_an_arm_usually_has_them_keep_the_usual_widths(seed, noise):
    assert found_of(points(arm(seed, 0.3, 0.05), seed, noise=noise)) == USUAL
    assert found_of(points(arm(seed, 0.6, 0.1), seed, noise=noise)) == USUAL


@pytest.mark.parametrize("seed", range(3))
def test_links_several_times_further_from_nominal_widen_it_to_about_that(seed):
    found = found_of(points(arm(seed, 3.0, 0.5), seed, poses=60))
    assert found.widened
    assert found.gain > ASKED
    # 22 angles and lengths that one point tells: their scatter is known to a fifth, steps are of 2
    assert found.angle in (2, 4, 8)
    assert found.length in (1, 2, 4, 8)


def test_a_prior_of_the_right_width_is_not_widened_again():
    table = points(arm(1, 3.0, 0.5), 1, poses=60)
    wide = np.where(np.isin(PRIOR.names, LINKS), 5.0, 1.0)
    assert found_of(table, Prior(PRIOR.mean, PRIOR.sd * wide, PRIOR.names)) == USUAL


def test_nothing_is_widened_without_poses_to_leave_out():
    assert found_of(points(arm(1, 3.0, 0.5), 1, poses=19)) == USUAL


def test_the_gain_is_the_ratio_of_whole_evidences_written_out():
    """One matrix of all readings, C = s^2 I + A Lambda^-1 A', for both widths, without springs."""
    table = points(arm(2, 3.0, 0.5), 2)
    near = identify(tx60(), table, PARAMETERS, prior=PRIOR).model
    found = link_widths(
        tx60(), near, table, PARAMETERS, (), parts_of(table, np.random.default_rng(0)),
        prior=PRIOR, links=LINKS,
    )  # fmt: skip
    assert found.widened
    whole = []
    for width in (USUAL, found):
        size = np.where(PARAMETERS.is_length, width.length, width.angle)
        sd = np.where(np.isin(PARAMETERS.names, LINKS), PRIOR.sd * size, PRIOR.sd)
        stack = linearize(near, table)
        y = stack.r + stack.A @ tx60().step_to(near)
        whole.append(max(log_density(y, stack.A * sd, s) for s in np.geomspace(1, 100, 400)))
    # the noise is that of effective degrees of freedom, which is that of most evidence nearly
    assert found.gain == pytest.approx(whole[1] - whole[0], abs=0.5)
