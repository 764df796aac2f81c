"""What earlier runs left: read a run folder's campaign, or make its derived files again."""

from collections.abc import Iterable, Sequence
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calib.errors import InputError
from testbed.run.derive import Derive, derived_file
from testbed.run.play import robot_of
from testbed.run.work import Work
from testbed.scenario.scenario import Scenario, scenario_hash
from testbed.store import layout
from testbed.store.manifest import read_manifest, require_campaign
from testbed.store.npz import strict_json
from testbed.store.run_folder import RunFolder
from testbed.studies import all_studies, load_scenario
from testbed.studies.protocol import Study

if TYPE_CHECKING:
    from testbed.studies.trial.records import Campaign


def load_run(path: str | Path, *, studies: Sequence[Study] | None = None) -> "Campaign":
    """The campaign in a run folder; nothing is computed.

    Raises
    ------
    InputError
        It is not a run folder, its scenario was changed, or a record is missing or damaged.
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


def read_result(path: str | Path) -> dict[str, Any]:
    """result.json of a run folder."""
    file = Path(path) / layout.RESULT
    require_campaign(Path(path), read_manifest(Path(path)))
    try:
        return checked_result(strict_json(file.read_bytes()))
    except OSError as error:
        raise InputError(
            f"has no {layout.RESULT}: the run is not finished",
            code="D42",
            where=str(path),
            fix="give the `truebed run` command again with --resume",
        ) from error
    except ValueError as error:
        raise InputError(
            f"is damaged: {error}",
            code="D42",
            where=str(file),
            fix=f"write it again by `truebed report {path}`",
        ) from error


def checked_result(document: dict[str, Any]) -> dict[str, Any]:
    """result.json, after making sure that it is one."""
    missing = [
        key for key in ("notice", "scenario", "seed", "trials", "verdict") if key not in document
    ]
    if missing:
        raise ValueError(f"it has no {', '.join(missing)}")
    return document


def equal_runs(paths: Sequence[Path]) -> list[list[Path]]:
    """Groups of runs whose result.json and arrays.npz are equal byte for byte."""
    groups: dict[bytes, list[Path]] = {}
    for path in paths:
        total = sha256()
        for name in (layout.RESULT, layout.ARRAYS):
            file = path / name
            total.update(sha256(file.read_bytes() if file.is_file() else b"").digest())
        groups.setdefault(total.digest(), []).append(path)
    return [group for group in groups.values() if len(group) > 1]


def recording_of(path: str | Path) -> Path:
    """The recording of a run folder, or the recording itself if a .rrd is given."""
    given = Path(path)
    if given.suffix == ".rrd" and given.is_file():
        return given
    read_manifest(given)
    file = given / layout.RECORDING
    if not file.is_file():
        raise InputError(
            f"has no {layout.RECORDING}",
            code="D42",
            where=str(path),
            fix=f"write it by `truebed record {path}`",
        )
    return file


def _open(path: Path, studies: Sequence[Study] | None, derive: Derive | None = None) -> Work:
    """The records of a run folder, none of which will be computed."""
    manifest = read_manifest(path)
    require_campaign(path, manifest)
    scenario, where = _scenario(path)
    robot = robot_of(scenario, where)
    if scenario_hash(scenario, robot) != manifest["scenario_sha256"]:
        raise InputError(
            "was changed since the run, or the robot's files were",
            code="D42",
            where=where,
            fix="undo the change, or run it again with another --out",
        )
    played = all_studies(scenario) if studies is None else studies
    folder = RunFolder(path)
    return Work(scenario, robot, played, derive or derived_file, folder=folder, only_stored=True)


def _scenario(path: Path) -> tuple[Scenario, str]:
    """The scenario stored in a run folder, and how messages call it."""
    file = path / layout.SCENARIO
    return load_scenario(file), str(file)
