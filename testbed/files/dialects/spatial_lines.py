"""Lines of a Spatial Analyzer export: fields, axes and units, and how many fields are names."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from testbed.files.columns import ANGLES, LENGTHS
from testbed.files.dialects.numbers import number_of, pointed
from testbed.files.refusal import refusal
from testbed.files.rows.below import table_ends
from testbed.gates.text import FileText

AXES = re.compile(r"AXES\s*=\s*(\w+)\s*:(.*)", re.IGNORECASE)
UNIT = re.compile(r"\((mm|m|meters|millimeters|inches|in|degrees|deg|radians|rad)\)", re.IGNORECASE)
STATED = re.compile(
    r"\bunits?\s*[:=]\s*(mm|m|cm|ft|meters|millimeters|inches|in)\s*(?=$|[,;])",
    re.IGNORECASE | re.MULTILINE,
)
"""``Units: mm`` in a comment of its own."""
WITHIN, BEHIND = re.compile(r"(?<=\d),(?=\d)"), re.compile(r",\s+")
"""A comma that may stand before decimals, and one that separates as a blank is behind it."""
DECIMAL = re.compile(r"[+\u2212-]?\d+,\d+")
UNITS = {"meters": "m", "millimeters": "mm", "inches": "in", "degrees": "deg", "radians": "rad"}
SYSTEMS = {
    "CARTESIAN": ("x", "y", "z"),
    "CYLINDRICAL": ("range", "azimuth", "z"),
    "SPHERICAL": ("range", "azimuth", "zenith"),
}
"""Our names of the coordinates of each system; the polar angle of a sphere is that from z."""
NAMES = ("target", "group", "collection")
"""What the fields before the coordinates are, the last one first."""


@dataclass(frozen=True, slots=True)
class Lines:
    """Fields of the lines that are no comments, axes and units from those that are."""

    where: str
    fields: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    separator: str
    encoding: str
    decimal: str
    """What numbers have before their decimals."""
    system: str = "CARTESIAN"
    length: str = ""
    angle: str = ""
    below: tuple[tuple[int, str], ...] = ()
    """Lines below the others that are none of them."""


def sa_lines(text: FileText) -> Lines:
    """Fields of the data lines, with axes and units from the comments."""
    comments = [line for line in text.lines if line.lstrip().startswith("//")]
    content = [(number, line.strip().rstrip(",;")) for number, line in text.content("//", "#")]
    if not content:
        raise refusal(text.where, "file", "has no points", fix="export them again")
    between = next((each for each in ";,\t" if each in content[0][1]), None)
    end = table_ends([list(map(str.strip, line.split(between))) for _, line in content])
    content, below = content[:end], tuple(content[end:])
    separator, parts, by_comma = _split_by([line for _, line in content])
    fields = tuple(_apart(parts(line)) for _, line in content)
    decimal = "," if by_comma and any(map(DECIMAL.fullmatch, fields[0])) else "."
    if by_comma:
        fields = tuple(tuple(map(_pointed, line)) for line in fields)
    numbers = tuple(number for number, _ in content)
    lines = Lines(text.where, fields, numbers, separator, text.encoding, decimal, below=below)
    found = AXES.search("\n".join(comments))
    if not found:
        stated = {word.lower() for word in STATED.findall("\n".join(comments))}
        return replace(lines, length=_as_ours(stated.pop())) if len(stated) == 1 else lines
    system = found.group(1).upper()
    if system not in SYSTEMS:
        message = f"AXES = {system[:20]} is not a system of coordinates"
        known = f"known are {', '.join(SYSTEMS)}"
        raise refusal(text.where, "AXES", message, allowed=known, fix="export again")
    units = [_as_ours(word) for word in UNIT.findall(found.group(2))]
    length = next((unit for unit in units if unit in LENGTHS), "")
    angle = next((unit for unit in units if unit in ANGLES), "")
    return replace(lines, system=system, length=length, angle=angle)


def _as_ours(word: str) -> str:
    """A unit by our name."""
    return UNITS.get(word.lower(), word.lower())


def _split_by(lines: Sequence[str]) -> tuple[str, Callable[[str], list[str]], bool]:
    """The name of what separates the fields of all lines, how that parts one, and a decimal comma.

    A comma may stand before decimals where something else separates: a semicolon, a tab, blanks, or
    a comma with a blank behind it. A mark that leaves no three numbers is one inside a field.
    """
    tab = "\t" if "\t" in lines[0] else None

    def by(mark: str | None) -> Callable[[str], list[str]]:
        return lambda line: [field.strip() for field in line.split(mark)]

    commas = [line.count(",") for line in lines]
    within, behind = ([len(mark.findall(line)) for line in lines] for mark in (WITHIN, BEHIND))
    found: dict[str, tuple[Callable[[str], list[str]], bool]] = {}
    if all(";" in line for line in lines):
        found["semicolon"] = by(";"), True
    if all(commas):
        both = [one + other for one, other in zip(within, behind, strict=True)]
        for name, parts, fits in (
            ("space", by(tab), within == commas),
            ("comma", BEHIND.split, all(behind) and both == commas),
        ):
            if fits and all(sum(map(bool, map(DECIMAL.fullmatch, parts(line)))) >= 3
                            for line in lines):  # fmt: skip
                return name, parts, True
        found["comma"] = by(","), False
    for name, (parts, by_comma) in found.items():
        fields = map(_pointed, parts(lines[0])) if by_comma else parts(lines[0])
        if sum(bool(np.isfinite(number_of(field))) for field in fields) >= 3:
            return name, parts, by_comma
    first = next(iter(found), "space")
    return first, *found.get(first, (by(tab), False))


def _pointed(field: str) -> str:
    """A number with a decimal comma as one with a point; anything else as it is."""
    number = pointed(field)
    return number if np.isfinite(number_of(number)) else field


def _apart(fields: Sequence[str]) -> tuple[str, ...]:
    """Fields of a line, a name as Collection::Group::Target in its parts."""
    return (*(part for first in fields[:1] for part in first.split("::")), *fields[1:])


def unit_of(
    lines: Lines, written: str, stated: str | None, key: str, known: dict[str, float]
) -> str:
    """The unit of an export: as the file has it, else as session.toml states."""
    if written and stated and written != stated:
        message = f'the file says {written}, session.toml says {key} = "{stated}"'
        raise refusal(lines.where, key, message, code="M21", fix="remove that key")
    unit = written or stated
    if not unit:
        table, _, name = key.partition(".")
        usual, units = (
            ("mm", "mm, m, in, um, cm or ft") if known is LENGTHS else ("deg", "deg or rad")
        )
        fix = f'write {name} = "{usual}" under [{table}] in session.toml'
        raise refusal(lines.where, key, "does not say its unit", allowed=f"it is {units}", fix=fix)
    return unit


def name_fields(lines: Lines, stated: int | None) -> int:
    """How many fields of each line come before the coordinates.

    Numbers may be names. Coordinates are written with the same number of decimals in a whole file,
    and a name hardly ever is: where that leaves one reading, it is taken.
    """
    width = min(len(fields) for fields in lines.fields)
    possible = [
        k
        for k in range(min(4, width - 2))
        if all(np.isfinite(number_of(f)) for fields in lines.fields for f in fields[k : k + 3])
    ]
    where, first = f"{lines.where}:{lines.lines[0]}", ", ".join(lines.fields[0][:7])
    if stated is not None:
        if stated not in possible:
            message = f"fields {stated + 1} to {stated + 3} of the lines are not all numbers"
            fix = "check names under [points] in session.toml"
            raise refusal(where, "points.names", message, value=stated, fix=fix)
        return stated
    left = [k for k in possible if _evenly_written(lines, k)] or possible
    if len(left) == 1:
        return left[0]
    message = (
        f"the line {first} can be read with {' or '.join(map(str, left))} names before x"
        if left
        else f"the line {first} has no three coordinates"
    )
    fix = (
        "write names = 1 (Target), 2 (Group Target) or 3 (Collection Group Target) under [points] "
        "in session.toml"
    )
    raise refusal(where, "points.names", message, fix=fix)


def _evenly_written(lines: Lines, k: int) -> bool:
    """Whether three fields have the same number of decimals, above zero, in all lines."""
    counts = {
        len(f.partition(".")[2]) if "." in f else 0
        for fields in lines.fields
        for f in fields[k : k + 3]
    }
    return len(counts) == 1 and counts != {0}
