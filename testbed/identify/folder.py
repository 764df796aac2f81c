"""The folder of a calibration: everything computed first, then written whole or not at all."""

import re
from collections.abc import Iterable
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

from calib.errors import refuse
from calib.geometry.model import RobotModel
from testbed.disk import atomic_path
from testbed.files.program import correct_program
from testbed.files.session import Session
from testbed.identify.calibrate import STEPS, Options, calibrate
from testbed.identify.records import Calibration, Delivered, FittedModel
from testbed.identify.results import arrays, dh_table, headline, split_csv
from testbed.identify.words import mm
from testbed.progress import Progress
from testbed.report.page import render
from testbed.report.text import csv_text
from testbed.robots.catalog import ROBOT_FILE, Robot, load_robot
from testbed.robots.write.folder import identified_robot, write_robot_folder
from testbed.store import layout, npz
from testbed.store.manifest import CALIBRATION, manifest_bytes, read_manifest
from testbed.store.npz import Failure, canonical, record_bytes
from testbed.store.run_folder import RunFolder, check_free, whole_folder
from testbed.versions import all_versions, own_version

RECORDS: dict[str, type] = {"calibration": Calibration, "delivered": Delivered}
ROBOT, DH_TABLE, SPLIT_TABLE = "robot", "dh_table.csv", "split.csv"
GEOMETRIC = "robot_geometric"
"""Folder of the geometric model beside an extended one."""
LONGEST_NAME = 64


def play_calibration(
    robot: Robot,
    session: Session,
    out: Path,
    options: Options | None = None,
    *,
    program: Path | None = None,
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
    overwrite : bool
        Rename an older run folder there first.
    progress : callable, optional
        Told what begins, steps done, steps in all.
    """
    check_free(out, layout.MANIFEST, overwrite=overwrite)
    calibration = calibrate(robot, session, options, progress=progress)
    tell = progress or (lambda *_: None)
    tell(STEPS[-1], len(STEPS) - 1, len(STEPS))
    with whole_folder(out, layout.MANIFEST, overwrite=overwrite) as folder:
        delivered = deliver(calibration, robot, folder, program=program)
        spec = input_hash(calibration, options or Options())
        for key, record in zip(RECORDS, (calibration, delivered), strict=True):
            RunFolder(folder).write_record(key, record_bytes(key, record, spec))
        (folder / SPLIT_TABLE).write_bytes(split_csv(calibration).encode())
        for name in layout.DERIVED:
            _derive(name, calibration, delivered, robot, folder / name)
        (folder / layout.MANIFEST).write_bytes(manifest_bytes(about(calibration, spec)))
    tell("", len(STEPS), len(STEPS))
    return calibration, delivered


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
        It is no such folder, or a record is missing or damaged.
    """
    document = read_manifest(path)
    calibration, delivered = (
        _record(path, key, kind, document["input_sha256"]) for key, kind in RECORDS.items()
    )
    return calibration, delivered


def rederive_calibration(path: Path, names: Iterable[str] = layout.DERIVED) -> Path:
    """Write derived files of a calibration again from its records; the folder's path."""
    calibration, delivered = load_calibration(path)
    robot = load_robot(path / ROBOT / ROBOT_FILE)
    with RunFolder.reopen(path):
        for name in names:
            with atomic_path(path / name) as temporary:
                _derive(name, calibration, delivered, robot, temporary)
    return path


def _derive(
    name: str, calibration: Calibration, delivered: Delivered, robot: Robot, path: Path
) -> None:
    """Write one derived file."""
    if name == layout.RECORDING:
        from testbed.identify.recording import calibration_story
        from testbed.recording.write import write_story

        write_story(calibration_story(calibration, robot), path)
    elif name == layout.RESULT:
        document = {**headline(calibration, delivered), "truebed": own_version()}
        path.write_bytes(npz.pretty_json(document))
    elif name == layout.ARRAYS:
        path.write_bytes(npz.to_bytes({"format": layout.FORMAT}, arrays(calibration)))
    else:
        from testbed.identify.report import page_of

        path.write_bytes(render(page_of(calibration, delivered, all_versions())).encode())


def _record(path: Path, key: str, kind: type, spec: str) -> Any:
    """One record of the folder."""
    record = RunFolder(path).read_record(key, kind, spec)
    if record is None or isinstance(record, Failure):
        raise refuse(
            key,
            code="D42",
            message=f"the record {key} is missing or damaged",
            fix="give the `truebed identify` command again with another --out",
            where=str(path),
        )
    return record


def deliver(
    calibration: Calibration, robot: Robot, folder: Path, *, program: Path | None = None
) -> Delivered:
    """Write the identified robot, the table and the corrected program; what became of each."""
    model, name = delivered_model(calibration, calibration.fit), identified_name(robot.name)
    identified = identified_robot(robot, model, name=name)
    sentences = (*write_robot_folder(identified, folder / ROBOT), *identified.notes)
    if calibration.choice.chosen == "extended":
        # its geometric part leans on the joint terms: alone it is worse than a geometric fit
        plain = delivered_model(calibration, calibration.fits[0])
        write_robot_folder(identified_robot(robot, plain, name=name), folder / GEOMETRIC)
        sentences += (_geometric_words(calibration),)
    sentences += (_frame_words(calibration),)
    rows = [
        (
            row.name,
            row.unit,
            *(f"{value:.9g}" for value in (row.old, row.new, row.delta)),
            "" if row.expanded is None else f"{row.expanded:.3g}",
        )
        for row in dh_table(calibration)
    ]
    head = ("number", "unit", "old", "new", "delta", "U_k2")
    (folder / DH_TABLE).write_bytes(csv_text(head, rows).encode())
    if program is None:
        return Delivered(sentences, (), 0)
    result = correct_program(program, robot, model, folder / f"{program.stem}_corrected.csv")
    return Delivered(sentences, result.sentences, int((~result.corrected).sum()))


def delivered_model(calibration: Calibration, fit: FittedModel) -> RobotModel:
    """One fit's model as a robot: in the world of the robot's file, without the fixtures.

    Where base and tool were found from nothing they say where the tracker stood and where its
    target was mounted; the robot handed out keeps the base and the tool of its file.
    """
    model = fit.identification.model
    if calibration.own_frames:
        return RobotModel(model.chain, model.joint_errors)
    own = calibration.nominal.chain
    chain = replace(model.chain, T_world_base=own.T_world_base, T_flange_tool=own.T_flange_tool)
    return RobotModel(chain, model.joint_errors)


def identified_name(name: str) -> str:
    """Name of the identified robot."""
    plain = re.sub(r"[^a-z0-9_]", "_", name.lower())
    plain = plain if plain[:1].isalpha() else f"robot_{plain}"
    return f"{plain[: LONGEST_NAME - len('_identified')]}_identified"


def _geometric_words(calibration: Calibration) -> str:
    """What to take where joint terms cannot be said."""
    fits = (calibration.fits[0], calibration.fit)
    one, two = (mm((fit.test or fit.train).position.mean) for fit in fits)
    return (
        f"{GEOMETRIC}/ holds the geometric model, fitted without joint terms: for what reads URDF "
        f"or MJCF it is the better one; mean error {one} mm, with joint terms {two} mm"
    )


def _frame_words(calibration: Calibration) -> str:
    """In which frames the robot is handed out."""
    if calibration.own_frames:
        return "its base and tool are the identified ones"
    return (
        "its base and tool are those of the robot's file: where the measuring frame and the target "
        "were is in the table of parameters only"
    )
