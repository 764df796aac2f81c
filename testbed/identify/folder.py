"""The folder of a calibration: everything computed first, then written whole or not at all."""

from collections.abc import Iterable
from hashlib import sha256
from pathlib import Path
from typing import Any

from testbed.disk import atomic_write
from testbed.files.programs.read import read_program
from testbed.files.session import Session
from testbed.gates.paths import real
from testbed.identify.calibrate import STEPS, Options, calibrate
from testbed.identify.calibration import Calibration
from testbed.identify.handback.deliver import deliver
from testbed.identify.handback.delivered import ROBOT, Delivered
from testbed.identify.report.page import sheet_rows
from testbed.identify.results import arrays, headline, split_csv
from testbed.jobsheet.report import JOB_SHEET, job_csv
from testbed.progress import Progress
from testbed.report.page import render
from testbed.robots.catalog import ROBOT_FILE, Robot, load_robot
from testbed.robots.write.urdf import require_package
from testbed.store import layout, npz
from testbed.store.manifest import CALIBRATION, manifest_bytes, read_manifest
from testbed.store.npz import canonical, record_bytes
from testbed.store.run_folder import AGAIN, RunFolder
from testbed.store.whole_folder import check_free, whole_folder
from testbed.versions import all_versions, own_version

RECORDS: dict[str, type] = {"calibration": Calibration, "delivered": Delivered}
SPLIT_TABLE = "split.csv"


def play_calibration(
    robot: Robot,
    session: Session,
    out: Path,
    options: Options | None = None,
    *,
    program: Path | None = None,
    package: str | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> tuple[Calibration, Delivered]:
    """Calibrate and write the folder; the folder is checked first, and written last.

    Parameters
    ----------
    robot : Robot
        Nominal.
    session : Session
        Measurements.
    out : Path
        Folder to write; it must not be there, unless `overwrite` renames an older one.
    options : Options, optional
        What a user may decide.
    program : Path, optional
        CSV of targets to correct.
    package : str, optional
        ROS package whose root the robot's folder will be; without it the URDF names its meshes by
        relative paths.
    overwrite : bool
        Rename an older run folder there first.
    progress : callable, optional
        Told what begins, steps done, steps in all.
    """
    check_place(out, overwrite=overwrite)
    if package is not None:
        require_package(package)
    if program is not None:
        read_program(program, robot)  # its faults are told before anything is computed
    calibration = calibrate(robot, session, options, progress=progress)
    tell = progress or (lambda *_: None)
    tell(ROBOT, STEPS.index(ROBOT), len(STEPS))
    with whole_folder(out, layout.MANIFEST, overwrite=overwrite) as folder:
        delivered = deliver(calibration, robot, folder, program=program, package=package)
        spec = input_hash(calibration, options or Options())
        for key, record in zip(RECORDS, (calibration, delivered), strict=True):
            RunFolder(folder).write_record(key, record_bytes(key, record, spec))
        (folder / SPLIT_TABLE).write_bytes(split_csv(calibration).encode())
        if rows := sheet_rows(calibration, delivered):
            (folder / JOB_SHEET).write_bytes(job_csv(rows).encode())
        drawn = load_robot(folder / ROBOT / ROBOT_FILE)  # the same as whenever they are made again
        for name in layout.DERIVED:
            tell(name, STEPS.index(name), len(STEPS))
            (folder / name).write_bytes(_derived(name, calibration, delivered, drawn))
        (folder / layout.MANIFEST).write_bytes(manifest_bytes(about(calibration, spec)))
    tell("", len(STEPS), len(STEPS))
    return calibration, delivered


def check_place(out: Path, *, overwrite: bool) -> None:
    """Refuse a folder that cannot be written, before anything is read or computed; C40."""
    real(out, field="--out", code="C40")  # MuJoCo proves the robot in it, and takes UTF-8 only
    check_free(out, layout.MANIFEST, overwrite=overwrite)


def input_hash(calibration: Calibration, options: Options) -> str:
    """Hex sha256 of all that decides the numbers: files, robot, options."""
    source = calibration.source
    document = {
        "files": [digest for _, digest in source.files],
        "robot": source.robot_sha256,
        "options": {name: getattr(options, name) for name in options.__slots__},
    }
    return sha256(canonical(document)).hexdigest()


def about(calibration: Calibration, spec: str) -> dict[str, Any]:
    """What the manifest says."""
    source = calibration.source
    return {
        "kind": CALIBRATION,
        "name": source.name,
        "seed": calibration.split.seed,
        "robot": source.robot,
        "robot_sha256": source.robot_sha256,
        "files_sha256": dict(source.files),
        "input_sha256": spec,
    }


def load_calibration(path: Path) -> tuple[Calibration, Delivered]:
    """The records of a calibration's folder; nothing is computed.

    Raises
    ------
    InputError
        It is no such folder, or a record is missing, damaged or of another version.
    """
    spec, folder = read_manifest(path)["input_sha256"], RunFolder(path)
    records: list[Any] = [  # none is a failure: these are written together, and only when made
        folder.require_record(key, kind, spec, fix=AGAIN) for key, kind in RECORDS.items()
    ]
    return records[0], records[1]


def rederive_calibration(path: Path, names: Iterable[str] = layout.DERIVED) -> Path:
    """Write derived files of a calibration again from its records; the folder's path."""
    calibration, delivered = load_calibration(path)
    robot = load_robot(path / ROBOT / ROBOT_FILE)
    with RunFolder.reopen(path):
        for name in names:
            atomic_write(path / name, _derived(name, calibration, delivered, robot))
    return path


def _derived(name: str, calibration: Calibration, delivered: Delivered, robot: Robot) -> bytes:
    """Content of one derived file."""
    if name == layout.RECORDING:
        from testbed.identify.recording.story import calibration_story
        from testbed.recording.write import story_bytes

        return story_bytes(calibration_story(calibration, robot))
    if name == layout.RESULT:
        return npz.pretty_json({**headline(calibration, delivered), "truebed": own_version()})
    if name == layout.ARRAYS:
        return npz.to_bytes({"format": layout.FORMAT}, arrays(calibration))
    from testbed.identify.report.page import page_of

    return render(page_of(calibration, delivered, all_versions())).encode()
