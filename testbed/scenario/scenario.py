"""The settings of a campaign: typed, checked, and resolved from their presets."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from testbed.scenario.plan import DEFAULT_POSES, PlanCriterion, PlanMethod, PlanSettings
from testbed.scenario.tables import (
    CellSettings,
    JointRange,
    Name,
    PlainText,
    Point,
    Settings,
    Side,
    facts_of,
    robot_of,
    with_workspace,
)
from testbed.scenario.tables import IdentificationSettings as IdentificationSettings
from testbed.scenario.tracker import At960Tracker as At960Tracker
from testbed.scenario.tracker import PaperTracker as PaperTracker
from testbed.scenario.tracker import TrackerSettings
from testbed.scenario.truth import MAX_JOINTS, resolved_truth
from testbed.scenario.truth import TruthSettings as TruthSettings
from testbed.studies.compensation.settings import COMPENSATION_KEYS, CompensationSettings
from testbed.studies.coverage.settings import COVERAGE_KEYS, CoverageSettings
from testbed.studies.wen2022.settings import REEXAMINED_KEYS, SETS_KEY, ReexaminedSettings

FORMAT = 1
"""Version of the scenario file format this program writes; it reads this one."""
STUDY_KEYS = ("pose_count", "random_sets", "paper_budget", "tool_point", "population")
RESERVED = (
    "setting",
    "validation",
    *STUDY_KEYS,
    *COVERAGE_KEYS,
    SETS_KEY,
    *REEXAMINED_KEYS,
    *COMPENSATION_KEYS,
)
"""Record names that no trial may take."""
MAX_TRIALS = 200


class PoolSettings(Settings):
    """[pool]: the candidate poses."""

    size: Annotated[int, Field(ge=10, le=20_000)] = 1000
    box_center_mm: Point = (250.0, 0.0, 200.0)
    """Of the nominal tool position, base frame."""
    box_size_mm: tuple[Side, Side, Side] = (900.0, 1200.0, 800.0)
    self_collision: bool = True
    line_of_sight: bool = True
    joint_margin_deg: Annotated[float, Field(ge=0.0, le=90.0)] = 0.0
    """Kept from every joint limit; prismatic joints ignore it."""
    joint_ranges_deg: Annotated[tuple[JointRange, ...], Field(max_length=MAX_JOINTS)] = ()
    """Lowest and highest value of each joint in a posture; deg, mm where a joint slides; empty: the
    joint limits. For arms whose joints turn more than once: half a turn to either side is enough,
    and the moves between the poses stay short."""


class HeldOutSettings(Settings):
    """[test]: poses that judge and are never used for identification."""

    poses: Annotated[int, Field(ge=1, le=5000)] = 50


class UncertaintySettings(Settings):
    """[uncertainty]: how often things are repeated and drawn."""

    repeats: Annotated[int, Field(ge=2, le=1000)] = 10
    """Visits of each pose, type A."""
    replications: Annotated[int, Field(ge=0, le=100_000)] = 200
    """Calibrations repeated to check the stated intervals; 0 skips the check."""
    draws: Annotated[int, Field(ge=2_000, le=10_000_000)] = 10_000
    """Monte Carlo draws of the tool point; fewer than 100 / (1 - p) say nothing of a 95 % interval
    (JCGM 101:2008, 7.9.4 b)."""


class StudySettings(Settings):
    """[studies]: which extra studies are played."""

    pose_count: bool = False
    pose_count_max: Annotated[int, Field(ge=30, le=1000)] = 150
    random_sets: Annotated[int, Field(ge=0, le=10_000)] = 100
    """Random sets each designed set is compared with; 0 skips the study."""
    paper_budget: bool = False
    tool_point: bool = False
    population: Annotated[int, Field(ge=0, le=10_000)] = 0
    """Further virtual robots on which every trial's set is played; 0 skips the study."""


class TrialSettings(Settings):
    """[[trial]]: one pose set."""

    name: Name
    poses: Annotated[int, Field(ge=1, le=5000)]
    method: PlanMethod
    criterion: PlanCriterion = "O1"
    """What the method makes best; random is only judged by it. V and G take their poses from
    [plan.goal], as `truebed plan` does."""
    rows: Literal["whitened", "paper"] = "whitened"
    """Rows and units the index is computed in; "paper": 12 unweighted rows, mm and rad."""
    sets: Annotated[int, Field(ge=1, le=10_000)] = 100
    """Random sets of which best_of_random keeps the best; the other methods ignore it."""


class Scenario(Settings):
    """A campaign, fully resolved: presets applied, every default written out."""

    format: Literal[1]
    name: Name
    title: Annotated[str, Field(max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$")] = ""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    robot: Annotated[PlainText, Field(min_length=1)]
    """Name of a shipped robot, or path of a robot.toml or its folder."""
    truth: TruthSettings
    tracker: TrackerSettings = PaperTracker()
    pool: PoolSettings = PoolSettings()
    cell: CellSettings = CellSettings()
    test: HeldOutSettings = HeldOutSettings()
    identification: IdentificationSettings = IdentificationSettings()
    uncertainty: UncertaintySettings = UncertaintySettings()
    studies: StudySettings = StudySettings()
    coverage: CoverageSettings = CoverageSettings()
    reexamined: ReexaminedSettings = ReexaminedSettings()
    compensation: CompensationSettings = CompensationSettings()
    plan: PlanSettings
    trial: Annotated[tuple[TrialSettings, ...], Field(min_length=1, max_length=MAX_TRIALS)]

    @property
    def trials(self) -> tuple[TrialSettings, ...]:
        """The trials, in the order of the file."""
        return self.trial

    def trial_named(self, name: str) -> TrialSettings:
        """The trial with this name."""
        return next(trial for trial in self.trial if trial.name == name)

    @model_validator(mode="after")
    def _fits_together(self) -> "Scenario":
        """Collect every contradiction between tables."""
        from testbed.scenario.contradictions import contradictions

        found = contradictions(self)
        if found:
            raise ValueError("\n".join(found))
        return self


def resolved(document: Mapping[str, Any]) -> dict[str, Any]:
    """The document with presets applied; wrong types are left for the strict check to name."""
    robot = robot_of(document)
    out = with_workspace(document, robot)
    truth = out.get("truth", {})
    tracker = out.get("tracker", {})
    if isinstance(tracker, Mapping):
        tracker = out["tracker"] = {"preset": "paper", **tracker}
    if isinstance(truth, Mapping):
        at960 = isinstance(tracker, Mapping) and tracker.get("preset") == "at960"
        out["truth"] = resolved_truth(truth, **facts_of(robot), at960=at960)
    plan = out.get("plan", {})
    if isinstance(plan, Mapping):
        pool = out.get("pool", {})
        size = pool.get("size") if isinstance(pool, Mapping) else None
        small = type(size) is int and 10 <= size < DEFAULT_POSES
        poses = size if small else DEFAULT_POSES
        out["plan"] = {"poses": 0 if "target_um" in plan else poses} | dict(plan)
        if isinstance(goal := plan.get("goal"), Mapping):
            out["plan"]["goal"] = {"kind": "box"} | dict(goal)
        if "plan" in document and "trial" not in document:
            # a file made for planning can be played too, as one designed set
            out["trial"] = [{"name": "designed", "poses": poses, "method": "detmax"}]
    return out
