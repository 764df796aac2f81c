"""[plan]: how many poses, for what goal, from which station, in what time; for `truebed plan`."""

from typing import Annotated, Literal

from pydantic import Field

from testbed.scenario.tables import Length, PlainText, Point, Settings, Side, Turn

MAX_STATIONS, MAX_GOALS = 400, 5000
DEFAULT_POSES = 29
"""Poses of a plan that names neither a number nor a target."""
PlanCriterion = Literal["D", "A", "V", "G", "E", "O1", "O2", "O3", "O4", "O5"]
PlanMethod = Literal["random", "best_of_random", "greedy", "detmax", "fedorov", "exchange"]
JointTarget = Annotated[tuple[Length, ...], Field(min_length=1, max_length=32)]
"""One number per joint: deg, or mm where a joint slides."""
ToolPose = tuple[Length, Length, Length, Turn, Turn, Turn]
"""x, y, z in mm, then a rotation vector in deg, of the nominal tool in the base frame."""
Weight = Annotated[float, Field(gt=0.0, le=1e9)]
Entries = Field(max_length=MAX_GOALS)


class BoxGoal(Settings):
    """[plan.goal] kind "box": poses drawn as the pool is, in a box that may be another one."""

    kind: Literal["box"] = "box"
    center_mm: Point | None = None
    """Of the nominal tool position, base frame; None: the center of the pool's box."""
    size_mm: tuple[Side, Side, Side] | None = None
    """Edges; None: those of the pool's box."""
    poses: Annotated[int, Field(ge=1, le=MAX_GOALS)] = 200
    """How many are drawn."""


class ListGoal(Settings):
    """[plan.goal] kind "list": the poses the robot will work at."""

    kind: Literal["list"] = "list"
    joints_deg: Annotated[tuple[JointTarget, ...], Entries] = ()
    """Poses as joint values; deg, mm where a joint slides. Give these or `tool_mm_deg`."""
    tool_mm_deg: Annotated[tuple[ToolPose, ...], Entries] = ()
    """Poses as x, y, z [mm] and rotation vector [deg] of the tool in the base frame."""
    weights: Annotated[tuple[Weight, ...], Entries] = ()
    """How much each pose counts; empty: all the same. Only their ratios matter."""


class PathGoal(Settings):
    """[plan.goal] kind "path": straight lines between corners, each meter counts the same."""

    kind: Literal["path"] = "path"
    joints_deg: Annotated[tuple[JointTarget, ...], Entries] = ()
    """Corners as joint values, straight in joint space. Give these or `tool_mm_deg`."""
    tool_mm_deg: Annotated[tuple[ToolPose, ...], Entries] = ()
    """Corners as x, y, z [mm] and rotation vector [deg] of the tool, straight in space."""
    step_mm: Annotated[float, Field(gt=0.0, le=1000.0)] = 20.0
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

    @property
    def given(self) -> bool:
        """Whether there is anything to compare."""
        return bool(self.list_mm) or self.grid is not None


class PlanSettings(Settings):
    """[plan]: poses, goal, stations and times of one real calibration."""

    poses: Annotated[int, Field(ge=0, le=5000)]
    """Poses to measure, beyond those in `measured`; 0: as many as `target_um` needs."""
    target_um: Annotated[float, Field(ge=0.0, le=100_000.0)] = 0.0
    """Wanted expanded uncertainty U = coverage * u of the tool point; 0: none, poses decides."""
    target_is: Literal["mean", "worst"] = "mean"
    """What must not exceed the target: the mean (RMS) over the goal, or its worst pose."""
    coverage: Annotated[float, Field(ge=1.0, le=10.0)] = 2.0
    """k of the target and of the stated U."""
    criterion: PlanCriterion = "V"
    method: PlanMethod = "exchange"
    goal: GoalSettings = BoxGoal()
    point_mm: Point = (0.0, 0.0, 0.0)
    """Point in the tool frame whose uncertainty counts."""
    held_out: Annotated[int, Field(ge=0, le=1000)] = 10
    """Poses that check the calibration afterwards and take no part in it."""
    measured: PlainText = ""
    """CSV of joint targets measured already (deg, mm where a joint slides); "": none."""
    speed_share: Annotated[float, Field(gt=0.0, le=1.0)] = 0.3
    """Joint speed of the moves, as a share of the robot's largest."""
    settle_s: Annotated[float, Field(ge=0.0, le=3600.0)] = 3.0
    """Rest at each pose: settling and measuring."""
    clearance_mm: Annotated[float, Field(ge=0.0, le=1000.0)] = 10.0
    """Poses and moves keep so far from obstacles and floor; 0: only no touch. The base may stand on
    either, and the goal may lie nearer."""
    start_deg: Annotated[tuple[Length, ...], Field(max_length=32)] = ()
    """Posture the robot starts from; deg, mm where a joint slides; empty: all joints at zero."""
    stations: StationSettings = StationSettings()


def plan_contradictions(plan: PlanSettings) -> list[str]:
    """Sentences, one per contradiction in [plan]; empty if it is sound."""
    found = []
    if plan.poses and plan.target_um:
        found.append(
            f"[plan] poses is {plan.poses} and target_um is {plan.target_um:g}; one decides; "
            "remove the other"
        )
    if not plan.poses and not plan.target_um:
        found.append("[plan] has neither poses nor target_um; write one of them")
    if plan.target_um and plan.criterion not in ("V", "G"):
        found.append(
            f'[plan] criterion is "{plan.criterion}"; target_um needs "V" or "G", '
            'which know the goal; write criterion = "V"'
        )
    if plan.target_um and plan.method in ("random", "best_of_random"):
        found.append(
            f'[plan] method is "{plan.method}", which does not look for the fewest poses that '
            'reach target_um; write method = "exchange" or poses'
        )
    if plan.measured and plan.stations.given:
        found.append(
            "[plan] measured and [plan.stations] contradict each other: poses measured from one "
            "station do not count at another, where the robot's base has to be found anew; remove "
            "[plan.stations] and write where they were measured from as [tracker] station_mm"
        )
    if plan.stations.grid and plan.stations.list_mm:
        found.append("[plan.stations] has list_mm and grid; remove one")
    if plan.stations.grid:
        across, deep, high = plan.stations.grid.count
        if across * deep * high > MAX_STATIONS:
            found.append(
                f"[plan.stations.grid] count makes {across * deep * high} stations; at most "
                f"{MAX_STATIONS}; choose smaller counts"
            )
    if not isinstance(plan.goal, BoxGoal):
        found += _goal_contradictions(plan.goal)
    return found


def _goal_contradictions(goal: ListGoal | PathGoal) -> list[str]:
    """The same, of a goal given pose by pose."""
    if bool(goal.joints_deg) == bool(goal.tool_mm_deg):
        both = "both" if goal.joints_deg else "neither of"
        return [f"[plan.goal] has {both} joints_deg and tool_mm_deg; give one of them"]
    found = []
    count = len(goal.joints_deg or goal.tool_mm_deg)
    key = "joints_deg" if goal.joints_deg else "tool_mm_deg"
    if isinstance(goal, PathGoal) and count < 2:
        found.append(f"[plan.goal] {key} has 1 entry; a path has two corners or more; add one")
    wanted = count - isinstance(goal, PathGoal)
    if goal.weights and len(goal.weights) != wanted:
        found.append(
            f"[plan.goal] weights has {len(goal.weights)} entries; {wanted} belong there, "
            f"one per {'line' if isinstance(goal, PathGoal) else 'pose'}; mend the list"
        )
    return found
