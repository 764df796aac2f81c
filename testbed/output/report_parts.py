"""What a report is made of: sections of paragraphs, lists, tables and figures."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True, slots=True)
class Text:
    """One paragraph."""

    kind: ClassVar[str] = "text"
    text: str


@dataclass(frozen=True, slots=True)
class Points:
    """A list of sentences."""

    kind: ClassVar[str] = "points"
    items: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of cells that are already written out; units stand in the head."""

    kind: ClassVar[str] = "table"
    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    align: str
    """One letter per column: l or r."""
    note: str = ""
    size: str = "normal"
    """normal, or small for tables of many columns."""
    strong: tuple[int, ...] = ()
    """Rows printed bold."""


@dataclass(frozen=True, slots=True)
class Figure:
    """A drawing and what it shows."""

    kind: ClassVar[str] = "figure"
    caption: str
    svg: str


@dataclass(frozen=True, slots=True)
class Code:
    """Text kept as it is, line by line."""

    kind: ClassVar[str] = "code"
    text: str


Block = Text | Points | Table | Figure | Code


@dataclass(frozen=True, slots=True)
class Section:
    """A heading and what stands under it."""

    anchor: str
    title: str
    blocks: tuple[Block, ...]


def versions_table(versions: Mapping[str, str]) -> Table:
    """Program and packages that made a result."""
    return Table(
        caption="Versions",
        head=("program or package", "version"),
        rows=tuple(versions.items()),
        align="ll",
    )
