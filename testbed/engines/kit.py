"""What a process needs to play the pieces of one cut: all of it as bytes, for any machine."""

import os
import shutil
import tempfile
import weakref
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from calib.errors import refuse
from testbed.engines.piece import Piece, played
from testbed.robots.catalog import load_robot
from testbed.scenario.hashes import record_hash, scenario_hash
from testbed.scenario.read import dump_scenario, parse_scenario
from testbed.scenario.scenario import Scenario
from testbed.store.npz import from_bytes, record_bytes, record_from, to_bytes
from testbed.studies import all_studies, declared_tables, study_named
from testbed.studies.protocol import Record, Records, Study
from testbed.toml_text import toml_value
from testbed.versions import compiler_version, number_versions, sources_hash

if TYPE_CHECKING:
    from testbed.robots.robot import Robot

DESCRIPTIONS = (".toml", ".xml", ".mjcf", ".urdf", ".xacro")
"""Endings of files beside a robot that may belong to it."""
THREADS = "OPENBLAS_NUM_THREADS"
"""Of the linear algebra: they decide last bits."""
CODE = "C42"


@dataclass(frozen=True, eq=False)
class Kit:
    """All that the pieces of one cut need to be played."""

    scenario: Scenario
    robot: "Robot"
    study: Study
    needed: Records

    @cached_property
    def data(self) -> bytes:
        """As bytes: scenario, records, own files by content, and what must be alike elsewhere."""
        known = known_records(self.scenario)
        specs = {key: record_hash(known[key].reads, self.robot, key) for key in self.needed.values}
        parts = {
            f"record/{key}": record_bytes(key, value, specs[key])
            for key, value in self.needed.values.items()
        }
        paths = own_paths(self.scenario)
        files = sorted({file.absolute() for file in own_files(paths, self.robot)})
        parts |= {f"file/{k}": file.read_bytes() for k, file in enumerate(files)}
        meta = {
            "alike": alike(),
            "scenario": dump_scenario(self.scenario),
            "scenario_sha256": scenario_hash(self.scenario, self.robot),
            "specs": specs,
            "failed": dict(self.needed.failed),
            "paths": paths,
            "files": [str(file) for file in files],
        }
        return to_bytes(meta, {name: np.frombuffer(part, np.uint8) for name, part in parts.items()})


def known_records(scenario: Scenario) -> dict[str, Record]:
    """Every record of a scenario, by key."""
    return {one.key: one for study in all_studies(scenario) for one in study.records(scenario)}


def alike() -> dict[str, str]:
    """What must be the same wherever pieces of one study are played."""
    return {
        **number_versions(),
        "numba": compiler_version(),
        "source code": sources_hash()[:12],
        THREADS: os.environ.get(THREADS, "not set"),
    }


def own_paths(scenario: Scenario) -> list[str]:
    """The files and folders of this machine that a scenario names."""
    document = scenario.document()
    named = [entry.get("file") for entry in document["cell"]["obstacle"]]
    named += [document["plan"].get("measured"), scenario.robot]
    return [name for name in named if name and Path(name).is_absolute()]


def own_files(paths: list[str], robot: "Robot") -> Iterator[Path]:
    """The files at these paths with those that belong to the robot."""
    for path in map(Path, paths):
        if path.is_file():
            yield path
        if path in (robot.folder, *robot.folder.glob("*")):
            yield from (visual.file for visual in robot.visuals)
            yield from (one for one in robot.folder.rglob("*") if one.suffix in DESCRIPTIONS)


@dataclass(frozen=True, eq=False)
class Opened:
    """A kit where it is used; own files lie in a folder that goes with it."""

    scenario: Scenario
    needed: Records


def play_piece(kit: bytes, piece: Piece) -> bytes:
    """The file of a piece, from a kit's bytes alone: what other processes are asked for."""
    opened = _opened(kit)
    return played(study_named(piece.task.study), opened.scenario, piece, opened.needed)


@lru_cache(maxsize=2)
def _opened(data: bytes) -> Opened:
    """A kit ready for use; kept, for many pieces come with the same one."""
    meta, arrays = from_bytes(data)
    require_alike(meta["alike"])
    folder = tempfile.mkdtemp(prefix="truebed-") if meta["files"] else ""
    for k, name in enumerate(meta["files"]):
        path = _inside(folder, name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(arrays[f"file/{k}"].tobytes())
    text: str = meta["scenario"]
    for name in meta["paths"]:
        text = text.replace(toml_value(name), toml_value(str(_inside(folder, name))))
    where = "the scenario that was sent"
    scenario = parse_scenario(text, declared_tables, where=where, finished=True)
    if scenario_hash(scenario, load_robot(scenario.robot)) != meta["scenario_sha256"]:
        raise refuse(
            "robot", scenario.robot, code=CODE, where=where,
            message="is another one here: its robot or cell needs files that are not beside them",
            fix="copy them beside the robot's file, or play it without --workers and --scheduler",
        )  # fmt: skip
    known = known_records(scenario)
    values = {
        key: record_from(arrays[f"record/{key}"].tobytes(), key, known[key].kind, spec)
        for key, spec in meta["specs"].items()
    }
    opened = Opened(scenario, Records(values, meta["failed"]))
    if folder:
        weakref.finalize(opened, shutil.rmtree, folder, ignore_errors=True)
    return opened


def _inside(folder: str, name: str) -> Path:
    """Where a file of another machine lies here."""
    path = Path(name)
    return Path(folder, *path.relative_to(path.anchor).parts)


def require_alike(theirs: Mapping[str, Any]) -> None:
    """Refuse to play where the bits would be others: versions, sources or threads differ.

    Raises
    ------
    InputError
        C42: what differs, there and here.
    """
    ours = alike()
    other = [name for name in ours if theirs.get(name) != ours[name]]
    if other:
        told = "; ".join(f"{name} is {ours[name]}, not {theirs.get(name)}" for name in other)
        raise refuse(
            "worker", None, code=CODE, message=f"a worker differs from this command: {told}",
            fix="install the same versions there, and start it with OPENBLAS_NUM_THREADS=1",
        )  # fmt: skip
