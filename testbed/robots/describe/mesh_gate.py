"""What a file of a robot may say of its meshes, and the errors of those that it may not."""

from pathlib import Path
from typing import Any

from calib.errors import InputError
from testbed.gates.paths import real
from testbed.robots.describe.xml_gate import called, error_at, place_of

MESH_ROOT = "give the folder that holds all meshes as mesh_root"
MESHLESS = f"{MESH_ROOT}, or allow missing meshes"


def check_scale(mesh: Any, path: Path) -> None:
    """R11: no mesh is flattened."""
    text = mesh.get("scale", "1")
    if not all(map(float, text.split())):
        message = f'{called(mesh)} has scale="{text}"'
        raise error_at(mesh, path, "R11", message, "scale", text, "no factor may be zero")


def mesh_path(mesh: Any, path: Path, file: Path) -> Path:
    """Where a mesh would lie, links followed; R7 if nothing can lie there."""
    return real(file, field="mesh", where=place_of(mesh, path))


def not_local(mesh: Any, path: Path, field: str, name: str) -> InputError:
    """R7: a mesh on the net."""
    fix = "download it and name the file"
    return error_at(mesh, path, "R7", f"mesh {name} is not a local file", field, name, fix=fix)


def outside(
    mesh: Any, path: Path, field: str, name: str, folder: Path, fix: str = MESH_ROOT
) -> InputError:
    """R6: a mesh that is not below the folder of all meshes."""
    message = f"mesh {name} lies outside {folder}"
    return error_at(mesh, path, "R6", message, field, name, fix=fix)


def missing(mesh: Any, path: Path, field: str, name: str, folder: Path) -> InputError:
    """R7: a mesh that is not there."""
    allowed = f"it must be a file below {folder}"
    return error_at(mesh, path, "R7", f"mesh {name} is missing", field, name, allowed, MESHLESS)
