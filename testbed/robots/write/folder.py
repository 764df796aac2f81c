"""A robot as a folder with robot.toml, URDF and MJCF, each read again and compared with it."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from calib.arrays import Array
from calib.errors import one_line, refuse
from calib.geometry.chain import forward
from calib.geometry.frames import slide
from calib.geometry.inverse import spread
from calib.geometry.operating import AS_USUAL, OperatingConditions, approaches
from testbed.disk import flush_file, flush_folder, passing_folder, write_error
from testbed.gates.paths import real
from testbed.robots.catalog import ROBOT_FILE, load_robot
from testbed.robots.describe.urdf import load_urdf, urdf_poses, way_to
from testbed.robots.meshes.files import Mesh, part_mesh
from testbed.robots.parts import IN_PLACE, Visual
from testbed.robots.placements import agreement, difference, proof_joints, require_agreement
from testbed.robots.robot import Robot, reflector_frames
from testbed.robots.write.identified import require_name
from testbed.robots.write.mjcf import frames_of, load_mjcf, mjcf_poses, mjcf_text
from testbed.robots.write.ros import ros_files
from testbed.robots.write.toml import robot_toml
from testbed.robots.write.urdf import require_package, urdf_bytes
from testbed.units import MM, counted

PROOFS, SAMPLES = 65, 1001
"""Poses at which a file is compared, and at which joint terms are evaluated; without mid-range."""
MESHES = "meshes"


def write_robot_folder(
    robot: Robot, folder: Path, *, overwrite: bool = False, package: str | None = None
) -> tuple[str, ...]:
    """Write robot.toml, NAME.urdf, NAME.xml, joint origins and meshes, each read again and proven.

    robot.toml has the full model with its joint terms; the other formats can only have its
    geometric part. Nothing appears in the folder before every file has been compared.

    Parameters
    ----------
    robot : Robot
        The robot to write.
    folder : Path
        Created if it does not exist; other files in it are not touched.
    overwrite : bool
        Whether files of these names may be replaced.
    package : str, optional
        ROS package whose root the folder will be, by which the URDF names its meshes.

    Returns
    -------
    tuple of str
        How well each file agrees with the robot, and what URDF and MJCF leave out; in words.

    Raises
    ------
    InputError
        C40: a file is there already, or nothing can be written there; C41: no name of a package.
    MachineError
        The disk is full.
    RuntimeError
        A file does not describe the robot that was written: a defect of this program.
    """
    require_name(robot.name)
    if package is not None:
        require_package(package)
    names = [ROBOT_FILE, f"{robot.name}.urdf", f"{robot.name}.xml"]
    names += [f"{MESHES}/{visual.name}.obj" for visual in robot.visuals]
    names += (ros := ros_files(robot))
    real(folder, field="folder", code="C40")
    _require_free(folder, names, overwrite=overwrite)
    try:
        with passing_folder(folder) as made:
            draft = _with_meshes(robot, made)
            words = _geometric_words(robot)
            (draft.folder / names[0]).write_text(
                robot_toml(draft, comment=_head(robot)), encoding="utf-8", newline="\n"
            )
            (draft.folder / names[1]).write_bytes(
                urdf_bytes(draft, comment=words, for_mujoco=True, package=package)
            )
            (draft.folder / names[2]).write_text(
                mjcf_text(draft, comment=words), encoding="utf-8", newline="\n"
            )
            for name, (text, _) in ros.items():
                (draft.folder / name).write_text(text, encoding="utf-8", newline="\n")
            found = _proven(robot, draft.folder, names)
            folder.mkdir(exist_ok=True)
            for name in reversed(names):  # robot.toml last: it makes the folder a model
                (folder / name).parent.mkdir(exist_ok=True)
                flush_file(draft.folder / name)
                (draft.folder / name).replace(folder / name)
            flush_folder(folder)
    except OSError as error:
        raise write_error(folder / ROBOT_FILE, error) from error
    told = tuple(
        agreement(name, position, rotation) for name, (position, rotation) in found.items()
    )
    told += tuple(proof for _, proof in ros.values())
    if not robot.controller.plain:
        told += (
            f"{names[1]} and {names[2]} have the joints of the arm; those of its controller "
            f"({', '.join(robot.controller.statements)}) are in {ROBOT_FILE} alone",
        )
    return (*told, words) if robot.model.joint_errors.names else told


def _require_free(folder: Path, names: list[str], *, overwrite: bool) -> None:
    """Refuse a folder that cannot be written, or has files of these names."""
    there = [name for name in names if (folder / name).exists()]
    problem = ""
    if folder.exists() and not folder.is_dir():
        problem = "is a file"
    elif there and not overwrite:
        problem = f"has {there[0]} already" + f" and {len(there) - 1} more" * (len(there) > 1)
    else:
        try:
            folder.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            problem = f"cannot be written: {error.strerror or error}"
    if problem:
        fix = "choose another folder"
        raise refuse("folder", code="C40", message=problem, fix=fix, where=str(folder))


def _with_meshes(robot: Robot, folder: Path) -> Robot:
    """The robot with its meshes in another folder, each an OBJ in the frame of its link."""
    visuals: list[Visual] = []
    if robot.visuals:
        (folder / MESHES).mkdir()
    for visual in robot.visuals:
        file = folder / MESHES / f"{visual.name}.obj"
        if visual.affine == IN_PLACE and visual.file.suffix.lower() == ".obj":
            file.write_bytes(visual.file.read_bytes())
        else:
            file.write_text(_obj(part_mesh(visual), visual.name), encoding="utf-8", newline="\n")
        visuals.append(replace(visual, file=file, affine=IN_PLACE))
    return replace(robot, folder=folder, visuals=tuple(visuals))


def _obj(mesh: Mesh, name: str) -> str:
    """A mesh as OBJ text [m]."""
    lines = [f"o {name}"]
    lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in mesh.vertices + 0.0]
    lines += [f"vn {x:.6f} {y:.6f} {z:.6f}" for x, y, z in mesh.normals + 0.0]
    lines += [f"f {a}//{a} {b}//{b} {c}//{c}" for a, b, c in mesh.faces + 1]
    return "\n".join(lines) + "\n"


def _head(robot: Robot) -> str:
    """First lines of robot.toml."""
    return (
        f"{one_line(robot.title)}\n"
        "All terms of the model; angles and lengths read back to the last bit or the one before."
    )


def _geometric_words(robot: Robot) -> str:
    """What URDF and MJCF hold, and what they cannot."""
    errors = robot.model.joint_errors
    parts = [counted(len(errors.terms), "joint term")] if errors.terms else []
    parts += [counted(len(errors.springs.load), "spring")] if errors.springs else []
    if not parts:
        return "Geometry only; this is the whole model."
    q = spread(robot.limits, SAMPLES)[1:]
    waves = {term.wave for term in errors.terms}
    at = OperatingConditions(approach=approaches(q)) if "approach" in waves else AS_USUAL
    full, part = robot.model.poses(q, at), forward(robot.model.chain, q)
    mean = waves & {"torque", "lengths"}
    usual = ", drives and warmth as on average in the measurements" if mean else ""
    away = np.linalg.norm(full[:, :3, 3] - part[:, :3, 3], axis=1)
    return (
        f"Geometry only: the {' and '.join(parts)} of robot.toml cannot be said in URDF or MJCF. "
        f"Without them the tool is up to {away.max() * MM:.3f} mm away from the full model, rms "
        f"{np.sqrt(np.mean(away**2)) * MM:.3f} mm over poses spread over the joint limits{usual}."
    )


def _with_targets(robot: Robot, T: Array) -> Array:
    """Tool poses (m, 4, 4), then those of every frame of a reflector on it [m]."""
    places = [np.eye(4), *(slide(*reflector.place) for reflector in robot.reflectors)]
    return np.concatenate([T @ place for place in places])


def _proven(robot: Robot, folder: Path, names: list[str]) -> dict[str, tuple[float, float]]:
    """Distance [m] and angle [rad] between the robot and each file as each reader reads it."""
    toml, urdf, xml = (folder / name for name in names[:3])
    read = load_robot(toml)
    q = proof_joints(robot.limits, PROOFS)
    geometry = _with_targets(robot, forward(robot.model.chain, q))
    targets = reflector_frames(robot)
    above = {joint.child: joint for joint in load_urdf(urdf.read_bytes()).robot.joints}
    joints = list(range(len(robot.limits)))
    found: dict[str, tuple[Array, Array]] = {
        toml.name: (
            _with_targets(read, read.model.poses(q)), _with_targets(robot, robot.model.poses(q))
        ),
        f"{urdf.name} (yourdfpy)": (
            np.concatenate([urdf_poses(way_to(above, tip), q) for tip in ("tool0", *targets)]),
            geometry,
        ),
    }  # fmt: skip
    for file, tool in ((urdf, "tool0"), (xml, "tool")):
        model = load_mjcf(file)
        tips = [frames_of(model)[tip] for tip in (tool, *targets)]
        poses = np.concatenate([mjcf_poses(model, joints, tip, q) for tip in tips])
        found[f"{file.name} (MuJoCo)"] = poses, geometry
    out = {name: difference(T, other) for name, (T, other) in found.items()}
    for name, (position, rotation) in out.items():
        require_agreement(name, position, rotation)
    return out
