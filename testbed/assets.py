"""Where the models and scenes lie that ship with the package: in the wheel or in a checkout."""

import tomllib
from pathlib import Path
from typing import Any

_HERE = Path(__file__).resolve().parent


def _shipped(name: str) -> Path:
    """The folder inside the installed package, else the one beside it in a checkout."""
    inside = _HERE / name
    return inside if inside.is_dir() else _HERE.parent / name


def models() -> Path:
    """Folder with one folder per robot or instrument."""
    return _shipped("models")


def scenes() -> Path:
    """Folder with the scenario files."""
    return _shipped("scenes")


def scene_names() -> list[str]:
    """Names of the scenes that ship, in alphabetical order."""
    return sorted(path.stem for path in scenes().glob("*.toml"))


def scene_rows() -> list[tuple[str, str, str, list[str]]]:
    """Name, robot, title and names of the trials of each scene that ships, as its file says.

    The files are not checked against their schema, which would take longer than all else of a list.
    """
    found = {name: _read(scenes() / f"{name}.toml") for name in scene_names()}
    return [
        (
            name,
            text["robot"],
            text["title"],
            # one made for planning is played as one designed set
            [trial["name"] for trial in text.get("trial", [{"name": "designed"}])],
        )
        for name, text in found.items()
    ]


def robot_rows() -> list[tuple[str, str, str, str]]:
    """Name, title, number of joints and folder of each robot that ships, as its file says."""
    found = {name: _read(models() / name / "robot.toml") for name in robot_names()}
    return [
        (name, text["title"], str(len(text["joints"])), str(models() / name))
        for name, text in found.items()
    ]


def _read(path: Path) -> dict[str, Any]:
    return tomllib.loads(path.read_text(encoding="utf-8"))


def robot_names() -> list[str]:
    """Names of the robots that ship, in alphabetical order."""
    return sorted(file.parent.name for file in models().glob("*/robot.toml"))
