"""A robot as robot.toml: every number so that reading it back gives the same bits, or the next."""

from typing import Any

import numpy as np

from calib.arrays import Array
from calib.errors import one_line
from calib.geometry.frames import transform_step
from calib.geometry.joint_errors import JointTerm
from testbed.robots.coupled import controller_table
from testbed.robots.robot import Robot, Workspace
from testbed.robots.shapes import shapes_table
from testbed.robots.springs import springs_table
from testbed.robots.units import Unit, degrees, millimeters, millionths
from testbed.toml_text import toml_lines, toml_value


def robot_toml(robot: Robot, *, comment: str = "") -> str:
    """The robot as the text of a robot.toml, its meshes where they lie below its folder.

    Angles and lengths come back with the same bits or one unit in the last place away, because the
    file has degrees and millimeters; base and tool through their rotation vectors to some 1e-16.
    """
    chain, errors = robot.model.chain, robot.model.joint_errors
    head = {
        "format": 1,
        "name": _text(robot.name),
        "title": _text(robot.title),
        "floor_mm": millimeters(robot.base_offset),
        "mounting_height_mm": None
        if robot.mounting_height is None
        else millimeters(robot.mounting_height),
        "never_collide": [[_number(a), _number(b)] for a, b in robot.exclusions],
    }
    both = zip(errors.terms, errors.coefficients, strict=False)
    terms = [_term(term, value, (*chain.kinds, "lengths")[term.joint]) for term, value in both]
    counted = controller_table(robot.controller, chain.kinds)
    model = {
        "sources": {key: _text(source) for key, source in robot.sources.items()},
        "base": _frame(chain.T_world_base),
        "tool": _frame(chain.T_flange_tool),
        **({"workspace": _workspace(robot.workspace)} if robot.workspace else {}),
        "joints": [_joint(robot, i) for i in range(chain.n_joints)],
        **({} if counted is None else {"controller": counted}),
        "tolerances": _tolerances(robot),
        "joint_terms": terms or None,
        **({} if (springs := springs_table(errors)) is None else {"springs": springs}),
        "reflectors": [
            {"name": one.name, "position_mm": [millimeters(x) for x in one.place]}
            for one in robot.reflectors
        ]
        or None,
    }
    lines = [f"# {one_line(line)}" for line in comment.split("\n")] if comment else []
    lines += toml_lines(head)
    if robot.notes:
        notes = (f"    {toml_value(_text(note))}," for note in robot.notes)
        lines += ["notes = [", *notes, "]"]
    lines += toml_lines(model)
    if robot.free_sets:
        lines += toml_lines({"free_sets": {key: list(v) for key, v in robot.free_sets.items()}})
    return "\n".join(lines + toml_lines(_parts(robot))) + "\n"


def _frame(T: Array) -> dict[str, Any]:
    """A fixed frame (4, 4)."""
    step = transform_step(T)
    return {
        "position_mm": [millimeters(x) for x in step[:3]],
        "rotation_vector_deg": [degrees(x) for x in step[3:]],
    }


def _tolerances(robot: Robot) -> dict[str, Any] | None:
    """[tolerances], joint by joint; None where the robot states none."""
    if robot.tolerances is None:
        return None
    sizes = robot.tolerances[:, [1, 0]]
    joints = [
        {"joint": k + 1, "length_mm": millimeters(length), "angle_deg": degrees(angle)}
        for k, (length, angle) in enumerate(sizes.tolist())
    ]
    return {"joints": joints}


def _workspace(box: Workspace) -> dict[str, Any]:
    """[workspace], with the ranges of the joints where it states them."""
    numbers = {key: np.array(getattr(box, key)) for key in box.__slots__}
    return {key: values.astype(float).tolist() for key, values in numbers.items() if values.size}


def _joint(robot: Robot, i: int) -> dict[str, Any]:
    """One of [[joints]]."""
    chain = robot.model.chain
    theta, d, a, alpha, beta = chain.links[i]
    slides = chain.kinds[i] == "prismatic"
    unit, own, fine = ("mm", millimeters, "um") if slides else ("deg", degrees, "urad")
    return {
        "kind": chain.kinds[i],
        "theta_deg": degrees(theta),
        "d_mm": millimeters(d),
        "a_mm": millimeters(a),
        "alpha_deg": degrees(alpha),
        "beta_deg": degrees(beta),
        f"lower_{unit}": own(robot.limits[i, 0]),
        f"upper_{unit}": own(robot.limits[i, 1]),
        f"max_speed_{unit}_s": own(robot.speeds[i]),
        f"repeatability_{fine}": millionths(robot.repeatability[i]),
        "mass_kg": float(robot.masses[i]),
        "center_mm": [millimeters(x) for x in robot.centers[i]],
        "inertia_kg_m2": robot.inertias[i].tolist(),
    }


UNITS: dict[str, tuple[str, Unit]] = {
    "prismatic": ("mm", millimeters), "revolute": ("deg", degrees), "lengths": ("per_k", float)
}  # fmt: skip


def _term(term: JointTerm, value: float, kind: str) -> dict[str, Any]:
    """One of [[joint_terms]]."""
    unit, own = UNITS[kind]
    return {
        "name": _text(term.name),
        "joint": term.joint + 1,
        "wave": term.wave,
        "weights": list(term.weights),
        **({} if term.is_wave or not term.reference else {"reference": float(term.reference)}),
        **({} if term.share == 1.0 else {"share": float(term.share)}),
        f"coefficient_{unit}": own(value),
    }


def _parts(robot: Robot) -> dict[str, Any]:
    """[colors], [[parts]] and [[shapes]]."""
    used = dict.fromkeys(part.rgb for part in robot.parts)
    names = {rgb: f"color{k}" for k, rgb in enumerate(used, 1)}
    parts = [
        {
            "name": _text(visual.name),
            "link": visual.link,
            "file": _text(visual.file.relative_to(robot.folder).as_posix()),
            "color": names[visual.rgb],
            "collides": visual.collides,
            **({} if visual.drawn else {"drawn": False}),
        }
        for visual in robot.visuals
    ]
    shapes = shapes_table(robot.primitives, names)
    colors = {"colors": {name: [float(x) for x in rgb] for rgb, name in names.items()}}
    lists = {"parts": parts or None, "shapes": shapes or None}
    return {**colors, **lists} if names else {}


def _text(text: str) -> str:
    """A text without what cannot be printed."""
    return "".join(c for c in text if c.isprintable())


def _number(body: str) -> int:
    """Number of a body from its name; see `body_name`."""
    return 0 if body == "base" else int(body.removeprefix("link"))
