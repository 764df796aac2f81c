"""Type A: what repeated calibrations say about the scatter of one, and how well they say it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, check, frozen
from calib.errors import refuse


@dataclass(frozen=True, slots=True, eq=False)
class TypeA:
    """Mean and experimental standard deviation of v repeated estimates of f numbers."""

    mean: Array
    """(f,) mean of the estimates [m or rad]."""
    standard: Array
    """(f,) standard deviation of one estimate, not of the mean [m or rad]."""
    degrees_of_freedom: int
    """v - 1."""

    def __repr__(self) -> str:
        return f"TypeA({len(self.mean)} numbers, {self.degrees_of_freedom} degrees of freedom)"


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
        frozen(estimates.mean(axis=0)),
        frozen(estimates.std(axis=0, ddof=1)),
        len(estimates) - 1,
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
