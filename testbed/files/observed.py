"""A table as readings: what each column states, in which unit and which convention."""

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from calib.arrays import Array, Bool
from calib.errors import InputError
from calib.geometry.frames import inverse, transform
from calib.measurement.noise import inverse_covariance
from testbed.files.columns import COMMANDED, TEXTS, close_to, is_known, misspelt_reading
from testbed.files.dialects.tables import FramesTable, ObservedTable, PointsTable, RangesTable
from testbed.files.joints import extra_columns, extras_of
from testbed.files.readings import Readings, plain_readings
from testbed.files.refusal import refusal, require_names
from testbed.files.rotations import checked_rotations, stated_in
from testbed.files.rows.planned import foretold
from testbed.files.session import Stated
from testbed.files.session_toml import UncertaintyTable
from testbed.files.table import Columns, DataTable, Unread, together
from testbed.files.uncertainty import Spread, spread_columns, spread_of
from testbed.files.valid import valid_rows
from testbed.units import listed

BESIDE_PLAN = (
    "it says what a plan foretells: give what was measured beside it, by truebed new session PLAN "
    "MEASURED"
)
MOST_NAMED = 4
"""Lines named in one sentence."""
PROPOSED = "name the columns so, or let `truebed new session` propose them"


def section_of(table: DataTable, fix: str = PROPOSED) -> ObservedTable:
    """The table of session.toml that a CSV in the project's own layout belongs to.

    Raises
    ------
    InputError
        M35: it holds no readings.
    """
    if table.find("length", "distance"):
        return RangesTable()
    if any(name in table for name in ("qw", "r11")) or any(
        table.find("angle", stem) for stem in ("rx", "e1", "rvx", "axis_angle")
    ):
        return FramesTable()
    if any(table.find("length", stem) for stem in ("x", "range", "difference_x")):
        return PointsTable()
    ahead = foretold(table.names)
    hint = BESIDE_PLAN if ahead else misspelt_reading(table.names)
    raise refusal(
        table.where, "columns", "has no readings", value=", ".join(table.names)[:200],
        allowed="needed: x_mm y_mm z_mm (also _m), with qw qx qy qz, rx_deg ry_deg rz_deg or r11 "
        f"... r33 for poses, or distance_mm; {table.found(120)}",
        fix=hint or fix,
    )  # fmt: skip


def has_readings(table: DataTable) -> bool:
    """Whether `section_of` finds readings in a table."""
    try:
        section_of(table)
    except InputError:
        return False
    return True


def read_observed(
    table: DataTable, section: ObservedTable, uncertainty: UncertaintyTable, *, drop: bool | None
) -> Readings:
    """Readings of one CSV.

    Parameters
    ----------
    table : DataTable
        Of the file.
    section : ObservedTable
        Its table in session.toml: what it holds.
    uncertainty : UncertaintyTable
        What session.toml states of it.
    drop : bool or None
        Leave out rows that are no numbers; None: it cannot be asked for.

    Raises
    ------
    InputError
        Names the file, the line and the column.
    """
    m = len(table)
    position, distance, rotation = np.zeros((m, 3)), np.zeros(m), np.tile(np.eye(3), (m, 1, 1))
    stated, turned = Stated(), Columns()
    if isinstance(section, FramesTable):
        stated, turned = _stated(table, section)
    if far := isinstance(section, RangesTable):
        distance, used = _distances(table, section)
    else:
        position, used = _positions(table, section)
    offset = table.find("length", "reflector_x", "reflector_y", "reflector_z")
    scatter = spread_columns(section.kind, table, uncertainty)
    columns = together(used, turned, offset, scatter, extra_columns(table))
    unseen = _unseen(table, together(used, turned))
    good, warnings = valid_rows(table, columns, drop=drop, spare=unseen)
    good &= ~unseen
    warnings += _unseen_words(table, unseen)
    if isinstance(section, FramesTable):
        rotation, odd = checked_rotations(stated, table, good)
        rotation = np.where(good[:, None, None], rotation, np.eye(3))
        warnings += odd
    for row in np.flatnonzero(good & (distance < 0.0))[:1]:
        message, allowed = f"distance is {distance[row]:g} m", "a distance is above 0"
        raise refusal(table.places[row], used.names[0], message, allowed=allowed, code="M25")
    position = np.where(good[:, None], position, 0.0)
    spread = spread_of(section.kind, table, position, good, uncertainty)
    if stated.inverted:
        position, rotation, spread = inverse_poses(position, rotation, spread)
    extras = extras_of(table, good)
    plain = plain_readings(table, section.kind, position, spread)
    anchors = (_names(table, "anchor", good) or _only_anchor(table, section)) if far else None
    whole = replace(
        plain,
        rotation=rotation,
        distance=np.where(good, distance, 0.0),
        target=table.texts_of("target") or plain.target,
        anchor=anchors or plain.anchor,
        station=_names(table, "station", None if far else good) or plain.station,
        offset=np.where(good[:, None], table.values(offset), 0.0) if offset else None,
        columns=columns,
        stated=stated,
        extras=extras,
        warnings=(*warnings, *spread.warnings, *extras.warnings),
        notes=(how_written(table),),
    )
    return whole.rows(good)


def _unseen(table: DataTable, seen: Columns) -> Bool:
    """Rows (m,) with nothing in any cell of a reading: frames that a camera dropped, missed shots.

    None where all rows are so.
    """
    empty = np.array([[not text.strip() for text in table.texts(name)] for name in seen.names])
    unseen = empty.all(axis=0) if len(empty) else np.zeros(len(table), dtype=np.bool_)
    return np.asarray(unseen & ~unseen.all())


def _unseen_words(table: DataTable, unseen: Bool) -> list[str]:
    """That rows were left out in which nothing was seen; nothing where there are none."""
    rows = np.flatnonzero(unseen)
    if not len(rows):
        return []
    lines = [f"line {table.sheet.lines[row]}" for row in rows]
    have, they = ("has", "it is") if len(rows) == 1 else ("have", "they are")
    return [
        f"{table.where}: {len(rows)} of {len(table)} rows {have} nothing in the cells of the "
        f"reading ({listed(lines, MOST_NAMED)}): nothing was seen there, and {they} left out"
    ]


def unused_columns(
    table: DataTable, *used: Columns, elsewhere: Collection[str] = (), idle: Collection[str] = ()
) -> list[Unread]:
    """Every column that was not read, in one record if any; texts under our names are.

    `elsewhere` has the file's own names of columns that other sections read, `idle` our names of
    texts that nothing is taken from.
    """
    said = {name for name in idle if any(table.texts_of(name) or ())}
    read = {*together(*used).names, *TEXTS} - said
    # one that is read may have a second name, for a table of another file
    taken = {theirs for name, theirs in table.names.items() if name in read}.union(elsewhere)
    shown = tuple(theirs for theirs in table.names.values() if theirs not in taken)
    return [Unread(table.where, shown)] if shown else []


def misspelt_columns(table: DataTable) -> list[str]:
    """Warnings of columns that look like a name of this program but are none."""
    ahead = foretold(table.names)
    hints = {
        name: close_to(name) for name in table.names if name not in ahead and not is_known(name)
    }
    return [
        f'{table.where}: column "{name}" is not used; {hint}'
        for name, hint in hints.items()
        if hint
    ]


def inverse_poses(position: Array, rotation: Array, spread: Spread) -> tuple[Array, Array, Spread]:
    """Positions (m, 3), rotations (m, 3, 3) and covariances of the inverse transforms."""
    T = transform(rotation, position)
    back = inverse(T)
    spread = replace(spread, covariance=inverse_covariance(T, spread.covariance))
    return back[:, :3, 3], back[:, :3, :3], spread


def polar(r: Array, azimuth: Array, elevation: Array) -> Array:
    """Positions (m, 3) from range [m], azimuth from x toward y and elevation above xy [rad]."""
    flat = r * np.cos(elevation)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), r * np.sin(elevation)], 1)


def cartesian(system: str, values: Array) -> Array:
    """Positions (m, 3) [m] of coordinates that are Cartesian, cylindrical or spherical [m, rad]."""
    if system == "CARTESIAN":
        return values
    r, theta, last = values.T
    if system == "SPHERICAL":
        return polar(r, theta, np.pi / 2 - last)
    flat = polar(r, theta, np.zeros(len(r)))
    return np.column_stack([flat[:, :2], last])


def _stated(table: DataTable, section: FramesTable) -> tuple[Stated, Columns]:
    """How the rotations stand in the table."""
    found = stated_in(table, section.euler)
    if found is None:
        raise refusal(
            table.where, "frames", "has no rotations",
            allowed=f"qw qx qy qz, rx_deg ry_deg rz_deg, or r11 ... r33; {table.found()}",
            fix="map them under [frames] columns, or write [points] if there are none",
        )  # fmt: skip
    stated, columns = found
    return replace(stated, inverted=section.gives == "T_tool_tracker"), columns


def _positions(table: DataTable, section: ObservedTable) -> tuple[Array, Columns]:
    """Positions (m, 3) [m], Cartesian or polar or from a target, and their columns."""
    found = table.find("length", "x", "y", "z")
    clockwise = isinstance(section, PointsTable) and section.azimuth == "clockwise"
    if clockwise and (found or not table.find("length", "range")):
        message = 'azimuth = "clockwise" is of polar readings, and these are none'
        raise refusal(table.where, "points.azimuth", message, fix="take it out")
    if found:
        return table.values(found), found
    away = table.find("length", *(f"difference_{axis}" for axis in "xyz"))
    target = table.find("length", *(f"{COMMANDED}{axis}" for axis in "xyz"))
    if away and target and isinstance(section, PointsTable):
        sign = 1.0 if section.differences == "measured - target" else -1.0
        return table.values(target) + sign * table.values(away), together(target, away)
    reach = table.find("length", "range")
    azimuth = table.find("angle", "azimuth")
    up, down = table.find("angle", "elevation"), table.find("angle", "zenith")
    height = up or down
    if not (reach and azimuth and height):
        raise refusal(
            table.where, "columns", "has no positions",
            allowed="x_mm y_mm z_mm, or range_mm azimuth_deg elevation_deg (or zenith_deg); "
            + table.found(),
            fix=misspelt_reading(table.names) or "name the columns so",
        )  # fmt: skip
    used = together(reach, azimuth, height)
    r, a, e = table.values(used).T
    a = -a if clockwise else a
    return polar(r, a, e if up else np.pi / 2 - e), used


def _distances(table: DataTable, section: ObservedTable) -> tuple[Array, Columns]:
    """Distances (m,) [m] and their column."""
    found = table.find("length", "distance")
    if found is None or not (any(table.texts_of("anchor") or ()) or _only_anchor(table, section)):
        missing = "anchor" if found else "distance_mm"
        fix = "name the fixed point of each distance in a column anchor" if found else ""
        message = f"has {'an empty' if missing in table else 'no'} column {missing}"
        raise refusal(table.where, missing, message, allowed=table.found(), fix=fix)
    return table.values(found)[:, 0], found


def _only_anchor(table: DataTable, section: ObservedTable) -> tuple[str, ...] | None:
    """Name (m,) of the one anchor that a session states, where no column names any."""
    names = tuple(section.anchors_mm) if isinstance(section, RangesTable) else ()
    return None if "anchor" in table or len(names) != 1 else names * len(table)


def _names(table: DataTable, column: str, needed: Bool | None) -> tuple[str, ...] | None:
    """Names (m,) of a column that may be missing; rows that need one may not leave it empty.

    A column without any name is no column.
    """
    names = table.texts_of(column)
    if names is None or not any(names):
        return None
    rows = np.flatnonzero([] if needed is None else needed)
    require_names(column, [names[row] for row in rows], [table.places[row] for row in rows])
    return names


def how_written(table: DataTable) -> str:
    """How the file of a table is written, and how many rows it has."""
    mark = "comma" if table.decimal == "," else "point"
    titles = table.sheet.titles
    above = f", under a title ({titles[0][:40]})" if titles else ""
    return (
        f"{table.where}: {table.sheet.encoding}, {table.sheet.separator} between cells, decimal "
        f"{mark}, {len(table)} rows{above}"
    )
