"""Whether linear propagation holds at the tool point: first order against Monte Carlo."""

from dataclasses import replace

import numpy as np

from calib.arrays import Array
from calib.geometry.frames import exp_so3
from calib.geometry.jacobian import reflector_rows
from calib.geometry.model import RobotModel
from calib.identification.identify import Identification
from calib.measurement.observations import Measurements
from calib.uncertainty.adaptive import adaptive, fewest_draws
from calib.uncertainty.bootstrap import UNSETTLED
from calib.uncertainty.covariance import correlated_draws
from calib.uncertainty.sprung import valley
from calib.uncertainty.tool_point import propagate, tool_statement
from calib.uncertainty.validation import LinearCheck, validate
from testbed.studies.trial.statement.records import LEVEL

FLAT = 1e-9
"""Fraction of the largest variance below which a direction does not scatter."""
DIGITS = 1
"""Digits of a stated uncertainty that linear propagation must get right; each more takes a hundred
times the draws."""


def linear_check(
    result: Identification,
    measurements: Measurements,
    q: Array,
    target: Array,
    rng: np.random.Generator,
) -> tuple[LinearCheck, int]:
    """First-order propagation against Monte Carlo, at the posture with the largest stated u.

    Numbers are drawn from their covariance. If springs share information of the measurements, they
    are drawn by virtual calibrations of `measurements` instead.

    References
    ----------
    JCGM 102:2011, clause 8.
    """
    covariance = result.full_covariance
    linear = tool_statement(result.model, q, covariance, target=target)
    worst = int(np.argmax(linear.point))
    there = q[worst : worst + 1]
    axes = moving_axes(linear.covariance[worst])
    sigma = axes.T @ linear.covariance[worst] @ axes
    springs, late = result.model.joint_errors.springs, 0
    sprung = None if springs is None else valley(result, measurements)
    slopes = reflector_rows(*result.model.poses_and_jacobian(there), target[None])[1][0]

    def sample(count: int, rng: np.random.Generator) -> Array:
        """Points of the target under moved models."""
        nonlocal late
        steps = correlated_draws(covariance, count, rng)
        if sprung is None:
            return np.asarray(moved_targets(result.model, there, steps, target)[:, 0] @ axes)
        found = sprung.settled(steps, rng)
        late += found.late
        along = steps @ slopes.T @ axes
        exact = moved_targets(result.model, there, found.steps, target)[:, 0] @ axes
        return np.asarray(exact - along + matched(along, sigma))

    batch = None if sprung is None else fewest_draws(LEVEL)
    played = adaptive(sample, rng, digits=DIGITS, probability=LEVEL, finer=5.0, batch=batch)
    check = validate(linear.position[worst] @ axes, sigma, played, digits=DIGITS)
    share = float((check.differences / check.tolerance).max())
    draws = "Monte Carlo draws" if sprung is None else "virtual calibrations"
    sentence = (
        f"first-order propagation is {check.outcome}: against {played.draws} {draws} at "
        f"the held-out pose with the largest uncertainty, means, uncertainties and region differ "
        f"by at most {share:.2g} of what JCGM 101 allows for {DIGITS} digit of u"
    )
    if late > UNSETTLED * played.draws:
        check = replace(check, outcome="not validated")
        sentence = f"{late} of {played.draws} virtual calibrations did not settle"
    return replace(check, sentence=sentence), worst


def matched(along: Array, sigma: Array) -> Array:
    """The linear part (M, k) of draws, adjusted to its exact mean and covariance (k, k).

    These are known without draws, so that only the nonlinear part has sampling scatter.
    """
    own = np.linalg.cholesky(np.cov(along, rowvar=False).reshape(sigma.shape))
    white = np.linalg.solve(own, (along - along.mean(axis=0)).T)
    return np.asarray((np.linalg.cholesky(sigma) @ white).T)


def moved_targets(model: RobotModel, q: Array, steps: Array, target: Array) -> Array:
    """Points (M, N, 3) of a target (3,) on the tool under M moved models [m].

    A tool frame that moves by t and turns by R takes the target to t + R target in the old frame,
    which is the tool point of a frame that moves by as much.
    """
    if target.any():
        end, steps = model.chain.n_numbers, steps.copy()
        steps[:, end - 6 : end - 3] += exp_so3(steps[:, end - 3 : end]) @ target
    return propagate(model, q, steps)


def moving_axes(covariance: Array) -> Array:
    """Directions (3, k) in which a point scatters: world axes unless it stays in a plane."""
    values, vectors = np.linalg.eigh(covariance)
    flat = values <= FLAT * values[-1]
    return np.eye(3) if not flat.any() else np.asarray(vectors[:, ~flat])
