"""Readings of each file of a session, without what does not count."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from calib.errors import InputError
from testbed.files.dialects.controllers.read import joints_in
from testbed.files.dialects.spatial_analyzer import read_sa
from testbed.files.dialects.tables import (
    FileTable,
    JointsTable,
    ObservedTable,
    OpticalTable,
    PointsTable,
)
from testbed.files.nests.drift import without_drift
from testbed.files.observed import how_written, misspelt_columns, read_observed, section_of
from testbed.files.readings import Readings, lost_readings, lost_targets
from testbed.files.reflectors.own_files import of_reflector
from testbed.files.refusal import no_rows
from testbed.files.rows.copies import is_fine
from testbed.files.rows.kinds import own_rows, some_rows
from testbed.files.rows.wide import one_target_a_row
from testbed.files.rows.widened import sheet_in
from testbed.files.session import Drift
from testbed.files.session_toml import SessionFile
from testbed.files.sources import Sources
from testbed.files.table import DataTable, table_of
from testbed.files.text import Sheet
from testbed.gates.kinds import require_no_program
from testbed.gates.text import FileText

BEGINNING = 1000
"""Lines that show whether the columns of a long file make sense."""


@dataclass(frozen=True, slots=True, eq=False)
class Cleaned:
    """Readings of one file without what does not count, and what was left out."""

    readings: Readings
    section: ObservedTable
    text: FileText
    table: DataTable | None
    """None for an export of Spatial Analyzer."""
    masked: tuple[str, ...]
    warnings: tuple[str, ...]
    drift: Drift | None
    fine: bool
    """As `is_fine` of the readings as they stand in the file."""
    lines: tuple[str, ...]
    """Lines of the file in their order: missed shots and invalid rows too, but no nests."""

    @property
    def poses(self) -> tuple[str, ...]:
        """Names of the poses that are read."""
        return self.readings.extras.pose or ()


def readings_of(sources: Sources, settings: SessionFile, *, drop: bool) -> Iterator[Cleaned]:
    """Readings of all files that session.toml names, or of DATA."""
    for section in settings.observed or (None,):
        files = section.sources if section is not None else ((None, ""),)
        stations = len(section.files) if section is not None else 0
        for k, (file, reflector) in enumerate(files):
            key = section.name if section is not None else "joints"
            text = sources.text(file, key, sheet_of(section, settings.joints, file))
            station = f"{k + 1}" if stations > 1 else ""
            yield _cleaned(text, section, (station, reflector), sources, settings, drop=drop)


def sheet_of(own: FileTable | None, other: FileTable | None, file: str | None) -> str | None:
    """The sheet of a table of session.toml; one that names none has that of the same file."""
    if own is not None and own.sheet is not None:
        return own.sheet
    return other.sheet if other is not None and other.file == file else None


def _cleaned(
    text: FileText,
    section: ObservedTable | None,
    of: tuple[str, str],
    sources: Sources,
    settings: SessionFile,
    *,
    drop: bool,
) -> Cleaned:
    """Readings of one file, of a station and a reflector where these have files of their own.

    Without nests, lost readings and drift.
    """
    station, reflector = of
    warnings, table = list[str](), None
    if isinstance(section, OpticalTable) and section.format == "sa":
        require_no_program(text.lines, text.where)
        readings = read_sa(text, section, settings.uncertainty, drop=drop)
    else:
        _try_beginning(text, section, settings)
        table = table_in(text, settings, section, settings.joints)
        if not len(table):
            raise no_rows(text.where)
        warnings += misspelt_columns(table)
        section = section or section_of(table)
        readings = _read_own(table, text, section, settings, drop=drop)
    if station and not any(readings.station):
        readings = replace(readings, station=(station,) * len(readings))
    called = settings.drift.nests if settings.drift else ()
    if reflector:
        readings = of_reflector(readings, reflector, called)
    places = readings.place if table is None else table.places
    of_nests = {readings.place[row] for row in np.flatnonzero(np.isin(readings.target, called))}
    lines = tuple(dict.fromkeys(place for place in places if place not in of_nests))
    good, masked = lost_readings(readings, called)
    warnings += lost_targets(readings, good)
    readings, drift = readings.rows(good), None
    fine = is_fine(readings)
    if settings.drift is not None:
        nests = _nests(sources, settings)
        readings, drift, more = without_drift(readings, nests, settings.drift)
        warnings += more
    return Cleaned(
        readings, section, text, table, tuple(masked), tuple(warnings), drift, fine, lines
    )


def _read_own(
    table: DataTable, text: FileText, section: ObservedTable, settings: SessionFile, *, drop: bool
) -> Readings:
    """Readings of a table without the rows that hold another section's, where that reads it too."""
    others = [one for one in settings.observed if one is not section and _same(one, section)]
    if not others:
        return read_observed(table, section, settings.uncertainty, drop=drop)
    read_by = [(one, table_in(text, settings, one, settings.joints)) for one in others]
    rows = own_rows(table, section, read_by)
    if not len(rows):
        return read_observed(table, section, settings.uncertainty, drop=drop)  # which says why
    found = read_observed(some_rows(table, rows), section, settings.uncertainty, drop=drop)
    left = len(table) - len(rows)
    note = f"{table.where}: {left} of {len(table)} rows have nothing for [{section.name}]"
    notes = (how_written(table), *([note] if left else []))  # of the file, not of these rows
    return replace(found, order=rows[found.order], notes=notes)


def _same(one: ObservedTable, other: ObservedTable) -> bool:
    """Whether two sections read one table of one file."""
    place = [(each.sources, each.files, each.sheet) for each in (one, other)]
    return place[0] == place[1] and getattr(one, "format", "csv") == "csv"


def _try_beginning(text: FileText, section: ObservedTable | None, settings: SessionFile) -> None:
    """Refuse a long file by its first lines, if its columns are wrong: all of it takes long."""
    if len(text.lines) <= 2 * BEGINNING:
        return
    if section is not None and any(
        _same(one, section) for one in settings.observed if one is not section
    ):
        return  # the first lines may be another section's
    try:
        table = table_in(replace(text, lines=text.lines[:BEGINNING]), settings, section)
        read_observed(table, section or section_of(table), settings.uncertainty, drop=True)
    except InputError as error:
        # whether numbers have a decimal comma, and what they are, only the whole file shows
        if error.code in ("M24", "M35") and error.field != "decimal":
            raise


def _nests(sources: Sources, settings: SessionFile) -> Readings | None:
    """Readings of the nests, where they have a file of their own."""
    drift = settings.drift
    if drift is None or drift.file is None:
        return None
    text = sources.text(drift.file, "drift")
    section = settings.points or PointsTable()
    if section.format == "sa":
        # whatever numbers the poses of the robot, the names of the targets are those of the nests
        own = section.model_copy(update={"pose": "occurrence"})
        return read_sa(text, own, settings.uncertainty, drop=False)
    table = table_in(text, settings, section)
    return read_observed(table, section, settings.uncertainty, drop=False)


def _holds(sheet: Sheet, section: PointsTable, own: bool) -> bool:
    """Whether a sheet is that of several targets in a row: its `own` section says so."""
    return own or {column for each in section.targets.values() for column in each} <= {*sheet.head}


def table_in(text: FileText, settings: SessionFile, *sections: FileTable | None) -> DataTable:
    """The table of a CSV under our column names."""
    dialect = settings.dialect
    own = sections[0]
    if isinstance(own, JointsTable) and own.format != "csv":
        return table_of(joints_in(text, own.format).sheet, {}, decimal=".")
    require_no_program(text.lines, text.where)
    header = dialect.header if own is None or own.header is None else own.header
    sheet = sheet_in(text, separator=dialect.separator or "", header=header)
    for k, section in enumerate(sections):
        if isinstance(section, PointsTable) and section.targets and _holds(sheet, section, k == 0):
            sheet = one_target_a_row(sheet, section)
    # what the first section maps must be there; the others may mean other files
    mapping = {
        own: theirs
        for k, section in enumerate(sections)
        for own, theirs in (section.columns if section else {}).items()
        if k == 0 or theirs in sheet.head
    }
    return table_of(sheet, mapping, decimal=dialect.decimal)
