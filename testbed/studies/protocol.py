"""The interface of a study: its records, how each is played, and the results from them.

A study is one question about a campaign. It declares its records and what they depend on, plays
them piece by piece, joins the pieces in a fixed order, and returns results. The runner, the run
folder, the report and the recording know studies by this interface only.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, runtime_checkable

from calib.errors import CalibError
from testbed.names import some
from testbed.report.page import Figure, Section, Table, Verdict
from testbed.scenario.scenario import Scenario, StudyTable
from testbed.store.quantities import Quantity

if TYPE_CHECKING:
    from testbed.recording.story import Chapter

R = TypeVar("R")
Json = Any
"""Plain JSON values: text, number, true or false, null, list, mapping."""


@dataclass(frozen=True, slots=True)
class Cut:
    """How the work on one record, or on several together, is cut into pieces."""

    name: str
    """Name of the pieces; records with the same name come from the same pieces."""
    total: int
    """Number of robots, pools or designed sets in all."""
    size: int
    """Number of these in each piece but the last; the scenario decides it, not the machine."""
    reads: Mapping[str, Json]
    """Values on which a piece depends besides its number and size; not the total, so that full
    pieces are kept if that is raised."""

    single: bool = False
    """Whether figures of each robot are kept in float32; decided like `size`."""

    @property
    def count(self) -> int:
        """Number of pieces."""
        return max(1, -(-self.total // self.size))

    def block(self, piece: int) -> range:
        """Range of one piece."""
        return range(piece * self.size, min(self.total, (piece + 1) * self.size))


@dataclass(frozen=True, slots=True)
class Record:
    """One file under trials/: its class, and all that its numbers depend on."""

    key: str
    """Key that never changes, whatever the names of files, since streams and run folders use it."""
    kind: type
    """Class of the finished record."""
    reads: Mapping[str, Json]
    """Values of the scenario on which it depends; its hash follows from these."""
    needs: tuple[str, ...] = ()
    """Keys of the records that `play` gets; they are made first."""
    cut: Cut | None = None
    """Division into independent pieces, parts of the record's class; None for a single piece."""
    vital: bool = False
    """Whether the campaign needs it: if so, bad input ends the run and leaves no files."""


@dataclass(frozen=True, slots=True)
class Task:
    """One record, or one piece of those of a cut, named so that any process can play it."""

    study: str
    keys: tuple[str, ...]
    """Keys of the records; several only if they are cut together."""
    piece: int = 0
    block: range = range(0)
    """Range of the total, for a piece."""

    @property
    def key(self) -> str:
        """Key of the record, if it is a single one."""
        (key,) = self.keys
        return key


@dataclass(frozen=True, slots=True, eq=False)
class Records:
    """Finished records; one that failed or is switched off is not among them."""

    values: Mapping[str, object]
    failed: Mapping[str, str]
    """Reasons of failed records, by key."""

    def __repr__(self) -> str:
        names, failed = some(list(self.values), 6), len(self.failed)
        return f"Records({names}{f'; {failed} failed' * bool(failed)})"

    def get(self, key: str, kind: type[R]) -> R:
        """The record `key`; CalibError if it failed."""
        if key in self.failed:
            raise CalibError(f"{key} failed ({self.failed[key]})", code="T1", field=key)
        record = self.values[key]
        if not isinstance(record, kind):
            raise TypeError(f"{key} is {type(record).__name__}, not {kind.__name__}")
        return record

    def find(self, key: str, kind: type[R]) -> R | None:
        """The record `key`, or None if it failed or is switched off."""
        return self.get(key, kind) if key in self.values else None


@dataclass(frozen=True, slots=True)
class Answer:
    """A study's answer to the question of a scene, for the first screen."""

    verdict: Verdict
    table: Table
    """Its figures."""
    next_step: str
    """Recommended next step."""
    picture: Callable[[], Figure] | None = None
    """Function that draws a figure for the page; without one the page has the first figure of the
    study's own section."""


@runtime_checkable
class Study(Protocol):
    """One question asked of a campaign."""

    @property
    def name(self) -> str:
        """Its folder, and its name in the register."""

    @property
    def settings(self) -> type[StudyTable] | None:
        """Its table of the scenario; None if it reads core tables only."""

    @property
    def keys(self) -> tuple[str, ...]:
        """All record keys that it may use, which are no names of trials."""

    def records(self, scenario: Scenario) -> tuple[Record, ...]:
        """The records of this scenario; none if the study is off."""

    def play(self, scenario: Scenario, task: Task, needed: Records) -> object:
        """One record from the arguments alone, with the same bytes in any process and order.

        For a piece, the parts of its records by key, each independent of the others; if one cannot
        be computed, each is requested separately.
        """

    def gather(self, scenario: Scenario, key: str, parts: Sequence[Any]) -> object:
        """The record from its parts in two or more pieces, in the order of their numbers.

        Parts of a `single` cut are read each time they are used, with figures in float32.
        """

    def answer(self, scenario: Scenario, records: Records) -> Answer | None:
        """Its answer to the question of the scene; None if it has none."""

    def results(self, scenario: Scenario, records: Records) -> Sequence[Quantity]:
        """Its part of result.json."""

    def arrays(self, scenario: Scenario, records: Records) -> Sequence[Quantity]:
        """Its part of arrays.npz."""

    def sections(self, scenario: Scenario, records: Records, *, first: bool) -> Sequence[Section]:
        """Its sections of the report; `first` is true if its answer is the first screen."""

    def recording(self, scenario: Scenario, records: Records) -> Sequence["Chapter"]:
        """Its chapters of the recording."""
