"""The URDF of a robot's owner with corrected joint origins, and nothing else in it changed.

Only numbers of `<origin>` of joints between the root link and the tip are written anew, in the text
itself: names, meshes, limits, comments and line ends stay byte for byte.
"""

from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from calib.arrays import Array
from calib.geometry.chain import Chain
from testbed.robots.describe.urdf import load_urdf, urdf_poses, way_to
from testbed.robots.describe.xml_gate import parse_xml
from testbed.robots.placements import rpy
from testbed.robots.source import UrdfText
from testbed.robots.write.own.places import (
    SAME,
    CorrectedFile,
    Place,
    identified_places,
    is_same,
    largest_move,
    proven,
)
from testbed.robots.write.own.text import XmlText, content, numbers, require_rest
from testbed.units import counted


class JointOrigin(NamedTuple):
    """Frames (4, 4) of a joint in its parent link [m]."""

    old: Array
    new: Array


def corrected_urdf(source: UrdfText, nominal: Chain, chain: Chain, limits: Array) -> CorrectedFile:
    """The file of a robot with the origins of a chain.

    Parameters
    ----------
    source : UrdfText
        The file.
    nominal, chain : Chain
        The robot as it is described there and as it was identified, their world its root link.
    limits : (n, 2) array
        Of its joints, over which the new file is compared with it [rad, m].

    Raises
    ------
    NotCorrectableError
        Its text cannot be taken apart.
    RuntimeError
        The new file has other poses, or more than origins changed: a defect of this program.
    """
    joints = _way(source.data, source)
    way = [_place(joint) for joint in joints]
    found, left = identified_places(way, nominal, chain)
    new = {
        place.name: JointOrigin(place.own, T)
        for place, T in zip(way, found, strict=True)
        if not is_same(place.own, T)
    }
    data = with_origins(source.data, new, where=source.path.name)
    name = f"the corrected {source.path.name}"
    require_rest(name, _rest(source.data, set(new)), _rest(data, set(new)))
    poses = partial(urdf_poses, _way(data, source))
    return CorrectedFile(
        data=data,
        root=joints[0].parent,
        changed=tuple(new),
        what=f"the origins of {counted(len(new), 'joint')}",
        moved=largest_move([*new.values()]),
        agreement=proven(name, poses, chain, left, limits),
        last=way[-1].name if way[-1].axis is not None else "",
        left=largest_move([(np.eye(4), left)]),
    )


def _way(data: bytes, source: UrdfText) -> list[Any]:
    """Joints from the root link to the tip as yourdfpy reads them, their axes unit vectors."""
    from lxml import etree

    root = parse_xml(data, "robot", where=str(source.path))
    for part in list(root):
        if part.tag not in ("link", "joint"):
            root.remove(part)
        elif part.tag == "link":  # what is drawn or weighs plays no part
            for own in list(part):
                part.remove(own)
    robot = load_urdf(etree.tostring(root)).robot
    way = way_to({joint.child: joint for joint in robot.joints}, source.tip)
    for joint in way:
        if joint.type != "fixed":
            joint.axis = np.asarray(joint.axis, dtype=np.float64) / np.linalg.norm(joint.axis)
    return way


def _place(joint: Any) -> Place:
    """The frame of a joint in its parent link; its axis runs through the origin."""
    own = np.eye(4) if joint.origin is None else np.asarray(joint.origin, dtype=np.float64)
    return Place(joint.name, own, None if joint.type == "fixed" else joint.axis)


def with_origins(data: bytes, origins: Mapping[str, JointOrigin], *, where: str) -> bytes:
    """A URDF with the origins of some joints replaced.

    Parameters
    ----------
    data : bytes
        A checked URDF in any encoding.
    origins : mapping
        By the names of joints. Where only the place of an origin changes, its angles stay as they
        are written, and the other way round.
    where : str
        Name of the file in errors.

    Raises
    ------
    NotCorrectableError
        Its text cannot be taken apart.
    """
    text = XmlText.of(data, "robot", where=where)
    for joint in text.root.findall("joint"):
        origin = origins.get(joint.get("name"))
        if origin is None:
            continue
        own = joint.find("origin")
        new = _attributes(origin, "0 0 0" if own is None else own.get("rpy", "0 0 0"))
        if own is None:
            text.insert(joint, "origin", new)
        else:
            text.write(own, new)
    return text.changed()


def _attributes(origin: JointOrigin, angles: str) -> dict[str, str]:
    """Text of what changes of an origin whose roll, pitch and yaw were written as `angles`."""
    (old, new), found = origin, dict[str, str]()
    if np.abs(new[:3, 3] - old[:3, 3]).max() > SAME:
        found["xyz"] = numbers(new[:3, 3])
    if np.abs(new[:3, :3] - old[:3, :3]).max() > SAME:
        roll, pitch, yaw = map(float, angles.split())
        found["rpy"] = numbers(np.array(near_rpy(new, (roll, pitch, yaw))))
    return found


def near_rpy(T: Array, other: tuple[float, float, float]) -> tuple[float, float, float]:
    """Of all roll, pitch and yaw of a frame (4, 4) those nearest to others [rad].

    Near a half turn they so keep their signs.
    """
    roll, pitch, yaw = rpy(T)
    known = np.array(other)
    found = []
    for angles in ((roll, pitch, yaw), (roll + np.pi, np.pi - pitch, yaw + np.pi)):
        near = angles + 2 * np.pi * np.round((known - angles) / (2 * np.pi))
        found.append((float(np.abs(near - known).max()), near.tolist()))
    r, p, y = min(found)[1]
    return r, p, y


def _rest(data: bytes, joints: set[str]) -> Iterator[tuple[Any, ...]]:
    """Tag, attributes and text of every element but the origins of some joints."""
    root = parse_xml(data, "robot", where="")
    own = {joint.find("origin") for joint in root.findall("joint") if joint.get("name") in joints}
    return (content(one) for one in root.iter() if one not in own)
