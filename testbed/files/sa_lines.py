"""Lines of a Spatial Analyzer export: fields, what the comments say, where the coordinates are."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.errors import InputError
from testbed.files.columns import ANGLES, LENGTHS
from testbed.files.text import Text

AXES = re.compile(r"AXES\s*=\s*(\w+)\s*:(.*)", re.IGNORECASE)
UNIT = re.compile(r"\((mm|m|meters|millimeters|inches|in|degrees|deg|radians|rad)\)", re.IGNORECASE)
UNITS = {"meters": "m", "millimeters": "mm", "inches": "in", "degrees": "deg", "radians": "rad"}
SYSTEMS = ("CARTESIAN", "CYLINDRICAL", "SPHERICAL")


@dataclass(frozen=True, slots=True)
class Header:
    """What the comments of an export say."""

    system: str = "CARTESIAN"
    length: str = ""
    angle: str = ""
    frame: str = ""


@dataclass(frozen=True, slots=True)
class Lines:
    """Fields of the lines that are no comments."""

    where: str
    fields: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    separator: str
    header: Header
    encoding: str


def sa_lines(text: Text) -> Lines:
    """Fields of the data lines and what the comments say."""
    comments = [line for line in text.lines if line.lstrip().startswith("//")]
    kept = [
        (number, line.strip().rstrip(","))
        for number, line in enumerate(text.lines, start=1)
        if line.strip() and not line.lstrip().startswith(("//", "#"))
    ]
    if not kept:
        raise InputError("has no points", code="M35", where=text.where, field="file")
    separator = "comma" if all("," in line for _, line in kept) else "space"
    fields = [
        tuple(f.strip() for f in line.split(",")) if separator == "comma" else tuple(line.split())
        for _, line in kept
    ]
    if "\t" in kept[0][1] and separator == "space":
        fields = [tuple(f.strip() for f in line.split("\t")) for _, line in kept]
    return Lines(
        text.where,
        tuple(fields),
        tuple(number for number, _ in kept),
        separator,
        _header(comments, text.where),
        text.encoding,
    )


def _header(comments: Sequence[str], where: str) -> Header:
    """What the comments say of axes, units and frame."""
    joined = "\n".join(comments)
    frame = re.search(r"Coordinate Frame\s+'([^']*)'", joined, re.IGNORECASE)
    found = AXES.search(joined)
    if not found:
        return Header(frame=frame.group(1) if frame else "")
    system = found.group(1).upper()
    if system not in SYSTEMS:
        raise InputError(
            f"AXES = {system[:20]} is no system of coordinates",
            code="M35",
            where=where,
            field="AXES",
            allowed=f"known are {', '.join(SYSTEMS)}",
            fix="export again",
        )
    units = [UNITS.get(word.lower(), word.lower()) for word in UNIT.findall(found.group(2))]
    return Header(
        system,
        next((unit for unit in units if unit in LENGTHS), ""),
        next((unit for unit in units if unit in ANGLES), ""),
        frame.group(1) if frame else "",
    )


def unit_of(lines: Lines, said: str, stated: str | None, key: str, known: dict[str, float]) -> str:
    """The unit of an export: what the file says, else what session.toml states."""
    if said and stated and said != stated:
        raise InputError(
            f'the file says {said}, session.toml says {key} = "{stated}"',
            code="M21",
            where=lines.where,
            field=key,
            fix="remove that key",
        )
    unit = said or stated
    if not unit:
        choice = "it is mm, m or in" if known is LENGTHS else "it is deg or rad"
        raise InputError(
            "does not say its unit",
            code="M35",
            where=lines.where,
            field=key,
            allowed=choice,
            fix=f'write {key.split(".")[1]} = "{"mm" if known is LENGTHS else "deg"}" under '
            f"[{key.split('.')[0]}] in session.toml",
        )
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
        if all(_is_number(f) for fields in lines.fields for f in fields[k : k + 3])
    ]
    if stated is not None:
        if stated not in possible:
            raise InputError(
                f"fields {stated + 1} to {stated + 3} of the lines are not all numbers",
                code="M35",
                where=f"{lines.where}:{lines.lines[0]}",
                field="points.names",
                value=stated,
                fix="check names under [points] in session.toml",
            )
        return stated
    even = [k for k in possible if _evenly_written(lines, k)]
    left = even or possible
    if len(left) == 1:
        return left[0]
    first = ", ".join(lines.fields[0][:7])
    raise InputError(
        f"the line {first} can be read with {' or '.join(map(str, left))} names before x"
        if left
        else f"the line {first} has no three coordinates",
        code="M35",
        where=f"{lines.where}:{lines.lines[0]}",
        field="points.names",
        fix="write names = 1 (Target), 2 (Group Target) or 3 (Collection Group Target) under "
        "[points] in session.toml",
    )


def _evenly_written(lines: Lines, k: int) -> bool:
    """Whether three fields have the same number of decimals, above zero, in all lines."""
    counts = {
        len(f.partition(".")[2]) if "." in f else 0
        for fields in lines.fields
        for f in fields[k : k + 3]
    }
    return len(counts) == 1 and counts != {0}


def _is_number(cell: str) -> bool:
    """Whether a field is a number."""
    try:
        return bool(np.isfinite(float(cell))) and "_" not in cell
    except ValueError:
        return False
