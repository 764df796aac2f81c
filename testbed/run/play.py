"""Plays a scenario into a run folder: checks first, then records, then what derives from them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calib.errors import InputError
from testbed.progress import Progress as Progress
from testbed.run.derive import Derive, derived_file
from testbed.run.work import Work
from testbed.scenario.checks import check_robot
from testbed.scenario.read import dump_scenario
from testbed.scenario.scenario import Scenario, scenario_hash
from testbed.store import layout
from testbed.store.run_folder import RunFolder
from testbed.studies import all_studies
from testbed.studies.protocol import Records, Study

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


def play(
    scenario: Scenario,
    out: str | Path | None = None,
    *,
    resume: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
    order: Iterable[str] | None = None,
) -> "Campaign":
    """Play a scenario and return the campaign.

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

    Raises
    ------
    InputError
        The scenario or `out` cannot be used; nothing is left behind.
    MachineError
        The disk is full or the folder is in use; what is finished is kept.
    """
    return play_run(
        scenario, out, resume=resume, overwrite=overwrite, progress=progress, order=order
    ).campaign


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
) -> RunOutcome:
    """`play` with failures and kept records; `where` names the scenario in messages.

    `studies` and `derive` stand in for the registered studies and for the usual derived files.
    """
    robot = robot_of(scenario, where)
    played = all_studies(scenario) if studies is None else studies
    work = Work(scenario, robot, played, derive or derived_file, progress=progress)
    if out is None:
        try:
            records: Records = work.make(order)
        except InputError as error:
            raise error.located(where) from error
        return RunOutcome(scenario, records, None, ())
    path = Path(out)
    opened = (
        RunFolder.resume(path, scenario_hash(scenario, robot))
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
        opened.end()
        work.event("end", failed=sorted(work.failed))
    return RunOutcome(scenario, records, path, tuple(work.kept))


def about(scenario: Scenario, robot: "Robot") -> dict[str, Any]:
    """What a run's manifest says."""
    return {
        "name": scenario.name,
        "seed": scenario.seed,
        "robot": robot.name,
        "scenario_sha256": scenario_hash(scenario, robot),
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
