"""[tool_in_use] of a session: the tool that the robot will carry, where another was measured."""

from dataclasses import dataclass
from itertools import product
from typing import Annotated

import numpy as np
from pydantic import Field

from calib.arrays import LATER, Array
from testbed.bounds import LENGTH_SD, TOOL
from testbed.strict import PlainText, Strict

Offset = Annotated[float, TOOL.signed("mm")]
Edge = Annotated[float, TOOL.or_zero("mm")]


@dataclass(frozen=True, slots=True)
class ToolInUse:
    """A tool point, or a box of them, in the flange's frame."""

    name: str
    point: tuple[float, float, float]
    """The point, or the middle of the box [m]."""
    box: tuple[float, float, float]
    """Edges of the box; zero for a point [m]."""
    sd: float
    """How well the point is known in the flange's frame, per axis, a standard deviation [m]."""
    frame: Annotated[tuple[float, ...], LATER] = ()
    """That frame in the flange of the robot's chain, the upper three rows of a pose, row by row
    [m]; empty if both are one."""

    def in_chain(self, point: Array) -> Array:
        """A point (3,) of the tool in the flange of the robot's chain [m]."""
        if not self.frame:
            return point
        T = np.reshape(self.frame, (3, 4))
        return np.asarray(T[:, :3] @ point + T[:, 3])

    @property
    def points(self) -> Array:
        """(k, 3) the point, or the corners of the box: any point in between is known better [m].

        The trace of a covariance that comes of linear propagation is convex in the offset.
        """
        signs = sorted({tuple(np.sign(self.box) * s) for s in product((-0.5, 0.5), repeat=3)})
        return np.asarray(np.array(self.point) + np.array(signs) * np.array(self.box))


class ToolInUseTable(Strict):
    """[tool_in_use]: for which tool the calibration is to hold, beside the targets measured."""

    name: Annotated[PlainText, Field(min_length=1, max_length=100)] = "tool in use"
    """What the tool is called in the report."""
    point_mm: tuple[Offset, Offset, Offset]
    """In the frame of the flange, as robot.toml has it; of a URDF or MJCF, in its tip: the link or
    site at which the arm ends."""
    box_mm: tuple[Edge, Edge, Edge] = (0.0, 0.0, 0.0)
    """Edges of a box about the point, for tools that differ."""
    position_um: Annotated[float, LENGTH_SD.or_zero("um")] = 0.0
    """Standard uncertainty of the point in the flange's frame, per axis."""

    @property
    def tool(self) -> ToolInUse:
        """It in SI units."""
        (x, y, z), (a, b, c) = self.point_mm, self.box_mm
        return ToolInUse(
            self.name, (x / 1e3, y / 1e3, z / 1e3), (a / 1e3, b / 1e3, c / 1e3),
            self.position_um * 1e-6,
        )  # fmt: skip
