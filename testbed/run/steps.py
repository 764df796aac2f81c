"""The steps of the work on a scenario as progress counts them: records or pieces, then files."""

from collections.abc import Iterable, Mapping

from testbed.store import layout
from testbed.studies.protocol import Record


def step_of(record: Record) -> str:
    """What progress calls the work on a record: its cut, or itself."""
    return record.cut.name if record.cut else record.key


def steps_of(records: Iterable[Record]) -> dict[str, int]:
    """Pieces of each step of the work on some records, by what progress calls it."""
    return {step_of(record): record.cut.count if record.cut else 1 for record in records}


class Steps:
    """How many steps there are, and how many of them are done."""

    def __init__(self, records: Iterable[Record]) -> None:
        self._pieces = steps_of(records)
        self._files, self._written = len(layout.DERIVED), 0
        self.played: dict[str, int] = {}
        """How many pieces of each cut there are."""

    def keep_slice(self, needed: Iterable[Record], pieces: Mapping[str, int]) -> None:
        """Count some records and so many pieces of some cuts alone, and no derived file."""
        self._pieces = {step: self._pieces[step] for step in map(step_of, needed)} | {**pieces}
        self._files = 0

    def wrote(self) -> None:
        """Count one more derived file as written."""
        self._written += 1

    def done(self, finished: Iterable[Record]) -> int:
        """How many are done, once some records are finished."""
        had = set(map(step_of, finished))
        of_records = (
            count if step in had else self.played.get(step, 0)
            for step, count in self._pieces.items()
        )
        return sum(of_records) + self._written

    def total(self, *, files: bool) -> int:
        """How many there are in all, those of derived files too where they will be written."""
        return sum(self._pieces.values()) + (self._files if files else 0)
