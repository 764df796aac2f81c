"""CSV tables of poses, points and distances into `Readings`."""

import numpy as np

from calib.arrays import Array, Bool
from calib.errors import InputError
from calib.geometry.frames import inverse, transform
from testbed.files.columns import close_to, find, find_all, is_known
from testbed.files.readings import Readings, extras_of
from testbed.files.rotations import checked_rotations, stated_in
from testbed.files.session import Stated
from testbed.files.session_toml import FramesTable, ObservedTable, SessionFile
from testbed.files.table import Table, refuse_bad
from testbed.files.uncertainty import spread_of

KINDS = {"frames": "pose", "points": "point", "ranges": "distance"}
"""Table of session.toml to kind of reading."""


def kind_in(table: Table) -> str:
    """Which table of session.toml a CSV in the project's own layout belongs to.

    Raises
    ------
    InputError
        M35: it holds no readings.
    """
    where = table.where
    if find(table.names, "distance", "length", where):
        return "ranges"
    turned = any(name in table for name in ("qw", "r11")) or any(
        find(table.names, stem, "angle", where) for stem in ("rx", "e1", "rvx")
    )
    if turned:
        return "frames"
    if find(table.names, "x", "length", where) or find(table.names, "range", "length", where):
        return "points"
    raise InputError(
        "has no readings",
        code="M35",
        where=where,
        field="columns",
        value=", ".join(table.names)[:200],
        allowed=f"needed: x_mm y_mm z_mm (also _m), with qw qx qy qz, rx_deg ry_deg rz_deg or r11 "
        f"... r33 for poses, or distance_mm; found: {', '.join(table.names)[:120]}",
        fix=_hint(table) or "name the columns so, or map them with --config session.toml",
    )


def read_observed(
    table: Table, name: str, config: SessionFile, section: ObservedTable, *, drop: bool
) -> Readings:
    """Readings of one CSV.

    Parameters
    ----------
    table : Table
        Of the file.
    name : {"frames", "points", "ranges"}
        What it holds.
    config : SessionFile
        For the uncertainties.
    section : ObservedTable
        Its table in session.toml.
    drop : bool
        Leave out rows that are no numbers.

    Raises
    ------
    InputError
        Names the file, the line and the column.
    """
    kind = KINDS[name]
    stated, turned = Stated(), list[str]()
    if kind == "pose":
        stated, turned = _stated(table, section)
    position, placed = _positions(table, kind)
    far, ranged = _distances(table, kind)
    good, warnings = refuse_bad(table, [*placed, *turned, *ranged], drop=drop)
    rotation = np.tile(np.eye(3), (len(table), 1, 1))
    if kind == "pose":
        rotation, told = checked_rotations(stated, table, good)
        rotation = np.where(good[:, None, None], rotation, np.eye(3))
        warnings += told
    position = np.where(good[:, None], position, 0.0)
    spread = spread_of(kind, table, position, good, config.uncertainty)
    if spread.columns:
        fine, told = refuse_bad(table, spread.columns, drop=drop)
        good, warnings = good & fine, warnings + told
    if stated.inverted:
        if spread.columns:
            raise InputError(
                'columns of uncertainties do not fit gives = "T_tool_tracker"',
                code="M32",
                where=table.where,
                field="frames.gives",
                fix="state position_um and rotation_mdeg under [uncertainty] in session.toml",
            )
        T = inverse(transform(rotation, position))
        position, rotation = T[:, :3, 3], T[:, :3, :3]
    extras = extras_of(table)
    whole = Readings(
        kind=kind,
        where=table.where,
        place=tuple(table.place(row) for row in range(len(table))),
        order=np.arange(len(table)),
        position=position,
        rotation=rotation,
        distance=np.where(good, far, 0.0),
        covariance=spread.covariance,
        target=_texts(table, "target"),
        anchor=_texts(table, "anchor"),
        station=_texts(table, "station"),
        offset=_offsets(table, good),
        stated=stated,
        extras=extras,
        uncertainty=spread.source,
        warnings=(*warnings, *spread.warnings, *extras.warnings),
        notes=(_dialect(table),),
    )
    return whole.rows(good)


def unused_columns(table: Table) -> list[str]:
    """Warnings of columns that look like a name of this program but are none."""
    out = []
    for name in table.names:
        hint = "" if is_known(name) or is_joint(name) else close_to(name)
        if hint:
            out.append(f'{table.where}: column "{name}" is not used; {hint}')
    return out


def is_joint(name: str) -> bool:
    """Whether a name is that of a joint column of any robot."""
    return name.startswith("q") and is_known(name)


def _stated(table: Table, section: ObservedTable) -> tuple[Stated, list[str]]:
    """How the rotations stand in the table."""
    euler = section.euler if isinstance(section, FramesTable) else None
    gives = section.gives if isinstance(section, FramesTable) else "T_tracker_tool"
    found = stated_in(table, euler)
    if found is None:
        raise InputError(
            "has no rotations",
            code="M35",
            where=table.where,
            field="frames",
            allowed=f"qw qx qy qz, rx_deg ry_deg rz_deg, or r11 ... r33; found: "
            f"{', '.join(table.names)[:160]}",
            fix="map them under [frames] columns, or write [points] if there are none",
        )
    stated, names = found
    return Stated(stated.form, stated.numbers, gives == "T_tool_tracker"), names


def _positions(table: Table, kind: str) -> tuple[Array, list[str]]:
    """Positions (m, 3) [m], Cartesian or polar, and their columns."""
    if kind == "distance":
        return np.zeros((len(table), 3)), []
    found = find_all(table.names, ("x", "y", "z"), "length", table.where)
    if found:
        names, factors = found
        return table.numbers(names) * factors, names
    reach = find(table.names, "range", "length", table.where)
    azimuth = find(table.names, "azimuth", "angle", table.where)
    up = find(table.names, "elevation", "angle", table.where)
    down = find(table.names, "zenith", "angle", table.where)
    if not (reach and azimuth and (up or down)):
        raise InputError(
            "has no positions",
            code="M35",
            where=table.where,
            field="columns",
            allowed="x_mm y_mm z_mm, or range_mm azimuth_deg elevation_deg (or zenith_deg); "
            f"found: {', '.join(table.names)[:160]}",
            fix=_hint(table),
        )
    height = up or down or ("", 1.0)
    names = [reach[0], azimuth[0], height[0]]
    r, a, e = (table.numbers(names) * [reach[1], azimuth[1], height[1]]).T
    return polar(r, a, e if up else np.pi / 2 - e), names


def polar(r: Array, azimuth: Array, elevation: Array) -> Array:
    """Positions (m, 3) from range [m], azimuth from x toward y and elevation above xy [rad]."""
    flat = r * np.cos(elevation)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), r * np.sin(elevation)], 1)


def _distances(table: Table, kind: str) -> tuple[Array, list[str]]:
    """Distances (m,) [m] and their column; zeros for other kinds."""
    if kind != "distance":
        return np.zeros(len(table)), []
    found = find(table.names, "distance", "length", table.where)
    if found is None or "anchor" not in table:
        missing = "anchor" if found else "distance_mm"
        raise InputError(
            f"has no column {missing}",
            code="M35",
            where=table.where,
            field=missing,
            allowed=f"found: {', '.join(table.names)[:160]}",
            fix="name the fixed point of each distance in a column anchor" if found else "",
        )
    return table.numbers([found[0]])[:, 0] * found[1], [found[0]]


def _offsets(table: Table, good: Bool) -> Array | None:
    """Places (m, 3) of the reflectors in the tool frame, where the file gives them [m]."""
    stems = ("reflector_x", "reflector_y", "reflector_z")
    found = find_all(table.names, stems, "length", table.where)
    if found is None:
        return None
    names, factors = found
    refuse_bad(table, names, drop=False)
    return np.where(good[:, None], table.numbers(names) * factors, 0.0)


def _texts(table: Table, name: str) -> tuple[str, ...]:
    """Cells of a column that may be missing."""
    return tuple(table.texts(name)) if name in table else ("",) * len(table)


def _hint(table: Table) -> str:
    """A likely misspelling."""
    return next(
        (hint for name in table.names if not is_known(name) and (hint := close_to(name))), ""
    )


def _dialect(table: Table) -> str:
    """How the file is written."""
    mark = "comma" if table.decimal == "," else "point"
    return (
        f"{table.where}: {table.sheet.encoding}, {table.sheet.separator} between cells, decimal "
        f"{mark}, {len(table)} rows"
    )
