"""What a report is made of: sections of paragraphs, lists, tables and figures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from calib.arrays import Index
from testbed.units import NARROW


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


BANNER = "SIMULATED - not a calibration certificate"


TEMPLATES = Path(__file__).parents[1] / "report" / "templates"


@dataclass(frozen=True, slots=True)
class Page:
    """Everything the template prints."""

    banner: str
    title: str
    subtitle: str
    believable: bool
    mark: str
    """The verdict in a few words, behind a tick or a cross."""
    verdict: str
    reasons: tuple[str, ...]
    headline: Table
    next_step: str
    sections: tuple[Section, ...]


def render(page: Page) -> str:
    """The page as HTML; whatever a user wrote is escaped."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("report.html.j2").render(page=page)


def plain(text: str) -> str:
    """A sentence of the report as plain text, for the terminal as well."""
    return text.replace(NARROW, " ").replace("µ", "u").replace("−", "-")


def pool_rows(n_drawn: int, names: Sequence[str], rejected: Index, size: int) -> Table:
    """The same, of a pool of `size` poses from `n_drawn` candidates."""
    counts = [int(count) for count in rejected]
    rows = [("drawn", str(n_drawn), "100 %")]
    share = [f"{100 * count / max(n_drawn, 1):.1f} %" for count in counts]
    rows += [
        (f"refused: {name}", str(count), part)
        for name, count, part in zip(names, counts, share, strict=True)
    ]
    kept = n_drawn - sum(counts)
    rows.append(("feasible", str(kept), f"{100 * kept / max(n_drawn, 1):.1f} %"))
    return Table(
        caption=f"Candidate poses: a pool of {size}",
        head=("candidates", "number", "share"),
        rows=tuple(rows),
        align="lrr",
        note="Each candidate is counted under the first reason that applies. "
        + (f"The first {size} feasible ones are the pool." if kept > size else ""),
    )
