"""The folder of a plan or of a test after ISO 9283, opened: its numbers and its tables."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from calib.shown import ResultTable, Shown
from testbed.gates.text import read_text, split
from testbed.store.documents import read_json
from testbed.store.layout import ISO9283, OWNERS, PLAN, RESULT

NUMBERS = {PLAN: PLAN, ISO9283: RESULT}
"""Where the numbers of a folder stand, by the file that marks it."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class WrittenFolder(Shown, Mapping[str, Any]):
    """What a folder says, as it says it: a mapping of its numbers, units in the keys."""

    kind: str
    """What it is, in words."""
    path: Path
    numbers: Mapping[str, Any]

    def __getitem__(self, name: str) -> Any:
        return self.numbers[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.numbers)

    def __len__(self) -> int:
        return len(self.numbers)

    def __repr__(self) -> str:
        return f"WrittenFolder({str(self.path)!r}: {self.kind})"

    def tables(self) -> dict[str, ResultTable]:
        """Each CSV file of the folder by its name without ending, units in the heads."""
        return {file.stem: read_columns(file) for file in sorted(self.path.glob("*.csv"))}


def written_folder(path: Path) -> WrittenFolder | None:
    """The plan or test in a folder; None where it holds neither."""
    for mark, numbers in NUMBERS.items():
        if (path / mark).is_file():
            fix = "give the command that wrote it again, with another --out"
            return WrittenFolder(OWNERS[mark], path, read_json(path / numbers, fix=fix))
    return None


def read_columns(path: Path) -> ResultTable:
    """A CSV file that this program wrote; columns of numbers as numbers, an empty cell as nan."""
    head, *rows = split(read_text(path, str(path)).content(), "comma", str(path))
    return ResultTable({name: _column([row[k] for row in rows]) for k, name in enumerate(head)})


def _column(cells: list[str]) -> np.ndarray[Any, Any]:
    """Numbers, unless a cell is a word."""
    try:
        return np.array([float(cell or "nan") for cell in cells])
    except ValueError:
        return np.array(cells)
