"""The robot of a URDF or MJCF as a folder with its robot.toml."""

from dataclasses import replace
from pathlib import Path

from calib.errors import refuse
from testbed.gates.kinds import kind_of_name
from testbed.robots.catalog import ROBOT_FILE, load_robot
from testbed.robots.describe.xml_gate import FileOptions
from testbed.robots.file_frames import toml_words
from testbed.robots.write.folder import write_robot_folder


def of_description(
    path: Path | None, options: FileOptions, out: Path | None
) -> tuple[Path, tuple[str, ...]] | None:
    """Write the robot that a URDF or MJCF describes into a folder, and give its robot.toml.

    The folder is `out`, or that of a robot.toml so called; it has the name of the robot if none is
    given. With sentences on frames that differ from those of that file; the notes of the new one
    have them, too. None where the file is no URDF or MJCF.

    Raises
    ------
    InputError
        S37: options that only a URDF or MJCF has, of another file; as `load_robot`; C40: files of
        these names are there already, or `out` is called as another file.
    """
    if path is None or kind_of_name(path) != "description":
        if options != FileOptions():
            raise refuse(
                "options", code="S37", message="a tip and meshes are asked of a URDF or MJCF alone",
                fix="leave them out", where="" if path is None else str(path),
            )  # fmt: skip
        return None
    robot = load_robot(
        path, tip=options.tip, mesh_root=options.mesh_root,
        allow_missing_meshes=options.allow_missing_meshes,
    )  # fmt: skip
    folder = Path(robot.name) if out is None else out
    if folder.name == ROBOT_FILE:
        folder = folder.parent
    elif folder.suffix.lower() == ".toml":
        raise refuse(
            "--out", code="C40", where=str(folder), fix="name one",
            message=f"of a URDF or MJCF a folder is written, with its {ROBOT_FILE}",
        )  # fmt: skip
    frames = toml_words(robot)
    write_robot_folder(replace(robot, notes=(*robot.notes, *frames)), folder)
    return folder / ROBOT_FILE, frames
