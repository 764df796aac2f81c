"""Rows of measured cycles: where the robot was sent, where it was seen, in which cycle."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.errors import InputError
from testbed.bounds import COUNT
from testbed.files.cleaned import table_in
from testbed.files.columns import COMMANDED, COUNTS, misspelling
from testbed.files.dialects.tables import CyclesTable, FramesTable
from testbed.files.observed import misspelt_columns, read_observed, section_of, unused_columns
from testbed.files.readings import COPIES, Readings, copied_rows, lost_readings, rows_said
from testbed.files.refusal import no_rows, refusal, require_names
from testbed.files.session import rows_of
from testbed.files.session_toml import SessionFile, UncertaintyTable
from testbed.files.table import Columns, DataTable
from testbed.files.uncertainty import spread_columns
from testbed.gates.text import FileText

UNKNOWN = UncertaintyTable(position_um=1.0, rotation_mdeg=1.0, distance_um=1.0)
"""Stands in where no noise is stated, or none is asked for."""
MINE = (*COUNTS, "path", "pose_id", "approach")


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Rows of one file, in its order; lost readings are left out."""

    where: str
    place: tuple[str, ...]
    """(r,) file and line."""
    pose: tuple[str, ...]
    """(r,) pose_id; empty in rows of paths."""
    path: tuple[str, ...]
    approach: tuple[str, ...]
    cycle: Index | None
    """(r,); None: no column says it, and the k-th row of a pose is cycle k."""
    point: Array | None
    """(r,) number of the path point; nan where the cell is empty."""
    time: Array | None
    """(r,) [s]"""
    position: Array
    """(r, 3) [m]"""
    rotation: Array | None
    """(r, 3, 3)"""
    command: Array | None
    """(r, 3) [m]; None where other rows or another file say it."""
    command_rotation: Array | None
    covariance: Array | None
    """(r, 6, 6); None where no noise is stated."""
    uncertainty: str
    warnings: tuple[str, ...]
    notes: tuple[str, ...]

    def rows(self, index: Index) -> "Rows":
        """Some of them (indices)."""
        columns = ("place", "pose", "path", "approach", "cycle", "point", "time", "position",
                   "rotation", "command", "command_rotation", "covariance")  # fmt: skip
        return rows_of(self, index, columns)


def read_rows(
    text: FileText,
    section: CyclesTable,
    settings: SessionFile,
    *,
    drop: bool,
    commands: bool = True,
) -> Rows:
    """Rows of a table of cycles.

    Parameters
    ----------
    text : FileText
        The file.
    section : CyclesTable
        [cycles] or [paths].
    settings : SessionFile
        For dialect and uncertainty.
    drop : bool
        Leave out rows that are no numbers.
    commands : bool
        Whether columns of commands are looked for; a file of commands has none.

    Raises
    ------
    InputError
        Names the file, the line and the column.
    """
    table = table_in(text, settings, section)
    if not len(table):
        raise no_rows(table.where)
    readings, stated = _readings(table, section, settings, drop=drop)
    good, lost = lost_readings(readings, (), touches=False)
    readings = readings.rows(good)
    index = readings.order
    if not len(index):
        fix = "see what was left out, and measure again"
        raise refusal(table.where, "measurements", "no row is left", code="M27", fix=fix)
    copied = ~copied_rows(readings)[0]
    copies = rows_said(readings.place, copied, f"{COPIES}: they make scatter small", left="")
    sent = _commands(table, section) if commands else None
    names = Columns((*MINE, *(name for name in table.names if name.startswith(COMMANDED))))
    full, unused = readings.kind == "pose", unused_columns(table, readings.columns, names)
    return Rows(
        where=table.where,
        place=readings.place,
        pose=_texts(table, "pose_id", index),
        path=_texts(table, "path", index),
        approach=_texts(table, "approach", index),
        cycle=_cycles(table, index),
        point=table.numbers(["path_point"])[index, 0] if "path_point" in table else None,
        time=readings.extras.time,
        position=readings.position,
        rotation=readings.rotation if full else None,
        command=None if sent is None else sent.position[index],
        command_rotation=sent.rotation[index] if sent is not None and sent.kind == "pose" else None,
        covariance=readings.covariance if stated else None,
        uncertainty=readings.uncertainty if stated else "",
        warnings=(*misspelt_columns(table), *readings.warnings, *copies),
        notes=(*readings.notes, *lost, *(one.sentence for one in unused)),
    )


def _readings(
    table: DataTable, section: CyclesTable, settings: SessionFile, *, drop: bool | None
) -> tuple[Readings, bool]:
    """What was seen, and whether its noise is stated."""
    fix = (
        "name the columns so, let `truebed new session` propose it, or say in columns of [cycles] "
        "which is which"
    )
    observed = section_of(table, fix)
    if observed.kind == "distance":
        message, fix = "holds distances", "give positions x_mm y_mm z_mm"
        raise refusal(table.where, "distance", message, fix=fix)
    if isinstance(observed, FramesTable):
        observed = observed.model_copy(update={"euler": section.euler})
    given = settings.uncertainty
    stated = bool(
        spread_columns(observed.kind, table, given).names or given.position_um or given.mpe_um
    )
    try:
        return read_observed(table, observed, given if stated else UNKNOWN, drop=drop), stated
    except InputError as error:
        if error.field != "euler":
            raise
        # the key stands elsewhere than in a calibration
        raise refusal(
            error.where, error.field, error.message, code=error.code, value=error.value,
            allowed=error.allowed, fix=error.fix.replace("[frames]", "[cycles] or [paths]"),
        ) from error  # fmt: skip


def _commands(table: DataTable, section: CyclesTable) -> Readings | None:
    """Where the robot was sent, in all rows; None where no column says it."""
    names = {
        name.removeprefix(COMMANDED): theirs
        for name, theirs in table.names.items()
        if name.startswith(COMMANDED)
    }
    if not names:
        return None
    if "euler" in table:
        names["euler"] = table.names["euler"]
    try:
        return _readings(replace(table, names=names), section, SessionFile(), drop=None)[0]
    except InputError as error:
        if error.code != "M35":
            raise
        fix = "give command_x_mm, command_y_mm and command_z_mm"
        if error.field.startswith(("r", "q", "e")) and error.fix:
            fix = error.fix  # it is the rotation that is not whole
        raise refusal(
            table.where, COMMANDED, f"the columns {COMMANDED}... give no command: {error.message}",
            fix=misspelling(table.names) or fix,
        ) from error  # fmt: skip


def _cycles(table: DataTable, index: Index) -> Index | None:
    """Number of the cycle of some rows.

    Raises
    ------
    InputError
        M35: it is no whole number.
    """
    name = next((name for name in ("cycle", "repeat") if name in table), None)
    if name is None:
        return None
    values = table.numbers([name])[index, 0]
    wrong = ~are_counts(values)
    if wrong.any():
        row = int(index[np.argmax(wrong)])
        message = f'{name} is "{table.texts(name)[row][:20]}"'
        raise refusal(
            table.place(row), name, message, allowed="it is a whole number", fix="correct it"
        )
    return np.asarray(values.astype(np.int64))


def are_counts(values: Array) -> Bool:
    """Which numbers (r,) are whole, and count something."""
    with np.errstate(invalid="ignore"):
        return np.asarray((np.abs(values) <= COUNT.most) & (values == np.floor(values)))


def _texts(table: DataTable, name: str, index: Index) -> tuple[str, ...]:
    """Cells of a column in some rows; empty ones where there is no such column."""
    cells = table.texts_of(name)
    return tuple("" if cells is None else cells[row] for row in index)


def require_pose_names(rows: Rows) -> None:
    """Refuse rows of poses without names; M25."""
    if not any(rows.pose):
        message = "no column names the poses that were measured"
        fix = 'write a column pose_id, or pose_id = "NAME" under [cycles.columns]'
        raise refusal(rows.where, "pose_id", message, code="M25", fix=fix)
    require_names("pose_id", rows.pose, rows.place)


def one_command(name: str, command: Array, place: Sequence[str]) -> Array:
    """The command that some rows (r, *) of one pose share.

    Raises
    ------
    InputError
        M31: two rows say different ones.
    """
    off = np.abs(command - command[0]).reshape(len(command), -1).max(axis=1)
    if (off > 1e-9).any():
        row = int(np.argmax(off > 1e-9))
        line = place[0].rpartition(":")[2]
        message = f"{name} is commanded to another place than in line {line}"
        fix = "give it a name of its own"
        raise refusal(place[row], "pose_id", message, code="M31", value=name, fix=fix)
    return np.asarray(command[0])
