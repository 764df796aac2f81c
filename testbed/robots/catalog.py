"""Loading of robots: a model folder becomes a `Robot`, frozen and in SI units."""

from functools import partial
from pathlib import Path
from types import MappingProxyType

import numpy as np

from calib.arrays import Array, frozen
from calib.errors import refuse
from calib.geometry.chain import Chain
from calib.geometry.joint_errors import JointErrors, JointTerm
from calib.geometry.model import RobotModel
from testbed import assets
from testbed.assets import robot_names as robot_names
from testbed.gates.kinds import kind_of_name, wrong_kind
from testbed.gates.paths import near, real
from testbed.gates.toml import read_toml
from testbed.names import choice_of, name_meant
from testbed.robots.assumed import (
    SLIDE_SCATTER,
    SLIDE_SPEED,
    TURN_SCATTER,
    TURN_SPEED,
    assumed,
    assumed_sources,
    bodies,
)
from testbed.robots.controller import AS_THE_ARM
from testbed.robots.file import Drawn, Frame, ReflectorEntry, RobotFile, TrackerFile, WorkspaceBox
from testbed.robots.links import PrismaticLink, RevoluteLink, link_row
from testbed.robots.meshes.files import check_files
from testbed.robots.placements import frame_of
from testbed.robots.robot import Reflector
from testbed.robots.robot import Robot as Robot
from testbed.robots.robot import Visual as Visual
from testbed.robots.robot import Workspace as Workspace
from testbed.robots.robot import body_name as body_name
from testbed.robots.room import beyond_rail
from testbed.robots.shapes import primitive
from testbed.robots.tolerances import tolerances_of, usual_tolerances

ROBOT_FILE, TRACKER_FILE = "robot.toml", "tracker.toml"
TRACKER = "laser_tracker"


def load_robot(
    name_or_path: str | Path,
    *,
    tip: str | None = None,
    mesh_root: Path | None = None,
    allow_missing_meshes: bool = False,
) -> Robot:
    """Load a shipped robot by name, or any robot from its robot.toml or folder, URDF or MJCF.

    URDF and MJCF are converted to a chain; the poses of the chain are compared with those that
    yourdfpy or MuJoCo computes, and defaults for missing numbers are listed in `notes`.

    Parameters
    ----------
    name_or_path : str or Path
        Name of a shipped robot, or a path.
    tip : str, optional
        URDF and MJCF: the link, body or site where the arm ends; the only end by default.
    mesh_root : Path, optional
        URDF and MJCF: the folder that holds all meshes; that of the file by default.
    allow_missing_meshes : bool
        URDF and MJCF: whether a mesh may be missing, or a URDF's of no use (its format, its size);
        it is then listed in `notes`.

    Raises
    ------
    InputError
        If there is no such robot, or its file has a mistake; names the key and the likely fix.

    Examples
    --------
    >>> load_robot("staubli_tx60").model.chain.n_joints
    6
    """
    path = _robot_path(name_or_path)
    if kind_of_name(path) == "description":
        from testbed.robots.describe.convert import read_description
        from testbed.robots.describe.xml_gate import FileOptions

        return read_description(path, FileOptions(tip, mesh_root, allow_missing_meshes))
    if tip is not None:
        allowed, fix = "a robot.toml says itself where its tool is", "leave the tip out"
        raise refuse("tip", tip, allowed, code="S37", fix=fix, where=str(path))
    if mesh_root is not None:
        allowed, fix = "the meshes of a robot.toml lie beside it", "leave the mesh root out"
        raise refuse("mesh root", mesh_root, allowed, code="S37", fix=fix, where=str(path))
    data = read_toml(path, RobotFile, "robot")
    chain = robot_chain(data)
    model = RobotModel(chain, joint_errors(path, data))
    _check_free_sets(path, data, model.names)
    ranges = np.array([_in_si(joint) for joint in data.joints])
    masses, centers, inertias = bodies(data.joints, chain)
    colors = {name: (r, g, b) for name, (r, g, b) in data.colors.items()}
    return Robot(
        name=data.name,
        title=data.title or data.name,
        folder=path.parent,
        model=model,
        limits=frozen(ranges[:, :2]),
        speeds=frozen(ranges[:, 2]),
        masses=frozen(masses),
        centers=frozen(centers),
        inertias=frozen(inertias),
        repeatability=frozen(ranges[:, 3]),
        visuals=visuals(path, data),
        base_offset=_floor(data, chain, ranges[:, :2]),
        exclusions=tuple((body_name(a), body_name(b)) for a, b in data.never_collide),
        free_sets=MappingProxyType(dict(data.free_sets)),
        sources=MappingProxyType(assumed_sources(data.joints) | dict(data.sources)),
        workspace=_workspace(data.workspace),
        reflectors=tuple(_reflector(entry) for entry in data.reflectors),
        notes=(*data.notes, *assumed(data.joints)),
        tolerances=None
        if data.tolerances is None
        else frozen(tolerances_of(data.tolerances, usual_tolerances(chain.n_joints))),
        controller=AS_THE_ARM
        if data.controller is None
        else data.controller.controller(chain.kinds),
        primitives=tuple(primitive(entry, colors) for entry in data.shapes),
        mounting_height=None if data.mounting_height_mm is None else data.mounting_height_mm / 1e3,
    )


def robot_chain(data: RobotFile) -> Chain:
    """Nominal chain of a robot file [m, rad]."""
    return Chain(
        links=frozen([link_row(joint) for joint in data.joints]),
        kinds=tuple(j.kind for j in data.joints),
        T_world_base=_transform(data.base),
        T_flange_tool=_transform(data.tool),
    )


def _floor(data: RobotFile, chain: Chain, limits: Array) -> float:
    """Height of the floor in the base frame [m]; beyond the reach of an arm on a rail."""
    if data.floor_mm is None:
        return beyond_rail(chain, limits) or 0.0
    return data.floor_mm / 1e3


def joint_errors(path: Path, data: RobotFile) -> JointErrors:
    """Joint terms and springs of a robot file with their numbers [rad or m; kg or kg m]."""
    terms, coefficients = [], []
    for entry in data.joint_terms:
        terms.append(
            JointTerm(
                entry.name, entry.joint - 1, entry.wave, entry.weights, entry.reference, entry.share
            )
        )
        if entry.coefficient_per_k is not None:
            coefficients.append(entry.coefficient_per_k)
            continue
        kind = data.joints[entry.joint - 1].kind
        if entry.coefficient_deg is not None:
            coefficients.append(float(np.radians(entry.coefficient_deg)))
            unit, wanted = "deg", "mm"
        else:
            coefficients.append((entry.coefficient_mm or 0.0) / 1e3)
            unit, wanted = "mm", "deg"
        if (unit == "deg") != (kind == "revolute"):
            raise refuse(
                f"joint_terms.{entry.name}", code="S37", where=str(path),
                message=f"[joint_terms] {entry.name}: coefficient_{unit} of a {kind} joint",
                fix=f"write coefficient_{wanted}",
            )  # fmt: skip
    own = JointErrors(tuple(terms), np.array(coefficients))
    return own if data.springs is None else own.joined(data.springs.joint_errors(robot_chain(data)))


def load_tracker_visuals() -> tuple[Visual, ...]:
    """Parts of the tracker, origin where its beam axes meet, z up, beam along x [m].

    Link 0 stands on the floor, link 1 turns about z (azimuth), link 2 also about y (elevation,
    upward negative). The stand is as long as `beam_height_mm` in tracker.toml states.
    """
    path = assets.models() / TRACKER / TRACKER_FILE
    return visuals(path, read_toml(path, TrackerFile, "tracker"))


def visuals(path: Path, data: Drawn) -> tuple[Visual, ...]:
    """Parts of a model file `path`; each mesh must be there, inside the model's folder."""
    folder = path.parent.resolve()
    out = []
    for part in data.parts:
        file = path.parent / part.file
        problem = partial(refuse, f"parts.{part.name}.file", part.file, where=str(path))
        found = real(file, field=f"part {part.name}: mesh", where=str(path))
        if not found.is_relative_to(folder):
            message = f"part {part.name}: {part.file} leads out of the model's folder"
            raise problem(f"files below {folder}", code="R6", message=message)
        if not file.is_file():
            fix = "copy the meshes along with the file, or take its [[parts]] out"
            if data.drawing:
                fix = f"python -m testbed.robots.write.generate {data.name}"
            raise problem(code="R7", message=f"part {part.name}: no mesh {part.file}", fix=fix)
        check_files(file)
        red, green, blue = data.colors[part.color]
        rgb, rest = (red, green, blue), (part.collides, part.link, part.name)
        out.append(Visual(rgb, *rest, drawn=part.drawn, file=file))
    return tuple(out)


def _robot_path(name_or_path: str | Path) -> Path:
    """Path of the robot.toml meant by a name, a folder or a file."""
    shipped = assets.models() / str(name_or_path) / ROBOT_FILE
    if str(name_or_path) in robot_names():
        return shipped
    real(name_or_path, field="robot", code="S37")
    path = Path(name_or_path)
    if path.is_dir() and (path / ROBOT_FILE).is_file():
        return path / ROBOT_FILE
    if path.is_file():
        if kind_of_name(path) == "table":
            raise wrong_kind("table", "robot", str(path))
        return path
    raise refuse(
        "robot", str(name_or_path),
        "a shipped name, or the path of a robot.toml, a URDF or an MJCF", code="S37",
        message=f'there is no robot "{name_or_path}"',
        fix=_robot_meant(path),
    )  # fmt: skip


def _robot_meant(path: Path) -> str:
    """Suggestion for a misspelled name or path of a robot."""
    if path.suffix or len(path.parts) > 1:
        return near(path)
    return name_meant(str(path), robot_names()) or f"there is {', '.join(robot_names())}"


def _workspace(data: WorkspaceBox | None) -> Workspace | None:
    """The workspace a robot file states."""
    if data is None:
        return None
    (cx, cy, cz), (sx, sy, sz), (x, y, z) = data.box_center_mm, data.box_size_mm, data.station_mm
    ranges = tuple((low, high) for low, high in data.joint_ranges_deg)
    return Workspace((cx, cy, cz), (sx, sy, sz), (x, y, z), ranges)


def _reflector(entry: ReflectorEntry) -> Reflector:
    """A reflector of a robot file [m]."""
    x, y, z = entry.position_mm
    return Reflector(entry.name, (x / 1e3, y / 1e3, z / 1e3))


def _transform(frame: Frame) -> Array:
    """The frame as (4, 4) [m]."""
    return frame_of(frame.position_mm, frame.rotation_vector_deg)


def _in_si(joint: RevoluteLink | PrismaticLink) -> tuple[float, float, float, float]:
    """Lower limit, upper limit, speed and repeatability of a joint [rad or m]."""
    turns = isinstance(joint, RevoluteLink)
    speed = (TURN_SPEED if turns else SLIDE_SPEED) if joint.speed is None else joint.speed
    scatter = (TURN_SCATTER if turns else SLIDE_SCATTER) if joint.scatter is None else joint.scatter
    if isinstance(joint, RevoluteLink):
        lower, upper = np.radians([joint.lower_deg, joint.upper_deg])
        return float(lower), float(upper), speed, scatter
    return joint.lower_mm / 1e3, joint.upper_mm / 1e3, speed, scatter


def _check_free_sets(path: Path, data: RobotFile, known: tuple[str, ...]) -> None:
    """Every name in a free set is a parameter of this chain, once."""
    for title, names in data.free_sets.items():
        for name in names:
            if name not in known or names.count(name) > 1:
                problem = "there twice" if name in known else "not a parameter"
                raise refuse(
                    f"free_sets.{title}", name, code="S37", where=str(path),
                    message=f'[free_sets] {title}: "{name}" is {problem}',
                    fix="" if name in known else choice_of(name, known),
                )  # fmt: skip
