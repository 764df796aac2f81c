"""What is damaged, and who reads it: small whole files of every kind, each with its reader."""

from collections.abc import Callable
from dataclasses import dataclass, is_dataclass
from pathlib import Path
from random import Random
from typing import get_type_hints

import numpy as np

from calib.errors import visible
from testbed.cli.terminal import headline
from testbed.files.probe import probe
from testbed.files.programs.correct import correct_program
from testbed.files.read import ReadOptions, read_session
from testbed.files.visits.tables import CampaignFile
from testbed.gates.mistakes import validated
from testbed.gates.toml import toml_document
from testbed.iso9283.play import play_test
from testbed.iso9283.read import read_test
from testbed.iso9283.results import headline as numbers_of
from testbed.iso9283.words import mark, reasons
from testbed.laboratory.cell import cell_from
from testbed.laboratory.joint_lists import read_conditions, read_joints
from testbed.laboratory.simulator import Simulator
from testbed.proposal.data import look_at
from testbed.proposal.session import propose_session
from testbed.proposal.text import session_text
from testbed.robots.catalog import load_robot
from testbed.robots.robot import workspace
from testbed.run.play import rederive, robot_of
from testbed.run.result import equal_runs, read_result
from testbed.store import layout, npz
from testbed.studies import load_scenario
from tests.fuzz import grammars, trees, whole
from tests.fuzz.whole import Files
from tests.testbed.files.made import ROBOT
from tests.testbed.studies.trial.fake_campaign import Fake

GRAMMARS: dict[str, grammars.Mutator] = {
    ".toml": grammars.toml_changed,
    ".csv": grammars.table_changed,
    ".txt": grammars.table_changed,
    ".obj": grammars.table_changed,
    ".stl": grammars.flipped,
    ".json": trees.json_changed,
    ".urdf": trees.xml_changed,
    ".xml": trees.xml_changed,
    ".dae": trees.xml_changed,
    ".ply": grammars.flipped,
    ".npz": trees.record_changed,
}
"""How a file is damaged, by the end of its name."""


@dataclass(frozen=True)
class Target:
    """A kind of input."""

    read: Callable[[Path], object]
    """Takes a folder and returns what is accepted there: read, and not computed with."""
    folders: tuple[Files, ...]
    """Whole files."""
    damaged: tuple[str, ...]
    """Names of those that are damaged."""
    may_be_empty: frozenset[str] = frozenset()
    """Fields that hold nan or inf where there is nothing."""
    largest: float = 1e100
    """Above it the fourth power of a number is none; what is only shown or kept may be larger."""
    share: int = 2
    """Of all inputs; those that are read at once have more, those that are fitted to less."""


def damaged(name: str, data: bytes, rng: Random) -> bytes:
    """A file with up to three changes by its grammar, some by its bytes."""
    if rng.random() < 0.15:
        data = rng.choice((grammars.renumbered, grammars.encoded))(data, rng)
    for _ in range(rng.choice((0, 1, 1, 1, 2, 3))):
        data = GRAMMARS[Path(name).suffix](data, rng)
    return grammars.flipped(data, rng) if rng.random() < 0.2 else data


def read_scenario(folder: Path) -> object:
    """A scenario, its robot, its cell and its measured poses."""
    scenario = load_scenario(folder / layout.SCENARIO)
    robot = robot_of(scenario, layout.SCENARIO)
    measured = scenario.plan.measured
    return (
        scenario.document(),
        robot,
        cell_from(scenario.cell, robot.model.chain),
        (read_joints(robot, measured), read_conditions(measured)) if measured else None,
    )


def read_measured(folder: Path) -> object:
    """A session, with the files it names or the one beside it, and whether it is read wrongly."""
    toml, beside = folder / "session.toml", folder / "a.csv"
    data, config = (beside, toml) if beside.exists() else (toml, None)
    options = ReadOptions(drop_invalid=bool(data.stat().st_size % 2))
    session = read_session(data, ROBOT, config=config, options=options)
    if not all(map(session.pose_name, range(len(session.measurements)))):
        raise AssertionError("a row belongs to a pose without a name")
    if not session.measurements.is_distance.any():  # where nothing fits, that takes seconds
        probe(ROBOT, session).raise_if_wrong()
    return session


def read_proposal(folder: Path) -> object:
    """What `new session` writes of the files that are there, without a robot."""
    files = sorted(file for file in folder.iterdir() if file.suffix != ".toml")
    looks = look_at(files, folder)
    proposed = propose_session(looks, None, folder)
    text = session_text(proposed, looks, "session.toml", None, None)
    return validated(toml_document(visible(text).encode(), "new"), CampaignFile, "new")


def read_cycles(folder: Path) -> object:
    """A test after ISO 9283, all its figures, and what is said of them."""
    result = play_test(read_test(folder))
    return result, numbers_of(result), mark(result), reasons(result)


def read_program(folder: Path) -> object:
    """A program and what becomes of it."""
    return correct_program(folder / "program.csv", ROBOT, whole.REAL, folder / "corrected.csv")


def read_results(folder: Path) -> object:
    """What `run` and `compare` show of a result."""
    read = read_result(folder)
    return read, headline(read), equal_runs([folder, folder])


def read_run(folder: Path) -> object:
    """What `report` does before it computes."""
    fake = Fake()
    return rederive(folder, (layout.RESULT,), studies=[fake], derive=fake.derive)


def read_record(folder: Path) -> object:
    """A record, by the class that its file is named after."""
    (file,) = folder.glob("*.npz")
    found = npz.record_from(file.read_bytes(), file.stem, whole.KINDS[file.stem], whole.SPEC)
    if isinstance(found, npz.Failure):
        return found.reason
    check_sizes(found)
    return found


def check_sizes(record: object) -> None:
    """Every array is as long as its field says, and a letter is one size in all of a class."""
    sizes: dict[object, int] = {}
    for name, hint in get_type_hints(type(record), include_extras=True).items():
        value = getattr(record, name)
        if is_dataclass(value):
            check_sizes(value)
        stated = getattr(hint, "__metadata__", ())
        if stated and isinstance(value, np.ndarray):
            for size, one in zip(value.shape, stated, strict=True):
                expected = one if isinstance(one, int) else sizes.setdefault(one, size)
                assert size == expected, f"{name} {value.shape} is not {stated}"


def read_robot(name: str) -> Callable[[Path], object]:
    """The reader of a robot's file, up to where its cell could be simulated."""

    def read(folder: Path) -> object:
        robot = load_robot(folder / name)
        Simulator(robot, robot.model.chain)
        return robot, workspace(robot)

    return read


NOT_STATED = frozenset({"rotation", "numbers", "time", "temperature"})
"""Columns of a session that a file may leave out for some rows."""
TARGETS = {
    "scenario": Target(
        read_scenario, whole.SCENARIOS, ("scenario.toml", "measured.csv", "fixture.stl")
    ),
    "session": Target(read_measured, whole.SESSIONS, ("session.toml",), NOT_STATED, share=6),
    "measurements": Target(read_measured, whole.SESSIONS, ("a.csv", "joints.csv"), NOT_STATED),
    "spatial analyzer": Target(read_measured, whole.SESSIONS, ("smr.txt",), NOT_STATED, share=1),
    "joints of a program": Target(read_measured, whole.SESSIONS, ("cal.txt",), NOT_STATED, share=1),
    "proposal": Target(read_proposal, whole.SESSIONS, ("a.csv", "smr.txt", "cal.txt")),
    "records of JSON": Target(read_proposal, whole.DOCUMENTS, ("m.json",)),
    "logs": Target(read_proposal, whole.LOGS, ("m.txt",)),
    "cycles": Target(
        read_cycles,
        whole.CYCLES,
        ("session.toml", "cycles.csv", "path.csv"),
        frozenset({"floor", "noise", "drift_p_value"}),
    ),
    "URDF": Target(read_robot("arm.urdf"), whole.ARMS, ("arm.urdf",)),
    "MJCF": Target(read_robot("arm.xml"), whole.ARMS, ("arm.xml",)),
    "mesh of a URDF": Target(
        read_robot("arm.urdf"), whole.ARMS, ("part.obj", "part.stl", "part.dae", "part.ply")
    ),
    "mesh of an MJCF": Target(read_robot("arm.xml"), whole.ARMS, ("assets/block.stl",)),
    "robot.toml": Target(
        read_robot("robot.toml"), whole.ROBOTS, ("robot.toml", "part.stl", "part.obj"), share=6
    ),
    "plan.csv": Target(
        lambda folder: (
            read_joints(ROBOT, folder / "plan.csv"),
            read_conditions(folder / "plan.csv"),
        ),
        whole.PLANS,
        ("plan.csv",),
        share=6,
    ),
    "program": Target(read_program, whole.PROGRAMS, ("program.csv",), share=6),
    "result.json": Target(
        read_results, whole.RUNS, (layout.RESULT, layout.ARRAYS), largest=np.inf, share=6
    ),
    "run folder": Target(read_run, whole.RUNS, (layout.MANIFEST, layout.SCENARIO)),
    "record": Target(
        read_record,
        whole.RECORDS,
        tuple(f"{name}.npz" for name in whole.KINDS),
        largest=np.inf,
        share=6,
    ),
}
