"""One number for people: the radius around a predicted tool point, and with what probability."""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import bdtr

from calib.arrays import LATER, Array, FloatOrNan, frozen
from calib.geometry.operating import AS_USUAL, OperatingConditions
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.measurement.tool_target import ToolTarget
from calib.shown import length_words
from calib.uncertainty.regions import coverage_factor
from calib.uncertainty.statement.belief import Belief
from calib.uncertainty.statement.distance import radius_over
from calib.uncertainty.tool_point import ToolStatement

IN_DATUM = ", in the frame that fits the tool points best"
"""Where a radius is stated that no reading ties to the base."""
CHANCE = 0.05
"""Chance of so few held-out poses within the radius below which they widen it."""


@dataclass(frozen=True, slots=True)
class StatedPoint:
    """How near the true tool point lies at poses drawn like n given ones."""

    u_mean: float
    """3-D standard uncertainty of the mean of many moves, root mean square over the poses [m]."""
    radius_mean: float
    """Radius that holds it with `probability` [m]."""
    u_move: FloatOrNan
    """The same of where one move ends; nan where nothing tells how well joints come back [m]."""
    radius_move: FloatOrNan
    probability: float
    n_poses: int
    held_out: bool
    """Whether the poses were held out, else identified from."""
    move_told_by: str
    """What tells how well joints come back; empty where nothing does."""
    relative: Annotated[bool, LATER] = False
    """Whether points are stated to each other, in the frame that fits them best: none is shown."""

    @property
    def sentence(self) -> str:
        """Of the mean of many moves, in words."""
        radius = length_words(self.radius_mean, um="#.3g")
        return (
            f"the mean tool point lies within {radius} of the predicted one "
            f"with {100 * self.probability:g} % probability (3-D radius, poses like the "
            f"{self.n_poses} {'held out' if self.held_out else 'identified from'})"
            + IN_DATUM
            * self.relative
        )

    @property
    def move_sentence(self) -> str:
        """Of one move, in words; empty where nothing is known of it."""
        if np.isnan(self.radius_move):
            return ""
        radius = length_words(self.radius_move, um="#.3g")
        return (
            f"a single move ends within {radius} of it, with the same probability "
            f"(joint repeatability: {self.move_told_by})"
        )


def stated_point(
    belief: Belief,
    q: Array,
    *,
    target: ArrayLike | ToolTarget,
    held_out: bool,
    repeatability: Array | None = None,
    told_by: str = "",
    measured: Measurements | None = None,
    visits: bool = False,
    at: OperatingConditions = AS_USUAL,
    unseen: Array | None = None,
    growth: Array | None = None,
) -> StatedPoint:
    """What is believed at poses like q (n, j), as one radius.

    The regions are normal, errors need not be: where held-out poses lie beyond the radius more
    often than chance allows, it grows until as many of them as promised are within.

    Parameters
    ----------
    belief : Belief
        Of the identified robot.
    q : (n, j) array
        Postures [rad, m].
    target : (3,) array_like or ToolTarget
        Point in the tool frame that is stated [m], or a reflector of the model.
    held_out : bool
        Whether these poses were held out.
    repeatability : (j,) array, optional
        Standard deviation with which each joint comes back [rad, m].
    told_by : str
        What tells it.
    measured : Measurements, optional
        Readings of points at these poses that guard the radius.
    visits : bool
        Whether they were read in frames of their own: then they guard the radius there, and it
        grows here as it does there.
    at : OperatingConditions, optional
        Under which the robot stands there.
    unseen : (n, 3, 3) array, optional
        What further poses like these have more than these, which were identified from [m^2].
    growth : (n,) array, optional
        Of the misfit's variance at further poses like these; by default that at these.
    """
    if growth is None:
        growth = belief.proven.applies(q, at).growth
    known = repeatability is not None and repeatability.any()
    mean, move = belief.mean_and_move(
        q, target=target, growth=growth, repeatability=repeatability if known else None, at=at
    )
    if unseen is not None:
        mean = replace(mean, covariance=frozen(mean.covariance + unseen))
        move = move and replace(move, covariance=frozen(move.covariance + unseen))
    u_move = radius_move = float("nan")
    if move is not None:
        u_move, radius_move = _usual(move), common_radius(move)
    radius, grown = common_radius(mean), 1.0
    if measured is not None:
        there = belief.seen_regions(measured) if visits else None
        usual = radius if there is None else common_radius(there)
        if there is None and np.array_equal(measured.q, q) and measured.conditions.alike(at):
            there = mean
        elif there is None:
            there = belief.regions(measured.q, target=target, at=measured.conditions)
        grown = _guarded(usual, belief, measured, there) / usual
    return StatedPoint(
        grown * _usual(mean), grown * radius, grown * u_move, grown * radius_move,
        belief.probability, len(q), held_out, told_by if np.isfinite(u_move) else "",
        belief.datum is not None,
    )  # fmt: skip


def common_radius(stated: ToolStatement) -> float:
    """Radius that holds the tool point at a pose drawn from those stated [m].

    References
    ----------
    mean over the poses of P(|e| <= R) = p, e ~ N(0, S (k / k_3)^2): a factor k above the chi-square
    one k_3 widens S first.
    """
    S = widened(stated)
    return radius_over(S, np.full(len(S), 1 / len(S)), stated.probability)


def _guarded(radius: float, belief: Belief, measured: Measurements, there: ToolStatement) -> float:
    """The radius, or the one that errors measured at some points ask for, one of each pose [m].

    Whether they are too many beyond it is asked of errors less the share of their noise; the larger
    radius is that of the errors themselves, less what noise adds in squares.
    """
    own = np.trace(widened(there), axis1=1, axis2=2)
    noise = np.trace(measured.covariance[:, :3, :3], axis1=1, axis2=2)
    square, p = predict(belief.model, measured).misses ** 2, belief.probability
    pose = np.unique(measured.pose_id, return_inverse=True)[1].ravel()
    # rows of one pose share its error, not their noise: the worst would be the noisiest
    shared, seen = (
        np.sort(np.sqrt(np.bincount(pose, each) / np.bincount(pose)))
        for each in (square * own / (own + noise), square)
    )
    rank = int(np.ceil(p * (len(shared) + 1) - 1e-9)) - 1
    if bdtr(int((shared <= radius).sum()), len(shared), p) >= CHANCE or rank >= len(shared):
        return radius
    of_noise = coverage_factor(3, p) ** 2 * float(noise.mean()) / 3
    return max(radius, float(shared[rank]), float(np.sqrt(max(seen[rank] ** 2 - of_noise, 0.0))))


def widened(stated: ToolStatement) -> Array:
    """Covariances (N, 3, 3) whose chi-square region is the stated one [m^2]."""
    stretch = (stated.factor / coverage_factor(3, stated.probability)) ** 2
    return np.asarray(stretch * stated.covariance)


def _usual(stated: ToolStatement) -> float:
    """Root mean square of u_3D [m]."""
    return float(np.sqrt(np.trace(widened(stated), axis1=1, axis2=2).mean()))
