"""An MJCF with all it includes as one tree, and errors that know which file a line is in."""

from pathlib import Path
from typing import Any

from calib.errors import InputError
from testbed.robots.describe.xml_gate import read_xml

MOST_FILES = 64
SOURCE = "{truebed}file"
"""Attribute with the file that an included element comes from, while it is checked."""


def error_at(
    message: str, code: str, path: Path, element: Any, field: str, **more: Any
) -> InputError:
    """An error with the line it is about."""
    where = f"{element.get(SOURCE) or path}:{element.sourceline}"
    return InputError(message, code=code, where=where, field=field, **more)


def whole(path: Path, trail: list[Path], folder: Path, seen: set[Path]) -> Any:
    """The tree of a file with the files it includes in their places."""
    root = read_xml(path, *(("mujoco",) if len(trail) == 1 else ("mujoco", "mujocoinclude")))
    seen.add(path.resolve())
    for element in list(root.iter("include")):
        name = element.get("file", "")
        beside = [trail[0].parent / name, path.parent / name]
        file = next((one for one in beside if one.is_file()), beside[0])
        chain = " -> ".join([*(one.name for one in trail), name])
        problem = ""
        if not name or not file.is_file():
            problem = f"include {name} is missing"
        elif not file.resolve().is_relative_to(folder):
            problem = f"include {name} lies outside {folder}"
        elif file.resolve() in seen:
            problem = f"include {name} is there twice, or within itself"
        elif len(seen) >= MOST_FILES:
            problem = f"more than {MOST_FILES} files are included"
        if problem:
            raise error_at(f"{problem} ({chain})", "R8", path, element, "include", value=name)
        part = whole(file, [*trail, file], folder, seen)
        parent = element.getparent()
        for child in list(part):
            if isinstance(child.tag, str):
                for one in child.iter("*"):
                    if one.get(SOURCE) is None:
                        one.set(SOURCE, str(file))
                element.addprevious(child)
        parent.remove(element)
    return root


def remove(element: Any) -> None:
    """Take an element out, if it is still in."""
    parent = element.getparent()
    if parent is not None:
        parent.remove(element)
