"""What a calibration hands out to be used: the identified robot, its table, corrected targets."""

import re
from dataclasses import replace
from pathlib import Path

from calib.geometry.model import RobotModel
from testbed.files.program import correct_program
from testbed.identify.records import Calibration, Delivered, FittedModel
from testbed.identify.results import dh_table
from testbed.identify.words import mm
from testbed.report.text import csv_text
from testbed.robots.catalog import Robot
from testbed.robots.write.folder import write_robot_folder
from testbed.robots.write.identified import identified_robot

ROBOT, DH_TABLE, SPLIT_TABLE = "robot", "dh_table.csv", "split.csv"
GEOMETRIC = "robot_geometric"
"""Folder of the geometric model beside an extended one."""
LONGEST_NAME = 64


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
            f"{row.old:.9g}",
            f"{row.new:.9g}",
            f"{row.delta:.9g}",
            "" if row.expanded is None else f"{row.expanded:.3g}",
        )
        for row in dh_table(calibration)
    ]
    head = ("number", "unit", "old", "new", "delta", "U_k2")
    (folder / DH_TABLE).write_bytes(csv_text(head, rows).encode())
    if program is None:
        return Delivered(sentences, (), 0)
    result = correct_program(program, robot, model, folder / corrected_name(program))
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


def corrected_name(program: Path) -> str:
    """File name of a corrected program."""
    return f"{program.stem}_corrected.csv"


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
