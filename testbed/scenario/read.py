"""The scenario file: read strictly, checked against its robot, written with every default."""

import json
import shlex
from collections.abc import Callable, Collection, Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from calib.errors import refuse
from testbed.assets import robot_names, scene_names, scenes
from testbed.faults import Fault, KeyPath, flat, foreign_values, nested, one_error
from testbed.gates.kinds import kind_of_name, require_kind
from testbed.gates.paths import near, real
from testbed.gates.toml import read_toml_bytes, toml_document
from testbed.names import name_meant
from testbed.scenario.contradictions import contradictions
from testbed.scenario.laboratory import TruthSettings
from testbed.scenario.messages import keys_by_table, sentences
from testbed.scenario.origin import (
    ORIGIN,
    OriginTable,
    differing,
    filled_in,
    is_path,
    origin_lines,
    unknown,
)
from testbed.scenario.presets import given_in, resolved, written
from testbed.scenario.scenario import FORMAT, Scenario, ScenarioFile, StudyTable
from testbed.scenario.stale import CALLED, OLD, copied_fault, filled_scenario, stale
from testbed.store.foreign import foreign
from testbed.toml_text import toml_lines, toml_value

TABLE = ("a table", "to calibrate from measurements, type truebed new session {}")
ROBOT = ("the description of a robot", "to begin a scenario for it, type truebed new scene {}")
OTHERS = {"table": TABLE, "description": ROBOT}
"""What files of other endings are, and what they are for."""


def scenario_path(name_or_path: str | Path) -> tuple[Path, str]:
    """File of a shipped scene or of a path, and how messages call it."""
    text = str(name_or_path)
    if text in scene_names():
        return scenes() / f"{text}.toml", f"scenes/{text}.toml"
    path = Path(text)
    try:
        is_file, is_folder = path.is_file(), path.is_dir()
    except (OSError, ValueError):
        is_file = is_folder = False
    if is_folder and (path / "scenario.toml").is_file():
        return path / "scenario.toml", str(path / "scenario.toml")
    if is_folder and text:
        told, fix = foreign(path)
        raise refuse(
            "SCENE", text, code="S37", message=f"{text} has no scenario.toml: {told}", fix=fix
        )
    if is_file and (kind := kind_of_name(path)):
        what, fix = OTHERS[kind]
        message = f"{text} is {what}, and a scenario is a .toml"
        raise refuse("SCENE", text, code="S37", message=message, fix=fix.format(shlex.quote(text)))
    if not is_file:
        names = ", ".join(scene_names())
        allowed = f"scenes that ship: {names}" if names else "no scenes ship with this copy"
        fix = name_meant(text, scene_names())
        if name_meant(text, robot_names()) and not fix:
            robot = name_meant(text, robot_names()).partition('"')[2].rpartition('"')[0]
            fix = f"to begin one for a robot, type truebed new scene {robot}"
        if path.suffix or len(path.parts) > 1 or not fix:
            fix = near(path, fix or "give a scene name or the path of a .toml")
        message = f'there is no scene or file "{text}"'
        raise refuse("SCENE", text, allowed, code="S37", message=message, fix=fix)
    return path, text


Declared = Callable[[Collection[str]], Mapping[str, type[StudyTable]]]
"""Takes the keys of a document and returns the tables of studies it may have, by name."""


def load_scenario(
    name_or_path: str | Path, declared: Declared, *, finished: bool = False
) -> Scenario:
    """A scenario from a shipped scene's name, a file, or a run folder.

    With `finished` it is that of a finished run, see `scenario_of`.

    Raises
    ------
    InputError
        All faults of the file at once (up to 20), each with table, key, value and likely fix.
    """
    path, where = scenario_path(name_or_path)
    data = read_toml_bytes(path, where)
    return parse_scenario(data, declared, where=where, folder=path.parent, finished=finished)


def parse_scenario(
    data: bytes | str,
    declared: Declared,
    *,
    where: str,
    folder: Path | None = None,
    finished: bool = False,
) -> Scenario:
    """A scenario from the content of a file; `folder` is what a relative robot path starts from."""
    document = toml_document(data.encode() if isinstance(data, str) else data, where)
    require_kind(document, "scenario", where)
    if folder is not None:
        _place_files(document, folder.resolve(), where)
    return scenario_of(document, declared, where=where, finished=finished)


def _place_files(document: dict[str, Any], folder: Path, where: str) -> None:
    """Make the paths of robot, obstacles and measured poses absolute, in place."""
    for _, table in _tables([document, document.get(ORIGIN)]):
        if isinstance(robot := table.get("robot"), str) and is_path(robot):
            table["robot"] = str(real(folder / robot, field="robot", code="S37", where=where))
    cell, plan = document.get("cell"), document.get("plan")
    obstacles = cell.get("obstacle") if isinstance(cell, dict) else None
    entries = [
        *((f"[[cell.obstacle]] {k + 1} file", "file", entry) for k, entry in _tables(obstacles)),
        *(("[plan] measured", "measured", entry) for _, entry in _tables([plan])),
    ]
    for at, key, table in entries:
        name = table.get(key)
        if not isinstance(name, str) or not name or "\0" in name or Path(name).is_absolute():
            continue
        file = real(folder / name, field=at, where=where)
        if not file.is_relative_to(folder):
            message = f"{at} is {toml_value(name)}"
            allowed = "a file beside the scenario or in a folder below it"
            raise refuse(
                key, name, allowed, code="R6", message=message, fix="copy it there", where=where
            )
        table[key] = str(file)


def _tables(entries: object) -> list[tuple[int, dict[str, Any]]]:
    """The tables in a list, with their positions; nothing if it is no list."""
    rows = enumerate(entries) if isinstance(entries, list) else ()
    return [(k, entry) for k, entry in rows if isinstance(entry, dict)]


def scenario_of(
    document: Mapping[str, Any],
    declared: Declared,
    *,
    where: str = "scenario",
    finished: bool = False,
    way_out: str = OLD,
) -> Scenario:
    """A scenario from nested mappings, as a TOML reader gives them; presets are applied.

    With `finished` it is that of a finished run, whose hash guards it: its numbers count as they
    are, whatever preset stands beside them. `way_out` is told where they do not, and no [origin]
    says what was given.
    """
    version = document.get("format")
    if isinstance(version, int) and not isinstance(version, bool) and version > FORMAT:
        message, allowed = f"has format {version}", f"this version reads format {FORMAT}"
        fix = "install a newer truebed"
        raise refuse("format", version, allowed, code="D42", message=message, fix=fix, where=where)
    kinds = declared(document.keys())
    if ORIGIN in document:
        try:
            origin = OriginTable.model_validate_json(json.dumps(document[ORIGIN]))
        except (ValidationError, TypeError):
            # among its other faults
            _checked(ScenarioFile(document, {**kinds, ORIGIN: OriginTable}), where)
            raise
        rest = {key: value for key, value in document.items() if key != ORIGIN}
        file = ScenarioFile(rest, kinds)
        keys = {
            table: [key for own in branches.values() for key in own]
            for table, branches in keys_by_table(file).items()
            if table != "trial"  # given as a whole
        }
        if not finished and (faults := [*unknown(origin, keys)]):
            raise one_error(faults, where)
        return _read_back(file, origin, where, finished=finished)
    scenario = _checked(ScenarioFile(document, kinds), where)
    by_program = set(scenario.given.get("truth", ())) == set(TruthSettings.model_fields)
    # people give a few numbers of a preset, and may; who gives all of them has copied them
    fault = copied_fault(scenario, way_out) if by_program and not finished else None
    if fault:
        raise one_error([fault], where)
    return scenario


def _checked(file: ScenarioFile, where: str) -> Scenario:
    """The scenario of what was given, or one error with all its faults."""
    faults, clean = foreign_values(file.document, file.tables)
    told = {fault.path for fault in faults}
    given = dict(clean)
    own = {name: clean.pop(name, {}) for name in file.kinds}
    tables: dict[str, StudyTable] = {}
    for name, kind in file.kinds.items():
        try:
            table = kind.model_validate_json(json.dumps(own[name]))
        except ValidationError as error:
            faults += sentences(error, file, skip=told, table=(name,))
        else:
            tables |= {name: table} if isinstance(table, StudyTable) else {}
    try:
        core = Scenario.model_validate_json(json.dumps(resolved(clean)))
    except ValidationError as error:
        faults += sentences(error, file, skip=told)
        raise one_error(file.in_order(faults), where) from None
    scenario = core.with_tables(tables)
    if len(tables) == len(file.kinds):
        faults += [Fault((), line) for line in contradictions(scenario)]
    if faults:
        raise one_error(file.in_order(faults), where)
    return scenario.with_given(given_in(given, scenario.document()))


def _read_back(file: ScenarioFile, origin: OriginTable, where: str, *, finished: bool) -> Scenario:
    """The scenario of a written file, where only some keys were given and others filled in.

    A number that was filled in and edited since then counts as given.
    """
    values, given = flat(file.document), origin.given_in(file.document)
    try:
        then = filled_scenario(nested(given | origin.deciders(given)), file.kinds)
        filled = filled_in(values, then)
    except (ValidationError, TypeError):
        return _checked(file, where)  # which says what is wrong

    def without(paths: Collection[KeyPath]) -> Scenario:
        # in the order of the file: which reflector comes first counts
        kept = {path: v for path, v in values.items() if path in given or path not in paths}
        empty = {path: table for path, table in given.items() if table == {}}
        return _checked(ScenarioFile(nested(empty | kept), file.kinds), where)

    scenario = without(filled)
    moved = differing(values, filled, scenario)
    fault = None if finished else stale(moved, scenario, then)
    if fault:
        raise one_error([fault], where)
    return without(set(filled) - set(moved)) if moved else scenario


def changed(scenario: Scenario, changes: Mapping[str, Any], *, where: str = "") -> Scenario:
    """The scenario with some keys changed, checked again: ``{"tracker.position_um": 5.0}``.

    As if its author had written them so: another preset or robot decides anew what nobody gave.
    """
    document = scenario.given
    for dotted_key, value in changes.items():
        *tables, key = str(dotted_key).split(".")
        table: Any = document
        for name in tables:
            table = table.setdefault(name, {})
            if not isinstance(table, dict):
                message = f'"{dotted_key}" cannot be changed: {name} is not a table'
                fix = f"give all of {name}"
                raise refuse(dotted_key, value, code="S37", message=message, fix=fix)
        table[key] = deepcopy(value)
    kinds = {name: type(table) for name, table in scenario.tables.items()}
    return scenario_of(document, lambda _: kinds, where=where or scenario.name, way_out=CALLED)


def dump_scenario(scenario: Scenario) -> str:
    """The scenario as TOML text, every default written out; reading it back gives an equal one."""
    return "\n".join([*toml_lines(written(scenario.document())), *origin_lines(scenario)]) + "\n"
