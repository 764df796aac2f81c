"""The folder of a calibration: everything computed first, then written whole or not at all."""

import re
from collections.abc import Iterable
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

from calib.geometry.model import RobotModel
from testbed.disk import atomic_write
from testbed.files.program import correct_program, read_program
from testbed.files.session import Session
from testbed.gates.paths import real, short_stem
from testbed.identify.calibrate import STEPS, Options, calibrate
from testbed.identify.conditions import measured
from testbed.identify.delivered import Delivered
from testbed.identify.records import Calibration, FittedModel
from testbed.identify.results import arrays, dh_csv, headline, joint_map_csv, split_csv
from testbed.identify.targets import statement_at, statement_csv, target_words
from testbed.identify.words import mm
from testbed.progress import Progress
from testbed.report.page import render
from testbed.robots.catalog import ROBOT_FILE, Robot, load_robot
from testbed.robots.robot import Reflector
from testbed.robots.write.folder import identified_robot, write_robot_folder
from testbed.robots.write.urdf import require_package
from testbed.store import layout, npz
from testbed.store.manifest import CALIBRATION, manifest_bytes, read_manifest
from testbed.store.npz import canonical, record_bytes
from testbed.store.run_folder import AGAIN, RunFolder
from testbed.store.whole_folder import check_free, whole_folder
from testbed.versions import all_versions, own_version

RECORDS: dict[str, type] = {"calibration": Calibration, "delivered": Delivered}
ROBOT, DH_TABLE, SPLIT_TABLE = "robot", "dh_table.csv", "split.csv"
JOINT_MAP = "joint_map.csv"
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
    tell(STEPS[-1], len(STEPS) - 1, len(STEPS))
    with whole_folder(out, layout.MANIFEST, overwrite=overwrite) as folder:
        delivered = deliver(calibration, robot, folder, program=program, package=package)
        spec = input_hash(calibration, options or Options())
        for key, record in zip(RECORDS, (calibration, delivered), strict=True):
            RunFolder(folder).write_record(key, record_bytes(key, record, spec))
        (folder / SPLIT_TABLE).write_bytes(split_csv(calibration).encode())
        drawn = load_robot(folder / ROBOT / ROBOT_FILE)  # the same as whenever they are made again
        for name in layout.DERIVED:
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
        from testbed.identify.recording import calibration_story
        from testbed.recording.write import story_bytes

        return story_bytes(calibration_story(calibration, robot))
    if name == layout.RESULT:
        return npz.pretty_json({**headline(calibration, delivered), "truebed": own_version()})
    if name == layout.ARRAYS:
        return npz.to_bytes({"format": layout.FORMAT}, arrays(calibration))
    from testbed.identify.report import page_of

    return render(page_of(calibration, delivered, all_versions())).encode()


def deliver(
    calibration: Calibration,
    robot: Robot,
    folder: Path,
    *,
    program: Path | None = None,
    package: str | None = None,
) -> Delivered:
    """Write the identified robot, the table and the corrected program; what became of each."""
    identified = delivered_robot(calibration, robot, calibration.fit)
    told = write_robot_folder(identified, folder / ROBOT, package=package)
    sentences = (*told, *identified.notes)
    if calibration.choice.chosen == "extended":
        # its geometric part leans on the joint terms: alone it is worse than a geometric fit
        plain = delivered_robot(calibration, robot, calibration.fits[0])
        write_robot_folder(plain, folder / GEOMETRIC, package=package)
        sentences += (_geometric_words(calibration),)
    sentences += (_frame_words(calibration, identified),)
    if package is not None:
        sentences += (f"its URDF finds the meshes where {ROBOT}/ is the root of {package}",)
    (folder / DH_TABLE).write_bytes(dh_csv(calibration).encode())
    if (text := joint_map_csv(calibration)) is not None:
        (folder / JOINT_MAP).write_bytes(text.encode())
    if program is None:
        return Delivered(sentences, (), 0)
    model = in_own_frames(calibration)
    result = correct_program(
        program,
        robot,
        model,
        folder / corrected_name(program),
        measured=measured(calibration),
        set_up=calibration.set_up,
    )
    failed = int((~result.corrected).sum())
    targets, told = statement_at(calibration, result), result.sentences
    if targets is not None:
        told += target_words(targets)
        (folder / statement_name(program)).write_bytes(statement_csv(targets).encode())
    return Delivered(sentences, told, failed, result.conditions, targets)


def delivered_robot(calibration: Calibration, robot: Robot, fit: FittedModel) -> Robot:
    """One fit's model as a robot: base and tool as they were found, and the reflectors on it.

    Its world is the frame of the measurements.
    """
    model = fit.identification.model
    return identified_robot(
        robot,
        RobotModel(model.chain, model.joint_errors),
        name=identified_name(robot.name),
        reflectors=reflectors_on(calibration, fit),
    )


def reflectors_on(calibration: Calibration, fit: FittedModel) -> tuple[Reflector, ...]:
    """Every reflector that has a name, where it was stated or found, in the tool frame of a fit."""
    places = fit.identification.model.fixtures.reflectors.tolist()
    found = (
        Reflector(name, (x, y, z))
        for name, (x, y, z) in zip(calibration.reflector_names, places, strict=True)
    )
    named: dict[str, Reflector] = {}
    for one in (*calibration.stated_reflectors, *found):
        name = "".join(c for c in one.name if c.isprintable()) or "reflector"
        while name in named:
            name += "_"
        named[name] = replace(one, name=name)
    return tuple(named.values())


def corrected_name(program: Path) -> str:
    """Name of the corrected program: ``NAME_corrected.csv``."""
    return f"{short_stem(program)}_corrected.csv"


def statement_name(program: Path) -> str:
    """Name of what is stated at a program's targets: ``NAME_statement.csv``."""
    return f"{short_stem(program)}_statement.csv"


def in_own_frames(calibration: Calibration) -> RobotModel:
    """The chosen model in the base and with the tool of the robot's file: what its programs know.

    Found from nothing, both say only where the tracker stood and where its target was mounted.
    """
    model, own = calibration.fit.identification.model, calibration.nominal.chain
    if calibration.own_frames:
        return RobotModel(model.chain, model.joint_errors)
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


def _frame_words(calibration: Calibration, identified: Robot) -> str:
    """In which frames the robot is handed out, and what is mounted on it."""
    words = "its base and tool are the identified ones"
    if not calibration.own_frames:
        words += ", and its world is the frame that the measurements are in"
    names = [reflector.name for reflector in identified.reflectors]
    return words + f"; on its tool are the reflectors {', '.join(names)}" * bool(names)
