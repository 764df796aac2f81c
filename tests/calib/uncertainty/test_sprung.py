"""Virtual calibrations of arms that give way, against the fits that they stand for."""

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from calib.arrays import Array
from calib.geometry.felt_springs import Felt
from calib.geometry.frames import exp_so3
from calib.geometry.gravity import weight_of
from calib.geometry.joint_errors import JointErrors
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import Identification, identify
from calib.identification.prior import Prior, weak_prior
from calib.measurement.observations import Measurements
from calib.measurement.prediction import perfect
from calib.measurement.residual import linearize
from calib.measurement.tables import poses
from calib.uncertainty.covariance import correlated_draws
from calib.uncertainty.sprung import valley
from calib.uncertainty.tool_point import propagate, tool_statement
from tests.calib.geometry.test_springs import ALL
from tests.reference import SIGMA_POSITION, SIGMA_ROTATION, WEN24, pool_r, tx60

SOFT = 1e-3
"""Bends of the joints at the largest torque [rad]."""


@dataclass
class Told:
    """Stands for a generator: the noise that it draws is told."""

    noise: Array

    def standard_normal(self, shape: tuple[int, int]) -> Array:
        assert self.noise.shape == shape
        return self.noise


@cache
def calibrated() -> tuple[Identification, Measurements]:
    """A soft arm and 40 poses without noise: the fit is the arm that was measured."""
    chain = tx60().chain
    springs, _ = Felt.of(weight_of(chain), ALL).springs(("z",), free_moments=True)
    numbers = np.zeros(len(springs.names))
    numbers[: len(springs.load)] = SOFT
    arm = RobotModel(chain, JointErrors((), numbers, springs))
    q = pool_r(40)
    table = poses(q, arm.poses(q), sd=(SIGMA_POSITION, SIGMA_ROTATION))
    # what holds links alone bends geometry as well, by some tenths of u
    free = parameters_of(arm, (*WEN24, *springs.names))
    return identify(arm, table, free, prior=weak_prior(free, arm)), table


def test_a_virtual_calibration_is_the_fit_to_its_measurements():
    """Fits to noise whose linear estimate and rest are known, products by differences of slopes."""
    fit, table = calibrated()
    model, names, rng = fit.model, fit.names, np.random.default_rng(1)
    plan, free, f = perfect(model, table), fit.parameters.free_index, fit.rank
    A, U = linearize(model, plan).A[:, free], np.diag(1 / fit.prior.sd)
    springs = model.joint_errors.springs
    first, p = names.index("spring2.z"), len(springs.load)
    moments = range(first + p, f)
    B = np.stack([slope_change(model, plan, free, k)[:, first : first + p] for k in moments], 2)
    rows = np.vstack([A, U])
    beside = np.vstack([B.reshape(len(A), -1), np.zeros((f, p * len(moments)))])
    across = beside - rows @ np.linalg.lstsq(rows, beside, rcond=None)[0]
    found = valley(fit, table)
    assert found.springs == (p, len(moments))
    told = found.factor[f:, f:]
    u = tool_statement(model, table.q, fit.full_covariance).point
    e = 2 * rng.standard_normal(len(rows))  # more than usual: what is not linear grows with e'e
    linear = np.linalg.lstsq(rows, e, rcond=None)[0]
    rest = np.linalg.lstsq(told.T, across.T @ (e - rows @ linear), rcond=None)[0]
    start = np.zeros((1, model.n_numbers))
    start[0, free] = linear
    step = found.settled(start, Told(rest[None])).steps[0]
    again = identify(
        model, noisy(plan, e[: len(A)]), fit.parameters,
        prior=Prior(fit.prior.sd * e[len(A) :], fit.prior.sd, names),
    )  # fmt: skip
    places = propagate(model, table.q, [start[0], step, fit.parameters.expand(again.step)])
    off = np.linalg.norm(places[:2] - places[2], axis=2) / u
    # its last step was 0.01 sd; geometry is linear to some hundredths
    assert off[1].max() < 0.04
    assert off[0].max() > 1


def slope_change(model: RobotModel, plan: Measurements, free: Any, k: int) -> Array:
    """Derivative of the whitened columns by a free number, by differences."""
    e = np.zeros(model.n_numbers)
    e[free[k]] = 0.01  # kg or kg m: bends are linear in it
    ahead, behind = (linearize(model.moved(side * e), plan).A[:, free] for side in (1, -1))
    return (ahead - behind) / 0.02


def noisy(plan: Measurements, e: Array) -> Measurements:
    """The table with whitened noise (6 m,) added to it."""
    noise = (np.linalg.cholesky(plan.covariance) @ e.reshape(-1, 6, 1))[..., 0]
    return replace(
        plan, position=plan.position + noise[:, :3], rotation=exp_so3(noise[:, 3:]) @ plan.rotation
    )


def test_calibrations_scatter_at_the_tool_as_linear_propagation_says_and_draws_do_not():
    fit, table = calibrated()
    q, rng = table.q[:8], np.random.default_rng(2)
    stated = tool_statement(fit.model, q, fit.full_covariance)
    draws = correlated_draws(fit.full_covariance, 1000, rng)
    found = valley(fit, table).settled(draws, rng)
    assert found.late <= 10
    ratio = []
    for steps in (found.steps, draws):
        away = propagate(fit.model, q, steps) - stated.position
        ratio.append(np.sqrt(np.square(away).sum(axis=2).mean(axis=0)) / stated.point)
    # an rms of 1000 draws of three directions is known to about 2 %
    assert np.abs(ratio[0] - 1).max() < 0.08
    assert ratio[1].mean() > 1.5


@pytest.mark.parametrize("free", [("spring2.z", "spring3.z"), ("moment3.hx", "moment4.m"), ()])
def test_without_products_there_is_no_valley(free):
    fit, table = calibrated()
    found = replace(fit, parameters=fit.parameters.freeing((*fit.names[:6], *free)))
    assert valley(found, table) is None
