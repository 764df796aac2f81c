"""Points and frames that Spatial Analyzer exports as ASCII, in their variants, into `Readings`.

The manual's "Exporting ASCII Formatted Points": names as Collection Group Target, Group Target,
Target or none; then three coordinates, Cartesian, cylindrical or spherical; then what was ticked.
Comments begin with // and may name the axes and the unit; coordinates are in the working frame.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array
from testbed.files.columns import ANGLES, LENGTHS, is_known
from testbed.files.joints import Extras
from testbed.files.matching import visits_of
from testbed.files.observed import inverse_poses, polar
from testbed.files.readings import Readings, plain_readings
from testbed.files.refusal import refusal
from testbed.files.rotations import MATRIX, QUATERNION, checked_rotations, sequence_of
from testbed.files.session import Stated
from testbed.files.session_toml import FramesTable, OpticalTable, PointsTable, UncertaintyTable
from testbed.files.table import DataTable, number_of, table_of, unknown_column, valid_rows
from testbed.files.text import FileText, Sheet
from testbed.files.uncertainty import spread_of

AXES = re.compile(r"AXES\s*=\s*(\w+)\s*:(.*)", re.IGNORECASE)
UNIT = re.compile(r"\((mm|m|meters|millimeters|inches|in|degrees|deg|radians|rad)\)", re.IGNORECASE)
UNITS = {"meters": "m", "millimeters": "mm", "inches": "in", "degrees": "deg", "radians": "rad"}
SYSTEMS = ("CARTESIAN", "CYLINDRICAL", "SPHERICAL")
NAMES = ("target", "group", "collection")
"""What the fields before the coordinates are, the last one first."""
COORDINATES = ("c1", "c2", "c3")
CYCLING = "the k-th shot at a target belongs to the k-th pose"


@dataclass(frozen=True, slots=True)
class Lines:
    """Fields of the lines that are no comments, axes and units from those that are."""

    where: str
    fields: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    separator: str
    encoding: str
    system: str = "CARTESIAN"
    length: str = ""
    angle: str = ""


def sa_lines(text: FileText) -> Lines:
    """Fields of the data lines, with axes and units from the comments."""
    comments = [line for line in text.lines if line.lstrip().startswith("//")]
    content = [(number, line.strip().rstrip(",")) for number, line in text.content("//", "#")]
    if not content:
        raise refusal(text.where, "file", "has no points")
    separator = "comma" if all("," in line for _, line in content) else "space"
    mark = "," if separator == "comma" else "\t" if "\t" in content[0][1] else None
    fields = tuple(tuple(f.strip() for f in line.split(mark)) for _, line in content)
    numbers = tuple(number for number, _ in content)
    lines = Lines(text.where, fields, numbers, separator, text.encoding)
    found = AXES.search("\n".join(comments))
    if not found:
        return lines
    system = found.group(1).upper()
    if system not in SYSTEMS:
        message = f"AXES = {system[:20]} is no system of coordinates"
        known = f"known are {', '.join(SYSTEMS)}"
        raise refusal(text.where, "AXES", message, allowed=known, fix="export again")
    units = [UNITS.get(word.lower(), word.lower()) for word in UNIT.findall(found.group(2))]
    length = next((unit for unit in units if unit in LENGTHS), "")
    angle = next((unit for unit in units if unit in ANGLES), "")
    return replace(lines, system=system, length=length, angle=angle)


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
        usual, units = ("mm", "mm, m or in") if known is LENGTHS else ("deg", "deg or rad")
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


def read_sa(
    text: FileText, section: OpticalTable, uncertainty: UncertaintyTable, *, drop: bool
) -> Readings:
    """Points or frames of an export, as `section` says.

    Raises
    ------
    InputError
        M24: the rotation of frames is not stated; M35: the unit is not stated, the names of points
        can be read in two ways, or the fields do not fit what is stated.
    """
    lines = sa_lines(text)
    if isinstance(section, PointsTable):
        return _read_points(lines, section, uncertainty, drop=drop)
    assert isinstance(section, FramesTable)  # there is no third kind
    return _read_frames(lines, section, uncertainty, drop=drop)


def _read_points(
    lines: Lines, section: PointsTable, uncertainty: UncertaintyTable, *, drop: bool
) -> Readings:
    """Reflector positions: names, coordinates, and what was ticked."""
    length = unit_of(lines, lines.length, section.length, "points.length", LENGTHS)
    k = name_fields(lines, section.names)
    room = min(len(fields) for fields in lines.fields) - k - 3
    _check_after(section.after, room, lines.where)
    after = [own or f"unused{j}" for j, own in enumerate(section.after)]
    table = _table(lines, [*reversed(NAMES[:k]), *COORDINATES, *after])
    good, warnings = valid_rows(table, COORDINATES, drop=drop)
    numbers = np.where(good[:, None], table.numbers(COORDINATES), 0.0)
    position = _cartesian(lines, numbers, length, section.angle)
    spread = spread_of("point", table, position, good, uncertainty)
    pose, target, rule = _poses(table, k, section)
    system = lines.system.lower()
    note = f"Spatial Analyzer points, {system}, {length}, {k} name fields; {rule}"
    whole = replace(
        plain_readings(table, "point", position, spread),
        target=target,
        extras=Extras(pose=pose),
        warnings=(*warnings, *spread.warnings),
        notes=(f"{lines.where}: {note}",),
        cycling=rule == CYCLING,
    )
    return whole.rows(good)


def _read_frames(
    lines: Lines, section: FramesTable, uncertainty: UncertaintyTable, *, drop: bool
) -> Readings:
    """Poses: a name, then position and rotation as stated."""
    form = section.rotation or ("euler" if section.euler is not None else None)
    if form is None:
        raise refusal(
            lines.where, "frames.rotation",
            "a Spatial Analyzer file does not say how its frames are turned", code="M24",
            allowed="euler, matrix, quaternion_scalar_first or quaternion_scalar_last",
            fix='write euler = "xyz", or rotation = "matrix", under [frames] in session.toml',
        )  # fmt: skip
    length = unit_of(lines, lines.length, section.length, "frames.length", LENGTHS)
    count = {"euler": 6, "matrix": 16}.get(form, 7)
    width = min(len(fields) for fields in lines.fields)
    full = form == "matrix" and width >= 20  # the position comes first, then the whole matrix
    if width < count + 1:
        raise refusal(
            lines.where, "frames.rotation", f"lines have {width} fields",
            allowed=f"a name and {count} numbers for {form}; found: {lines.separator} between them",
            fix="check [frames] in session.toml",
        )  # fmt: skip
    names = [f"n{j}" for j in range(count + 3 * full)]
    table = _table(lines, ["pose_id", *names])
    good, warnings = valid_rows(table, names, drop=drop)
    numbers = np.where(good[:, None], table.numbers(names), 0.0)[:, 3 * full :]
    position, stated = _frames(lines, form, numbers, section)
    rotation, odd = checked_rotations(stated, table, good)
    rotation = np.where(good[:, None, None], rotation, np.eye(3))
    position = position * LENGTHS[length]
    spread = spread_of("pose", None, position, good, uncertainty)
    if stated.inverted:
        position, rotation = inverse_poses(position, rotation)
    whole = replace(
        plain_readings(table, "pose", position, spread),
        rotation=rotation,
        stated=stated,
        extras=Extras(pose=table.texts("pose_id")),
        warnings=(*warnings, *odd),
        notes=(f"{lines.where}: Spatial Analyzer frames, {stated.form}, {length}",),
    )
    return whole.rows(good)


def _frames(lines: Lines, form: str, numbers: Array, section: FramesTable) -> tuple[Array, Stated]:
    """Positions (m, 3) as in the file and rotations as they stand."""
    inverted = section.gives == "T_tool_tracker"
    if form == "matrix":
        T = numbers.reshape(-1, 4, 4)
        return T[:, :3, 3], Stated(MATRIX, T[:, :3, :3].reshape(-1, 9), inverted)
    position, rest = numbers[:, :3], numbers[:, 3:]
    if form == "euler":
        angle = unit_of(lines, lines.angle, section.angle, "frames.angle", ANGLES)
        sequence = sequence_of(section.euler, lines.where)
        return position, Stated(sequence, rest * ANGLES[angle], inverted)
    order = [0, 1, 2, 3] if form == "quaternion_scalar_first" else [3, 0, 1, 2]
    return position, Stated(QUATERNION, rest[:, order], inverted)


def _check_after(after: Sequence[str], room: int, where: str) -> None:
    """The names of what follows the coordinates are ours, and there is room for them."""
    for own in after:
        if own and not is_known(own):
            fix = 'write "" for a field that is not used'
            raise unknown_column(where, "points.after", own, fix)
    if len(after) > room:
        message = f"after names {len(after)} fields; {room} follow the coordinates"
        raise refusal(where, "points.after", message, fix="check [points] in session.toml")


def _table(lines: Lines, head: Sequence[str]) -> DataTable:
    """The first fields of each line under names of our own."""
    rows = tuple(fields[: len(head)] for fields in lines.fields)
    sheet = Sheet(lines.where, tuple(head), rows, lines.lines, lines.separator, lines.encoding)
    return table_of(sheet, {}, decimal=".")


def _cartesian(lines: Lines, numbers: Array, length: str, angle: str | None) -> Array:
    """Positions (m, 3) [m] of coordinates in the system of the export."""
    unit, system = LENGTHS[length], lines.system
    if system == "CARTESIAN":
        return numbers * unit
    turn = ANGLES[unit_of(lines, lines.angle, angle, "points.angle", ANGLES)]
    r, theta, last = numbers.T
    if system == "CYLINDRICAL":
        flat = polar(r * unit, theta * turn, np.zeros(len(r)))
        return np.column_stack([flat[:, :2], last * unit])
    # the third coordinate is the angle from the z axis
    return polar(r * unit, theta * turn, np.pi / 2 - last * turn)


def _poses(
    table: DataTable, k: int, section: PointsTable
) -> tuple[tuple[str, ...], tuple[str, ...], str]:
    """Pose and reflector of each row, and how they were told apart."""
    n = len(table)
    nameless = ("",) * n
    target = table.texts("target") if k else nameless
    group = table.texts("group") if k > 1 else nameless
    rule = section.pose
    if rule is None:
        if k and len(set(target)) == n and not set(section.reflectors_mm) & set(target):
            rule = "target"
        elif k > 1 and len(set(zip(group, target, strict=True))) == n and len(set(group)) > 1:
            rule = "group"
        else:
            rule = "occurrence"
    if rule == "target":
        return target, nameless, "each target is a pose"
    if rule == "group":
        return group, target, "each group is a pose"
    return tuple(map(str, visits_of(target))), target, CYCLING
