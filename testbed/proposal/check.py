"""What a file is, and whether it can be used: it is read completely, and nothing else computed."""

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from calib.errors import InputError, refuse
from testbed.assets import scene_names
from testbed.files.columns import is_known
from testbed.files.read import read_session
from testbed.files.session_toml import SESSION_FILE
from testbed.files.visits.probing import probed, tried_words
from testbed.files.visits.tables import CampaignFile
from testbed.gates.kinds import OF_SCENARIOS, OF_SESSIONS, PROGRAMS, kind_of, kind_of_name
from testbed.gates.mistakes import validated
from testbed.gates.paths import is_there, near, real
from testbed.gates.toml import read_toml, read_toml_bytes, toml_document
from testbed.iso9283.read import read_test
from testbed.iso9283.words import extent
from testbed.proposal.cycles import cycles_in
from testbed.proposal.data import look_at
from testbed.proposal.missing import with_rows
from testbed.proposal.own_outputs import WROTE, what_we_wrote
from testbed.robots.catalog import ROBOT_FILE, TRACKER_FILE, load_robot, robot_names
from testbed.robots.file import TrackerFile
from testbed.robots.robot import Robot
from testbed.store.foreign import foreign
from testbed.units import counted

SCENARIO_FILE = "scenario.toml"


def checked(file: Path, robot: str | None, tip: str | None = None) -> list[str]:
    """Sentences on a file: what it is, and what is odd about it.

    Parameters
    ----------
    file : path
        A session.toml, a scenario, a robot.toml, URDF or MJCF, a tracker.toml or a table.
    robot : str or None
        For sessions and tables: the robot whose joints these are.
    tip : str, optional
        Last link of the robot, if its file has several ends.

    Raises
    ------
    InputError
        The file cannot be used; the error is that of the command that needs it.
    """
    at = real(file, field="FILE", code="S37")
    if is_there(at, Path.is_dir):
        known = (SESSION_FILE, SCENARIO_FILE, ROBOT_FILE)
        inside = [name for name in known if is_there(file / name, Path.is_file)]
        if not inside:
            allowed, (told, fix) = f"a folder with one of {', '.join(known)}", foreign(file)
            message = f"{file} contains nothing to check: {told}"
            raise refuse("FILE", str(file), allowed, code="S37", message=message, fix=fix)
        file = file / inside[0]
    if not is_there(file, Path.is_file):
        message = "is not an ordinary file" if at.exists() else "does not exist"
        fix = "check the path" if at.exists() else _named(file)
        raise refuse("FILE", str(file), code="S37", message=message, fix=fix, where=str(file))
    if kind_of_name(file) == "description":
        return _robot(load_robot(file, tip=tip), "a robot description", str(file))
    if file.suffix.lower() == ".toml":
        return _toml(file, robot, tip)
    if ours := what_we_wrote(file):
        return [f"{ours} {WROTE}"]
    arm = None if robot is None else load_robot(robot, tip=tip, allow_missing_meshes=True)
    return _table(file, arm)


def _named(file: Path) -> str:
    """Advice for a missing file; shipped robots and scenes are shown by other commands."""
    for verb, names in (("robots", robot_names()), ("scenes", scene_names())):
        if str(file) in names:
            return f"`truebed {verb} {file}` shows what ships under that name"
    return near(file)


def _toml(file: Path, robot: str | None, tip: str | None) -> list[str]:
    """Sentences on a TOML file of truebed, by its contents."""
    where = str(file)
    document = toml_document(read_toml_bytes(file, where), where)
    kind, keys = kind_of(document), set(document)
    if kind == "robot" or file.name == ROBOT_FILE:
        return _robot(load_robot(file), "a robot", where)
    if kind == "tracker" or file.name == TRACKER_FILE:
        return [f"a drawn instrument, {read_toml(file, TrackerFile, 'tracker').name}"]
    if kind == "scenario" or len(keys & OF_SCENARIOS) > len(keys & OF_SESSIONS):
        return _scenario(file)
    return _session(file, document, robot, tip)


def _robot(robot: Robot, what: str, where: str) -> list[str]:
    """Sentences on a robot."""
    chain = robot.model.chain
    reach = float(abs(chain.links[:, 1:3]).sum())
    drawn = robot.joint_names or chain.prismatic.all() or chain.T_flange_tool[:3, 3].any()
    if not reach and not drawn:
        message, fix = f"{robot.name} has no lengths: all d and a are 0", "write the link numbers"
        raise refuse("joints", 0.0, code="S37", message=message, fix=fix, where=where)
    said = f"{what}, {robot.name}: {counted(chain.n_joints, 'joint')}"
    said = f"{said}, link lengths of {reach * 1e3:.0f} mm in total"
    counted_so = filter(None, [robot.controller.sentence])
    return [said, *counted_so, *(f"note: {n}" for n in robot.notes)]


def _scenario(file: Path) -> list[str]:
    """Sentences on a scenario."""
    from testbed.laboratory.sufficiency import check_trials
    from testbed.scenario.checks import check_robot, odd_settings
    from testbed.studies import load_scenario

    scenario = load_scenario(file)
    try:
        arm = load_robot(scenario.robot)
    except InputError as error:
        raise error.located(str(file)) from error
    check_robot(scenario, arm, where=str(file))
    try:
        check_trials(scenario)
    except InputError as error:
        raise error.located(str(file)) from error
    trials = ", ".join(trial.name for trial in scenario.trial) or "none"
    odd = [f"warning: {text}" for text in odd_settings(scenario)]
    return [f"a scenario, {scenario.name}, for {arm.name}; trials: {trials}", *odd]


def _session(file: Path, document: dict[str, Any], robot: str | None, tip: str | None) -> list[str]:
    """Sentences on a session, and on its files if the robot is known."""
    settings = validated(document, CampaignFile, str(file))
    tables = [table.name for table in settings.observed]
    repeated = {"cycles": settings.cycles, "paths": settings.paths}
    tables += [name for name, table in repeated.items() if table is not None]
    said = f"a session of {' and '.join(tables) or 'no readings yet'}"
    if settings.session:
        names = [one.name + " (held out)" * one.held_out for one in settings.session]
        said = f"{counted(len(names), 'session')} of one robot: {', '.join(names)}"
    if any(repeated.values()):
        test = read_test(file)
        told = [*test.notes, *(f"warning: {text}" for text in test.warnings)]
        told = [f"for truebed iso9283: {extent(test)}", *told]
        if not settings.observed:
            return [said, *told]
        said = "; ".join([said, *told])
    named = robot or (settings.robot if settings.robot in robot_names() else None)
    if named is None:
        return [said, "its files were not read: name the robot with --robot"]
    arm = load_robot(named, tip=tip, allow_missing_meshes=True)  # nothing is drawn here
    return [said, *_read(file, arm)]


def _read(file: Path, arm: Robot) -> list[str]:
    """Sentences on measurements that were read completely."""
    session = read_session(file, arm)
    probes = probed(arm, session)
    table = session.measurements
    rows = f"{counted(len(table), 'row')} of {counted(table.n_poses, 'pose')}"
    if session.split_stated:
        rows += f", {counted(int(session.is_test.sum()), 'row')} held out"
    return [
        f"{rows}; {session.joint_source} joints; uncertainties from {session.uncertainty}",
        *session.notes,
        *session.masked,
        *(f"warning: {text}" for text in session.warnings),
        *(f"warning: {text}" for found in probes for text in found.warnings),
        *tried_words(session, probes),
    ]


def _table(file: Path, arm: Robot | None) -> list[str]:
    """Sentences on a table or an export."""
    said, ours = list[str](), True
    looks = with_rows(look_at([file], file.parent))
    for one in looks:
        ours = ours and one.kind == "table" and all(map(is_known, one.head))
        kind = {
            "table": "a table", "bare": "a table whose columns have no names",
            "points": "an export of points", "frames": "an export of frames",
            "program": PROGRAMS[one.language][0] if one.language else "",
        }[one.kind]  # fmt: skip
        place = f" in sheet {one.sheet}" if one.sheet else ""
        said.append(f"{kind}{place}, {counted(one.rows, 'row')}")
        said += _columns(one.head, {m.theirs: m.plain for m in one.meanings}, one.kind)
    cycles = cycles_in(looks, file.parent)
    if cycles is not None:
        said.append(cycles.sentence)
        if cycles.document is not None:
            verb = "iso9283" if ours else "new session"
            return [*said, f"type truebed {verb} {shlex.quote(str(file))}"]
    if arm is None:
        return [*said, "units and conventions were not tried: name the robot with --robot"]
    given = shlex.quote(str(file))
    asked = f"identify needs a session.toml: truebed new session {given} --robot ROBOT"
    if any(one.kind != "table" for one in looks):  # nothing but a session says what is in these
        return [*said, asked]
    try:
        return [*said, *_read(file, arm)]
    except InputError as error:
        of_a_line = error.where.rpartition(":")[2].isdigit()
        if of_a_line or error.code not in ("M24", "M33", "M35"):
            raise
        if ours and error.code == "M35":
            raise
        return [*said, asked]  # not in the layout of truebed


def _columns(head: Sequence[str], known: dict[str, str], kind: str) -> list[str]:
    """The meaning assumed for each column."""
    if kind in ("bare", "points", "frames"):
        return []
    own = [name for name in head if is_known(name)]
    told = [f"{name} as {known[name]}" for name in head if name in known and name not in own]
    if own:
        told.append(f"{len(own)} with the names that truebed uses")
    left = [name for name in head if name not in known]
    said = [f"columns: {', '.join(told)}"] if told else []
    return said + ([f"unknown: {', '.join(left)}"] if left else [])
