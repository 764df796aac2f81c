"""A measuring session from its files: read, cleaned, matched, with every assumption stated."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path

from calib.errors import InputError, refuse
from testbed.files.assembly import assemble
from testbed.files.drift import without_drift
from testbed.files.frames_fit import mismatched_rows
from testbed.files.joints import read_joints
from testbed.files.matching import Match, by_cycle, by_order, by_pose, by_row
from testbed.files.observed import (
    misspelt_columns,
    read_observed,
    section_of,
    unused_columns,
)
from testbed.files.rapid import read_rapid
from testbed.files.readings import Readings, copied_rows, lost_readings
from testbed.files.refusal import require_names
from testbed.files.session import Drift, Session, Sources
from testbed.files.session_toml import (
    SESSION_FILE,
    FileTable,
    JointsTable,
    ObservedTable,
    OpticalTable,
    PointsTable,
    SessionFile,
)
from testbed.files.slips import raise_if_slipped
from testbed.files.spatial_analyzer import read_sa
from testbed.files.table import DataTable, table_of
from testbed.files.targets import TargetPart
from testbed.files.text import read_sheet
from testbed.files.uncertainty import require_shown
from testbed.gates.mistakes import validated
from testbed.gates.paths import is_there, real
from testbed.gates.text import MAX_MB, FileText, SourceFile
from testbed.gates.toml import read_toml_bytes, toml_document
from testbed.robots.robot import Robot

LARGEST_MB = 100_000.0
"""What a user may allow."""
BEGINNING = 1000
"""Lines that show whether the columns of a long file make sense."""


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """What the user may allow."""

    drop_invalid: bool = False
    """Leave out rows that are no numbers and joints without readings, instead of refusing."""
    max_mb: float = MAX_MB
    """Largest file that is read [MB]."""

    def __post_init__(self) -> None:
        """Refuse a size that no file has, nan among them."""
        if not 0.0 < self.max_mb <= LARGEST_MB:
            allowed = f"it must be above 0 and at most {LARGEST_MB:g} MB"
            fix = "give the size of the file in MB"
            raise refuse("--max-mb", self.max_mb, allowed, code="C41", fix=fix)


@dataclass(frozen=True, slots=True, eq=False)
class _Cleaned:
    """Readings of one file without what does not count, and what was left out."""

    readings: Readings
    section: ObservedTable
    text: FileText
    table: DataTable | None
    """None for an export of Spatial Analyzer."""
    masked: tuple[str, ...]
    warnings: tuple[str, ...]
    drift: Drift | None

    @property
    def poses(self) -> tuple[str, ...]:
        """Names of the poses that are read."""
        return self.readings.extras.pose or ()


def read_session(
    data: str | Path,
    robot: Robot,
    *,
    config: str | Path | None = None,
    options: ReadOptions | None = None,
    alone: bool = False,
) -> Session:
    """Read a measuring session.

    Parameters
    ----------
    data : path
        A CSV, or a session.toml (or its folder) that names the files.
    robot : Robot
        Whose joints these are; its limits distinguish degrees from radians.
    config : path, optional
        A session.toml on how to read a CSV: column names, units, conventions.
    options : ReadOptions, optional
        What is allowed.
    alone : bool
        Whether `data` holds joints and readings, whatever files `config` names.

    Raises
    ------
    InputError
        Names the file, the line, the thing, what was allowed and the likely fix.
    """
    options = ReadOptions() if options is None else options
    file = _session_file(Path(data))
    real(file, field="measurements", code="S37")
    toml = file if config is None and file.suffix.lower() == ".toml" else config
    settings, first = SessionFile(), list[SourceFile]()
    if toml is not None:
        content = read_toml_bytes(Path(toml), str(toml))
        first.append(SourceFile(Path(toml), sha256(content).hexdigest()))
        settings = validated(toml_document(content, str(toml)), SessionFile, str(toml))
    if alone:
        settings = settings.of_one_table
    root = file.parent if toml is None else Path(toml).parent
    sources = Sources(root, None if toml == file else file, options.max_mb, {})
    session = session_of(settings, sources, robot, drop=options.drop_invalid, where=str(toml))
    named = replace(session, name=session.name or file.stem, files=(*first, *session.files))
    return _without_strays(robot, named)


def session_of(
    settings: SessionFile, sources: Sources, robot: Robot, *, drop: bool, where: str
) -> Session:
    """The session that a session.toml describes, `where` in messages, with all its rows.

    Raises
    ------
    InputError
        As `read_session`, but for rows that belong to other joints.
    """
    cleaned = list(_observed(sources, settings, drop=drop))
    joined = []
    for one in cleaned:
        elsewhere = {name for other in cleaned if other is not one for name in other.poses}
        joined.append(_with_joints(one, sources, settings, robot, elsewhere, drop=drop))
    session = assemble([part for part, _ in joined], robot, settings, name=settings.name)
    require_shown(settings.uncertainty, session.measurements, where)
    warnings = [f"{where}: {text}" for text in settings.uncertainty.odd]
    warnings += [text for one in cleaned for text in one.warnings]
    warnings += [text for _, match in joined for text in match.warnings]
    if settings.robot and settings.robot != robot.name:
        warnings.append(f'the session names the robot "{settings.robot}", not {robot.name}')
    drifts = [one.drift for one in cleaned if one.drift is not None]
    return replace(
        session,
        files=sources.files,
        stated_reflectors=settings.stated_reflectors,
        masked=tuple(text for one in cleaned for text in one.masked),
        warnings=tuple(dict.fromkeys([*warnings, *session.warnings])),
        notes=tuple(dict.fromkeys([*session.notes, *(drift.sentence for drift in drifts)])),
        drift=max(drifts, key=lambda drift: float(drift.shift.max()), default=None),
    )


def _without_strays(robot: Robot, session: Session) -> Session:
    """The session without rows that no base and tool bring near their joints, which are named."""
    mismatched, why, doubtful = mismatched_rows(robot.model, session.measurements)
    raise_if_slipped(robot.model, session.measurements, doubtful, session.place)
    if not why:
        return session
    masked = tuple(f"{session.place[row]}: left out: {why[row]}" for row in sorted(why))
    return replace(session.rows(~mismatched), masked=(*session.masked, *masked))


def read_held_out(
    test: Path,
    robot: Robot,
    data: Path,
    *,
    config: Path | None = None,
    options: ReadOptions | None = None,
) -> Session:
    """Read held-out poses from a file of their own.

    A CSV says nothing of its own about units, conventions and uncertainties: what the session.toml
    of `data` says holds for it, too, but for the files that are named there.
    """
    file, main = _session_file(test), _session_file(data)
    own = config is not None or file.suffix.lower() == ".toml" or main.suffix.lower() != ".toml"
    if own:
        return read_session(test, robot, config=config, options=options)
    try:
        return read_session(file, robot, config=main, options=options, alone=True)
    except InputError as error:
        raise error.located(str(file)) from error


def _session_file(path: Path) -> Path:
    """The session.toml of a folder, or the file itself."""
    return path / SESSION_FILE if is_there(path, Path.is_dir) else path


def _observed(sources: Sources, settings: SessionFile, *, drop: bool) -> Iterator[_Cleaned]:
    """Readings of all files that session.toml names, or of DATA."""
    for section in settings.observed or (None,):
        files = (section.files or (section.file,)) if section is not None else (None,)
        for k, file in enumerate(files):
            key = section.name if section is not None else "joints"
            text = sources.text(file, key, _sheet(section, settings.joints, file))
            station = f"{k + 1}" if len(files) > 1 else ""
            yield _cleaned(text, section, station, sources, settings, drop=drop)


def _sheet(own: FileTable | None, other: FileTable | None, file: str | None) -> str | None:
    """The sheet of a table of session.toml; one that names none has that of the same file."""
    if own is not None and own.sheet is not None:
        return own.sheet
    return other.sheet if other is not None and other.file == file else None


def _cleaned(
    text: FileText,
    section: ObservedTable | None,
    station: str,
    sources: Sources,
    settings: SessionFile,
    *,
    drop: bool,
) -> _Cleaned:
    """Readings of one file without nests, lost readings, copies and drift."""
    warnings, table = list[str](), None
    if isinstance(section, OpticalTable) and section.format == "sa":
        readings = read_sa(text, section, settings.uncertainty, drop=drop)
    else:
        _try_beginning(text, section, settings)
        table = _table(text, settings, section, settings.joints)
        warnings += misspelt_columns(table)
        section = section or section_of(table)
        readings = read_observed(table, section, settings.uncertainty, drop=drop)
    if station and not any(readings.station):
        readings = replace(readings, station=(station,) * len(readings))
    good, masked = lost_readings(readings, settings.drift.nests if settings.drift else ())
    readings, drift = readings.rows(good), None
    if settings.drift is not None:
        nests = _nests(sources, settings)
        readings, drift, more = without_drift(readings, nests, settings.drift)
        warnings += more
    good, copies = copied_rows(readings)
    masked += copies
    return _Cleaned(
        readings.rows(good), section, text, table, tuple(masked), tuple(warnings), drift
    )


def _try_beginning(text: FileText, section: ObservedTable | None, settings: SessionFile) -> None:
    """Refuse a long file by its first lines, if its columns are wrong: all of it takes long."""
    if len(text.lines) <= 2 * BEGINNING:
        return
    try:
        table = _table(replace(text, lines=text.lines[:BEGINNING]), settings, section)
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
        return read_sa(text, section, settings.uncertainty, drop=False)
    table = _table(text, settings, section)
    return read_observed(table, section, settings.uncertainty, drop=False)


def _table(text: FileText, settings: SessionFile, *sections: FileTable | None) -> DataTable:
    """The table of a CSV under our column names."""
    dialect = settings.dialect
    if isinstance(sections[0], JointsTable) and sections[0].format == "rapid":
        return table_of(read_rapid(text), {}, decimal=".")
    sheet = read_sheet(text, separator=dialect.separator or "", header=dialect.header)
    # what the first section maps must be there; the others may mean other files
    mapping = {
        own: theirs
        for k, section in enumerate(sections)
        for own, theirs in (section.columns if section else {}).items()
        if k == 0 or theirs in sheet.head
    }
    return table_of(sheet, mapping, decimal=dialect.decimal)


def _with_joints(
    cleaned: _Cleaned,
    sources: Sources,
    settings: SessionFile,
    robot: Robot,
    elsewhere: Collection[str],
    *,
    drop: bool,
) -> tuple[TargetPart, Match]:
    """The joints of one file's readings; other files show the poses of `elsewhere`."""
    how, readings, section = settings.joints, cleaned.readings, cleaned.section
    apart = how.file is not None or sources.data is not None
    text = (
        sources.text(how.file, "joints", _sheet(how, section, how.file)) if apart else cleaned.text
    )
    same = text is cleaned.text
    table = _table(text, settings, how, section if same else None)
    joints = read_joints(table, robot, how.source, drop=drop)
    unused = unused_columns(table, joints.used, *([readings.columns] if same else []))
    if not same and cleaned.table is not None:
        unused += unused_columns(cleaned.table, readings.columns)
    readings = replace(readings, notes=(*readings.notes, *unused))
    if same:
        match = by_row(joints, readings)
    elif readings.cycling:
        match = by_cycle(joints, readings, robot.model)
    elif settings.match == "order":
        match = by_order(joints, readings, robot.model)
    else:
        match = by_pose(joints, readings, drop=drop, elsewhere=elsewhere)
    part = TargetPart(joints.rows(match.joints), readings.rows(match.readings), section)
    # only now: nests have no pose, and may be the only targets with a name
    require_names("pose_id", part.joints.extras.pose or (), part.joints.place)
    for side in (part.joints, part.readings):
        require_names("tool", side.extras.conditions.tool or (), side.place)
    if readings.kind != "pose" and any(part.readings.target):
        require_names("target", part.readings.target, part.readings.place)
    return part, match
