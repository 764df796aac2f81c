"""The files that a calibration hands back: the robot, its numbers, the corrected program."""

import re
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

from calib.geometry.model import RobotModel
from testbed.files.programs.correct import correct_program
from testbed.gates.paths import short_stem
from testbed.identify.applies.beyond import map_words
from testbed.identify.applies.targets import (
    datum_words,
    statement_at,
    statement_csv,
    target_words,
    tool_words,
)
from testbed.identify.calibration import Calibration
from testbed.identify.conditions import measured
from testbed.identify.handback.delivered import GEOMETRIC, ROBOT, Delivered
from testbed.identify.handback.least_moved import RULE
from testbed.identify.handback.own_file import deliver_own_file
from testbed.identify.handback.results import dh_csv, geometric_csv, tool_csv
from testbed.identify.handback.root import root_words
from testbed.identify.handback.states import handed_robot, in_own_frames
from testbed.identify.headline import mm
from testbed.identify.records import FittedModel
from testbed.identify.results import joint_map_csv
from testbed.identify.visits.report import handed_out, own_reflectors
from testbed.robots.catalog import Robot
from testbed.robots.file_frames import base_words
from testbed.robots.robot import Reflector
from testbed.robots.source import MjcfText
from testbed.robots.write.folder import write_robot_folder
from testbed.robots.write.identified import identified_robot

DH_TABLE, JOINT_MAP = "dh_table.csv", "joint_map.csv"
TOOL_TABLE = "tool_in_use.csv"
LONGEST_NAME = 64


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
        (folder / GEOMETRIC / DH_TABLE).write_bytes(geometric_csv(calibration).encode())
        sentences += (_geometric_words(calibration),)
    own, told = deliver_own_file(calibration, robot, folder)
    urdf, mjcf = ("", own) if isinstance(robot.own_text, MjcfText) else (own, "")
    root = base_words(robot)
    found = () if calibration.own_frames or not root else (root_words(calibration, root),)
    sentences += (_frame_words(calibration, identified), *found, *told)
    if package is not None:
        sentences += (f"its URDF finds the meshes where {ROBOT}/ is the root of {package}",)
    (folder / DH_TABLE).write_bytes(dh_csv(calibration).encode())
    tables = {JOINT_MAP: joint_map_csv(calibration), TOOL_TABLE: tool_csv(calibration)}
    for name, text in tables.items():
        if text is not None:
            (folder / name).write_bytes(text.encode())
    if program is None:
        return Delivered(sentences, (), 0, urdf=urdf, mjcf=mjcf, root=root)
    model = in_own_frames(calibration)
    result = correct_program(
        program,
        robot,
        model,
        folder / corrected_name(program),
        measured=measured(calibration),
        set_up=calibration.set_up,
        in_use=None if calibration.handback.in_use is None else calibration.handback.in_use.tool,
    )
    failed = int((~result.corrected).sum())
    targets, told = statement_at(calibration, result), result.sentences
    told += map_words(model, calibration.measurements.q[calibration.is_used], result.q)
    if targets is not None:
        told += target_words(targets) + datum_words(calibration)
        told += tool_words(calibration, result)
        (folder / statement_name(program)).write_bytes(statement_csv(targets).encode())
    return Delivered(sentences, told, failed, result.conditions, targets, urdf, mjcf, root)


def delivered_robot(calibration: Calibration, robot: Robot, fit: FittedModel) -> Robot:
    """One fit's model as a robot: base and tool as they were found, and the reflectors on it.

    Its world is the frame of the measurements.
    """
    model = handed_robot(calibration, fit).model
    found = identified_robot(
        robot,
        RobotModel(model.chain, model.joint_errors),
        name=identified_name(robot.name),
        reflectors=reflectors_on(calibration, fit),
    )
    told = {**found.sources, "geometry": f"{found.sources['geometry']}; {RULE}"}
    return replace(
        found, sources=MappingProxyType(told), notes=(*found.notes, *handed_out(calibration))
    )


def reflectors_on(calibration: Calibration, fit: FittedModel) -> tuple[Reflector, ...]:
    """Every reflector that has a name, where it was stated or found, in the tool frame of a fit."""
    places = fit.identification.model.fixtures.reflectors.tolist()
    found = (
        Reflector(name, (x, y, z))
        for name, (x, y, z) in zip(
            own_reflectors(calibration.visits, calibration.reflector_names), places, strict=True
        )
        if name is not None
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
        f"{GEOMETRIC}/ has the geometric model, fitted without joint terms: use it for whatever "
        f"takes link numbers (its {DH_TABLE}), URDF or MJCF; its mean error is {one} mm, with "
        f"joint terms {two} mm"
    )


def _frame_words(calibration: Calibration, identified: Robot) -> str:
    """In which frames the robot is handed out, and what is mounted on it."""
    words = "its base and tool are the identified ones"
    if not calibration.own_frames:
        words += ", and its world is the frame that the measurements are in"
    names = [reflector.name for reflector in identified.reflectors]
    return words + f"; on its tool are the reflectors {', '.join(names)}" * bool(names)
