"""Points and frames that Spatial Analyzer exports as ASCII, in their variants, into `Readings`.

The manual's "Exporting ASCII Formatted Points": names as Collection Group Target, Group Target,
Target or none; then three coordinates, Cartesian, cylindrical or spherical; then what was ticked.
Comments begin with // and may name the axes and the unit; coordinates are in the working frame.
"""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from calib.arrays import Array, frozen
from calib.errors import InputError
from calib.geometry.frames import inverse, transform
from testbed.files.columns import ANGLES, LENGTHS, close_to, is_known
from testbed.files.observed import polar
from testbed.files.readings import Extras, Readings
from testbed.files.rotations import MATRIX, QUATERNION, checked_rotations, sequence_of
from testbed.files.sa_lines import Lines, name_fields, sa_lines, unit_of
from testbed.files.session import Stated
from testbed.files.session_toml import FramesTable, PointsTable, SessionFile
from testbed.files.table import Table, refuse_bad, table_of
from testbed.files.text import Sheet, Text
from testbed.files.uncertainty import spread_of

NAMES = ("target", "group", "collection")
"""What the fields before the coordinates are, the last one first."""
COORDINATES = ("c1", "c2", "c3")
CYCLING = "the k-th shot at a target belongs to the k-th pose"


def read_sa_points(
    text: Text, config: SessionFile, section: PointsTable, *, drop: bool
) -> Readings:
    """Reflector positions of an export.

    Raises
    ------
    InputError
        M35: the unit is not stated, or the names can be read in two ways.
    """
    lines = sa_lines(text)
    length = unit_of(lines, lines.header.length, section.length, "points.length", LENGTHS)
    k = name_fields(lines, section.names)
    width = min(len(fields) for fields in lines.fields)
    after = [own or f"unused{j}" for j, own in enumerate(section.after[: max(width - k - 3, 0)])]
    _check_after(section.after, width - k - 3, lines.where)
    head = [*reversed(NAMES[:k]), *COORDINATES, *after]
    table = _table(lines, head)
    good, warnings = refuse_bad(table, COORDINATES, drop=drop)
    numbers = np.where(good[:, None], table.numbers(COORDINATES), 0.0)
    position = _cartesian(lines, numbers, length, section.angle)
    spread = spread_of("point", table, position, good, config.uncertainty)
    pose, target, told = _poses(table, k, section)
    n = len(table)
    system = lines.header.system.lower()
    whole = Readings(
        kind="point",
        where=lines.where,
        place=tuple(table.place(row) for row in range(n)),
        order=np.arange(n),
        position=position,
        rotation=np.tile(np.eye(3), (n, 1, 1)),
        distance=np.zeros(n),
        covariance=spread.covariance,
        target=target,
        anchor=("",) * n,
        station=("",) * n,
        offset=None,
        stated=Stated(),
        extras=Extras(pose=pose),
        uncertainty=spread.source,
        warnings=(*warnings, *spread.warnings),
        notes=(
            f"{lines.where}: Spatial Analyzer points, {system}, {length}, {k} name fields; {told}",
        ),
        cycling=told == CYCLING,
    )
    return whole.rows(good)


def read_sa_frames(
    text: Text, config: SessionFile, section: FramesTable, *, drop: bool
) -> Readings:
    """Poses of an export of frames: a name, then position and rotation as stated.

    Raises
    ------
    InputError
        M24: the rotation is not stated; M35: the fields do not fit what is stated.
    """
    lines = sa_lines(text)
    form = section.rotation or ("euler" if section.euler is not None else None)
    if form is None:
        raise InputError(
            "a Spatial Analyzer file does not say how its frames are turned",
            code="M24",
            where=lines.where,
            field="frames.rotation",
            allowed="euler, matrix, quaternion_scalar_first or quaternion_scalar_last",
            fix='write euler = "xyz", or rotation = "matrix", under [frames] in session.toml',
        )
    length = unit_of(lines, lines.header.length, section.length, "frames.length", LENGTHS)
    count = {"euler": 6, "matrix": 16}.get(form, 7)
    width = min(len(fields) for fields in lines.fields)
    full = form == "matrix" and width >= 20  # the position comes first, then the whole matrix
    if width < count + 1:
        raise InputError(
            f"lines have {width} fields",
            code="M35",
            where=lines.where,
            field="frames.rotation",
            allowed=f"a name and {count} numbers for {form}; found: {lines.separator} between them",
            fix="check [frames] in session.toml",
        )
    names = [f"n{j}" for j in range(count + 3 * full)]
    table = _table(lines, ["pose_id", *names])
    good, warnings = refuse_bad(table, names, drop=drop)
    numbers = np.where(good[:, None], table.numbers(names), 0.0)[:, 3 * full :]
    position, stated = _frames(lines, form, numbers, section)
    rotation, told = checked_rotations(stated, table, good)
    rotation = np.where(good[:, None, None], rotation, np.eye(3))
    position = position * LENGTHS[length]
    spread = spread_of("pose", None, position, good, config.uncertainty)
    if stated.inverted:
        T = inverse(transform(rotation, position))
        position, rotation = T[:, :3, 3], T[:, :3, :3]
    n = len(table)
    whole = Readings(
        kind="pose",
        where=lines.where,
        place=tuple(table.place(row) for row in range(n)),
        order=np.arange(n),
        position=position,
        rotation=rotation,
        distance=np.zeros(n),
        covariance=spread.covariance,
        target=("",) * n,
        anchor=("",) * n,
        station=("",) * n,
        offset=None,
        stated=stated,
        extras=Extras(pose=tuple(table.texts("pose_id"))),
        uncertainty=spread.source,
        warnings=(*warnings, *told),
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
        angle = unit_of(lines, lines.header.angle, section.angle, "frames.angle", ANGLES)
        sequence = sequence_of(section.euler, lines.where)
        return position, Stated(sequence, rest * ANGLES[angle], inverted)
    order = [0, 1, 2, 3] if form == "quaternion_scalar_first" else [3, 0, 1, 2]
    return position, Stated(QUATERNION, rest[:, order], inverted)


def _check_after(after: Sequence[str], room: int, where: str) -> None:
    """The names of what follows the coordinates are ours, and there is room for them."""
    for own in after:
        if own and not is_known(own):
            raise InputError(
                f'after: "{own}" is no column of this program',
                code="S37",
                where=where,
                field="points.after",
                value=own,
                fix=close_to(own) or 'write "" for a field that is not used',
            )
    if len(after) > room:
        raise InputError(
            f"after names {len(after)} fields; {room} follow the coordinates",
            code="M35",
            where=where,
            field="points.after",
            fix="check [points] in session.toml",
        )


def _table(lines: Lines, head: Sequence[str]) -> Table:
    """The first fields of each line under names of our own."""
    rows = tuple(fields[: len(head)] for fields in lines.fields)
    sheet = Sheet(lines.where, tuple(head), rows, lines.lines, lines.separator, lines.encoding)
    return table_of(sheet, {}, (), decimal=".")


def _cartesian(lines: Lines, numbers: Array, length: str, angle: str | None) -> Array:
    """Positions (m, 3) [m] of coordinates in the system of the export."""
    unit, system = LENGTHS[length], lines.header.system
    if system == "CARTESIAN":
        return frozen(numbers * unit)
    turn = ANGLES[unit_of(lines, lines.header.angle, angle, "points.angle", ANGLES)]
    r, theta, last = numbers.T
    if system == "CYLINDRICAL":
        flat = r * unit
        return np.stack(
            [flat * np.cos(theta * turn), flat * np.sin(theta * turn), last * unit], axis=1
        )
    # the third coordinate is the angle from the z axis
    return polar(r * unit, theta * turn, np.pi / 2 - last * turn)


def _poses(
    table: Table, k: int, section: PointsTable
) -> tuple[tuple[str, ...], tuple[str, ...], str]:
    """Pose and reflector of each row, and how they were told apart."""
    n = len(table)
    target = tuple(table.texts("target")) if k else ("",) * n
    group = tuple(table.texts("group")) if k > 1 else ("",) * n
    nests = set(section.reflectors_mm)
    rule = section.pose
    if rule is None:
        if k and len(set(target)) == n and not nests & set(target):
            rule = "target"
        elif k > 1 and len(set(zip(group, target, strict=True))) == n and len(set(group)) > 1:
            rule = "group"
        else:
            rule = "occurrence"
    if rule == "target":
        return target, ("",) * n, "each target is a pose"
    if rule == "group":
        return group, target, "each group is a pose"
    seen: Counter[str] = Counter()
    pose = []
    for name in target:
        pose.append(str(seen[name]))
        seen[name] += 1
    return tuple(pose), target, CYCLING
