"""Tables of a plan: goal, stations, and what the measurement may cost."""

from typing import Annotated, Literal

from pydantic import Field

from testbed.scenario.tables import (
    Length,
    PlanCriterion,
    PlanMethod,
    Point,
    Settings,
    Side,
    Text,
    Turn,
)
from testbed.scenario.use import UseSettings

MAX_STATIONS, MAX_GOALS = 400, 5000
DEFAULT_POSES = 29
"""Poses of a plan that names neither a number nor a target."""
JointTarget = Annotated[tuple[Length, ...], Field(min_length=1, max_length=32)]
"""One number per joint: deg, or mm where a joint slides."""
ToolPose = tuple[Length, Length, Length, Turn, Turn, Turn]
"""x, y, z in mm, then a rotation vector in deg, of the nominal tool in the base frame."""
Weight = Annotated[float, Field(ge=1e-9, le=1e9)]
Entries = Field(max_length=MAX_GOALS)


class BoxGoal(Settings):
    """[plan.goal] kind "box": poses drawn as the pool is, in a box that may be another one."""

    kind: Literal["box"] = "box"
    """Poses drawn in a box."""
    center_mm: Point | None = None
    """Of the nominal tool position, base frame; None: the center of the pool's box."""
    size_mm: tuple[Side, Side, Side] | None = None
    """Edges; None: those of the pool's box."""
    poses: Annotated[int, Field(ge=1, le=MAX_GOALS)] = 200
    """How many are drawn."""


class ListGoal(Settings):
    """[plan.goal] kind "list": the poses the robot will work at."""

    kind: Literal["list"] = "list"
    """Poses one by one."""
    joints_deg: Annotated[tuple[JointTarget, ...], Entries] = ()
    """Poses as joint values of the controller; deg, mm where a joint slides. Give these or
    `tool_mm_deg`."""
    tool_mm_deg: Annotated[tuple[ToolPose, ...], Entries] = ()
    """Poses as x, y, z [mm] and rotation vector [deg] of the tool in the base frame."""
    weights: Annotated[tuple[Weight, ...], Entries] = ()
    """How much each pose counts; empty: all the same. Only their ratios matter."""


class PathGoal(Settings):
    """[plan.goal] kind "path": straight lines between corners, each meter counts the same."""

    kind: Literal["path"] = "path"
    """Lines between corners."""
    joints_deg: Annotated[tuple[JointTarget, ...], Entries] = ()
    """Corners as joint values of the controller, straight in joint space. Give these or
    `tool_mm_deg`."""
    tool_mm_deg: Annotated[tuple[ToolPose, ...], Entries] = ()
    """Corners as x, y, z [mm] and rotation vector [deg] of the tool, straight in space."""
    step_mm: Annotated[float, Field(ge=0.01, le=1000.0)] = 20.0
    """Largest way of the tool between two goal poses on a line."""
    weights: Annotated[tuple[Weight, ...], Entries] = ()
    """How much each line counts beyond its length (one fewer than corners); empty: the same."""


GoalSettings = Annotated[BoxGoal | ListGoal | PathGoal, Field(discriminator="kind")]


class GridSettings(Settings):
    """[plan.stations.grid]: stations at the corners of a regular grid."""

    from_mm: Point
    """First corner, base frame."""
    to_mm: Point
    """Opposite corner, base frame."""
    count: tuple[Annotated[int, Field(ge=1, le=MAX_STATIONS)], ...] = Field(
        min_length=3, max_length=3
    )
    """Stations along x, y, z; 1: halfway."""


class StationSettings(Settings):
    """[plan.stations]: places the tracker could stand at; none: only [tracker] station_mm."""

    list_mm: Annotated[tuple[Point, ...], Field(max_length=MAX_STATIONS)] = ()
    """Beam origins in the base frame. Give these or a grid."""
    grid: GridSettings | None = None
    """Places on a regular grid instead of a list."""

    @property
    def given(self) -> bool:
        """Whether there is anything to compare."""
        return bool(self.list_mm) or self.grid is not None


PlanOrder = Literal["tour", "random"]


class PlanSettings(Settings):
    """[plan]: poses, goal, stations and times of one real calibration."""

    poses: Annotated[int, Field(ge=0, le=5000)]
    """Poses to measure, beyond those in `measured`; 0: as many as `target_um` needs."""
    target_um: Annotated[float, Field(ge=0.0, le=100_000.0)] = 0.0
    """Wanted expanded uncertainty U = coverage * u of the tool point, u the 3-D standard
    uncertainty: a ball of twice u holds at least 95 %; 0: none, poses decides."""
    target_is: Literal["mean", "worst"] = "mean"
    """What must not exceed the target: the mean (RMS) over the goal, or its worst pose."""
    stiff_joints: bool = False
    """Whether the arm's joints are known neither to sag nor to wave: then `target_um` asks for the
    poses that links alone need; false: for as many as tell such joint errors as well."""
    coverage: Annotated[float, Field(ge=1.0, le=10.0)] = 2.0
    """k of the target and of the stated U."""
    criterion: PlanCriterion = "V"
    """What the chosen set makes best: V is the mean uncertainty over the goal, G its worst."""
    method: PlanMethod = "exchange"
    """How the set is searched for."""
    goal: GoalSettings = BoxGoal()
    point_mm: Point = (0.0, 0.0, 0.0)
    """Point in the tool frame whose uncertainty counts."""
    held_out: Annotated[int, Field(ge=0, le=1000)] = 20
    """Poses that check the calibration afterwards and take no part in it."""
    measured: Text = ""
    """CSV of joint targets measured already (deg, mm where a joint slides); "": none."""
    speed_share: Annotated[float, Field(ge=1e-6, le=1.0)] = 0.3
    """Joint speed of the moves, as a share of the robot's largest."""
    settle_s: Annotated[float, Field(ge=0.0, le=3600.0)] = 3.0
    """Rest at each pose: settling and measuring."""
    order: PlanOrder = "tour"
    """The shortest way found from pose to pose, or poses at random, which takes longer and lets the
    calibration tell drift from misfit."""
    clearance_mm: Annotated[float, Field(ge=0.0, le=1000.0)] = 10.0
    """Poses and moves keep so far from obstacles and floor; 0: only no touch. The base may stand on
    either, and the goal may lie nearer."""
    start_deg: Annotated[tuple[Length, ...], Field(max_length=32)] = ()
    """Posture the robot starts from, as its controller counts; deg, mm where a joint slides; empty:
    all joints at zero."""
    stations: StationSettings = StationSettings()
    use: UseSettings | None = None
    """Under which conditions the goal will be worked at: measure under the same; None: unsaid."""
