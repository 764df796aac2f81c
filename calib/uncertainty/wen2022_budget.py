"""The paper's parameter uncertainty budget: repeats, environment, number of poses, location."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, check, frozen
from calib.errors import InputError
from calib.uncertainty.type_a import root_sum_square, type_a

REPEATABILITY = "repeatability"
ENVIRONMENT = "environment"
POSE_NUMBER = "number of poses"
LOCATION = "location"

REPEATS = 10
"""Calibrations repeated on one pose set."""
POSE_NUMBERS = (30, 50, 70, 90, 110, 130, 150)
"""Sizes of the random sets whose estimates are compared for u_p."""
LOCATION_POSES = 50
"""Poses in each of the four regions for u_w."""


@dataclass(frozen=True, slots=True, eq=False)
class Contributor:
    """One source of uncertainty, for all f identified numbers."""

    name: str
    """One of the four names of this module."""
    standard: Array
    """(f,) standard uncertainty [m or rad]."""
    degrees_of_freedom: float
    """Repeats minus one; infinite for a stated value."""


@dataclass(frozen=True, slots=True, eq=False)
class Budget:
    """Contributors of the f identified numbers, added as if uncorrelated."""

    parameters: tuple[str, ...]
    """(f,) names."""
    contributors: tuple[Contributor, ...]
    """(k,) in the order of the paper."""

    def __post_init__(self) -> None:
        for part in self.contributors:
            (standard,) = check(f"{len(self.parameters)}", standard=part.standard)
            if (standard < 0).any():
                raise InputError(
                    f"standard uncertainty of {part.name} is negative",
                    code="A3",
                    field="standard",
                    value=float(standard.min()),
                    allowed="zero or more",
                )

    @property
    def combined(self) -> Array:
        """(f,) root sum of squares of all contributors [m or rad]."""
        return root_sum_square(*(part.standard for part in self.contributors))

    @property
    def variance_shares(self) -> Array:
        """(k, f) share of each contributor in the combined variance; a column adds to one."""
        squares = np.stack([part.standard**2 for part in self.contributors])
        total = squares.sum(axis=0)
        return frozen(squares / np.where(total > 0, total, 1.0))

    @property
    def degrees_of_freedom(self) -> Array:
        """(f,) effective degrees of freedom of the combined figure (Welch-Satterthwaite)."""
        nu = np.array([part.degrees_of_freedom for part in self.contributors])
        lost = (self.variance_shares**2 / nu[:, None]).sum(axis=0)
        return frozen(np.divide(1.0, lost, out=np.full(len(lost), np.inf), where=lost > 0))

    def contributor(self, name: str) -> Contributor:
        """The contributor called `name`."""
        for part in self.contributors:
            if part.name == name:
                return part
        known = ", ".join(part.name for part in self.contributors)
        raise InputError(
            f'no contributor is called "{name}"', code="A4", field="name", value=name, allowed=known
        )


def best_budget(
    parameters: Sequence[str], repeats: ArrayLike, *, environment: ArrayLike = 0.0
) -> Budget:
    """What the paper counts for an optimal pose set: repeats and environment only.

    Parameters
    ----------
    parameters : (f,) names
        Identified numbers, in the order of the columns.
    repeats : (v, f) array_like
        Estimates of repeated calibrations on the optimal set [m or rad].
    environment : float or (f,) array_like
        u_c, a stated standard uncertainty [m or rad]; the paper sets it to zero.

    References
    ----------
    Wen et al. 2022, eq. (8): u_best = sqrt(u_r^2 + u_c^2).
    """
    return Budget(tuple(parameters), _repeats_and_environment(repeats, environment))


def random_budget(
    parameters: Sequence[str],
    repeats: ArrayLike,
    pose_numbers: ArrayLike,
    locations: ArrayLike,
    *,
    environment: ArrayLike = 0.0,
) -> Budget:
    """What the paper counts for random pose sets: two contributors more than for the optimal set.

    Parameters
    ----------
    parameters : (f,) names
        Identified numbers, in the order of the columns.
    repeats : (v, f) array_like
        Estimates of repeated calibrations on one random set [m or rad].
    pose_numbers : (k, f) array_like
        One estimate per random set of 30, 50, ..., 150 poses.
    locations : (4, f) array_like
        One estimate per region of the workspace.
    environment : float or (f,) array_like
        u_c, a stated standard uncertainty [m or rad]; the paper sets it to zero.

    Notes
    -----
    Not like for like with `best_budget`: u_p and u_w are missing there, and each of them contains
    the noise of one calibration once more.

    References
    ----------
    Wen et al. 2022, eq. (9): u_rand = sqrt(u_r^2 + u_c^2 + u_p^2 + u_w^2).
    """
    return Budget(
        tuple(parameters),
        (
            *_repeats_and_environment(repeats, environment),
            _contributor(POSE_NUMBER, pose_numbers),
            _contributor(LOCATION, locations),
        ),
    )


def uncertainty_ratio(best: Budget, random: Budget) -> Array:
    """Last column of the paper's table: u_best / u_rand (f,) per parameter."""
    if best.parameters != random.parameters:
        raise InputError(
            "the two budgets list different parameters",
            code="A3",
            field="parameters",
            value=random.parameters,
            allowed=", ".join(best.parameters),
        )
    return frozen(best.combined / random.combined)


def location_regions(position: ArrayLike, *, x: float = 0.25, y: float = 0.0) -> Index:
    """Region 0..3 (m,) of tool positions: x below or above `x`, y below or above `y`.

    The paper names four regions without saying which; these quarter its workspace box.

    Parameters
    ----------
    position : (m, 3) array_like
        Nominal tool positions in the base frame [m].
    x, y : float
        Borders [m].
    """
    (position,) = check("m 3", position=position)
    regions = 2 * (position[:, 0] > x).astype(np.int64) + (position[:, 1] > y)
    return np.asarray(regions, dtype=np.int64)


def _repeats_and_environment(
    repeats: ArrayLike, environment: ArrayLike
) -> tuple[Contributor, Contributor]:
    """The two contributors that both budgets share."""
    repeatability = _contributor(REPEATABILITY, repeats)
    shape = repeatability.standard.shape
    stated = np.asarray(environment, dtype=np.float64)
    if stated.shape not in ((), shape):
        raise InputError(
            f"environment has shape {stated.shape}",
            code="A1",
            field="environment",
            value=stated.shape,
            allowed=f"one number or {shape[0]}, one per parameter",
        )
    return repeatability, Contributor(
        ENVIRONMENT, frozen(np.broadcast_to(stated, shape)), float("inf")
    )


def _contributor(name: str, estimates: ArrayLike) -> Contributor:
    """Scatter of estimates (v, f) under a name."""
    scatter = type_a(estimates)
    return Contributor(name, scatter.standard, scatter.degrees_of_freedom)
