"""Type A: what repeated calibrations say about the scatter of one, and the paper's budget of it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, check, frozen
from calib.errors import refuse
from calib.kinds import checked_kinds
from calib.shown import Shown


@dataclass(frozen=True, slots=True, eq=False)
class TypeA(Shown):
    """Mean and experimental standard deviation of v repeated estimates of f numbers."""

    mean: Array
    """(f,) mean of the estimates [m or rad]."""
    standard: Array
    """(f,) standard deviation of one estimate, not of the mean [m or rad]."""
    degrees_of_freedom: int
    """v - 1."""

    def __repr__(self) -> str:
        return f"TypeA({len(self.mean)} numbers, {self.degrees_of_freedom} degrees of freedom)"


@checked_kinds
def type_a(estimates: ArrayLike) -> TypeA:
    """Experimental standard deviation of repeated estimates, with n - 1.

    Parameters
    ----------
    estimates : (v, f) array_like
        One row per repeated calibration [m or rad]; steps from nominal or plain values alike.

    Notes
    -----
    Repeats see what changes between them: tracker noise and joint repeatability. A bias that all of
    them share (tool offset, model error) leaves no trace here.

    References
    ----------
    Wen et al. 2022, eq. (7); JCGM 100:2008, 4.2.
    """
    (estimates,) = check("v f", estimates=estimates)
    if len(estimates) < 2:
        count = len(estimates)
        raise refuse(
            "estimates", count, "a standard deviation needs at least two repeated calibrations",
            code="A3", message=f"estimates has {count} row(s)",
            fix="repeat the calibration; the paper takes ten",
        )  # fmt: skip
    return TypeA(
        frozen(estimates.mean(axis=0)), frozen(estimates.std(axis=0, ddof=1)), len(estimates) - 1
    )


def root_sum_square(*components: ArrayLike) -> Array:
    """Combined standard uncertainty (f,) of uncorrelated contributors (f,) or scalars [m or rad].

    References
    ----------
    Wen et al. 2022, eqs. (8) and (9); JCGM 100:2008, eq. (11a).
    """
    squares = np.stack(
        np.broadcast_arrays(*(np.asarray(part, dtype=np.float64) for part in components))
    )
    return frozen(np.sqrt(np.square(squares).sum(axis=0)))


@dataclass(frozen=True, slots=True, eq=False)
class ParameterBudget(Shown):
    """Standard uncertainties of the f identified numbers, by contributor [m or rad]."""

    repeatability: Array
    """(f,) u_r, from calibrations repeated on one pose set."""
    environment: Array
    """(f,) u_c; the paper takes it as zero."""
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


def best_budget(repeats: ArrayLike, environment: ArrayLike = 0.0) -> ParameterBudget:
    """What the paper counts for an optimal pose set: repeats and environment only.

    Parameters
    ----------
    repeats : (v, f) array_like
        Estimates of repeated calibrations on the optimal set [m or rad].
    environment : (f,) array_like or float
        u_c, which repeats cannot see [m or rad].

    References
    ----------
    Wen et al. 2022, eq. (8): u_best = sqrt(u_r^2 + u_c^2), with u_c zero there.
    """
    scatter = type_a(repeats).standard
    nothing, f = frozen(np.zeros(len(scatter))), len(scatter)
    if np.ndim(environment) == 0:
        environment = np.full(f, environment)
    (known,) = check(f"{f}", environment=environment)
    if (known < 0).any():
        raise refuse("environment", known.min(), "zero or more: it is an uncertainty", code="A3")
    return ParameterBudget(scatter, known, nothing, nothing)


def random_budget(
    repeats: ArrayLike, pose_numbers: ArrayLike, locations: ArrayLike, environment: ArrayLike = 0.0
) -> ParameterBudget:
    """What the paper counts for random pose sets: two contributors more than for the optimal set.

    Parameters
    ----------
    repeats : (v, f) array_like
        Estimates of repeated calibrations on one random set [m or rad].
    pose_numbers : (k, f) array_like
        One estimate per random set of 30, 50, ..., 150 poses in the paper.
    locations : (4, f) array_like
        One estimate per region of the workspace.
    environment : (f,) array_like or float
        u_c, as in `best_budget` [m or rad].

    Notes
    -----
    Not like for like with `best_budget`: u_p and u_w are missing there, and each of them contains
    the noise of one calibration once more.

    References
    ----------
    Wen et al. 2022, eq. (9): u_rand = sqrt(u_r^2 + u_c^2 + u_p^2 + u_w^2).
    """
    known = best_budget(repeats, environment)
    f = len(known.repeatability)
    sized, local = check(f"k {f}, r {f}", pose_numbers=pose_numbers, locations=locations)
    return replace(known, pose_number=type_a(sized).standard, location=type_a(local).standard)


def location_regions(position: ArrayLike, border: ArrayLike = (0.25, 0.0)) -> Index:
    """Region 0..3 (m,) of tool positions: x below or above its border, y below or above its own.

    The paper names four regions without saying which; by default they quarter its workspace box.

    Parameters
    ----------
    position : (m, 3) array_like
        Nominal tool positions in the base frame [m].
    border : (2,) array_like
        x and y where the regions meet [m].
    """
    position, border = check("m 3, 2", position=position, border=border)
    x, y = border
    regions = 2 * (position[:, 0] > x).astype(np.int64) + (position[:, 1] > y)
    return np.asarray(regions, dtype=np.int64)
