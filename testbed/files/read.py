"""A measuring session from its files: read, cleaned, matched, and every assumption said."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from calib.arrays import Array, Bool
from calib.errors import InputError
from testbed.files.assembly import assembled
from testbed.files.drift import without_drift
from testbed.files.frames_fit import wrong_rows
from testbed.files.joints import Joints, read_joints
from testbed.files.matching import Match, by_cycle, by_order, by_pose, by_row
from testbed.files.observed import kind_in, read_observed, unused_columns
from testbed.files.readings import Readings, copied_rows, missed_shots, numeric_columns
from testbed.files.session import Drift as Drift
from testbed.files.session import Session as Session
from testbed.files.session_toml import (
    SESSION_FILE,
    FileTable,
    FramesTable,
    ObservedTable,
    PointsTable,
    RangesTable,
    SessionFile,
    Sources,
)
from testbed.files.spatial_analyzer import read_sa_frames, read_sa_points
from testbed.files.table import Table, table_of
from testbed.files.targets import Part
from testbed.files.text import MAX_MB, SourceFile, Text, read_sheet, read_text
from testbed.robots.robot import Robot
from testbed.strict import read_toml

BEGINNING = 1000
"""Lines that tell whether the columns of a long file make sense."""
SECTIONS = {"frames": FramesTable, "points": PointsTable, "ranges": RangesTable}


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """What the user may allow."""

    drop_invalid: bool = False
    """Leave out rows that are no numbers and joints without readings, instead of refusing."""
    max_mb: float = MAX_MB
    """Largest file that is read [MB]."""


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """Readings of one file, cleaned, and what was left out."""

    readings: Readings
    section: ObservedTable
    text: Text
    masked: tuple[str, ...]
    warnings: tuple[str, ...]
    drift: Drift | None


def read_session(
    data: str | Path,
    robot: Robot,
    *,
    config: str | Path | None = None,
    options: ReadOptions | None = None,
) -> Session:
    """Read a measuring session.

    Parameters
    ----------
    data : path
        A CSV, or a session.toml (or its folder) that names the files.
    robot : Robot
        Whose joints these are; its limits tell degrees from radians.
    config : path, optional
        A session.toml that says how to read a CSV: column names, units, conventions.
    options : ReadOptions, optional
        What is allowed.

    Raises
    ------
    InputError
        Names the file, the line, the thing, what was allowed and the likely fix.
    """
    options = ReadOptions() if options is None else options
    file = _session_file(Path(data))
    toml = file if config is None and file.suffix.lower() == ".toml" else config
    settings, first = SessionFile(), list[SourceFile]()
    if toml is not None:
        first.append(read_text(Path(toml), str(toml), max_mb=1.0).source)
        settings = read_toml(Path(toml), SessionFile)
    root = file.parent if toml is None else Path(toml).parent
    sources = Sources(root, None if toml == file else file, options.max_mb, {})
    found = list(_observed(sources, settings, options))
    joined = [
        _with_joints(one, sources, settings, robot, options, _poses(found[:k] + found[k + 1 :]))
        for k, one in enumerate(found)
    ]
    session = assembled(
        [part for part, _ in joined], robot, settings, name=settings.name or file.stem
    )
    warnings = [told for one in found for told in one.warnings]
    warnings += [told for _, match in joined for told in match.warnings]
    if settings.robot and settings.robot != robot.name:
        warnings.append(f'the session names the robot "{settings.robot}", not {robot.name}')
    drifts = [one.drift for one in found if one.drift is not None]
    session = replace(
        session,
        files=(*first, *sources.files),
        masked=tuple(told for one in found for told in one.masked),
        warnings=tuple(dict.fromkeys([*warnings, *session.warnings])),
        notes=tuple(dict.fromkeys([*session.notes, *(drift.sentence for drift in drifts)])),
        drift=max(drifts, key=lambda drift: float(drift.shift.max()), default=None),
    )
    return _without_wrong_rows(session, robot)


def rows_of(session: Session, which: Bool) -> Session:
    """The session restricted to some rows (m,); what was left out stays told."""
    index = np.flatnonzero(which)

    def kept(values: Array | None) -> Array | None:
        return None if values is None else values[index]

    stated = session.stated
    return replace(
        session,
        measurements=session.measurements.rows(index),
        is_test=session.is_test[index],
        read_back=kept(session.read_back),
        time=kept(session.time),
        temperature=kept(session.temperature),
        approach=None if session.approach is None else tuple(session.approach[k] for k in index),
        stated=replace(stated, numbers=kept(stated.numbers)),
        place=tuple(session.place[k] for k in index),
    )


def _session_file(path: Path) -> Path:
    """The session.toml of a folder, or the file itself."""
    try:
        return path / SESSION_FILE if path.is_dir() else path
    except (OSError, ValueError):
        return path  # reading it will say why


def _observed(sources: Sources, settings: SessionFile, options: ReadOptions) -> Iterator[_Found]:
    """Readings of all files that session.toml names, or of DATA."""
    named = settings.observed or ((None, None),)
    for name, section in named:
        files = (section.files or (section.file,)) if section is not None else (None,)
        for k, file in enumerate(files):
            key = name or "joints"
            text = sources.text(file, key)
            own = f"{k + 1}" if len(files) > 1 else ""
            yield _cleaned(text, name, section, own, sources, settings, options)


def _cleaned(
    text: Text,
    name: str | None,
    section: ObservedTable | None,
    station: str,
    sources: Sources,
    settings: SessionFile,
    options: ReadOptions,
) -> _Found:
    """Readings of one file without nests, missed shots, copies and drift."""
    drop, warnings = options.drop_invalid, list[str]()
    if isinstance(section, FramesTable | PointsTable) and section.format == "sa":
        if isinstance(section, PointsTable):
            readings = read_sa_points(text, settings, section, drop=drop)
        else:
            readings = read_sa_frames(text, settings, section, drop=drop)
    else:
        _try_beginning(text, name, section, settings)
        table = _table(text, settings, section, settings.joints)
        warnings += unused_columns(table)
        name = name or kind_in(table)
        section = section or SECTIONS[name]()
        readings = read_observed(table, name, settings, section, drop=drop)
    assert section is not None  # a Spatial Analyzer file has one, others were just given one
    if station and not any(readings.station):
        readings = replace(readings, station=(station,) * len(readings))
    nests = settings.drift.nests if settings.drift is not None else ()
    good, masked = missed_shots(readings, nests)
    readings = readings.rows(good)
    drift = None
    if settings.drift is not None:
        readings, drift, told = without_drift(readings, _nests(sources, settings), settings.drift)
        warnings += told
    good, told = copied_rows(readings)
    return _Found(readings.rows(good), section, text, (*masked, *told), tuple(warnings), drift)


def _try_beginning(
    text: Text, name: str | None, section: ObservedTable | None, settings: SessionFile
) -> None:
    """Refuse a long file by its first lines, if its columns are wrong: all of it takes long."""
    if len(text.lines) <= 2 * BEGINNING:
        return
    try:
        table = _table(replace(text, lines=text.lines[:BEGINNING]), settings, section)
        name = name or kind_in(table)
        read_observed(table, name, settings, section or SECTIONS[name](), drop=True)
    except InputError as error:
        # whether numbers have a decimal comma, and what they are, the whole file must say
        if error.code in ("M24", "M35") and error.field != "decimal":
            raise


def _nests(sources: Sources, settings: SessionFile) -> Readings | None:
    """Shots at the nests, where they have a file of their own."""
    drift = settings.drift
    if drift is None or drift.file is None:
        return None
    text = sources.text(drift.file, "drift")
    section = settings.points or PointsTable()
    if section.format == "sa":
        return read_sa_points(text, settings, section, drop=False)
    return read_observed(_table(text, settings, section), "points", settings, section, drop=False)


def _table(text: Text, settings: SessionFile, *sections: FileTable | None) -> Table:
    """The table of a CSV under our column names."""
    dialect = settings.dialect
    sheet = read_sheet(text, separator=dialect.separator or "")
    # what the first section maps must be there; the others may speak of other files
    mapping = {
        own: theirs
        for k, section in enumerate(sections)
        for own, theirs in (section.columns if section else {}).items()
        if k == 0 or theirs in sheet.head
    }
    raw = table_of(sheet, mapping, (), decimal=dialect.decimal or ".")
    return table_of(sheet, mapping, numeric_columns(raw), decimal=dialect.decimal)


def _with_joints(
    found: _Found,
    sources: Sources,
    settings: SessionFile,
    robot: Robot,
    options: ReadOptions,
    elsewhere: frozenset[str],
) -> tuple[Part, Match]:
    """The joints of one file's readings; other files show the poses of `elsewhere`."""
    own, drop = settings.joints, options.drop_invalid
    text = found.text if own.file is None else sources.text(own.file, "joints")
    if own.file is None and sources.data is not None:
        text = sources.text(None, "joints")
    same = text is found.text
    table = _table(text, settings, own, *([found.section] if same else []))
    joints = read_joints(table, robot, own.source, drop=drop)
    readings = found.readings
    if same:
        match = by_row(joints, readings)
    elif readings.cycling:
        match = by_cycle(joints, readings)
    elif settings.match == "order":
        match = by_order(joints, readings)
    else:
        match = by_pose(joints, readings, drop=drop, elsewhere=elsewhere)
    return _part(joints, readings, match, found.section), match


def _poses(found: list[_Found]) -> frozenset[str]:
    """Names of the poses that some files show."""
    return frozenset(name for one in found for name in one.readings.extras.pose or ())


def _part(joints: Joints, readings: Readings, match: Match, section: ObservedTable) -> Part:
    """Rows that belong together."""
    return Part(joints.rows(match.joints), readings.rows(match.readings), section)


def _without_wrong_rows(session: Session, robot: Robot) -> Session:
    """The session without rows that no frames bring near their joints."""
    wrong, told = wrong_rows(robot.model, session.measurements)
    if not wrong.any():
        return session
    sentences = tuple(f"{session.place[row]}: left out: {told[row]}" for row in sorted(told))
    return replace(rows_of(session, ~wrong), masked=(*session.masked, *sentences))
