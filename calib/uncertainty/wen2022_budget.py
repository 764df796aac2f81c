"""The paper's parameter uncertainty budget: repeats, environment, number of poses, location."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, check, frozen
from calib.errors import refuse
from calib.uncertainty.type_a import root_sum_square, type_a

POSE_NUMBERS = (30, 50, 70, 90, 110, 130, 150)
"""Sizes of the random sets whose estimates are compared for u_p."""
LOCATION_POSES = 50
"""Poses in each of the four regions for u_w."""


@dataclass(frozen=True, slots=True, eq=False)
class ParameterBudget:
    """Standard uncertainties of the f identified numbers, by contributor [m or rad]."""

    repeatability: Array
    """(f,) u_r, from calibrations repeated on one pose set."""
    environment: Array
    """(f,) u_c, stated; the paper sets it to zero."""
    pose_number: Array
    """(f,) u_p, from random sets of several sizes; zero for an optimal set."""
    location: Array
    """(f,) u_w, from four regions of the workspace; zero for an optimal set."""

    def __repr__(self) -> str:
        return f"ParameterBudget({len(self.repeatability)} numbers)"

    @property
    def combined(self) -> Array:
        """(f,) all contributors, added as if uncorrelated [m or rad].

        References
        ----------
        Wen et al. 2022, eqs. (8) and (9).
        """
        return root_sum_square(
            self.repeatability, self.environment, self.pose_number, self.location
        )


def best_budget(repeats: ArrayLike, *, environment: ArrayLike = 0.0) -> ParameterBudget:
    """What the paper counts for an optimal pose set: repeats and environment only.

    Parameters
    ----------
    repeats : (v, f) array_like
        Estimates of repeated calibrations on the optimal set [m or rad].
    environment : float or (f,) array_like
        u_c, a stated standard uncertainty [m or rad].

    References
    ----------
    Wen et al. 2022, eq. (8): u_best = sqrt(u_r^2 + u_c^2).
    """
    scatter = type_a(repeats).standard
    size, stated = len(scatter), np.asarray(environment, dtype=np.float64)
    if stated.shape not in ((), (size,)):
        allowed = f"one number or {size}, one per parameter"
        message = f"environment has shape {stated.shape}"
        raise refuse("environment", stated.shape, allowed, code="A1", message=message)
    if (stated < 0).any():
        message = "standard uncertainty of environment is negative"
        raise refuse("environment", stated.tolist(), "zero or more", code="A3", message=message)
    nothing = frozen(np.zeros(size))
    return ParameterBudget(scatter, frozen(np.broadcast_to(stated, size)), nothing, nothing)


def random_budget(
    repeats: ArrayLike,
    pose_numbers: ArrayLike,
    locations: ArrayLike,
    *,
    environment: ArrayLike = 0.0,
) -> ParameterBudget:
    """What the paper counts for random pose sets: two contributors more than for the optimal set.

    Parameters
    ----------
    repeats : (v, f) array_like
        Estimates of repeated calibrations on one random set [m or rad].
    pose_numbers : (k, f) array_like
        One estimate per random set of 30, 50, ..., 150 poses.
    locations : (4, f) array_like
        One estimate per region of the workspace.
    environment : float or (f,) array_like
        u_c, a stated standard uncertainty [m or rad].

    Notes
    -----
    Not like for like with `best_budget`: u_p and u_w are missing there, and each of them contains
    the noise of one calibration once more.

    References
    ----------
    Wen et al. 2022, eq. (9): u_rand = sqrt(u_r^2 + u_c^2 + u_p^2 + u_w^2).
    """
    known = best_budget(repeats, environment=environment)
    f = len(known.repeatability)
    sized, local = check(f"k {f}, r {f}", pose_numbers=pose_numbers, locations=locations)
    return replace(known, pose_number=type_a(sized).standard, location=type_a(local).standard)


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
