"""A test after ISO 9283 from its files: tables of measured cycles, and a session.toml."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from calib.errors import refuse
from testbed.files.dialects.tables import CyclesTable
from testbed.files.read import ReadOptions
from testbed.files.session_toml import SESSION_FILE, SessionFile
from testbed.files.sources import Given, Sources, given
from testbed.gates.text import SourceFile
from testbed.iso9283.grouped import Commands, paths_in, visits_in
from testbed.iso9283.records import CycleTest, PathRuns, Visits
from testbed.iso9283.rows import Rows, are_counts, read_rows
from testbed.units import millimetres

SIZES = 5e-3, 5e1
"""Largest extent of all commands of an arm that is tested [m]; meters and millimeters exchanged
make it a thousand times smaller or larger."""


def read_test(
    data: str | Path, *, config: str | Path | None = None, options: ReadOptions | None = None
) -> CycleTest:
    """Read measured cycles.

    Parameters
    ----------
    data : path
        A table (CSV, xlsx), or a session.toml (or its folder) with [cycles], [paths] or both.
    config : path, optional
        A session.toml on how to read a table: column names, units, uncertainty, job sheet.
    options : ReadOptions, optional
        What is allowed.

    Raises
    ------
    InputError
        Names the file, the line, the thing, what was allowed and the likely fix.
    """
    options = ReadOptions() if options is None else options
    source = given(data, config, options.max_mb, field="DATA")
    if (
        source.toml == source.file
        and source.settings.cycles is None
        and source.settings.paths is None
    ):
        message, fix = "has no [cycles] and no [paths]", 'write [cycles] and file = "cycles.csv"'
        raise refuse("cycles", code="S37", message=message, fix=fix, where=str(source.file))
    test = test_of(source, drop=options.drop_invalid)
    source.sources.require_data_read(str(source.toml))
    return test


def test_of(source: Given, *, drop: bool) -> CycleTest:
    """The test that was given."""
    settings, sources, where = source.settings, source.sources, (source.toml or source.file).name
    visits: Visits | None = None
    paths, parts, notes = list[PathRuns](), list[Rows](), list[str]()
    for key, section, rows in _tables(settings, sources, drop=drop):
        parts.append(rows)
        is_path = np.array([bool(name) for name in rows.path])
        commands = _commanded(section, key, sources, settings, drop=drop)
        if is_path.any():
            found, said = paths_in(rows.rows(np.flatnonzero(is_path)), commands, drop=drop)
            paths += found
            notes += said
        if not is_path.all():
            if key == "paths":
                row = int(np.argmin(is_path))
                message, fix = "path is empty", "name the path of each row in the column path"
                raise refuse("path", code="M25", message=message, fix=fix, where=rows.place[row])
            visits, said = visits_in(rows.rows(np.flatnonzero(~is_path)), commands, drop=drop)
            notes += said
    sheet, stated = settings.job.sheet, settings.conditions
    warnings = [f"{where}: {text}" for text in sheet.instrument.warnings(stated.date)]
    warnings += [text for one in parts for text in one.warnings]
    warnings += _repeating(visits, paths)
    warnings += _of_odd_size(visits, paths)
    limits: dict[str, float] = {}
    limits |= {name: limit * 1e-6 for name, limit in settings.iso9283.limits_um.items()}
    sha = tuple(dict.fromkeys([*source.read, *sources.files]))
    frame = settings.iso9283.frame
    return CycleTest(
        name=settings.name or name_of(source.file),
        files=sha,
        visits=visits,
        paths=tuple(paths),
        fitted=None if frame is None else frame == "fitted",
        speed_percent=settings.iso9283.speed_percent,
        conditions=stated.rows(1).phrase if stated.rows(1).stated else "",
        date=stated.date,
        job=sheet,
        systematic=settings.uncertainty.systematic,
        limits=limits,
        uncertainty=" and ".join(
            dict.fromkeys(
                said for one in parts if one.uncertainty for said in one.uncertainty.split(" and ")
            )
        ),
        simulated=settings.simulated,
        warnings=_without_folders(warnings, sha),
        notes=_without_folders([*(note for one in parts for note in one.notes), *notes], sha),
    )


def name_of(file: Path) -> str:
    """Name of a test whose session gives none: that of its folder, or of its only file."""
    return (file.resolve().parent.name if file.name == SESSION_FILE else "") or file.stem


def _repeating(visits: Visits | None, paths: Sequence[PathRuns]) -> Iterator[str]:
    """Sentences on readings that are the commands, digit for digit."""
    same = [
        f"path {one.name}"
        for one in paths
        if all(np.array_equal(run, one.command) for run in one.runs)
    ]
    if visits is not None and (visits.position == visits.command[:, None]).all():
        same.insert(0, "poses")
    for what in same:
        yield (
            f"{what}: every reading is its command to the last digit: no measurement; name the "
            "columns of what the instrument saw"
        )


def _of_odd_size(visits: Visits | None, paths: Sequence[PathRuns]) -> Iterator[str]:
    """A sentence where all commands lie nearer together, or further apart, than an arm moves."""
    parts = [one.command for one in paths]
    parts += [visits.command] if visits is not None else []
    size = float(np.ptp(np.concatenate(parts), axis=0).max())
    if 0 < size < SIZES[0] or size > SIZES[1]:
        yield (
            f"all commands lie within {millimetres(size)} mm: if the arm moved another way "
            "than that, commands and readings are in another unit than their columns say (_mm, _m)"
        )


def _without_folders(texts: Sequence[str], files: Sequence[SourceFile]) -> tuple[str, ...]:
    """Sentences that name files without the folders of this machine, each once."""
    for folder in sorted({f"{file.path.parent}/" for file in files} - {"./", "/"}, key=len)[::-1]:
        texts = [text.replace(folder, "") for text in texts]
    return tuple(dict.fromkeys(texts))


def _tables(
    settings: SessionFile, sources: Sources, *, drop: bool
) -> Iterator[tuple[str, CyclesTable, Rows]]:
    """Rows of each table that session.toml names, or of DATA."""
    stated = {"cycles": settings.cycles, "paths": settings.paths}
    named = {key: section for key, section in stated.items() if section is not None}
    for key, section in (named or {"cycles": CyclesTable()}).items():
        text = sources.text(section.file, key, section.sheet)
        yield key, section, read_rows(text, section, settings, drop=drop)


def _commanded(
    section: CyclesTable, key: str, sources: Sources, settings: SessionFile, *, drop: bool
) -> Commands:
    """Commands from a file of their own: by pose, or by path and point."""
    if section.commanded is None:
        return {}
    text = sources.text(section.commanded, key)
    plain = CyclesTable(euler=section.euler)
    rows = read_rows(text, plain, SessionFile(dialect=settings.dialect), drop=drop, commands=False)
    found: dict[tuple[str, ...], tuple[np.ndarray, np.ndarray | None]] = {}
    for k, place in enumerate(rows.place):
        point = None if rows.point is None else rows.point[k]
        if rows.path[k] and (point is None or not are_counts(np.array(point))):
            message, fix = "path_point is not a whole number", "number the points of the path"
            raise refuse("path_point", code="M25", message=message, fix=fix, where=place)
        name = (
            (rows.path[k], str(int(point)))
            if point is not None and rows.path[k]
            else (rows.pose[k],)
        )
        if not name[0] or name in found:
            what = "is commanded twice" if name[0] else "has no name"
            message = f"{' point '.join(name) or 'a row'} {what}"
            fix = "give pose_id, or path and path_point, once each"
            raise refuse("pose_id", code="M31", message=message, fix=fix, where=place)
        found[name] = (rows.position[k], None if rows.rotation is None else rows.rotation[k])
    return found
