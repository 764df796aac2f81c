"""What `identify` is given: a robot, then measurements; said where they are swapped."""

import shlex
from pathlib import Path

from calib.errors import InputError, refuse
from testbed.files.session_toml import SESSION_FILE
from testbed.gates.kinds import kind_of, kind_of_name
from testbed.gates.paths import is_there
from testbed.gates.toml import read_toml_bytes, toml_document
from testbed.robots.catalog import ROBOT_FILE, robot_names


def require_order(robot: str, data: Path) -> None:
    """Refuse measurements in the place of the robot and a robot in the place of measurements.

    Raises
    ------
    InputError
        S37: both are swapped.
    """
    if _is_data(robot) and _is_robot(data):
        command = shlex.join(["truebed", "identify", str(data), robot])
        raise refuse(
            "ROBOT", robot, code="S37",
            message=f"ROBOT and DATA are swapped: {robot} holds measurements, {data} is a robot",
            fix=f"type {command}",
        )  # fmt: skip


def _is_data(given: str) -> bool:
    """Whether what was given as the robot holds measurements."""
    path = Path(given)
    if given in robot_names():
        return False
    if is_there(path, Path.is_dir):
        return is_there(path / SESSION_FILE) and not is_there(path / ROBOT_FILE)
    return is_there(path, Path.is_file) and (
        kind_of_name(path) == "table" or _kind_inside(path) == "session"
    )


def _is_robot(given: Path) -> bool:
    """Whether what was given as measurements is a robot."""
    if not is_there(given):
        return str(given) in robot_names()
    if is_there(given, Path.is_dir):
        return is_there(given / ROBOT_FILE) and not is_there(given / SESSION_FILE)
    return kind_of_name(given) == "description" or _kind_inside(given) == "robot"


def _kind_inside(path: Path) -> str | None:
    """What a TOML file holds; None of another file, or one that cannot be read."""
    if path.suffix.lower() != ".toml":
        return None
    try:
        return kind_of(toml_document(read_toml_bytes(path, str(path)), str(path)))
    except InputError:
        return None  # its reader says what is wrong with it
