"""New files, written completely or not at all, and never over another."""

import os
import re
from pathlib import Path

from calib.errors import visible
from testbed.assets import robot_names
from testbed.disk import atomic_write
from testbed.files.refusal import refusal
from testbed.gates.paths import is_there, real
from testbed.robots.catalog import ROBOT_FILE


def require_folder(path: Path) -> None:
    """Refuse a path where no file can be written.

    Raises
    ------
    InputError
        C40: its folder does not exist.
    """
    real(path, field="--out", code="C40")
    if not is_there(path.parent, Path.is_dir):
        message, fix = f"the folder {path.parent} does not exist", "make it, or choose another"
        raise refusal(str(path), "--out", message, code="C40", fix=fix)


def require_new(path: Path, *, renames: bool = False) -> None:
    """Refuse a path that exists already, or where no file can be written.

    `renames` is whether the command has an option for that.

    Raises
    ------
    InputError
        C40: it exists already, or its folder does not.
    """
    require_folder(path)
    if is_there(path) or path.is_symlink():
        fix = "choose another --out, or rename the old one by --overwrite"
        fix = fix if renames else "choose another --out, or move it away"
        raise refusal(str(path), "--out", "exists already", code="C40", fix=fix)


def move_aside(path: Path) -> None:
    """Rename an ordinary file, if there is one, to the first free ``<name>.old-<k>``."""
    if path.is_symlink() or not path.is_file():
        return
    number = 1
    while is_there(new := path.with_name(f"{path.name}.old-{number}")) or new.is_symlink():
        number += 1
    path.rename(new)


def plain_name(path: Path) -> str:
    """A name of small letters, digits and _ from that of a file."""
    letters = re.sub(r"[^a-z0-9]+", "_", path.stem.lower()).strip("_")
    return (letters if letters[:1].isalpha() else f"r_{letters}".rstrip("_"))[:60]


def seen_from(out: Path, robot: str) -> str:
    """Name of a robot in a file `out`: its relative path, or the name of a shipped robot."""
    if robot in robot_names():
        return robot
    file = Path(robot) / ROBOT_FILE if Path(robot).is_dir() else Path(robot)
    return Path(os.path.relpath(file.resolve(), out.parent.resolve())).as_posix()


def write_new(path: Path, text: str) -> None:
    """Write a new file; control characters of terminals are written as text."""
    require_new(path)
    atomic_write(path, visible(text).encode())
