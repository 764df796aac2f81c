"""The command that makes a model's files from its robot.toml: meshes, URDF, MJCF.

``python -m testbed.robots.write.generate [NAME ...] [--out DIR]``
"""

import argparse
import shutil
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from calib.arrays import Array
from calib.errors import CalibError, refuse
from calib.geometry.frames import inverse
from testbed import assets
from testbed.gates.toml import read_toml
from testbed.names import choice_of
from testbed.robots.catalog import (
    ROBOT_FILE,
    TRACKER,
    TRACKER_FILE,
    load_robot,
    robot_chain,
    robot_names,
)
from testbed.robots.file import Drawn, RobotFile, TrackerFile
from testbed.robots.meshes.drawings import ARMS, drawing
from testbed.robots.meshes.drawings.instruments import tracker
from testbed.robots.meshes.solids import Solid, moved, write_obj
from testbed.robots.placements import link_poses
from testbed.robots.write.mjcf import mjcf_text
from testbed.robots.write.urdf import urdf_bytes


def generate(name: str, out: Path) -> None:
    """Make all files of the shipped model `name` below the folder `out`."""
    source = assets.models() / name
    out.mkdir(parents=True, exist_ok=True)
    if (source / TRACKER_FILE).is_file():
        generate_tracker(source / TRACKER_FILE, out)
    elif (source / ROBOT_FILE).is_file():
        generate_robot(source / ROBOT_FILE, out)
    else:
        message, fix = f'there is no model "{name}"', choice_of(name, model_names())
        raise refuse("name", name, code="S37", message=message, fix=fix)


def model_names() -> list[str]:
    """Names of all shipped models: robots, then the tracker."""
    return [*robot_names(), TRACKER]


def generate_robot(path: Path, out: Path) -> None:
    """Draw the parts of a robot.toml into their link frames, then write URDF and MJCF."""
    if out.resolve() != path.parent.resolve():
        shutil.copyfile(path, out / ROBOT_FILE)
    data = read_toml(path, RobotFile, "robot")
    if data.drawing:
        if data.drawing not in ARMS:
            message, fix = f'drawing = "{data.drawing}"', choice_of(data.drawing, ARMS)
            raise refuse(
                "drawing", data.drawing, code="S37", message=message, fix=fix, where=str(path)
            )
        chain = robot_chain(data)
        at_zero = replace(chain, T_world_base=np.eye(4))
        frames = link_poses(at_zero, np.zeros((1, chain.n_joints)))[0]
        into = [inverse(T) for T in frames]
        write_parts(path, data, drawing(data.drawing), into, out)
    robot = load_robot(out)
    (out / f"{robot.name}.urdf").write_bytes(urdf_bytes(robot))
    (out / f"{robot.name}.xml").write_bytes(mjcf_text(robot).encode())


def generate_tracker(path: Path, out: Path) -> None:
    """Draw the parts of tracker.toml; all its links share one frame."""
    if out.resolve() != path.parent.resolve():
        shutil.copyfile(path, out / TRACKER_FILE)
    data = read_toml(path, TrackerFile, "tracker")
    write_parts(path, data, tracker(data.beam_height_mm / 1e3), [np.eye(4)] * 3, out)


def write_parts(
    path: Path, data: Drawn, solids: dict[str, Solid], into: list[Array], out: Path
) -> None:
    """Write each part named in the file, moved by `into[link]` (4, 4); none may be left over."""
    names = {part.name for part in data.parts}
    if names != set(solids):
        odd = ", ".join(sorted(names ^ set(solids)))
        message = f"[parts] and the drawing {data.drawing} differ in {odd}"
        allowed = f"one [[parts]] for each of {', '.join(solids)}"
        raise refuse("parts", allowed=allowed, code="S37", message=message, where=str(path))
    for part in data.parts:
        write_obj(moved(solids[part.name], into[part.link]), out / part.file)


def main(arguments: Iterable[str] | None = None) -> int:
    """Command line; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m testbed.robots.write.generate",
        description="Make meshes, URDF and MJCF from robot.toml.",
        allow_abbrev=False,
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="shipped models (default: all)")
    parser.add_argument("--out", type=Path, help="folder to write NAME/ into (default: in place)")
    options = parser.parse_args(None if arguments is None else list(arguments))
    try:
        for name in options.names or model_names():
            generate(name, (options.out or assets.models()) / name)
    except CalibError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
