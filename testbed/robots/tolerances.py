"""Standard deviations of an arm's link numbers from nominal, in files and as arrays."""

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from calib.arrays import Array
from testbed.bounds import ANGLE_SD, LENGTH_SD
from testbed.strict import Strict

LENGTH_TOLERANCE, ANGLE_TOLERANCE = 0.6e-3, float(np.radians(0.1))
"""Default standard deviations of a link's lengths and angles from nominal; those of the weak prior
[m, rad]."""


class JointTolerance(Strict):
    """Standard deviations of one joint's link, if they differ from the others'."""

    joint: Annotated[int, Field(ge=1)]
    """Number of the joint, counted from one at the base."""
    length_mm: Annotated[float, LENGTH_SD.size("mm")] | None = None
    """Standard deviation of its d and a."""
    angle_deg: Annotated[float, ANGLE_SD.size("deg")] | None = None
    """Standard deviation of its theta, alpha and beta."""


class LinkTolerances(Strict):
    """[tolerances] of a robot, [prior] of a session: how far its links may lie from nominal.

    Standard deviations, of d and a and of theta, alpha and beta.
    """

    length_mm: Annotated[float, LENGTH_SD.size("mm")] | None = None
    """Standard deviation of d and a; 0.6 mm where nothing is stated."""
    angle_deg: Annotated[float, ANGLE_SD.size("deg")] | None = None
    """Standard deviation of theta, alpha and beta; 0.1 deg where nothing is stated."""
    joints: tuple[JointTolerance, ...] = ()

    @model_validator(mode="after")
    def _joints_differ(self) -> "LinkTolerances":
        """Require at most one entry per joint."""
        numbers = [one.joint for one in self.joints]
        if twice := sorted({k for k in numbers if numbers.count(k) > 1}):
            raise ValueError(f"joint {twice[0]} appears twice")
        return self

    def strange(self, n: int) -> int | None:
        """The first joint listed that an arm of n joints does not have."""
        return next((one.joint for one in self.joints if one.joint > n), None)


def tolerances_of(stated: LinkTolerances, before: Array) -> Array:
    """Standard deviations (n, 5) of link numbers [rad, m, m, rad, rad]; `before` if not stated."""
    found = before.copy()
    sizes = [(slice(None), stated.length_mm, stated.angle_deg)]
    sizes += [(slice(k.joint - 1, k.joint), k.length_mm, k.angle_deg) for k in stated.joints]
    for rows, length, angle in sizes:
        if length is not None:
            found[rows, 1:3] = length / 1e3
        if angle is not None:
            found[rows, ::3] = found[rows, 4:] = np.radians(angle)
    return found


def usual_tolerances(n: int) -> Array:
    """Default standard deviations (n, 5) for n joints [rad, m, m, rad, rad]."""
    length, angle = LENGTH_TOLERANCE, ANGLE_TOLERANCE
    return np.tile([angle, length, length, angle, angle], (n, 1))
