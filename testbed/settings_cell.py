"""[cell]: the solid things around the robot, which it must not touch and no beam passes."""

from typing import Annotated, Literal

from pydantic import Field

from testbed.settings_types import PlainText, Point, RotationVector, Settings, Side

MAX_OBSTACLES = 100


class BoxObstacle(Settings):
    """[[cell.obstacle]] kind "box"."""

    kind: Literal["box"] = "box"
    size_mm: tuple[Side, Side, Side]
    """Full lengths of its edges."""
    position_mm: Point
    """Its center in the base frame."""
    rotation_vector_deg: RotationVector = (0.0, 0.0, 0.0)
    """Turn of its axes against the base frame."""


class MeshObstacle(Settings):
    """[[cell.obstacle]] kind "mesh": it collides as its convex hull and blocks beams as it is."""

    kind: Literal["mesh"] = "mesh"
    file: Annotated[PlainText, Field(min_length=1)]
    """OBJ or STL, relative to the scenario file and below its folder."""
    unit: Literal["mm", "m"] = "mm"
    """Of the file's coordinates, which name none themselves."""
    position_mm: Point = (0.0, 0.0, 0.0)
    """The mesh's origin in the base frame."""
    rotation_vector_deg: RotationVector = (0.0, 0.0, 0.0)
    """Turn of the mesh's axes against the base frame."""


ObstacleSettings = Annotated[BoxObstacle | MeshObstacle, Field(discriminator="kind")]


class CellSettings(Settings):
    """[cell]: obstacles, besides the floor."""

    obstacle: Annotated[tuple[ObstacleSettings, ...], Field(max_length=MAX_OBSTACLES)] = ()
