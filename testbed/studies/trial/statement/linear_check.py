"""Whether linear propagation holds at the tool point: first order against Monte Carlo."""

from dataclasses import replace

import numpy as np

from calib.arrays import Array
from calib.geometry.frames import exp_so3
from calib.geometry.model import RobotModel
from calib.identification.identify import Identification
from calib.uncertainty.adaptive import adaptive
from calib.uncertainty.covariance import correlated_draws
from calib.uncertainty.tool_point import propagate, tool_statement
from calib.uncertainty.validation import LinearCheck, validate
from testbed.studies.trial.statement.records import LEVEL

FLAT = 1e-9
"""Part of the largest variance below which a direction does not scatter: few numbers are free."""
DIGITS = 1
"""Digits of a stated uncertainty that linear propagation must get right; each more takes a hundred
times the draws."""


def linear_check(
    result: Identification, q: Array, target: Array, rng: np.random.Generator
) -> tuple[LinearCheck, int]:
    """First-order propagation against Monte Carlo, at the posture with the largest stated u.

    References
    ----------
    JCGM 102:2011, clause 8.
    """
    covariance = result.full_covariance
    linear = tool_statement(result.model, q, covariance, target=target)
    worst = int(np.argmax(linear.point))
    there = q[worst : worst + 1]

    def sample(count: int, rng: np.random.Generator) -> Array:
        """Points of the target under moved models."""
        steps = correlated_draws(covariance, count, rng)
        return moved_targets(result.model, there, steps, target)[:, 0] @ axes

    axes = moving_axes(linear.covariance[worst])
    played = adaptive(sample, rng, digits=DIGITS, probability=LEVEL, finer=5.0)
    sigma = axes.T @ linear.covariance[worst] @ axes
    check = validate(linear.position[worst] @ axes, sigma, played, digits=DIGITS)
    share = float((check.differences / check.tolerance).max())
    sentence = (
        f"first-order propagation is {check.outcome}: against {played.draws} Monte Carlo draws at "
        f"the held-out pose with the largest uncertainty, means, uncertainties and region differ "
        f"by at most {share:.2g} of what {DIGITS} digit of u allows"
    )
    return replace(check, sentence=sentence), worst


def moved_targets(model: RobotModel, q: Array, steps: Array, target: Array) -> Array:
    """Points (M, N, 3) of a target (3,) on the tool under M moved models [m].

    A tool frame that moves by t and turns by R carries the target to t + R target in the old frame:
    the tool point of a frame that moves by that much.
    """
    if target.any():
        end, steps = model.chain.n_numbers, steps.copy()
        steps[:, end - 6 : end - 3] += exp_so3(steps[:, end - 3 : end]) @ target
    return propagate(model, q, steps)


def moving_axes(covariance: Array) -> Array:
    """Directions (3, k) in which a point scatters at all: world axes unless it lies in a plane."""
    values, vectors = np.linalg.eigh(covariance)
    flat = values <= FLAT * values[-1]
    return np.eye(3) if not flat.any() else np.asarray(vectors[:, ~flat])
