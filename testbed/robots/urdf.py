"""URDF out and in, through yourdfpy: a robot as URDF, and any serial arm's URDF as a chain."""

import io
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from calib.arrays import Array, frozen
from calib.errors import InputError
from calib.geometry.chain import Chain, JointKind
from calib.geometry.frames import slide
from testbed.robots.axes import chain_from_axes
from testbed.robots.catalog import Robot, Visual
from testbed.robots.placements import placements, tidy
from testbed.robots.strict_toml import did_you_mean
from testbed.robots.urdf_checks import check_urdf
from testbed.robots.xml_gate import read_xml

NO_EFFORT_LIMIT = 1000.0
"""URDF wants an effort limit [N m or N]; ours is not known."""


@dataclass(frozen=True, slots=True, eq=False)
class UrdfArm:
    """A serial arm found in a URDF."""

    chain: Chain
    """Its geometry, from the root link to the tip [m, rad]."""
    joint_names: tuple[str, ...]
    """(n,) names of the moving joints, base to tip."""
    limits: Array
    """(n, 2) joint limits; -inf, inf for a continuous joint [rad or m]."""
    speeds: Array
    """(n,) largest joint speeds, inf where not given [rad/s or m/s]."""
    notes: tuple[str, ...]
    """What is legal but odd, in sentences."""


def write_urdf(robot: Robot, path: Path) -> None:
    """Write the nominal robot as URDF, every digit kept, mesh paths relative to its folder.

    Links: world, base, link_1 ... link_n with the body frames of `placements`, flange, tool0.
    """
    from yourdfpy import urdf as y

    out = y.Robot(name=robot.name)
    palette: dict[tuple[float, float, float], Any] = {}
    chain = robot.model.chain
    # the link base carries T_world_base, so joint 1 only keeps its own turn
    frames, flange, _ = placements(replace(chain, T_world_base=np.eye(4)))
    out.links.append(y.Link(name="world"))
    _add_fixed(out, "world", "base", chain.T_world_base)
    for i, frame in enumerate(frames):
        lower, upper = robot.limits[i]
        out.links.append(y.Link(name=_link_name(i + 1), inertial=_inertial(robot, i)))
        out.joints.append(
            y.Joint(
                name=f"joint_{i + 1}",
                type=chain.kinds[i],
                parent=_link_name(i),
                child=_link_name(i + 1),
                origin=frame,
                axis=np.array([0.0, 0.0, 1.0]),
                limit=y.Limit(NO_EFFORT_LIMIT, robot.speeds[i], lower, upper),
            )
        )
    by_name = {link.name: link for link in out.links}
    for visual in robot.visuals:
        _add_part(by_name[_link_name(visual.link)], visual, robot.folder, palette)
    out.materials = list(palette.values())
    _add_fixed(out, _link_name(chain.n_joints), "flange", flange)
    _add_fixed(out, "flange", "tool0", tidy(chain.T_flange_tool))
    document = y.URDF(
        robot=out, build_scene_graph=False, load_meshes=False, filename_handler=str
    ).write_xml()
    text = io.BytesIO()
    document.write(text, xml_declaration=True, encoding="UTF-8", pretty_print=True)
    path.write_bytes(text.getvalue())


def read_urdf_chain(path: str | Path, *, tip: str = "tool0") -> Chain:
    """Chain of the serial arm from the root link to `tip`; see `read_urdf`."""
    return read_urdf(path, tip=tip).chain


def read_urdf(
    path: str | Path,
    *,
    tip: str = "tool0",
    mesh_root: Path | None = None,
    allow_missing_meshes: bool = False,
) -> UrdfArm:
    """Read the serial arm that ends at link `tip`: any axes, revolute or prismatic.

    The link numbers are a choice (the gauge); poses are not: they equal the URDF's.

    Raises
    ------
    InputError
        R1 to R7 and R11 to R17: file and line, what was found, what was expected.
    """
    from yourdfpy import URDF

    path = Path(path)
    root = read_xml(path, "robot")
    notes = check_urdf(root, path, mesh_root=mesh_root, allow_missing_meshes=allow_missing_meshes)
    model = URDF.load(
        io.BytesIO(path.read_bytes()),
        build_scene_graph=False,
        load_meshes=False,
        filename_handler=str,
    )
    T = np.eye(4)
    moving, points, axes = [], [], []
    for joint in _path_to(model, tip, path):
        T = T if joint.origin is None else T @ joint.origin
        if joint.type == "fixed":
            continue
        if joint.mimic is not None or joint.type not in ("revolute", "continuous", "prismatic"):
            kind = "a mimic joint" if joint.mimic is not None else joint.type
            raise InputError(
                f"joint {joint.name} is {kind}",
                code="R16",
                where=str(path),
                field="type",
                value=joint.type,
                allowed="revolute, continuous, prismatic or fixed, each moving on its own",
            )
        moving.append(joint)
        points.append(T[:3, 3])
        axes.append(T[:3, :3] @ (joint.axis / np.linalg.norm(joint.axis)))
    if not moving:
        raise InputError(
            f"no joint moves {tip}", code="R16", where=str(path), field="tip", value=tip
        )
    kinds: list[JointKind] = [
        "prismatic" if joint.type == "prismatic" else "revolute" for joint in moving
    ]
    return UrdfArm(
        chain=chain_from_axes(np.array(points), np.array(axes), kinds, T),
        joint_names=tuple(joint.name for joint in moving),
        limits=frozen([_limits(joint) for joint in moving]),
        speeds=frozen([_speed(joint) for joint in moving]),
        notes=tuple(notes),
    )


def _path_to(model: Any, tip: str, path: Path) -> list[Any]:
    """Joints from the root link to the link `tip`."""
    if tip not in model.link_map:
        raise InputError(
            f'there is no link "{tip}"',
            code="R16",
            where=str(path),
            field="tip",
            value=tip,
            fix=did_you_mean(tip, model.link_map),
        )
    above = {joint.child: joint for joint in model.robot.joints}
    joints = []
    while tip in above:
        joints.append(above[tip])
        tip = above[tip].parent
    return joints[::-1]


def _limits(joint: Any) -> tuple[float, float]:
    """Lower and upper limit [rad or m]; a limit left out is 0 in URDF."""
    if joint.type == "continuous":
        return -np.inf, np.inf
    return joint.limit.lower or 0.0, joint.limit.upper or 0.0


def _speed(joint: Any) -> float:
    """Largest speed [rad/s or m/s]."""
    return float(joint.limit.velocity) if joint.limit and joint.limit.velocity else np.inf


def _link_name(link: int) -> str:
    """Name of a body in the URDF."""
    return f"link_{link}" if link else "base"


def _add_fixed(out: Any, parent: str, child: str, T: Array) -> None:
    """A link fixed to another."""
    from yourdfpy import urdf as y

    out.links.append(y.Link(name=child))
    out.joints.append(
        y.Joint(name=f"{parent}_{child}", type="fixed", parent=parent, child=child, origin=T)
    )


def _inertial(robot: Robot, i: int) -> Any:
    """Mass, center and inertia of moving body i, 0-based."""
    from yourdfpy import urdf as y

    return y.Inertial(
        origin=slide(*robot.centers[i]), mass=robot.masses[i], inertia=np.diag(robot.inertias[i])
    )


def _add_part(link: Any, visual: Visual, folder: Path, palette: dict[Any, Any]) -> None:
    """A drawn part, and its mesh again as collision shape if it collides."""
    from yourdfpy import urdf as y

    color = "color_" + "".join(f"{round(255 * x):02x}" for x in visual.rgb)
    material = palette.setdefault(
        visual.rgb, y.Material(name=color, color=y.Color(rgba=np.array([*visual.rgb, 1.0])))
    )
    shape = y.Geometry(mesh=y.Mesh(filename=visual.file.relative_to(folder).as_posix()))
    link.visuals.append(
        y.Visual(name=visual.name, origin=np.eye(4), geometry=shape, material=material)
    )
    if visual.collides:
        link.collisions.append(y.Collision(name=visual.name, origin=np.eye(4), geometry=shape))
