"""What a folder is that a verb was given, and what to do with one that the verb cannot use."""

import shlex
from collections.abc import Collection, Sequence
from itertools import islice
from pathlib import Path

from calib.errors import InputError, refuse
from testbed.gates.paths import is_there, real
from testbed.names import name_meant, some
from testbed.store import layout
from testbed.store.foreign import foreign
from testbed.store.manifest import CALIBRATION, CAMPAIGN, kind_of, read_manifest

PLAN, ISO9283, SESSION, ROBOT, SEVERAL = "plan", "iso9283", "session", "robot", "several"
MARKS = {layout.PLAN: PLAN, layout.ISO9283: ISO9283, "robot.toml": ROBOT, "session.toml": SESSION}
"""Files that tell what a folder is, beside the manifest of a run."""
PRINTED = {PLAN: "plan_report.html", ISO9283: layout.REPORT}
"""Reports that are printed as they were written."""
AGAIN = (CAMPAIGN, CALIBRATION)
"""What has records, from which its report and recording are made again."""
MOST = 1000
"""Entries of a folder that are looked at."""
WRITTEN = "its report and recording were written with it and are not made again"


def kind(path: Path) -> str:
    """What a folder is: a kind of run, one of `MARKS`, or several of these; else nothing.

    Raises
    ------
    InputError
        There is no such folder, or its manifest is damaged or of a newer version.
    """
    real(path, field="RUN", code="D42")
    if not is_there(path, Path.is_dir):
        raise _missing(path)
    for mark in (layout.PLAN, layout.ISO9283):
        if is_there(path / mark, Path.is_file):
            return MARKS[mark]
    if is_there(path / layout.MANIFEST):
        return kind_of(read_manifest(path))
    for mark, found in MARKS.items():
        if is_there(path / mark, Path.is_file):
            return found
    return SEVERAL if inside(path) else ""


def inside(path: Path) -> list[Path]:
    """Folders in a folder that hold runs, plans or tests."""
    marks = (layout.PLAN, layout.ISO9283, layout.MANIFEST)
    return sorted(
        one
        for one in islice(path.iterdir(), MOST)
        if not one.name.startswith(".") and any(is_there(one / mark) for mark in marks)
    )


def unusable(path: Path, found: str) -> InputError:
    """The error for a folder that a verb cannot use: what it is, and what to do with it."""
    quoted = shlex.quote(str(path))
    match found:
        case "plan":
            told, allowed = f"is {layout.OWNERS[layout.PLAN]}", WRITTEN
            fix = f"open {path / PRINTED[found]}, or type truebed view {quoted}"
        case "iso9283":
            told = f"is {layout.OWNERS[layout.ISO9283]}"
            allowed = "its report was written with it and is not made again"
            fix = f"open {path / PRINTED[found]}, or type truebed view {quoted}"
        case "session":
            told, allowed = "holds measurements to identify a robot from", ""
            fix = f"truebed identify ROBOT {quoted}"
        case "robot":
            told, allowed = "is the folder of a robot", ""
            fix = f"truebed robots {shlex.quote(str(path / 'robot.toml'))}"
        case "several":
            names = [str(one) for one in inside(path)]
            told, allowed = f"holds {len(names)} folders of truebed", ""
            fix = f"give one of them: {some(names, 6)}"
        case _:
            what, fix = foreign(path)
            told, allowed = f"is not a run folder: {what}", ""
    return refuse("", None, allowed, code="D42", message=told, fix=fix, where=str(path))


def require(path: Path, kinds: Collection[str]) -> str:
    """What a folder is, one of the kinds that a verb can use; else an error that helps."""
    found = kind(path)
    if found not in kinds:
        raise unusable(path, found)
    return found


def report_in(path: Path, found: str) -> Path:
    """The report of a plan or a test, as it was written with it.

    Raises
    ------
    InputError
        D42: it is not there any more.
    """
    page = path / PRINTED[found]
    if not is_there(page, Path.is_file):
        fix = "plan or test again with another --out"
        raise refuse("", None, code="D42", message="is not there", fix=fix, where=str(page))
    return page


def recording_in(path: Path, trial: str | None) -> Path:
    """The recording of a folder, of the trial named if there is one; or the .rrd given.

    Raises
    ------
    InputError
        There is none; what the folder is, and what to do with it, is said.
    """
    from testbed.run.play import recording_of

    if path.suffix == layout.RECORDING_ENDING and not is_there(path, Path.is_dir):
        return recording_of(path, trial)
    found = require(path, (*AGAIN, PLAN, ISO9283))
    if found in AGAIN:
        return recording_of(path, trial)
    refuse_trial(path, trial, found)
    return path / (layout.PLAYED_PLAN if found == PLAN else layout.PLAYED_TEST)


def refuse_trial(path: Path, trial: str | None, found: str) -> None:
    """Refuse the name of a trial where there are none; C41."""
    if trial is not None:
        owner = layout.OWNERS[layout.PLAN if found == PLAN else layout.ISO9283]
        message = f"--trial is {trial}, and {path} is {owner}, which has no trials"
        raise refuse("--trial", trial, code="C41", message=message, fix="leave --trial out")


def by_kind(paths: Sequence[Path]) -> dict[str, list[Path]]:
    """Folders that can stand in tables, by what they are; a folder of folders stands for these.

    Raises
    ------
    InputError
        One of them has nothing to be compared.
    """
    kinds: dict[str, list[Path]] = {}
    for path in paths:
        found = require(path, (*AGAIN, PLAN, ISO9283, SEVERAL))
        for one in inside(path) if found == SEVERAL else [path]:
            kinds.setdefault(kind(one), []).append(one)
    return kinds


def _missing(path: Path) -> InputError:
    """The error for a folder that is not there, or is a file."""
    where = str(path)
    if is_there(path):
        folder = path.parent
        ours = kind(folder) in (*AGAIN, PLAN, ISO9283)
        fix = (
            f"give the folder it lies in: {folder}" if ours else "give a folder that truebed wrote"
        )
        return refuse(
            "", None, "folders are wanted", code="D42", message="is a file", fix=fix, where=where
        )
    known: dict[str, Path] = {}
    for folder in (Path("runs"), path.parent):
        if is_there(folder, Path.is_dir):
            entries = islice(folder.iterdir(), MOST)
            known |= {one.name: one for one in entries if is_there(one, Path.is_dir)}
    fix = name_meant(path.name, known) or "check the path; truebed run SCENE writes one"
    for name, folder in known.items():
        fix = fix.replace(f'"{name}"', f'"{folder}"')
    return refuse("", None, code="D42", message="does not exist", fix=fix, where=where)
