"""What a study is: the records it leaves, how each is played, and what is said of them.

A study is one question asked of a campaign. It declares its records and what they depend on, plays
them piece by piece, joins the pieces in a fixed order, and says what came out. The runner, the run
folder, the report and the recording know studies by this interface only.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, runtime_checkable

from calib.errors import CalibError
from testbed.report.page import Section, Table, Verdict
from testbed.scenario.scenario import Scenario, StudyTable
from testbed.store.quantities import Quantity

if TYPE_CHECKING:
    from testbed.recording.story import Chapter

R = TypeVar("R")
Json = Any
"""Plain JSON values: text, number, true or false, null, list, mapping."""


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
    pieces: int = 1
    """Independent pieces of work, of the record's class; they are not hashed."""
    vital: bool = False
    """Without it there is no campaign: bad input ends the run and leaves nothing behind."""


@dataclass(frozen=True, slots=True)
class Task:
    """One piece of one record, named so that any process can play it."""

    study: str
    key: str
    piece: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Records:
    """Finished records; one that failed or is switched off is not among them."""

    values: Mapping[str, object]
    failed: Mapping[str, str]
    """Why others failed, by key."""

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
        """One piece, from what is handed in alone: the same bytes in any process and order."""

    def gather(self, scenario: Scenario, key: str, parts: Sequence[Any]) -> object:
        """The record from two or more pieces, in the order of their numbers; they are joined."""

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
