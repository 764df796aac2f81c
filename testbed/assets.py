"""Where the models and scenes lie that ship with the package: in the wheel or in a checkout."""

from pathlib import Path

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


def robot_names() -> list[str]:
    """Names of the robots that ship, in alphabetical order."""
    return sorted(file.parent.name for file in models().glob("*/robot.toml"))
