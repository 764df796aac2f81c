"""Virtual calibrations of models that the loops over replicates do not know: fitted one by one.

Arms that give way, lengths that follow the temperature, distances, several stations and free
fixtures: each replicate is a table of its own, and its fit the one of `identify`.
"""

from dataclasses import replace

import numpy as np

from calib.arrays import Array, frozen
from calib.geometry.frames import exp_so3
from calib.geometry.model import RobotModel
from calib.identification.least_squares import Status, solve
from calib.identification.prior import step_derivative
from calib.measurement.observations import Measurements
from calib.measurement.residual import linearize, table_whiteners
from calib.uncertainty.covariance import covariance_factor
from calib.uncertainty.refit import Frozen, Refits

MOST_STEPS = 100
"""Of each fit."""


def fitted_one_by_one(start: Frozen, normal: Array, center: Array) -> Refits:
    """Fits to the plan with noise, each from the model to where no step helps any more.

    Parameters
    ----------
    start : Frozen
        Model, plan, prior.
    normal : (K, m, 6) array
        Standard normal noise of every row.
    center : (K, f) array
        Where the prior of each replicate has its center, as a step from the model [m, rad].
    """
    found = [_fitted(start, *one) for one in zip(normal, center, strict=True)]
    steps, chi_square, last = zip(*found, strict=True)
    return Refits(frozen(np.array(steps)), frozen(chi_square), frozen(last))


def _fitted(start: Frozen, normal: Array, center: Array) -> tuple[Array, float, float]:
    """Step (f,), whitened sum of squares, and 0 where the fit arrived, else infinity."""
    model, free = start.model, start.parameters.free_index
    table = with_noise(start, normal)
    whitening, root = table_whiteners(table), covariance_factor(start.prior).T

    def evaluate(here: RobotModel) -> tuple[Array, Array]:
        stack, step = linearize(here, table, whitening=whitening), model.step_to(here)
        rows = root @ step_derivative(step, here)[np.ix_(free, free)]
        return (
            np.concatenate([stack.r, root @ (center - step[free])]),
            np.vstack([stack.A[:, free], rows]),
        )

    solution = solve(
        evaluate, model, move=lambda here, step: here.moved(start.parameters.expand(step)),
        most=MOST_STEPS,
    )  # fmt: skip
    left = solution.residual[: start.n_rows]
    arrived = solution.status is Status.CONVERGED
    return model.step_to(solution.x)[free], float(left @ left), 0.0 if arrived else np.inf


def with_noise(start: Frozen, normal: Array) -> Measurements:
    """The plan as it would be read with standard normal noise (m, 6) of its covariances."""
    plan = start.measurements
    noise = (start.factor @ normal[:, :, None])[:, :, 0]
    far = plan.is_distance
    return replace(
        plan,
        position=np.where(far[:, None], plan.position, plan.position + noise[:, :3]),
        rotation=exp_so3(noise[:, 3:]) @ plan.rotation,
        distance=np.where(far, plan.distance + noise[:, 0], plan.distance),
    )
