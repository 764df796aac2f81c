"""What a study is: the records it leaves, how each is played, and what is said of them.

A study is one question asked of a campaign. It declares its records and what they depend on, plays
them piece by piece, joins the pieces in a fixed order, and says what came out. The runner, the run
folder, the report and the recording know studies by this interface only.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, runtime_checkable

from calib.errors import CalibError
from testbed.report.page import Figure, Section, Table, Verdict
from testbed.scenario.scenario import Scenario, StudyTable
from testbed.store.quantities import Quantity
from testbed.strict import some

if TYPE_CHECKING:
    from testbed.recording.story import Chapter

R = TypeVar("R")
Json = Any
"""Plain JSON values: text, number, true or false, null, list, mapping."""


@dataclass(frozen=True, slots=True)
class Cut:
    """How the work on one record, or on several together, is cut into pieces."""

    name: str
    """Of the pieces; records with one name come from the same pieces."""
    total: int
    """What is counted in all: robots, pools, designed sets."""
    size: int
    """How many of them each piece has, but for the last: the scenario decides, no machine."""
    reads: Mapping[str, Json]
    """What decides a piece beside its number and size: without the total, so that all full pieces
    are kept where more is asked for."""

    single: bool = False
    """Whether figures of each robot are kept in float32, decided as `size` is."""

    @property
    def count(self) -> int:
        """Number of pieces."""
        return max(1, -(-self.total // self.size))

    def block(self, piece: int) -> range:
        """What one piece has."""
        return range(piece * self.size, min(self.total, (piece + 1) * self.size))


@dataclass(frozen=True, slots=True)
class Record:
    """One file under trials/: its class, and all that its numbers depend on."""

    key: str
    """Fixed for ever, whatever files are called: random streams and old run folders know it."""
    kind: type
    """Class of the finished record."""
    reads: Mapping[str, Json]
    """What of the scenario decides it; its hash follows from this."""
    needs: tuple[str, ...] = ()
    """Keys of the records that `play` is handed; they are made first."""
    cut: Cut | None = None
    """Into independent pieces of work, parts of the record's class; None: it is one."""
    vital: bool = False
    """Without it there is no campaign: bad input ends the run and leaves nothing behind."""


@dataclass(frozen=True, slots=True)
class Task:
    """One record, or one piece of those of a cut, named so that any process can play it."""

    study: str
    keys: tuple[str, ...]
    """The records: several only where they are cut together."""
    piece: int = 0
    block: range = range(0)
    """What of the total it has, where it is a piece."""

    @property
    def key(self) -> str:
        """The record, where it is one."""
        (key,) = self.keys
        return key


@dataclass(frozen=True, slots=True, eq=False)
class Records:
    """Finished records; one that failed or is switched off is not among them."""

    values: Mapping[str, object]
    failed: Mapping[str, str]
    """Why others failed, by key."""

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
    """A study's answer to the question a scene asks, for the first screen."""

    verdict: Verdict
    table: Table
    """Its figures."""
    next_step: str
    """What a person should do after reading it."""
    picture: Callable[[], Figure] | None = None
    """Draws what shows it at a glance, for the page alone; without one the first figure of the
    study's own section stands there."""


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
        """All record keys it may ever use; no trial may be called so."""

    def records(self, scenario: Scenario) -> tuple[Record, ...]:
        """The records of this scenario; none where the study is off."""

    def play(self, scenario: Scenario, task: Task, needed: Records) -> object:
        """One record, from what is handed in alone: the same bytes in any process and order.

        Of a piece the parts of its records by key, those of each the same whatever others there
        are; where one cannot be computed, each is asked for alone.
        """

    def gather(self, scenario: Scenario, key: str, parts: Sequence[Any]) -> object:
        """The record from its parts in two or more pieces, in the order of their numbers.

        Those of a cut that is `single` are read each time one is asked for, figures in float32.
        """

    def answer(self, scenario: Scenario, records: Records) -> Answer | None:
        """Its answer to the question of the scene; None where it has nothing to say."""

    def results(self, scenario: Scenario, records: Records) -> Sequence[Quantity]:
        """Its part of result.json."""

    def arrays(self, scenario: Scenario, records: Records) -> Sequence[Quantity]:
        """Its part of arrays.npz."""

    def sections(self, scenario: Scenario, records: Records, *, first: bool) -> Sequence[Section]:
        """Its sections of the report; `first` says whether the first screen is its answer."""

    def recording(self, scenario: Scenario, records: Records) -> Sequence["Chapter"]:
        """Its chapters of the recording."""
