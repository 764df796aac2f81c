"""The tool point that accuracy is stated for: at a known offset, or an identified reflector."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, check
from calib.errors import refuse
from calib.geometry.frames import target_points
from calib.geometry.jacobian import reflector_rows
from calib.geometry.model import RobotModel
from calib.measurement.observations import GIVEN, Measurements


def places_are_found(measurements: Measurements) -> bool:
    """Whether all rows see reflectors of the fixtures, whose places are identified with the robot.

    Their places then absorb every change of the tool and the last link: no row determines where
    the flange is.
    """
    return len(measurements) > 0 and bool((measurements.reflector != GIVEN).all())


@dataclass(frozen=True, slots=True)
class ToolTarget:
    """A point fixed to the tool."""

    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Position in the tool frame, if it is no reflector of the model [m]."""
    reflector: int = GIVEN
    """Which reflector of the model's fixtures it is, from 0; -1: the point at `offset`.

    The coordinates of a reflector are numbers of the model, and their uncertainty counts.
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
        """Position (3,) in the tool frame [m]; an unknown reflector is an `InputError` (A3)."""
        if self.reflector == GIVEN:
            return np.array(self.offset)
        count = len(model.fixtures.reflectors)
        if not 0 <= self.reflector < count:
            allowed = f"0 to {count - 1}" if count else "-1: the model has no reflectors"
            raise refuse("reflector", self.reflector, allowed, code="A3")
        return np.asarray(model.fixtures.reflectors[self.reflector])

    def positions(self, model: RobotModel, T: Array) -> Array:
        """World positions (N, 3) at tool poses T (N, 4, 4) of a model [m]."""
        return target_points(T, self.place(model))

    def positions_and_rows(self, model: RobotModel, T: Array, J: Array) -> tuple[Array, Array]:
        """World positions (N, 3) [m], and their derivative (N, 3, P) by the model's numbers.

        Parameters
        ----------
        model : RobotModel
            Model of P numbers.
        T, J : (N, 4, 4) and (N, 6, P) arrays
            Poses and Jacobian as `RobotModel.poses_and_jacobian` gives them.
        """
        position, rows = reflector_rows(T, J, np.broadcast_to(self.place(model), (len(T), 3)))
        if self.reflector != GIVEN:
            k = model.first_fixture + 3 * self.reflector
            rows[:, :, k : k + 3] += T[:, :3, :3]
        return position, rows
