"""The settings of a campaign: typed, checked, and resolved from their presets."""

from abc import abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeVar

from pydantic import Field, PrivateAttr

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
from testbed.strict import Fault

if TYPE_CHECKING:
    from testbed.robots.robot import Robot

FORMAT = 1
"""Version of the scenario file format this program writes; it reads this one."""
STUDY_KEYS = ("pose_count", "random_sets", "paper_budget", "tool_point", "population")
"""Records that [studies] asks for, each switched by the key of its name."""
RESERVED = ("setting", "validation", *STUDY_KEYS)
"""Record names that no trial may take, beside those of the studies' own tables."""
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


class StudyTable(Settings):
    """The table of one study, and what it asks of the other tables and of the robot."""

    table: ClassVar[str]
    """Its name in the file."""
    keys: ClassVar[tuple[str, ...]]
    """Record keys that go with it; no trial may be called so."""

    @abstractmethod
    def contradictions(self, scenario: "Scenario") -> list[str]:
        """Sentences, one per contradiction with itself or another table."""

    @abstractmethod
    def faults(self, scenario: "Scenario", robot: "Robot") -> list[Fault]:
        """Faults of what this robot cannot have; none where the study is off."""


T = TypeVar("T", bound=StudyTable)


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
    plan: PlanSettings
    trial: Annotated[tuple[TrialSettings, ...], Field(min_length=1, max_length=MAX_TRIALS)]
    _tables: dict[str, StudyTable] = PrivateAttr(default_factory=dict)

    @property
    def trials(self) -> tuple[TrialSettings, ...]:
        """The trials, in the order of the file."""
        return self.trial

    def trial_named(self, name: str) -> TrialSettings:
        """The trial with this name."""
        return next(trial for trial in self.trial if trial.name == name)

    @property
    def tables(self) -> Mapping[str, StudyTable]:
        """The tables of the studies, by name, in the order of the register."""
        return self._tables

    def table(self, kind: type[T]) -> T:
        """The table of one study, with the type of its settings."""
        table = self._tables[kind.table]
        if not isinstance(table, kind):
            raise TypeError(f"[{kind.table}] is {type(table).__name__}, not {kind.__name__}")
        return table

    def with_tables(self, tables: Mapping[str, StudyTable]) -> "Scenario":
        """The same scenario with these tables of studies."""
        copy = self.model_copy()
        copy._tables = dict(tables)
        return copy

    def document(self) -> dict[str, Any]:
        """Plain JSON values of everything, in the order in which a file has it."""
        out: dict[str, Any] = {}
        for key, value in self.model_dump(mode="json").items():
            out[key] = value
            if key == "studies":
                out |= {name: table.model_dump(mode="json") for name, table in self.tables.items()}
        return out


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
