"""Points and frames that Spatial Analyzer exports as ASCII, in their variants, into `Readings`.

The manual's "Exporting ASCII Formatted Points": names as Collection Group Target, Group Target,
Target or none, in fields of their own or with :: between them; then three coordinates, Cartesian,
cylindrical or spherical; then what was ticked. Comments begin with // and may name the axes and the
unit; coordinates are in the working frame.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.arrays import Array
from testbed.files.columns import ANGLES, LENGTHS, MATRIX_COLUMNS, QUATERNION_COLUMNS, is_known
from testbed.files.dialects.spatial_lines import (
    NAMES,
    SYSTEMS,
    Lines,
    name_fields,
    sa_lines,
    unit_of,
)
from testbed.files.dialects.tables import FramesTable, OpticalTable, PointsTable
from testbed.files.joints import Extras
from testbed.files.matching import visits_of
from testbed.files.observed import cartesian, inverse_poses
from testbed.files.readings import Readings, plain_readings
from testbed.files.reflectors.one_tool import apart_or_alike
from testbed.files.refusal import refusal
from testbed.files.rotations import checked_rotations, sequence_of
from testbed.files.session import Stated
from testbed.files.session_toml import UncertaintyTable
from testbed.files.table import Columns, DataTable, table_of, together, unknown_column
from testbed.files.text import Sheet
from testbed.files.uncertainty import spread_columns, spread_of
from testbed.files.valid import valid_rows
from testbed.gates.text import FileText

CYCLING = "the k-th shot at a target belongs to the k-th pose"


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
    units = {"azimuth": "", "zenith": ""}
    if lines.system != "CARTESIAN":
        angle = unit_of(lines, lines.angle, section.angle, "points.angle", ANGLES)
        units = dict.fromkeys(units, angle)
    columns = Columns(tuple(f"{x}_{units.get(x, length)}" for x in SYSTEMS[lines.system]))
    table = _table(lines, [*reversed(NAMES[:k]), *columns.names, *after])
    scatter = spread_columns("point", table, uncertainty)
    good, warnings = valid_rows(table, together(columns, scatter), drop=drop)
    position = cartesian(lines.system, np.where(good[:, None], table.values(columns), 0.0))
    spread = spread_of("point", table, position, good, uncertainty)
    pose, target, rule = _poses(table, k, section, position)
    note = f"Spatial Analyzer points, {lines.system.lower()}, {length}, {k} name fields; {rule}"
    unread = room - sum(bool(own) for own in section.after)
    note += "; decimal commas" if lines.decimal == "," else ""
    note += f"; {unread} fields after the coordinates are not used" if unread else ""
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
    count = {"euler": 6, "matrix": 12}.get(form, 7)  # 0 0 0 1 may be left out
    width = min(len(fields) for fields in lines.fields)
    full = form == "matrix" and width >= 20  # the position comes first, then the whole matrix
    if width < count + 1:
        raise refusal(
            lines.where, "frames.rotation", f"lines have {width} fields",
            allowed=f"a name and {count} numbers for {form}; found: {lines.separator} between them",
            fix="check [frames] in session.toml",
        )  # fmt: skip
    place = Columns(tuple(f"{axis}_{length}" for axis in "xyz"))
    turned, head = _turned(form, place, lines, section)
    table = _table(lines, ["pose_id", *(f"unused{k}" for k in range(3 * full)), *head])
    good, warnings = valid_rows(table, together(place, turned), drop=drop)
    position = np.where(good[:, None], table.values(place), 0.0)
    numbers = np.where(good[:, None], table.values(turned), 0.0)
    stated = Stated(
        sequence_of(section.euler, lines.where) if form == "euler" else form.partition("_")[0],
        numbers,
        section.gives == "T_tool_tracker",
    )
    rotation, odd = checked_rotations(stated, table, good)
    rotation = np.where(good[:, None, None], rotation, np.eye(3))
    spread = spread_of("pose", None, position, good, uncertainty)
    if stated.inverted:
        position, rotation, spread = inverse_poses(position, rotation, spread)
    whole = replace(
        plain_readings(table, "pose", position, spread),
        rotation=rotation,
        stated=stated,
        extras=Extras(pose=table.texts("pose_id")),
        warnings=(*warnings, *odd),
        notes=(f"{lines.where}: Spatial Analyzer frames, {stated.form}, {length}",),
    )
    return whole.rows(good)


def _turned(
    form: str, place: Columns, lines: Lines, section: FramesTable
) -> tuple[Columns, list[str]]:
    """Columns of rotations in a form of [frames] rotation, and all of a frame as they stand."""
    if form == "euler":
        angle = unit_of(lines, lines.angle, section.angle, "frames.angle", ANGLES)
        turned = Columns(tuple(f"e{k}_{angle}" for k in (1, 2, 3)))
        return turned, [*place.names, *turned.names]
    if form == "matrix":
        (x, y, z), r = place.names, MATRIX_COLUMNS
        return Columns(r), [*r[:3], x, *r[3:6], y, *r[6:], z]
    w, *xyz = QUATERNION_COLUMNS
    order = [w, *xyz] if form == "quaternion_scalar_first" else [*xyz, w]
    return Columns(QUATERNION_COLUMNS), [*place.names, *order]


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
    sheet = Sheet(
        lines.where, tuple(head), rows, lines.lines, lines.separator, lines.encoding,
        below=lines.below,
    )  # fmt: skip
    return table_of(sheet, {}, decimal=".")


def _poses(
    table: DataTable, k: int, section: PointsTable, position: Array
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
    if rule == "target" and len(set(target)) < n and len(set(zip(group, target, strict=True))) == n:
        if _repeat(target, group, position):
            return target, nameless, "each target is a pose, and each group measured it again"
        return target, group, "each target is a pose, and each group a reflector"
    if rule == "target":
        return target, nameless, "each target is a pose"
    if rule == "group":
        return group, target, "each group is a pose"
    return tuple(map(str, visits_of(target))), target, CYCLING


def _repeat(target: Sequence[str], group: Sequence[str], position: Array) -> bool:
    """Whether all groups saw their targets (m,) where no two reflectors can be [m]."""
    at: dict[str, dict[str, int]] = {}
    for row, (own, name) in enumerate(zip(group, target, strict=True)):
        at.setdefault(own, {})[name] = row
    first, *others = at.values()
    for other in others:
        both = [(first[name], other[name]) for name in first.keys() & other.keys()]
        one, two = np.array(both, dtype=np.int64).reshape(-1, 2).T
        why = apart_or_alike(position[one], position[two])
        if why is None or why.kind != "one reflector":
            return False
    return True
