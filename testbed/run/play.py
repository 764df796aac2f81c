"""Plays a scenario into a run folder, and opens a run folder that earlier runs left.

Checks come first, then records, then what derives from them; a record of an earlier run is read,
never computed.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calib.errors import InputError, refuse
from testbed.engines.engine import Engine
from testbed.gates.paths import is_there
from testbed.progress import Progress
from testbed.run.derive import Derive, derived_file, led_by, require_trial
from testbed.run.result import read_result
from testbed.run.steps import steps_of
from testbed.run.work import Work
from testbed.scenario.checks import check_robot
from testbed.scenario.hashes import growing_hash, scenario_hash
from testbed.scenario.read import dump_scenario
from testbed.scenario.scenario import Scenario
from testbed.store import layout
from testbed.store.manifest import (
    GROWING,
    PROCESSORS,
    manifest_bytes,
    read_manifest,
    require_campaign,
)
from testbed.store.run_folder import RunFolder
from testbed.studies import all_studies, load_scenario
from testbed.studies.protocol import Records, Study
from testbed.versions import own_version

if TYPE_CHECKING:
    from testbed.robots.robot import Robot
    from testbed.studies.trial.records import Campaign


@dataclass(frozen=True, slots=True, eq=False)
class RunOutcome:
    """What playing a scenario gave."""

    scenario: Scenario
    records: Records
    folder: Path | None
    """The run folder; None if the campaign was played in memory."""
    kept: tuple[str, ...]
    """Records taken over from an earlier run."""

    @property
    def failed(self) -> Mapping[str, str]:
        """Records that failed, and why."""
        return self.records.failed

    @property
    def campaign(self) -> "Campaign":
        """The records as a campaign."""
        from testbed.studies.trial.records import campaign_of

        return campaign_of(self.scenario, self.records)


def play_run(
    scenario: Scenario,
    out: str | Path | None = None,
    *,
    resume: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
    order: Iterable[str] | None = None,
    where: str = "scenario",
    studies: Sequence[Study] | None = None,
    derive: Derive | None = None,
    engine: Engine | None = None,
) -> RunOutcome:
    """Play a scenario, with failures and kept records.

    Parameters
    ----------
    scenario : Scenario
        As `testbed.studies.load_scenario` gives it.
    out : path, optional
        Run folder to write; without it nothing is written.
    resume : bool
        Go on with the unfinished run in `out`.
    overwrite : bool
        Rename an old run in `out` first.
    progress : callable, optional
        Called with what begins, steps done, steps in all.
    order : iterable of str, optional
        Keys in the order in which records are made; the numbers do not depend on it.
    where : str
        What messages call the scenario.
    studies, derive : optional
        Stand in for the registered studies and for the usual derived files.
    engine : Engine, optional
        Who plays the pieces of studies; this process by default. No number depends on it.

    Raises
    ------
    InputError
        The scenario or `out` cannot be used; nothing is left behind.
    MachineError
        The disk is full or the folder is in use; what is finished is kept.
    """
    robot = robot_of(scenario, where)
    played = all_studies(scenario) if studies is None else studies
    work = Work(scenario, robot, played, derive or derived_file, engine=engine, progress=progress)
    if out is None:
        try:
            records: Records = work.make(order)
        except InputError as error:
            raise error.located(where) from error
        return RunOutcome(scenario, records, None, ())
    path = Path(out)
    opened = (
        RunFolder.resume(path, scenario_hash(scenario, robot), growing_hash(scenario, robot))
        if resume
        else RunFolder.create(path, overwrite=overwrite)
    )
    with opened as work.folder:
        try:
            opened.begin(dump_scenario(scenario), about(scenario, robot))
            work.event("begin", scenario=scenario.name, seed=scenario.seed, resume=resume)
            work.make(order)
        except InputError as error:
            opened.discard()
            raise error.located(where) from error
        records = work.derive(layout.DERIVED)
        if found := work.processors(opened):
            said = about(scenario, robot) | {PROCESSORS: found}
            opened.write(layout.MANIFEST, manifest_bytes(said))
        opened.end()
        work.event("end", failed=sorted(work.failed))
    return RunOutcome(scenario, records, path, tuple(work.kept))


def planned_steps(scenario: Scenario) -> dict[str, int]:
    """What progress will tell of a run into a folder: steps with their pieces."""
    records = (record for study in all_studies(scenario) for record in study.records(scenario))
    return steps_of(records) | dict.fromkeys(layout.DERIVED, 1)


def about(scenario: Scenario, robot: "Robot") -> dict[str, Any]:
    """What a run's manifest says."""
    return {
        "name": scenario.name,
        "seed": scenario.seed,
        "robot": robot.name,
        "scenario_sha256": scenario_hash(scenario, robot),
        GROWING: growing_hash(scenario, robot),
    }


def robot_of(scenario: Scenario, where: str) -> "Robot":
    """The scenario's robot, with the scenario checked against it; errors name the scenario."""
    from testbed.robots.catalog import load_robot

    try:
        robot = load_robot(scenario.robot)
    except InputError as error:
        raise error.located(where) from error
    check_robot(scenario, robot, where=where)
    return robot


def record_trial(path: str | Path, trial: str) -> Path:
    """Write the recording of one trial of a run from its records; the file's path.

    Raises
    ------
    InputError
        C41: there is no such trial, or it failed; else as `load_run`.
    """
    led_by(load_run(path), trial)  # refused before anything is written
    name = recording_name(trial)
    return rederive(path, (name,)) / name


def load_run(path: str | Path, *, studies: Sequence[Study] | None = None) -> "Campaign":
    """The campaign in a run folder; nothing is computed.

    Raises
    ------
    InputError
        It is not a run folder, its scenario was changed, or a record is missing, damaged or of
        another version.
    """
    from testbed.studies.trial.records import campaign_of

    work = _open(Path(path), studies)
    return campaign_of(work.scenario, work.make())


def rederive(
    path: str | Path,
    names: Iterable[str] = layout.DERIVED,
    *,
    studies: Sequence[Study] | None = None,
    derive: Derive | None = None,
) -> Path:
    """Write derived files of a run again from its records; the run folder's path."""
    folder = Path(path)
    work = _open(folder, studies, derive)
    with RunFolder.reopen(folder) as work.folder:
        work.derive(names)
    return folder


def recording_of(path: str | Path, trial: str | None = None) -> Path:
    """The recording of a run folder, of its first trial or the one named; or the .rrd given.

    Raises
    ------
    InputError
        There is no such recording or trial, or the trial failed.
    """
    given = Path(path)
    if given.suffix == layout.RECORDING_ENDING and not is_there(given, Path.is_dir):
        if trial is None:
            return given
        raise refuse(
            "--trial", trial, code="C41",
            message=f"--trial is {trial}, and {given} is one recording, which has its trial",
            fix="give the run folder, or leave --trial out",
        )  # fmt: skip
    manifest = read_manifest(given)
    if trial is not None:
        require_campaign(given, manifest)
        result = read_result(given)
        require_trial(trial, list(result["trials"]), result.get("failed", {}))
        if trial == next(iter(result["trials"])) and not (given / recording_name(trial)).is_file():
            trial = None  # the recording of the run shows it
    file = given / recording_name(trial)
    if not file.is_file():
        message = f"has no {file.name}"
        fix = f"write it by `truebed record {path}{f' --trial {trial}' if trial else ''}`"
        if is_there(given / layout.UNFINISHED):
            message = "the run is not finished"
            fix = "give the `truebed run` command again with --resume"
        raise InputError(message, code="D42", where=str(path), fix=fix)
    return file


def recording_name(trial: str | None) -> str:
    """File name of the recording of a trial; of the first one without a name."""
    return layout.RECORDING if trial is None else trial.join(layout.OF_TRIAL)


def _open(path: Path, studies: Sequence[Study] | None, derive: Derive | None = None) -> Work:
    """The records of a run folder, none of which will be computed."""
    scenario, robot = scenario_in(path)
    played = all_studies(scenario) if studies is None else studies
    folder = RunFolder(path)
    return Work(scenario, robot, played, derive or derived_file, folder=folder, only_stored=True)


def scenario_in(path: Path) -> "tuple[Scenario, Robot]":
    """The scenario and robot of a run folder, which are those that it was begun with."""
    manifest = read_manifest(path)
    require_campaign(path, manifest)
    file = path / layout.SCENARIO
    scenario, where = load_scenario(file, finished=True), str(file)
    robot = robot_of(scenario, where)
    if scenario_hash(scenario, robot) != manifest["scenario_sha256"]:
        theirs, ours = manifest["versions"].get("truebed"), own_version()
        other = "" if theirs == ours else f", or truebed {theirs} read it otherwise than {ours}"
        raise InputError(
            f"was changed since the run, or the robot's files were{other}",
            code="D42",
            where=where,
            fix="undo the change, or run it again with another --out",
        )
    return scenario, robot
