"""A robot as URDF, through yourdfpy; `describe.urdf` is the way back."""

import io
import re
from dataclasses import replace
from typing import Any

import numpy as np

from calib.arrays import Array
from calib.errors import refuse
from calib.geometry.frames import slide
from testbed.robots.parts import Primitive, Visual
from testbed.robots.placements import placements, rpy, tidy
from testbed.robots.robot import Robot, reflector_frames

NO_EFFORT_LIMIT = 1000.0
"""URDF wants an effort limit [N m or N]; ours is not known."""
FOR_MUJOCO = '\n  <mujoco><compiler discardvisual="false" fusestatic="false" {}/></mujoco>'
"""Its compiler drops visuals, fixed links and the folders of meshes unless asked to keep them."""
PACKAGE = re.compile(r"(?=..)[a-z][a-z0-9]*(_[a-z0-9]+)*")
"""Names that ROS takes for a package: REP 144, and no underscore at the end, as rosidl asks."""


def require_package(name: str) -> None:
    """Refuse what ROS would not take as the name of a package; C41."""
    if not PACKAGE.fullmatch(name):
        allowed = (
            "two or more small letters, digits and single underscores between them, a letter first"
        )
        message = f'ROS takes no package called "{name}"'
        raise refuse("--package", name, allowed, code="C41", message=message)


def urdf_bytes(
    robot: Robot, *, comment: str = "", for_mujoco: bool = False, package: str | None = None
) -> bytes:
    """The geometry of a robot as URDF, every digit kept.

    Links: world, base, link_1 ... link_n with the body frames of `placements`, flange, and on
    it tool0 and the reflectors by their names.

    Parameters
    ----------
    robot : Robot
        To be written.
    comment : str
        Stands above it.
    for_mujoco : bool
        Whether it holds what MuJoCo needs to load it as it is: meshes in their folder, all links
        kept. Other readers skip that.
    package : str, optional
        ROS package whose root the robot's folder will be: mesh paths begin with package:// and its
        name. Without it they are relative to the folder. MuJoCo knows no packages and takes all
        meshes from the folder of the first one.
    """
    from yourdfpy import urdf as y

    out = y.Robot(name=robot.name)
    palette: dict[tuple[float, float, float], Any] = {}
    chain = robot.model.chain
    # the link base carries T_world_base, so joint 1 keeps only its turn
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
    # MuJoCo needs other names for what collides
    hull = "_hull" if for_mujoco else ""
    by_name = {link.name: link for link in out.links}
    for part in robot.parts:
        link = by_name[_link_name(part.link)]
        _add_part(link, part, _geometries(part, robot, package), palette, hull)
    out.materials = list(palette.values())
    _add_fixed(out, _link_name(chain.n_joints), "flange", flange)
    _add_fixed(out, "flange", "tool0", tidy(chain.T_flange_tool))
    for reflector, frame in zip(robot.reflectors, reflector_frames(robot), strict=True):
        # beside tool0, which stays the end of the arm for who looks for one
        _add_fixed(out, "flange", frame, tidy(chain.T_flange_tool @ slide(*reflector.place)))
    document = y.URDF(
        robot=out, build_scene_graph=False, load_meshes=False, filename_handler=str
    ).write_xml()
    for joint, element in zip(out.joints, document.getroot().iterfind("joint"), strict=True):
        # yourdfpy loses digits where a pitch is nearly a quarter turn
        element.find("origin").set("rpy", " ".join(map(str, rpy(joint.origin))))
    text = io.BytesIO()
    document.write(text, xml_declaration=True, encoding="UTF-8", pretty_print=True)
    if not (comment or for_mujoco):
        return text.getvalue()
    told = _mujoco_words(robot, package) if for_mujoco else b""
    said = f"<!-- {comment.replace('--', '-')} -->\n".encode() if comment else b""
    start, tag, rest = text.getvalue().partition(b"<robot ")
    name, close, parts = rest.partition(b">")
    return start + said + tag + name + close + told + parts


def _mujoco_words(robot: Robot, package: str | None) -> bytes:
    """What MuJoCo must be told about fixed links, visuals and where meshes lie."""
    where = 'strippath="false"'
    if package and robot.visuals:
        folder = robot.visuals[0].file.parent.relative_to(robot.folder).as_posix()
        where = f'strippath="true" meshdir="{folder}"'
    return FOR_MUJOCO.format(where).encode()


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


def _geometries(
    part: Visual | Primitive, robot: Robot, package: str | None
) -> list[tuple[str, Any, Array]]:
    """What a part is to URDF, which has no capsules: endings of names, shapes and their poses."""
    from yourdfpy import urdf as y

    if isinstance(part, Visual):
        file = part.file.relative_to(robot.folder).as_posix()
        path = f"package://{package}/{file}" if package else file
        return [("", y.Geometry(mesh=y.Mesh(filename=path)), np.eye(4))]
    (kind, (first, *rest)), T = part.form, np.array(part.affine)
    if kind == "box":
        return [("", y.Geometry(box=y.Box(size=np.array(part.form.size))), T)]
    if kind == "sphere":
        return [("", y.Geometry(sphere=y.Sphere(radius=first)), T)]
    rod = y.Geometry(cylinder=y.Cylinder(radius=first, length=rest[0]))
    ball = y.Geometry(sphere=y.Sphere(radius=first))
    ends = [
        (f"_end{k}", ball, T @ slide(0.0, 0.0, sign * rest[0] / 2))
        for k, sign in enumerate((-1, 1), 1)
    ]
    return [("", rod, T), *(ends if kind == "capsule" else [])]


def _add_part(
    link: Any,
    part: Visual | Primitive,
    geometries: list[tuple[str, Any, Array]],
    palette: dict[Any, Any],
    hull: str,
) -> None:
    """A part as what is drawn, and again as collision shape if it collides."""
    from yourdfpy import urdf as y

    color = "color_" + "".join(f"{round(255 * x):02x}" for x in part.rgb)
    material = palette.setdefault(
        part.rgb, y.Material(name=color, color=y.Color(rgba=np.array([*part.rgb, 1.0])))
    )
    for ending, shape, T in geometries:
        name = part.name + ending
        if part.drawn:
            link.visuals.append(y.Visual(name=name, origin=T, geometry=shape, material=material))
        if part.collides:
            link.collisions.append(y.Collision(name=name + hull, origin=T, geometry=shape))
