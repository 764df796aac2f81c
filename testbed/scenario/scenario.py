"""A campaign: its tables, checked and resolved, and the file they were read from."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self, TypeVar

from pydantic import Field, PrivateAttr

from testbed.faults import Fault, KeyPath, place
from testbed.scenario.laboratory import (
    CellSettings,
    FixtureSettings,
    PaperTracker,
    TrackerSettings,
    TruthSettings,
)
from testbed.scenario.planning import PlanSettings
from testbed.scenario.tables import (
    BudgetSettings,
    HeldOutSettings,
    IdentificationSettings,
    Name,
    PoolSettings,
    Settings,
    StudySettings,
    Text,
    TrialSettings,
    UncertaintySettings,
)
from testbed.scenario.tolerance import ToleranceTable
from testbed.strict import PlainText
from testbed.units import counted

if TYPE_CHECKING:
    from testbed.robots.robot import Robot

FORMAT = 1
"""Version of the scenario file format this program writes; it reads this one."""
STUDY_KEYS = ("pose_count", "random_sets", "paper_budget", "tool_point", "population")
"""Records that [studies] asks for, each switched by the key of its name."""
RESERVED = ("setting", "validation", *STUDY_KEYS, "random_calibrations")
"""Record names that no trial may take, beside those of the studies' own tables."""
PLAIN = ("format", "name", "title", "seed", "robot")
"""Keys at the top of the file that are no tables."""
NESTED = (
    "trial[]",
    "cell.obstacle[]",
    "identification.prior",
    "identification.prior.sd_deg",
    "identification.prior.sd_mm",
    "plan.stations",
    "plan.stations.grid",
    "plan.goal",
    "plan.use",
    "fixtures.reflectors_mm",
    "fixtures.anchors_mm",
)
"""Lists of tables, and tables inside tables."""
MAX_TRIALS = 200


class StudyTable(Settings):
    """The table of one study, and what it asks of the other tables and of the robot."""

    table: ClassVar[str]
    """Its name in the file."""
    keys: ClassVar[tuple[str, ...]]
    """Record keys that go with it; no trial may be called so."""
    totals: ClassVar[tuple[str, ...]] = ()
    """Its keys that only say how many there are of what is played in pieces."""

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
    """Version of the file format."""
    name: Name
    """What the campaign is called, also in the name of its folder."""
    title: Annotated[PlainText, Field(max_length=200)] = ""
    """One line about it, shown in lists and at the head of the report."""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    """All random numbers follow from it: the same seed gives the same campaign."""
    robot: Annotated[Text, Field(min_length=1)]
    """Name of a shipped robot, or path of a robot.toml or its folder."""
    truth: TruthSettings
    tracker: TrackerSettings = PaperTracker()
    fixtures: FixtureSettings | None = None
    pool: PoolSettings = PoolSettings()
    cell: CellSettings = CellSettings()
    test: HeldOutSettings = HeldOutSettings()
    identification: IdentificationSettings = IdentificationSettings()
    uncertainty: UncertaintySettings = UncertaintySettings()
    tolerance: ToleranceTable | None = None
    studies: StudySettings = StudySettings()
    budget: BudgetSettings = BudgetSettings()
    plan: PlanSettings
    trial: Annotated[tuple[TrialSettings, ...], Field(min_length=1, max_length=MAX_TRIALS)]
    _tables: dict[str, StudyTable] = PrivateAttr(default_factory=dict)
    _given: dict[str, Any] = PrivateAttr(default_factory=dict)

    def __repr__(self) -> str:
        """One line; `document` has every number."""
        trials = counted(len(self.trial), "trial")
        return f"Scenario({self.name!r}, seed {self.seed}, {self.robot}, {trials})"

    __str__ = __repr__

    def trial_named(self, name: str) -> TrialSettings:
        """The trial with this name."""
        return next(trial for trial in self.trial if trial.name == name)

    @property
    def designed(self) -> tuple[TrialSettings, ...]:
        """The trials whose sets are chosen, not drawn, in the order of the file."""
        return tuple(trial for trial in self.trial if trial.method != "random")

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

    @property
    def given(self) -> dict[str, Any]:
        """What somebody wrote of it, as a document; presets, robot and defaults decide the rest."""
        return deepcopy(self._given) or self.document()

    def with_tables(self, tables: Mapping[str, StudyTable]) -> "Scenario":
        """The same scenario with these tables of studies."""
        copy = self.model_copy()
        copy._tables = dict(tables)
        return copy

    def with_given(self, document: Mapping[str, Any]) -> "Scenario":
        """The same scenario, as what came of this document."""
        copy = self.model_copy()
        copy._given = dict(document)
        return copy

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy; tables in `update` count as given."""
        copy = super().model_copy(update=update, deep=deep)
        if update and self._given:
            document = copy.document()
            kept = {key: value for key, value in self._given.items() if key not in update}
            copy._given = kept | {key: document[key] for key in update if key in document}
        return copy

    def document(self) -> dict[str, Any]:
        """Plain JSON values of everything, in the order in which a file has it."""
        out: dict[str, Any] = {}
        for key, value in self.model_dump(mode="json").items():
            if value is not None:  # a table that is not there
                out[key] = value
            if key == "studies":
                out |= {name: table.model_dump(mode="json") for name, table in self.tables.items()}
        return out


@dataclass(frozen=True, slots=True)
class ScenarioFile:
    """A scenario document as its messages speak of it: its values, and the tables it may have."""

    document: Mapping[str, Any]
    kinds: Mapping[str, type[Settings]]
    """Tables that are no part of every scenario, by name: those of studies, and [origin]."""

    @property
    def keys(self) -> tuple[str, ...]:
        """Every key of the top of the file, in the order of a written scenario."""
        own = list(Scenario.model_fields)
        place = own.index("studies") + 1
        return (*own[:place], *self.kinds, *own[place:])

    @property
    def tables(self) -> tuple[str, ...]:
        """The names of all tables."""
        return (*(key for key in self.keys if key not in PLAIN), *NESTED)

    def place(self, path: KeyPath) -> str:
        """Where a value stands, in the words of the file."""
        return place(path, self.document, self.tables)

    def in_order(self, faults: Sequence[Fault]) -> list[Fault]:
        """The faults in the order of the file's tables, unknown keys last."""
        rank = {key: k for k, key in enumerate(self.keys)}
        first = [fault for fault in faults if fault.code == "S38"]
        rest = [fault for fault in faults if fault.code != "S38"]
        return first + sorted(
            rest, key=lambda fault: rank.get(str(fault.path[0]), len(rank)) if fault.path else -1
        )
