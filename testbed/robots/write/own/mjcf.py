"""The MJCF of a robot's owner with corrected places of its bodies, and nothing else in it changed.

Only `pos` and `quat` of bodies between the world and the tip are written anew, and of the site that
is the tip, in the text itself: names, classes, meshes, limits, comments and line ends stay byte for
byte. Joints keep their places and axes in their bodies.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from calib.arrays import Array
from calib.errors import InputError
from calib.geometry.chain import Chain
from calib.geometry.frames import exp_so3, inverse, slide, transform
from testbed.robots.describe.mjcf import compiled
from testbed.robots.describe.mjcf_gate import PATHS, Gated, whole
from testbed.robots.describe.xml_gate import SOURCE, parse_xml
from testbed.robots.placements import quaternion_wxyz
from testbed.robots.source import MjcfText
from testbed.robots.write.mjcf import (
    called,
    frames_of,
    joints_to,
    kind_of,
    mjcf_poses,
    stated_frame,
)
from testbed.robots.write.own.places import (
    SAME,
    CorrectedFile,
    NotCorrectableError,
    Place,
    identified_places,
    is_same,
    largest_move,
    proven,
)
from testbed.robots.write.own.text import XmlText, content, numbers, require_rest
from testbed.units import counted, listed

TURNS = frozenset({"quat", "axisangle", "xyaxes", "zaxis", "euler"})
"""Attributes by which an element may state how it is turned; it has one of them."""
PLACED = TURNS | {"pos"}
KINEMATIC = ("body", "joint", "site", "frame")
"""Elements of the world on which the place of a tool depends."""
BODY, SITE = "body", "site"


@dataclass(frozen=True, slots=True, eq=False)
class _Way:
    """The bodies from the world to the tip, and a site at its end, as MuJoCo reads them."""

    model: Any
    """`mujoco.MjModel` of the kinematics alone."""
    joints: list[int]
    """The joints of the arm in it."""
    tip: tuple[int, int]
    """Body and site, as in `frames_of`."""
    places: list[Place]
    elements: list[Any]
    """(k) elements of the places in the tree with all included files."""


class _NewPlace(NamedTuple):
    """A place that changes, its element, and its new frame (4, 4) [m]."""

    place: Place
    element: Any
    T: Array


def corrected_mjcf(
    source: MjcfText, nominal: Chain, chain: Chain, limits: Array
) -> CorrectedFile:  # fmt: skip
    """The file of a robot with the links of a chain.

    Parameters
    ----------
    source : MjcfText
        The file.
    nominal, chain : Chain
        The robot as it is described there and as it was identified, both in its world.
    limits : (n, 2) array
        Of its joints, over which the new file is compared with it [rad, m].

    Raises
    ------
    NotCorrectableError
        Its text cannot be taken apart, or numbers of the arm do not stand in it as those of bodies.
    RuntimeError
        The new file has other poses, or more than places changed: a defect of this program.
    """
    tree = _read(source, source.data)
    way = _way(tree, source)
    found, left = identified_places(way.places, nominal, chain)
    moved = [
        _NewPlace(place, element, T)
        for place, element, T in zip(way.places, way.elements, found, strict=True)
        if not is_same(place.own, T)
    ]
    data, name = _rewritten(source, tree, moved), f"the corrected {source.path.name}"
    again = _way(_read(source, data), source)
    poses = partial(mjcf_poses, again.model, again.joints, again.tip)
    last = way.places[-1]
    return CorrectedFile(
        data=data,
        root="world",
        changed=tuple(place.name for place, *_ in moved),
        what=_what(moved),
        moved=largest_move([(place.own, T) for place, _, T in moved]),
        agreement=proven(name, poses, chain, left, limits),
        last="" if last.axis is None else called(way.model, "joint", way.joints[-1]),
        left=largest_move([(np.eye(4), left)]),
    )


def _read(source: MjcfText, data: bytes) -> Any:
    """The tree of a content of the file, whose included files may be gone by now."""
    try:
        return whole(source.path, source.folder, data)
    except InputError as error:
        raise NotCorrectableError(f"it cannot be read again: {error.message}") from error


def _rewritten(source: MjcfText, tree: Any, moved: Sequence[_NewPlace]) -> bytes:
    """The file with new places of some elements of its tree."""
    for place, element, _ in moved:
        _require_stands_here(place.name, element, tree)
    text = XmlText.of(source.data, "mujoco", where=source.path.name)
    own = [one for one in tree.iter("*") if one.get(SOURCE) is None]
    outside = (one for one in text.root.iter() if next(one.iterancestors("include"), None) is None)
    written = [one for one in outside if one.tag != "include"]
    changed = [written[own.index(element)] for _, element, _ in moved]
    for element, (place, _, T) in zip(changed, moved, strict=True):
        new, gone = _attributes(place.own, T)
        text.write(element, new, without=gone)
    data = text.changed()
    numbered = {k for k, one in enumerate(text.root.iter()) if one in changed}
    rests = (_rest(each, numbered) for each in (source.data, data))
    require_rest(f"the corrected {source.path.name}", *rests)
    return data


def _what(moved: Sequence[_NewPlace]) -> str:
    """What is changed, in words."""
    sites = sum(element.tag == SITE for _, element, _ in moved)
    parts = [counted(len(moved) - sites, BODY)] * (len(moved) > sites)
    return f"the places of {listed([*parts, *[counted(sites, SITE)] * bool(sites)])}"


def _way(tree: Any, source: MjcfText) -> _Way:
    """The way to the tip in a tree, whose unnamed bodies get the names that `called` has."""
    from copy import deepcopy

    for k, body in enumerate(tree.iter(BODY), start=1):  # in the order of MuJoCo's numbers
        if not body.get("name"):
            body.set("name", f"#{k}")
    try:
        model = compiled(Gated(_bare(deepcopy(tree))), source.path)
    except InputError as error:
        raise NotCorrectableError(f"its bodies alone are no model: {error.message}") from error
    body, site = tip = frames_of(model)[source.tip]
    bodies, at = list[int](), body
    while at:
        bodies.insert(0, at)
        at = int(model.body_parentid[at])
    places = [_place(model, at) for at in bodies]
    named = {one.get("name"): one for one in tree.iter(BODY)}
    elements = [named[place.name] for place in places]
    if site >= 0:
        places.append(Place(source.tip, stated_frame(model, (body, site))))
        elements += [one for one in tree.iter(SITE) if one.get("name") == source.tip]
    return _Way(model, joints_to(model, body), tip, places, elements)


def _bare(tree: Any) -> Any:
    """A tree without what plays no part in where a tool is: only its bodies, with a weight."""
    for section in list(tree):
        if section.tag not in ("compiler", "default", "worldbody"):
            tree.remove(section)
    for compiler in tree.iter("compiler"):
        for key in (*PATHS, "inertiafromgeom", "balanceinertia", "boundmass", "boundinertia"):
            compiler.attrib.pop(key, None)
        for part in list(compiler):
            compiler.remove(part)
    kept = {"worldbody": KINEMATIC, "default": ("default", *KINEMATIC)}
    for section in tree.iter("worldbody", "default"):
        for part in list(section.iter("*")):
            parent = part.getparent()
            if part.tag not in (section.tag, *kept[section.tag]) and parent is not None:
                parent.remove(part)
    for site in tree.iter(SITE):
        site.attrib.pop("material", None)
    for body in tree.iter(BODY):
        weight = body.makeelement("inertial", pos="0 0 0", mass="1", diaginertia="1 1 1")
        body.insert(0, weight)
    return tree


def _place(model: Any, body: int) -> Place:
    """A body in its parent, and where the axis of its joint runs in it."""
    name, own = model.body(body).name, stated_frame(model, (body, -1))
    first, many = int(model.body_jntadr[body]), int(model.body_jntnum[body])
    if not many:
        return Place(name, own)
    if many > 1:
        raise NotCorrectableError(f"body {name} has {many} joints, whose axes stand in it")
    axis, point = model.jnt_axis[first].copy(), slide(*model.jnt_pos[first])
    # the file has the body where its joint is at `ref`
    ref = float(model.qpos0[model.jnt_qposadr[first]])
    slides = kind_of(model, first) == "prismatic"
    away = slide(*(-ref * axis)) if slides else transform(exp_so3(-ref * axis), np.zeros(3))
    return Place(name, own, axis, point @ away, inverse(point))


def _require_stands_here(name: str, element: Any, tree: Any) -> None:
    """Refuse what other elements or files have a part in."""
    if (file := element.get(SOURCE)) is not None:
        other = Path(file).name
        raise NotCorrectableError(
            f"{element.tag} {name} stands in {other}: pass that file instead if it is a model of "
            "its own, or write what it has in the place of its <include>"
        )
    if element.getparent().tag == "frame":
        raise NotCorrectableError(f"{element.tag} {name} stands in a <frame>, which moves it too")
    if element.tag != SITE:
        return
    by_class = {
        key for one in _classes(element, tree) for each in one.findall(SITE) for key in each.attrib
    }
    if "fromto" in by_class | {*element.attrib}:
        raise NotCorrectableError(f"site {name} is placed by fromto, which is its length as well")
    if by_class & TURNS:
        raise NotCorrectableError(f"a class turns its sites, of which {name} is one")


def _classes(element: Any, tree: Any) -> Iterator[Any]:
    """The <default> elements whose attributes an element of the world has."""
    around = (one.get("childclass") for one in element.iterancestors())
    own = element.get("class") or next(filter(None, around), None)
    for one in tree.iter("default"):
        inside = [each.get("class") for each in one.iter("default")]
        if own in inside or one.getparent().tag != "default":
            yield one


def _attributes(own: Array, new: Array) -> tuple[dict[str, str], frozenset[str]]:
    """Text of what changes of a place, and the attributes that it replaces."""
    found, gone = dict[str, str](), frozenset[str]()
    if np.abs(new[:3, 3] - own[:3, 3]).max() > SAME:
        found["pos"] = numbers(new[:3, 3])
    if np.abs(new[:3, :3] - own[:3, :3]).max() > SAME:
        found["quat"], gone = numbers(quaternion_wxyz(new[:3, :3])), TURNS
    return found, gone


def _rest(data: bytes, changed: set[int]) -> Iterator[tuple[Any, ...]]:
    """Tag, attributes and text of every element, without the places of some, by their numbers."""
    root = parse_xml(data, "mujoco", where="")
    return (
        content(one, PLACED if k in changed else frozenset()) for k, one in enumerate(root.iter())
    )
