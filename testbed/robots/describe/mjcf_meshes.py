"""The mesh files of an MJCF: found inside the folder, given names under which MuJoCo gets them."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from testbed.robots.describe.mjcf_includes import error_at, remove

PATHS = ("meshdir", "texturedir", "assetdir", "strippath", "discardvisual", "fusestatic")
"""Attributes of <compiler> that are settled here."""


def settle_meshes(
    root: Any, path: Path, folder: Path, notes: list[str], *, allow_missing: bool
) -> dict[str, Path]:
    """R6 and R7: mesh files are there and inside the folder; each gets a name MuJoCo is handed."""
    files: dict[str, Path] = {}
    place, strip = "", False
    for compiler in root.iter("compiler"):
        place = compiler.get("meshdir") or compiler.get("assetdir") or place
        strip = compiler.get("strippath", str(strip).lower()) == "true"
        for key in PATHS:
            compiler.attrib.pop(key, None)
    for material in root.iter("material"):
        material.attrib.pop("texture", None)
        for layer in list(material):
            remove(layer)
    for mesh in list(_mesh_assets(root)):
        name = mesh.get("file")
        if name is None:
            continue  # its vertices stand in the text
        if "://" in name:
            raise error_at(
                f"mesh {name} is not a local file",
                "R7",
                path,
                mesh,
                "file",
                value=name,
                fix="download it and name the file",
            )
        plain = Path(name.replace("\\", "/"))
        own = mesh.get("name") or plain.stem
        file = _mesh_file(mesh, Path(place) / (plain.name if strip else plain), path, folder)
        if file is None:
            if not allow_missing:
                raise error_at(
                    f"mesh {name} is missing",
                    "R7",
                    path,
                    mesh,
                    "file",
                    value=name,
                    allowed=f"a file below {folder}",
                    fix="give the folder that holds all meshes as mesh_root, or allow missing "
                    "meshes",
                )
            notes.append(f"mesh {name} is missing")
            for geom in [geom for geom in root.iter("geom") if geom.get("mesh") == own]:
                remove(geom)
            remove(mesh)
            continue
        mesh.set("name", own)
        mesh.set("file", asset_name(len(files), file))
        files[own] = file
    return files


def _mesh_assets(root: Any) -> Iterator[Any]:
    """The meshes of <asset>, not those of <default>."""
    for asset in root.iter("asset"):
        yield from asset.findall("mesh")


def _mesh_file(mesh: Any, name: Path, path: Path, folder: Path) -> Path | None:
    """Where a mesh lies, or None; refused if that is outside the folder."""
    candidates = [folder / name, path.parent / name]
    inside = [file for file in candidates if file.resolve().is_relative_to(folder)]
    found = next((file for file in inside if file.is_file()), None)
    if found is None and len(inside) < len(candidates):
        raise error_at(
            f"mesh {name.as_posix()} lies outside {folder}",
            "R6",
            path,
            mesh,
            "file",
            value=str(name),
            fix="give the folder that holds all meshes as mesh_root",
        )
    return found


def asset_name(number: int, file: Path) -> str:
    """Under which name MuJoCo is handed a mesh, whatever its file and folder are called."""
    return f"mesh{number}{file.suffix.lower()}"
