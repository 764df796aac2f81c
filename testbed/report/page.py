"""A report as one HTML page: headline, then sections of paragraphs, lists, tables and figures."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from itertools import zip_longest
from pathlib import Path
from typing import Any, ClassVar, Literal, get_args

from calib.arrays import Index
from calib.errors import visible
from testbed.units import counted, listed, plain, typeset

SIMULATED = "SIMULATED - not a calibration certificate"
"""On everything that was made from a virtual robot."""
SENTENCE_ENDS = re.compile(r"(?<=[.!?]) (?=[A-Z])")
OPTION = re.compile(r"--[a-z][a-z-]*")
"""An option of a command, which a browser would break behind its hyphens."""
SHORTEST = 3
"""Spaces in what counts as a sentence, at least."""
HALF = 74
"""Letters across half a printed page, in the type of small tables."""
LONG, PRINTED = 20, 10
"""Rows from which a table of one row per trial is long, and those of it that print shows."""
BETWEEN, LARGER = 1.7, 1.2
"""Letters between two columns, and what a letter of other tables takes."""
TEMPLATES = Path(__file__).parent / "templates"


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
    align: str = ""
    """One letter per column, l or r; without them the first is l and all others are r."""
    note: str = ""
    size: str = "normal"
    """normal, or small for tables of many columns."""
    strong: tuple[int, ...] = ()
    """Rows printed bold."""
    on_paper: int | None = None
    """Rows that print shows, the first ones; 0: a figure beside it says the same; None: all."""

    @property
    def is_narrow(self) -> bool:
        """Whether two such tables have room beside each other on paper: texts do not break."""
        widest = (
            max(max(map(len, head.split()), default=0), *(len(row[k]) for row in self.rows))
            for k, head in enumerate(self.head)
        )
        scale = 1.0 if self.size == "small" else LARGER
        return scale * sum(letters + BETWEEN for letters in widest) <= HALF

    @property
    def left_out(self) -> int:
        """Rows that print leaves to the file."""
        return 0 if self.on_paper is None else max(len(self.rows) - self.on_paper, 0)

    @property
    def letters(self) -> str:
        """One letter per column."""
        return self.align or "l" + "r" * (len(self.head) - 1)


def printed(count: int) -> int | None:
    """Rows that print shows of a table with so many that are alike, each of its own trial."""
    return PRINTED if count > LONG else None


def heads(text: str) -> tuple[str, ...]:
    """Heads of a table's columns, written in one line with commas between them."""
    return tuple(text.split(", "))


def table_of(rows: Sequence[Mapping[str, str]], caption: str, **look: Any) -> Table:
    """A table of rows, at least one, whose cells stand under the names of their columns."""
    return Table(caption, tuple(rows[0]), tuple(tuple(row.values()) for row in rows), **look)


@dataclass(frozen=True, slots=True)
class Figure:
    """A drawing and what it shows."""

    kind: ClassVar[str] = "figure"
    caption: str
    svg: str
    size: Literal["full", "half"] = "full"
    """Half: of a drawing for half the width; on paper two of them stand beside each other."""
    on_paper: bool = True
    """Whether print shows it; not where a table beside it says the same."""
    phone: str = ""
    """The same drawn for a phone (`on_phone`); without it a phone scrolls through the figure."""


Block = Text | Points | Table | Figure
Part = Literal["answer", "campaign", "detail", "record"]
"""Where a section stands: what answers the question of a scene, what was played, the rest."""
PARTS: tuple[Part, ...] = get_args(Part)


@dataclass(frozen=True, slots=True)
class Section:
    """A heading and what stands under it."""

    anchor: str
    title: str
    blocks: tuple[Block, ...]
    part: Part = "campaign"
    on_paper: bool = True
    """Whether print shows it; what is not asked may be left to the file."""


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
    recording: str = ""
    """Name of the file beside the page that plays what happened; empty if there is none."""
    picture: Figure | None = None
    """Beside the verdict on the first screen; without one the first figure of the sections."""

    @property
    def unprinted(self) -> str:
        """What print leaves to the file, in words; empty if nothing."""
        left = [section.title for section in self.sections if not section.on_paper]
        found = [b for section in self.sections if section.on_paper for b in section.blocks]
        tables = [block for block in found if isinstance(block, Table)]
        for count, noun in (
            (sum(isinstance(block, Figure) and not block.on_paper for block in found), "figure"),
            (sum(table.on_paper == 0 for table in tables), "table"),
            (sum(bool(table.left_out and table.on_paper) for table in tables), "long table"),
        ):
            if count:
                left.append("the end of " * (noun == "long table") + counted(count, noun))
        return listed(left) if left else ""

    def opened(self) -> "Page":
        """The page with a picture on its first screen, taken from the sections if need be."""
        if self.picture is not None:
            return self
        for k, section in enumerate(self.sections):
            found = next((block for block in section.blocks if isinstance(block, Figure)), None)
            if found is not None:
                rest = tuple(block for block in section.blocks if block is not found)
                emptied = (replace(section, blocks=rest),) if rest else ()
                sections = (*self.sections[:k], *emptied, *self.sections[k + 1 :])
                return replace(self, picture=found, sections=sections)
        return self


def said_once(page: Page) -> Page:
    """The page without sentences of its sections that stand before them, on the first screen first.

    Of paragraphs and lists only: tables and figures say what they say where they stand.
    """
    seen = set[str]()

    def new(text: str) -> str:
        """What of a text was not said before."""
        kept = []
        for sentence in SENTENCE_ENDS.split(text):
            if plain(sentence) not in seen:
                kept.append(sentence)
            if sentence.count(" ") >= SHORTEST:
                seen.add(plain(sentence))
        return " ".join(kept)

    for text in (page.verdict, *page.reasons, page.next_step):
        new(text)
    sections = []
    for section in page.sections:
        blocks: list[Block] = []
        for block in section.blocks:
            if isinstance(block, Text):
                text = new(block.text)
                blocks += [Text(text)] if text else []
            elif isinstance(block, Points):
                items = tuple(item for text in block.items if (item := new(text)))
                blocks += [Points(items)] if items else []
            else:
                blocks.append(block)
        sections.append(replace(section, blocks=tuple(_announced(blocks))))
    return replace(page, sections=tuple(section for section in sections if section.blocks))


def _announced(blocks: Sequence[Block]) -> Iterator[Block]:
    """The blocks but lines that end with a colon and have lost the list they announce."""
    for block, following in zip_longest(blocks, blocks[1:]):
        announces = isinstance(block, Text) and block.text.endswith(":")
        if not announces or isinstance(following, Points | Table | Figure):
            yield block


def whole(text: str) -> str:
    """A text as HTML whose options, as of a command, stand in one line: nothing is hidden in them.

    Examples
    --------
    >>> print(whole("a < b: --train 6"))
    a &lt; b: <span class="whole">--train</span> 6
    """
    return OPTION.sub(r'<span class="whole">\g<0></span>', escape(text))


def render(page: Page) -> str:
    """The page as HTML: no network, same bytes each time; whatever a user wrote is escaped."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["typeset"] = typeset
    environment.filters["whole"] = whole
    return visible(environment.get_template("report.html.j2").render(page=said_once(page.opened())))


def record_section(text: str, versions: Mapping[str, str]) -> Section:
    """How the result was made: what makes it again, and by which versions.

    Parameters
    ----------
    text : str
        Where the files lie, and what is promised to whoever uses them again.
    versions : mapping of str to str
        Program and packages.
    """
    made = ", ".join(f"{name} {version}" for name, version in versions.items())
    return Section("record", "How it was made", (Text(text), Text(f"Versions: {made}.")))


def rejections(n_drawn: int, names: Sequence[str], rejected: Index, size: int) -> str:
    """How many of `n_drawn` candidate poses were refused for which reason, for a pool of `size`."""
    counts = [(name, int(n)) for name, n in zip(names, rejected, strict=True) if n]
    kept = n_drawn - sum(n for _, n in counts)
    said = listed([f"{n} {name}" for name, n in counts])
    first = f"the first {size} of {kept} feasible ones" if kept > size else f"{kept} feasible ones"
    refused = f"{n_drawn - kept} were refused: {said}" if counts else "none was refused"
    return f"Of {n_drawn} candidate poses {refused}; the pool is {first}."


@dataclass(frozen=True, slots=True)
class Verdict:
    """One estimate judged."""

    believable: bool
    """Whether the stated uncertainty passed every test, replications against the truth included."""
    contradicted: bool
    """Whether a test failed; a statement that was never tested is neither."""
    sentence: str
    """How good, and whether that can be believed."""
    reasons: tuple[str, ...]
    """One sentence per test, the failed ones first."""
    mark: str
    """The verdict in a few words, behind a tick or a cross."""
