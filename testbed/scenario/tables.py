"""Core tables of a scenario that need no file of their own, and what a robot decides of them."""

from collections.abc import Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypedDict

from pydantic import Field

from calib.errors import CalibError
from testbed.strict import Strict

if TYPE_CHECKING:
    from testbed.robots.catalog import Robot

Name = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_.-]{0,63}$")]
PlainText = Annotated[str, Field(max_length=4096, pattern=r"^[^\x00-\x1f\x7f]*$")]
Length = Annotated[float, Field(ge=-50_000.0, le=50_000.0)]
Point = tuple[Length, Length, Length]
JointRange = tuple[Length, Length]
"""Lower and upper value of a joint: deg, or mm where it slides."""
Side = Annotated[float, Field(gt=0.0, le=50_000.0)]
Turn = Annotated[float, Field(ge=-720.0, le=720.0)]
RotationVector = tuple[Turn, Turn, Turn]


class Settings(Strict):
    """One table of a scenario."""


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


Spread = Annotated[float, Field(gt=0.0, le=1e4)]
"""Standard deviation of a prior."""
Named = dict[str, Spread]
PRIOR = ("identification", "prior")
"""Where the prior stands in the file."""
SINGLE = {"sd_deg": False, "sd_mm": True}
"""Keys of the prior that name numbers, and whether these are lengths."""


class PriorSettings(Settings):
    """[identification.prior]: how far from nominal the numbers may be, before any measurement.

    Standard deviations; a table with no key in it is the weak prior.
    """

    angles_deg: Spread = 0.1
    """Angles of the links."""
    lengths_mm: Spread = 0.6
    """Lengths of the links."""
    frame_angles_deg: Spread = 0.1
    """Rotation of base and tool, per axis."""
    frame_lengths_mm: Spread = 1.0
    """Position of base and tool, per axis."""
    gravity_mdeg: Spread = 50.0
    """Coefficients of sag; only the extended model has them."""
    harmonics_mdeg: tuple[Spread, Spread] = (20.0, 12.0)
    """Coefficients of once and twice a turn; only the extended model has them."""
    sd_deg: Named = Field(default_factory=dict)
    """Single numbers by name, angles: `alpha2 = 0.01`."""
    sd_mm: Named = Field(default_factory=dict)
    """Single numbers by name, lengths: `"base.x" = 5.0`."""


class IdentificationSettings(Settings):
    """[identification]: what the estimators may move, and how the default one works."""

    free: str | tuple[str, ...] = "identifiable"
    """"identifiable", a free set of the robot, or parameter names."""
    base: Literal["free", "fixed"] = "free"
    tool: Literal["free", "fixed"] = "free"
    estimators: Annotated[tuple[Literal["whitened", "paper"], ...], Field(min_length=1)] = (
        "whitened",
        "paper",
    )
    model: Literal["geometric", "extended", "choose"] = "geometric"
    """Of the default estimator: geometry alone, with sag and harmonics, or what the evidence asks
    for."""
    loss: Literal["squared", "huber", "cauchy"] = "squared"
    """Of the default estimator: how much a shot counts that lies far off."""
    prior: PriorSettings | None = None
    """Of the default estimator. Without this table the geometric model has no prior, and the
    extended one the weak one."""


PAPER_SET = "wen2022"
"""Name of the free set that the paper's estimator identifies."""
SIX = 6
"""Joints taken for granted where the robot cannot be loaded; its own error is told later."""


def robot_of(document: Mapping[str, Any]) -> "Robot | None":
    """The robot of a scenario not yet checked; None if it names none that can be loaded."""
    from testbed.robots.catalog import load_robot, robot_names

    name = document.get("robot")
    if not isinstance(name, str) or not name:
        return None
    try:
        return _shipped(name) if name in robot_names() else load_robot(name)
    except (CalibError, OSError, ValueError):
        return None  # the strict check says what is wrong with it


@lru_cache(maxsize=8)
def _shipped(name: str) -> "Robot":
    """A shipped robot; its files do not change while a program runs."""
    from testbed.robots.catalog import load_robot

    return load_robot(name)


class Facts(TypedDict):
    """What the presets of the truth ask of a robot."""

    joints: int
    """How many numbers lists have that hold one per joint."""
    paper_set: bool
    """Whether the set that the paper identifies is one of its free sets."""
    sags: bool
    """Whether the closed form of gravity holds for it."""


def facts_of(robot: "Robot | None") -> Facts:
    """What the presets of the truth ask of a robot."""
    from calib.identification.joint_models import gravity_is_closed

    if robot is None:
        return Facts(joints=SIX, paper_set=False, sags=True)
    chain = robot.model.chain
    return Facts(
        joints=chain.n_joints,
        paper_set=PAPER_SET in robot.free_sets,
        sags=gravity_is_closed(chain),
    )


def with_workspace(document: Mapping[str, Any], robot: "Robot | None") -> dict[str, Any]:
    """The document with [pool] box, [tracker] station and estimators that fit the robot.

    What is written stays; tables of a wrong type are left for the strict check to name.
    """
    out = dict(document)
    if robot is None:
        return out
    from testbed.robots.robot import workspace

    tables: dict[str, Mapping[str, Any]] = {}
    for name in ("pool", "tracker", "identification"):
        table = out.get(name, {})
        if isinstance(table, Mapping):
            tables[name] = table
    box = ("box_center_mm", "box_size_mm")
    pool, tracker = tables.get("pool"), tables.get("tracker")
    # a robot without a stated workspace has its postures looked through: only if it is needed
    if (pool is not None and not all(key in pool for key in box)) or (
        tracker is not None and "station_mm" not in tracker
    ):
        place = workspace(robot)
        if pool is not None:
            filled: dict[str, Any] = {key: list(getattr(place, key)) for key in box}
            if place.joint_ranges_deg:
                filled["joint_ranges_deg"] = [list(pair) for pair in place.joint_ranges_deg]
            out["pool"] = filled | dict(pool)
        if tracker is not None:
            out["tracker"] = {"station_mm": list(place.station_mm)} | dict(tracker)
    identification = tables.get("identification")
    if identification is not None and PAPER_SET not in robot.free_sets:
        out["identification"] = {"estimators": ["whitened"]} | dict(identification)
    return out
