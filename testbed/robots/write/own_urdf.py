"""The URDF of a robot's owner with corrected joint origins, and nothing else in it changed.

Only numbers of `<origin>` of joints between the root link and the tip are written anew, in the text
itself: names, meshes, limits, comments and line ends stay byte for byte.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np

from calib.arrays import Array
from calib.geometry.chain import Chain, forward
from calib.geometry.frames import inverse
from testbed.robots.describe.urdf import load_urdf, urdf_poses, way_to
from testbed.robots.describe.xml_gate import parse_xml
from testbed.robots.placements import difference, proof_joints, require_agreement
from testbed.robots.source import UrdfText
from testbed.robots.write.nearest_frames import DescribedArm, nearest_frames
from testbed.robots.write.xml_text import JointOrigin, is_same, with_origins

PROOFS = 65
"""Poses at which the file is compared."""


@dataclass(frozen=True, slots=True, eq=False)
class CorrectedUrdf:
    """A URDF with the joint origins of an identified robot."""

    data: bytes
    """All of it."""
    root: str
    """Name of its root link."""
    changed: tuple[str, ...]
    """Joints whose origins differ from the file's, base to tip."""
    moved: tuple[float, float]
    """Largest shift [m] and largest turn [rad] of an origin, seen from the frame before it."""
    agreement: tuple[float, float]
    """How far its poses are from those of the robot, as yourdfpy reads it [m, rad]."""
    last: str
    """The last joint on the way to the tip, if it moves; else empty."""
    left: tuple[float, float]
    """Shift [m] and turn [rad] of the tip that no origin can take: only where the tip is a link
    that moves with its own joint, about whose axis nothing but a turn and a slide is free."""


def corrected_urdf(
    source: UrdfText, nominal: Chain, chain: Chain, limits: Array
) -> CorrectedUrdf | None:
    """The file of a robot with the origins of a chain; None if its text cannot be taken apart.

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
    RuntimeError
        The new file has other poses, or more than origins changed: a defect of this program.
    """
    way = _way(source.data, source)
    moving = [joint for joint in way if joint.type != "fixed"]
    frames = nearest_frames(_arm(way, moving), chain, nominal.T_flange_tool)
    tip = forward(chain, np.zeros((1, chain.n_joints)))[0]
    origins, left = _origins(way, frames, tip)
    new = {
        joint.name: JointOrigin(_origin(joint), T)
        for joint, T in zip(way, origins, strict=True)
        if not is_same(_origin(joint), T)
    }
    data = with_origins(source.data, new, where=source.path.name)
    if data is None:
        return None
    name = f"the corrected {source.path.name}"
    _require_rest(name, source.data, data, set(new))
    q = proof_joints(limits, PROOFS)
    found = difference(urdf_poses(_way(data, source), q), forward(chain, q) @ inverse(left))
    require_agreement(name, *found)
    steps = np.array([np.eye(4), *(inverse(one.old) @ one.new for one in new.values())])
    still = np.tile(np.eye(4), (len(steps), 1, 1))
    return CorrectedUrdf(
        data=data,
        root=way[0].parent,
        changed=tuple(new),
        moved=difference(steps, still),
        agreement=found,
        last=way[-1].name if way[-1] is moving[-1] else "",
        left=difference(left[None], still[:1]),
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


def _origin(joint: Any) -> Array:
    """Frame (4, 4) of a joint in its parent link [m]."""
    return np.eye(4) if joint.origin is None else np.asarray(joint.origin, dtype=np.float64)


def _product(frames: Sequence[Array]) -> Array:
    """Frames (k) of (4, 4), each in the one before, as one."""
    return reduce(np.matmul, frames, np.eye(4))


def _arm(way: Sequence[Any], moving: Sequence[Any]) -> DescribedArm:
    """Its frames as the file has them."""
    steps, since = [], list[Array]()
    for joint in way:
        since.append(_origin(joint))
        if joint.type != "fixed":
            steps.append(_product(since))
            since = []
    return DescribedArm(steps, [joint.axis for joint in moving], _product(since))


def _origins(way: Sequence[Any], frames: Array, tip: Array) -> tuple[list[Array], Array]:
    """New frame (4, 4) of each joint in its parent link, and what is left of the tip [m].

    Each moving joint takes what its link needs, the last fixed one before the tip what the tip
    needs; fixed joints before and between them stay.
    """
    before, since, k = np.eye(4), list[Array](), 0
    out = []
    for joint in way:
        if joint.type == "fixed":
            since.append(_origin(joint))
            out.append(since[-1])
            continue
        out.append(inverse(before @ _product(since)) @ frames[k])
        before, since, k = frames[k], [], k + 1
    if not since:
        return out, inverse(before) @ tip
    out[-1] = inverse(before @ _product(since[:-1])) @ tip
    return out, np.eye(4)


def _require_rest(name: str, old: bytes, new: bytes, joints: set[str]) -> None:
    """Raise a RuntimeError if elements differ in anything but the origins of some joints."""
    if _rest(old, joints) != _rest(new, joints):
        raise RuntimeError(f"{name} differs from the file in more than origins of joints")


def _rest(data: bytes, joints: set[str]) -> list[Any]:
    """Tag, attributes and text of every element but the origins of some joints."""
    root = parse_xml(data, "robot", where="")
    own = {joint.find("origin") for joint in root.findall("joint") if joint.get("name") in joints}
    return [
        (one.tag, dict(one.attrib), (one.text or "").strip())
        for one in root.iter()
        if one not in own
    ]
