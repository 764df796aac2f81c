"""The point of the tool that is stated: at a known place in its frame, or a reflector found."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, check
from calib.errors import refuse
from calib.geometry.jacobian import reflector_rows
from calib.geometry.model import RobotModel
from calib.measurement.observations import GIVEN, Measurements


def places_are_found(measurements: Measurements) -> bool:
    """Whether nothing but reflectors was seen whose places the robot itself tells.

    They take up all that the last link and the tool do: no row speaks of where the flange lies.
    """
    return len(measurements) > 0 and bool((measurements.reflector != GIVEN).all())


@dataclass(frozen=True, slots=True)
class ToolTarget:
    """A point that the tool carries."""

    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where it lies in the tool frame, if it is no reflector of the model [m]."""
    reflector: int = GIVEN
    """Which reflector of the model's fixtures it is, from 0; -1: the point at `offset`.

    The place of a reflector is a number of the model: what is uncertain of it counts.
    """

    @classmethod
    def of(cls, target: "ArrayLike | ToolTarget") -> "ToolTarget":
        """The target itself, or the one at a point (3,) of the tool frame [m]."""
        if isinstance(target, ToolTarget):
            return target
        (point,) = check("3", target=target)
        x, y, z = point.tolist()
        return cls((x, y, z))

    def place(self, model: RobotModel) -> Array:
        """Where it lies in the tool frame (3,) [m]."""
        if self.reflector == GIVEN:
            return np.array(self.offset)
        count = len(model.fixtures.reflectors)
        if not 0 <= self.reflector < count:
            allowed = f"0 to {count - 1}" if count else "-1: the model has no reflectors"
            raise refuse("reflector", self.reflector, allowed, code="A3")
        return np.asarray(model.fixtures.reflectors[self.reflector])

    def positions(self, model: RobotModel, T: Array) -> Array:
        """Its positions (N, 3) at tool poses T (N, 4, 4) of a model [m]."""
        return np.asarray(T[:, :3, 3] + T[:, :3, :3] @ self.place(model))

    def positions_and_rows(self, model: RobotModel, T: Array, J: Array) -> tuple[Array, Array]:
        """Positions (N, 3), and their derivative (N, 3, P) by the model's numbers.

        Parameters
        ----------
        model : RobotModel
            Of P numbers.
        T, J : (N, 4, 4) and (N, 6, P) arrays
            Its poses, and their derivative, as `RobotModel.poses_and_jacobian` gives them.
        """
        position, rows = reflector_rows(T, J, np.broadcast_to(self.place(model), (len(T), 3)))
        if self.reflector != GIVEN:
            k = model.first_fixture + 3 * self.reflector
            rows[:, :, k : k + 3] += T[:, :3, :3]
        return position, rows
