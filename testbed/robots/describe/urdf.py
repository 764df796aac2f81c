"""The URDF of any serial arm, read by yourdfpy: joint axes, bodies, shapes and poses."""

import io
from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import partial, reduce
from pathlib import Path
from typing import Any

import numpy as np

from calib.arrays import Array
from calib.errors import refuse
from calib.geometry.chain import JointKind
from testbed.names import some
from testbed.robots.describe.description import (
    Body,
    Description,
    Shape,
    check_count,
    choose_tip,
    shapes_of,
)
from testbed.robots.describe.urdf_checks import check_urdf, mesh_files
from testbed.robots.describe.urdf_mimic import how_to_follow
from testbed.robots.describe.urdf_shapes import form_of
from testbed.robots.describe.xml_gate import FileOptions, parse_xml, xml_bytes
from testbed.robots.foreign import foreign
from testbed.robots.parts import Form
from testbed.robots.room import LEANS
from testbed.robots.shapes import GRAY
from testbed.robots.source import UrdfText

UNIT = 1e-6
"""An axis that is longer or shorter than 1 by more than this is noted."""


def describe_urdf(path: Path, options: FileOptions) -> Description:
    """The arm in a URDF from its root link to the tip; fixed joints are merged.

    What moves with joints that are not on the way to the tip is left out and listed in the notes.

    Raises
    ------
    InputError
        R1 to R7 and R11 to R17: file and line, what it has, what was expected.
    """
    from lxml import etree

    root = parse_xml(data := xml_bytes(path), "robot", where=str(path))
    notes = check_urdf(root, path, options)
    with foreign("yourdfpy", where=str(path)):
        model = load_urdf(etree.tostring(root))
    above = {joint.child: joint for joint in model.robot.joints}
    tree = _from_the_root(model.robot)
    tip, choice = choose_tip(options.tip, _ends(model, tree), model.link_map, path)
    notes += [choice] if choice else []
    way = way_to(above, tip)
    moving = [joint for joint in way if _moves(joint, way, path)]
    check_count(len(moving), tip, path)
    for joint in moving:
        length = float(np.linalg.norm(joint.axis))
        if abs(length - 1) > UNIT:
            notes.append(f"the axis of joint {joint.name} has length {length:.4g}; 1 is taken")
        joint.axis = np.asarray(joint.axis, dtype=np.float64) / length
    poses = _poses_at_zero(model, tree)
    places = [poses[joint.child] for joint in moving]
    groups, left_out = _groups(model, tree, moving, way)
    if left_out:
        notes.append(f"not on the way to {tip} and left out: {some(left_out)}")
    folder = options.folder(path)
    names = ["base", *(joint.name for joint in moving)]
    some_collide = any(link.collisions for link in model.robot.links)
    colors = {material.name: material.color for material in model.robot.materials or ()}
    bodies = tuple(
        _body(name, [model.link_map[link] for link in links], poses, folder, some_collide, colors)
        for name, links in zip(names, groups, strict=True)
    )
    kinds: list[JointKind] = [
        "prismatic" if joint.type == "prismatic" else "revolute" for joint in moving
    ]
    return Description(
        name=str(model.robot.name or ""),
        path=path,
        folder=folder,
        reader="yourdfpy",
        joint_names=tuple(str(joint.name) for joint in moving),
        kinds=tuple(kinds),
        points=np.array([T[:3, 3] for T in places]),
        axes=np.array([T[:3, :3] @ joint.axis for T, joint in zip(places, moving, strict=True)]),
        T_world_tip=poses[tip],
        limits=np.array([_limits(joint) for joint in moving]),
        speeds=np.array([_speed(joint) for joint in moving]),
        bodies=bodies,
        poses=partial(_poses, way, path),
        notes=tuple(notes),
        stands=bool(poses[moving[0].parent][2, 2] > LEANS),
        own_text=UrdfText(path, data, tip),
    )


def _poses(way: Sequence[Any], path: Path, q: Array) -> Array:
    """`urdf_poses` of a file of somebody else."""
    with foreign("yourdfpy", where=str(path)):
        return urdf_poses(way, q)


def load_urdf(data: bytes) -> Any:
    """The bytes of a checked URDF as a `yourdfpy.URDF` without meshes and without a scene."""
    from yourdfpy import URDF

    return URDF.load(
        io.BytesIO(data), build_scene_graph=False, load_meshes=False, filename_handler=str
    )


def urdf_poses(way: Sequence[Any], q: Array) -> Array:
    """Poses (m, 4, 4) of the last link at q (m, n) as yourdfpy finds them [m].

    `way` are the joints from the root link to the tip (`way_to`); nothing else takes part.
    """
    from yourdfpy import URDF
    from yourdfpy import urdf as y

    links = [y.Link(name=way[0].parent), *(y.Link(name=joint.child) for joint in way)]
    arm = URDF(
        robot=y.Robot(name="arm", links=links, joints=list(way)),
        build_scene_graph=True,
        load_meshes=False,
    )
    fixed = {
        joint.child: arm.get_transform(joint.child, joint.parent)
        for joint in way
        if joint.type == "fixed"
    }
    out = np.empty((len(q), 4, 4))
    for k, row in enumerate(q):
        arm.update_cfg(row)
        # one by one: a whole path takes trimesh the cube of its length
        steps = (
            fixed[joint.child] if joint.type == "fixed"
            else arm.get_transform(joint.child, joint.parent)
            for joint in way
        )  # fmt: skip
        out[k] = reduce(np.matmul, steps)
    return out


def way_to(above: Mapping[str, Any], tip: str) -> list[Any]:
    """Joints from the root link to the link `tip`, given the joint above each link."""
    joints = []
    while tip in above:
        joints.append(above[tip])
        tip = above[tip].parent
    return joints[::-1]


def _from_the_root(robot: Any) -> list[Any]:
    """All joints, each after the one above it."""
    below: dict[str, list[Any]] = defaultdict(list)
    for joint in robot.joints:
        below[joint.parent].append(joint)
    children = {joint.child for joint in robot.joints}
    (top,) = (link.name for link in robot.links if link.name not in children)
    tree = list(below[top])
    for joint in tree:  # which grows meanwhile
        tree += below[joint.child]
    return tree


def _ends(model: Any, tree: Sequence[Any]) -> list[str]:
    """Links without children; those that no joint moves only if there are no others."""
    parents = {joint.parent for joint in tree}
    ends = [link.name for link in model.robot.links if link.name not in parents]
    moved: set[str] = set()
    for joint in tree:
        if joint.type != "fixed" or joint.parent in moved:
            moved.add(joint.child)
    return [end for end in ends if end in moved] or ends


def _moves(joint: Any, way: Sequence[Any], path: Path) -> bool:
    """Whether a joint on the way moves; one that cannot be calibrated alone is refused."""
    if joint.type == "fixed":
        return False
    if joint.mimic is not None or joint.type not in ("revolute", "continuous", "prismatic"):
        kind = f"a mimic joint of {joint.mimic.joint}" if joint.mimic is not None else joint.type
        allowed = "joints must be revolute, continuous, prismatic or fixed, and move independently"
        message = f"joint {joint.name} is {kind}"
        fix = how_to_follow(joint, way) if joint.mimic is not None else ""
        raise refuse(
            "type", joint.type, allowed, code="R16", message=message, fix=fix, where=str(path)
        )
    return True


def _poses_at_zero(model: Any, tree: Sequence[Any]) -> dict[str, Array]:
    """Pose (4, 4) of every link in the root link, all joints at zero [m]."""
    poses: dict[str, Array] = defaultdict(lambda: np.eye(4))
    for joint in tree:
        T = poses[joint.parent]
        poses[joint.child] = T if joint.origin is None else T @ joint.origin
    return {link.name: poses[link.name] for link in model.robot.links}


def _groups(
    model: Any, tree: Sequence[Any], moving: Sequence[Any], way: Sequence[Any]
) -> tuple[list[list[str]], list[str]]:
    """Links that move together, base first, and the links other joints move."""
    on_the_way = {joint.name for joint in way}
    number = {joint.name: i + 1 for i, joint in enumerate(moving)}
    group: dict[str, int] = defaultdict(int)
    """Of every link; -1 where another joint moves it."""
    for joint in tree:
        apart = joint.type != "fixed" and joint.name not in on_the_way
        above = group[joint.parent]
        group[joint.child] = -1 if apart or above < 0 else number.get(joint.name, above)
    groups: list[list[str]] = [[] for _ in range(len(moving) + 1)]
    left_out: list[str] = []
    for link in model.robot.links:
        (left_out if group[link.name] < 0 else groups[group[link.name]]).append(link.name)
    return groups, left_out


def _limits(joint: Any) -> tuple[float, float]:
    """Lower and upper limit [rad or m]; a limit left out is 0 in URDF."""
    if joint.type == "continuous":
        return -np.inf, np.inf
    return joint.limit.lower or 0.0, joint.limit.upper or 0.0


def _speed(joint: Any) -> float:
    """Largest speed [rad/s or m/s]."""
    return float(joint.limit.velocity) if joint.limit and joint.limit.velocity else np.inf


def _body(
    name: str,
    links: Sequence[Any],
    poses: dict[str, Array],
    folder: Path,
    some_collide: bool,
    colors: dict[str, Any],
) -> Body:
    """Links fixed to each other as one body, in the root link at joint zero.

    Unless `some_collide` in the file, what is drawn does.
    """
    mass, moment, center = 0.0, np.zeros((3, 3)), np.zeros(3)
    shapes, unread = list[Shape](), False
    parts = []
    for link in links:
        own = link.inertial
        if own is not None and own.mass:
            T = poses[link.name] if own.origin is None else poses[link.name] @ own.origin
            inertia = np.zeros((3, 3)) if own.inertia is None else own.inertia
            parts.append((float(own.mass), T[:3, 3], T[:3, :3] @ inertia @ T[:3, :3].T))
        drawn, solid = (
            [_shape(part, poses[link.name], folder, colors) for part in some or ()]
            for some in (link.visuals, link.collisions)
        )
        found, lacking = shapes_of(drawn, solid if some_collide else drawn)
        shapes, unread = shapes + found, unread or lacking
    if parts:
        mass = sum(m for m, _, _ in parts)
        center = np.asarray(sum(m * p for m, p, _ in parts)) / mass
        for m, p, inertia in parts:  # parallel axes
            away = p - center
            moment = moment + inertia + m * (away @ away * np.eye(3) - np.outer(away, away))
    return Body(name, mass, center, moment, tuple(shapes), unread)


def _shape(part: Any, T: Array, folder: Path, colors: dict[str, Any]) -> Shape | None:
    """A mesh file or a plain shape at its place; None if it cannot be read or is missing."""
    source: Path | Form | None
    shape, own = part.geometry, np.eye(4)
    if shape.mesh is not None:
        candidates = mesh_files(shape.mesh.filename, folder)
        source = next((file for file in candidates if file.is_file()), None)
        scale = 1.0 if shape.mesh.scale is None else shape.mesh.scale
        own = np.diag([*np.broadcast_to(scale, 3), 1.0])
    else:
        source = form_of(part)
    if source is None:
        return None
    affine = (T if part.origin is None else T @ part.origin) @ own
    material = getattr(part, "material", None)
    color = None if material is None else material.color or colors.get(material.name)
    red, green, blue = GRAY if color is None else np.clip(color.rgba[:3], 0, 1)
    return Shape(source, affine, (float(red), float(green), float(blue)), collides=False)
