"""A run shared by many processes without a leader: slices of its pieces, and folders merged."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from calib.errors import InputError, refuse
from testbed.disk import read_bounded
from testbed.engines.engine import Engine
from testbed.progress import Progress
from testbed.run.cut import all_pieces, cut_names, sliced_cuts
from testbed.run.derive import Derive, derived_file
from testbed.run.play import RunOutcome, about, play_run, robot_of, scenario_in
from testbed.run.work import Work
from testbed.scenario.hashes import growing_hash, scenario_hash
from testbed.scenario.read import dump_scenario
from testbed.scenario.scenario import Scenario
from testbed.store import layout
from testbed.store.manifest import check_same_run, check_same_runs
from testbed.store.npz import FAILED, MOST_BYTES, DamagedError, from_bytes
from testbed.store.pieces import NOBODY
from testbed.store.run_folder import RunFolder
from testbed.studies import all_studies
from testbed.studies.protocol import Study


@dataclass(frozen=True, slots=True)
class SliceOutcome:
    """What playing a slice gave."""

    pieces: int
    """In the slice; those that were there already are among them."""
    failed: Mapping[str, str]
    """Parts of pieces that failed, and why."""


def play_slice(
    scenario: Scenario,
    out: str | Path,
    number: int,
    count: int,
    *,
    progress: Progress | None = None,
    where: str = "scenario",
    studies: Sequence[Study] | None = None,
    engine: Engine | None = None,
) -> SliceOutcome:
    """Play every `count`-th piece of the studies, from `number` (1 is the first), into a folder.

    Slices may share the folder and be played at the same time; what all pieces need each of them
    makes, the same bytes. A folder with fewer or more robots keeps its full pieces.
    ``truebed run --resume`` or `merge_runs` make a run of them.

    Raises
    ------
    InputError
        The scenario or `out` cannot be used, or nothing in it is played in pieces.
    """
    robot = robot_of(scenario, where)
    played = all_studies(scenario) if studies is None else studies
    work = Work(scenario, robot, played, derived_file, engine=engine, progress=progress)
    if not sliced_cuts(work.planned):
        raise refuse(
            "--slice", f"{number}/{count}", "studies of many robots are played in slices",
            code="C41", where=where, fix="leave --slice out",
            message="--slice is given, and no study of many robots is on",
        )  # fmt: skip
    hashes = scenario_hash(scenario, robot), growing_hash(scenario, robot)
    with RunFolder.share(Path(out), *hashes) as work.folder:
        try:
            if not work.folder.begun:
                work.folder.begin(dump_scenario(scenario), about(scenario, robot))
            return SliceOutcome(*work.play_slice(number, count))
        except InputError as error:
            work.folder.discard()
            raise error.located(where) from error


def merge_runs(
    folders: Sequence[str | Path],
    out: str | Path,
    *,
    overwrite: bool = False,
    progress: Progress | None = None,
    studies: Sequence[Study] | None = None,
    derive: Derive | None = None,
    engine: Engine | None = None,
) -> RunOutcome:
    """One run from the folders of its slices: what is missing is played, the rest kept.

    Raises
    ------
    InputError
        The folders are not of one run, or disagree on what both hold, or `out` is one of them;
        nothing is written.
    """
    if len(folders) < 2:
        raise refuse(
            "merge", [str(folder) for folder in folders], "it needs two or more", code="C41",
            message="merge was given one folder",
            fix="to continue that run, type: truebed run FOLDER --out FOLDER --resume",
        )  # fmt: skip
    first, *others = (Path(folder) for folder in folders)
    real = [_real(folder) for folder in (first, *others)]
    if twice := [one for k, one in enumerate((first, *others)) if real[k] in real[:k]]:
        fix = "give each folder once"
        raise refuse("merge", code="C41", message="is given twice", fix=fix, where=str(twice[0]))
    if _real(out) in real:
        message, fix = "is one of the folders that are merged", "choose another --out"
        raise refuse("--out", code="C40", message=message, fix=fix, where=str(out))
    scenario, robot = scenario_in(first)
    check_same_run(first, scenario_hash(scenario, robot))
    for other in others:
        check_same_runs(first, other)
    played = all_studies(scenario) if studies is None else studies
    planned = Work(scenario, robot, played, derived_file).planned
    specs = {
        piece.name: piece.spec
        for name in cut_names(planned)
        for piece in all_pieces(planned, name, robot)
    }
    files: dict[str, _Found] = {}
    for folder in (first, *others):
        for one in _whole_files(folder, specs):
            kept = files.setdefault(one.name, one)
            _agree(kept, one)
            # of two kinds of processors the same one, in whatever order the folders are named
            files[one.name] = min(kept, one, key=lambda found: (found.processor, found.digest))
    with RunFolder.create(Path(out), overwrite=overwrite) as opened:
        opened.begin(dump_scenario(scenario), about(scenario, robot))
        for name, one in files.items():
            opened.add(name, one.path.read_bytes())
    return play_run(
        scenario, out, resume=True, progress=progress, where=str(first / layout.SCENARIO),
        studies=studies, derive=derive, engine=engine,
    )  # fmt: skip


def _real(path: str | Path) -> str:
    """A folder by a name that no other way to it has."""
    return os.path.normcase(os.path.realpath(path))


@dataclass(frozen=True, slots=True)
class _Found:
    """A whole file of a record or piece in a folder to be merged."""

    folder: Path
    name: str
    path: Path
    digest: str
    processor: str


def _whole_files(folder: Path, specs: Mapping[str, str]) -> list[_Found]:
    """Records and pieces of a folder that are whole and of this scenario.

    Raises
    ------
    InputError
        It has pieces, and none of them is of this scenario.
    """
    found, strange = [], 0
    for room in (layout.TRIALS, layout.PARTS):
        for path in sorted((folder / room).glob("*.npz")):
            try:
                data = read_bounded(path, MOST_BYTES)
                meta, _ = from_bytes(data)
            except (OSError, DamagedError):
                continue  # played again
            if room == layout.PARTS and meta.get("spec_sha256") != specs.get(path.stem):
                strange += 1
                continue
            name, processor = f"{room}/{path.name}", str(meta.get("processor", ""))
            if processor == NOBODY or meta.get("status") == FAILED:
                continue  # tried again
            found.append(_Found(folder, name, path, sha256(data).hexdigest(), processor))
    if strange and not any(one.processor for one in found):
        raise refuse(
            "merge", str(folder), code="D42", where=str(folder),
            message=f"its {strange} pieces under {layout.PARTS}/ are of another scenario",
            fix="leave it out, or play its slice again",
        )  # fmt: skip
    return found


def _agree(one: _Found, other: _Found) -> None:
    """Refuse two files of one name that are not the same, but for pieces of two processors.

    Bits are promised for one kind of processor only, and what pieces are played from must be one.
    """
    if one.digest == other.digest or one.processor != other.processor:
        return
    raise refuse(
        "merge", one.name, code="D42", where=str(other.folder),
        message=f"its {one.name} is another one than that of {one.folder}",
        fix="play all slices on one kind of processor, or remove the folder that is wrong",
    )  # fmt: skip
