"""The MJCF of any serial arm, read by MuJoCo: joint axes, bodies, shapes and poses."""

import logging
import re
from collections import defaultdict
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from calib.arrays import Array
from calib.errors import InputError, refuse
from calib.geometry.chain import JointKind
from calib.geometry.frames import inverse, transform
from testbed.bounds import SHAPE
from testbed.names import some
from testbed.robots.describe.description import (
    Body,
    Description,
    Shape,
    check_count,
    choose_tip,
    shapes_of,
)
from testbed.robots.describe.mjcf_alone import require_alone, taken
from testbed.robots.describe.mjcf_gate import Gated, gate
from testbed.robots.describe.xml_gate import SOURCE, FileOptions, angle_notes, place_of, xml_bytes
from testbed.robots.foreign import foreign
from testbed.robots.parts import Form
from testbed.robots.source import MjcfText
from testbed.robots.write.mjcf import (
    at_zero,
    called,
    frames_of,
    free_sites,
    joints_to,
    kind_of,
    mjcf_poses,
    pose_of,
)

HIDDEN = 3
"""Geoms of this group and above are not drawn unless a viewer is asked to."""
TAGS, LINE = re.compile(r">\s*<"), re.compile(r"line (\d+)")


def describe_mjcf(path: Path, options: FileOptions) -> Description:
    """The arm in an MJCF from the world to the body or site that is its tip.

    Bodies without joints are merged with their parents. What moves with joints that are not on the
    way to the tip is left out and listed in the notes.

    Raises
    ------
    InputError
        R1 to R19.
    """
    gated = gate(path, options, data := xml_bytes(path))
    notes = list(gated.notes)
    drives = taken(gated.root)
    model = compiled(gated, path)
    frames = frames_of(model)
    tip, choice = choose_tip(options.tip, _ends(model, frames), frames, path)
    notes += [choice] if choice else []
    joints = joints_to(model, frames[tip][0])
    check_count(len(joints), tip, path)
    require_alone(model, joints, drives, path)
    places = at_zero(model, joints)
    groups, left_out = _groups(model, joints)
    if left_out:
        notes.append(f"not on the way to {tip} and left out: {some(left_out)}")
    slides = [kind_of(model, joint) == "prismatic" for joint in joints]
    kinds: list[JointKind] = ["prismatic" if one else "revolute" for one in slides]
    limits = np.where(
        model.jnt_limited[joints].astype(bool)[:, None],
        model.jnt_range[joints],
        np.array([-np.inf, np.inf]),
    )
    notes += angle_notes(
        [
            float(np.abs(limit).max())
            for limit, one in zip(limits, slides, strict=True)
            if not one and np.isfinite(limit).all()
        ]
    )
    names = [called(model, "joint", joint) for joint in joints]
    bodies = tuple(
        _body(name, ids, model, places, gated)
        for name, ids in zip(["base", *names], groups, strict=True)
    )
    return Description(
        name=str(gated.root.get("model") or ""),
        path=path,
        folder=options.folder(path),
        reader="MuJoCo",
        joint_names=tuple(names),
        kinds=tuple(kinds),
        points=places.xanchor[joints].copy(),
        axes=places.xaxis[joints].copy(),
        T_world_tip=pose_of(places, frames[tip]),
        limits=limits,
        speeds=np.full(len(joints), np.inf),
        bodies=bodies,
        poses=partial(mjcf_poses, model, joints, frames[tip]),
        apart=_apart(drives["contact"], model, groups),
        notes=tuple(notes),
        own_text=MjcfText(path, data, tip, options.folder(path)),
    )


def _ends(model: Any, frames: dict[str, tuple[int, int]]) -> list[str]:
    """Sites of the bodies without children, or the bodies; only those that move, if any."""
    parents = set(model.body_parentid[1:].tolist())
    ends = [k for k in range(1, model.nbody) if k not in parents]
    ends = [k for k in ends if joints_to(model, k)] or ends
    sites: dict[int, list[str]] = defaultdict(list)
    for name, (body, site) in frames.items():
        if site >= 0:
            sites[body].append(name)
    return [name for k in ends for name in sites[k] or [called(model, "body", k)]]


def _groups(model: Any, joints: list[int]) -> tuple[list[list[int]], list[str]]:
    """Bodies that move together, base first, and the names of those that other joints move."""
    groups: list[list[int]] = [[0], *([] for _ in joints)]
    group, left_out = [0], []
    """How many of the joints move each body, -1 if others do too; parents come first."""
    for body in range(1, model.nbody):
        above = group[int(model.body_parentid[body])]
        first = int(model.body_jntadr[body])
        for joint in range(first, first + int(model.body_jntnum[body])):
            above = above + 1 if 0 <= above < len(joints) and joints[above] == joint else -1
        group.append(above)
        if above < 0:
            left_out.append(called(model, "body", body))
        else:
            groups[above].append(body)
    return groups, left_out


def _apart(
    contacts: Iterable[Any], model: Any, groups: list[list[int]]
) -> tuple[tuple[int, int], ...]:
    """Bodies that the file excludes from collision tests."""
    number = {
        model.body(body).name: i for i, bodies in enumerate(groups) for body in bodies if body
    }
    pairs = [(one.get("body1"), one.get("body2")) for one in contacts if one.tag == "exclude"]
    return tuple((number[a], number[b]) for a, b in pairs if a in number and b in number)


def _body(name: str, ids: list[int], model: Any, data: Any, gated: Gated) -> Body:
    """Bodies that move together as one, in the world at joint zero."""
    masses = model.body_mass[ids]
    mass = float(masses.sum())
    center, inertia = np.zeros(3), np.zeros((3, 3))
    if mass > 0:
        center = masses @ data.xipos[ids] / mass
        for body in ids:
            R, away = data.ximat[body].reshape(3, 3), data.xipos[body] - center
            inertia += (R * model.body_inertia[body]) @ R.T
            inertia += model.body_mass[body] * (away @ away * np.eye(3) - np.outer(away, away))
    geoms = np.flatnonzero(np.isin(model.geom_bodyid, ids)).tolist()
    found = {k: _shape(model, data, k, gated) for k in geoms if not _is_ground(model, k)}
    shown = [one for k, one in found.items() if model.geom_group[k] < HIDDEN]
    solid = [one for k, one in found.items() if model.geom_contype[k] or model.geom_conaffinity[k]]
    shapes, unread = shapes_of(shown if any(shown) else list(found.values()), solid)
    return Body(name, mass, center, inertia, tuple(shapes), unread)


def _is_ground(model: Any, geom: int) -> bool:
    """Whether a geom is a plane, which only the world has: no part of an arm."""
    import mujoco

    return bool(model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE)


def _is_file(model: Any, geom: int, gated: Gated) -> bool:
    """Whether a geom is a mesh that lies in a file."""
    import mujoco

    mesh = int(model.geom_dataid[geom])
    is_mesh = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH
    return bool(is_mesh and mesh >= 0 and model.mesh(mesh).name in gated.files)


def _shape(model: Any, data: Any, geom: int, gated: Gated) -> Shape | None:
    """A mesh file or a plain shape at its place; None of what is neither."""
    source: Path | Form | None
    affine = transform(data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom])
    if _is_file(model, geom, gated):
        name = model.mesh(int(model.geom_dataid[geom])).name
        source, affine = gated.files[name], affine @ _from_file(model, geom, gated, name)
    else:
        source = _form(model, geom)
    if source is None:
        return None
    own, material = model.geom_rgba[geom], int(model.geom_matid[geom])
    plain = np.allclose(own, [0.5, 0.5, 0.5, 1.0])
    color = model.mat_rgba[material] if material >= 0 and plain else own
    # MuJoCo keeps colors in single precision
    red, green, blue = np.clip(np.asarray(color[:3], dtype=np.float64), 0, 1).round(6)
    return Shape(source, affine, (float(red), float(green), float(blue)), collides=False)


def _form(model: Any, geom: int) -> Form | None:
    """A plain shape: MuJoCo has half edges and half lengths."""
    import mujoco

    kind, (a, b, c) = mujoco.mjtGeom(int(model.geom_type[geom])), model.geom_size[geom].tolist()
    forms = {
        mujoco.mjtGeom.mjGEOM_BOX: Form("box", (2 * a, 2 * b, 2 * c)),
        mujoco.mjtGeom.mjGEOM_CYLINDER: Form("cylinder", (a, 2 * b)),
        mujoco.mjtGeom.mjGEOM_CAPSULE: Form("capsule", (a, 2 * b)),
        mujoco.mjtGeom.mjGEOM_SPHERE: Form("sphere", (a,)),
    }
    form = forms.get(kind)
    return form if form is not None and min(form.size) >= SHAPE.least else None


def _from_file(model: Any, geom: int, gated: Gated, name: str) -> Array:
    """Places in a mesh's file to those of its geom: MuJoCo moves a mesh to its center."""
    import mujoco

    mesh = int(model.geom_dataid[geom])
    R = np.empty(9)
    mujoco.mju_quat2Mat(R, model.mesh_quat[mesh])
    T_mesh = transform(R.reshape(3, 3), model.mesh_pos[mesh])
    own = inverse(T_mesh) @ np.diag([*model.mesh_scale[mesh], 1.0])
    return np.asarray(own @ inverse(_reference(gated, name)))


def _reference(gated: Gated, name: str) -> Array:
    """Frame (4, 4) of its file in which a mesh is taken, before it is scaled; as a rule its own."""
    import mujoco

    mesh = next(mesh for mesh in gated.root.iter("mesh") if mesh.get("name") == name)
    place, turn = (
        np.array(mesh.get(key, plain).split(), dtype=np.float64)
        for key, plain in (("refpos", "0 0 0"), ("refquat", "1 0 0 0"))
    )
    R = np.empty(9)
    mujoco.mju_normalize4(turn)
    mujoco.mju_quat2Mat(R, turn)
    return transform(R.reshape(3, 3), place)


def compiled(gated: Gated, path: Path) -> Any:
    """The model, compiled by MuJoCo, which opens no file; its refusals in our form."""
    import mujoco
    from lxml import etree

    mujoco.set_mju_user_warning(logging.getLogger(__name__).info)
    places = [place_of(element, path) for element in gated.root.iter("*")]
    for element in gated.root.iter("*"):
        element.attrib.pop(SOURCE, None)
    etree.cleanup_namespaces(gated.root)
    # one tag a line, so that MuJoCo's lines can be told from each other
    text = TAGS.sub(">\n<", etree.tostring(gated.root, encoding="unicode"))
    assets = gated.assets()
    with foreign("MuJoCo", where=str(path), told=partial(_refusal, gated, path, places, text)):
        model = mujoco.MjSpec.from_string(text, assets=assets).compile()
    free_sites(model)
    return model


def _refusal(
    gated: Gated, path: Path, places: list[str], text: str, error: Exception
) -> InputError:
    """What MuJoCo says, with the file and the line of the user."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    said = "; ".join(line.rpartition("Error:")[2].strip() for line in lines[:2])
    told = LINE.search(said)
    above = text.split("\n")[: int(told[1])] if told else []
    tags = [line for line in above if line.startswith("<") and line[1:2] != "/"]
    where = places[len(tags) - 1] if tags else str(path)
    said = re.sub(r",? (id|line) \d+|; Element name ''", "", said).replace("Element", "element")
    said = said.replace("mjMINVAL", "1e-15")
    for name, file in zip(gated.asset_names(), gated.files.values(), strict=True):
        said = said.replace(f"'{name}'", file.name)
    code = "R15" if "repeated" in said or "already" in said else "R16"
    message, fix = f"MuJoCo refuses it: {said[:200]}", "check it with MuJoCo's own viewer"
    return refuse("file", code=code, message=message, fix=fix, where=where)
