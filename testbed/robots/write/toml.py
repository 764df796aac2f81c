"""A robot as robot.toml: every number so that reading it back gives the same bits, or the next."""

import json
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from calib.arrays import Array
from calib.geometry.frames import transform_step
from testbed.robots.robot import Robot, Visual

Unit = Callable[[float], float]


def degrees(value: float) -> float:
    """What `numpy.radians` of it gives back an angle [rad to deg]."""
    return _inverted(float(np.degrees(value)), value, lambda x: float(np.radians(x)))


def millimeters(value: float) -> float:
    """What a thousandth of it gives back a length [m to mm]."""
    return _inverted(value * 1e3, value, lambda x: x / 1e3)


def millionths(value: float) -> float:
    """What 1e-6 times it gives back a value."""
    return _inverted(value * 1e6, value, lambda x: x * 1e-6)


def _inverted(guess: float, value: float, read: Unit) -> float:
    """The shortest decimal number that is read as `value`, or else the nearest neighbor.

    A unit's factor maps some neighbors onto one and leaves gaps of one unit in the last place.
    """
    guess, value = float(guess), float(value)
    for digits in range(1, 17):
        short = float(f"{guess:.{digits}g}")
        if read(short) == value:
            return short + 0.0
    near = [guess]
    for direction in (-np.inf, np.inf):
        one = guess
        for _ in range(2):
            one = float(np.nextafter(one, direction))
            near.append(one)
    return min(near, key=lambda x: abs(read(x) - value))


def robot_toml(robot: Robot, *, comment: str = "") -> str:
    """The robot as the text of a robot.toml, its meshes where they lie below its folder.

    Angles and lengths come back with the same bits or one unit in the last place away, because the
    file has degrees and millimeters; base and tool through their rotation vectors to some 1e-16.
    """
    lines = [f"# {line}" for line in comment.splitlines()]
    lines += [
        "format = 1",
        f"name = {_text(robot.name)}",
        f"title = {_text(robot.title)}",
        f"floor_mm = {millimeters(robot.base_offset)!r}",
        f"never_collide = {[[_number(a), _number(b)] for a, b in robot.exclusions]}",
    ]
    if robot.notes:
        lines += ["notes = [", *(f"    {_text(note)}," for note in robot.notes), "]"]
    lines += ["", "[sources]", *(f"{_key(k)} = {_text(v)}" for k, v in robot.sources.items())]
    chain = robot.model.chain
    for name, T in (("base", chain.T_world_base), ("tool", chain.T_flange_tool)):
        step = transform_step(T)
        lines += [
            "",
            f"[{name}]",
            f"position_mm = {[millimeters(x) for x in step[:3]]}",
            f"rotation_vector_deg = {[degrees(x) for x in step[3:]]}",
        ]
    if robot.workspace is not None:
        lines += ["", "[workspace]"]
        for key in ("box_center_mm", "box_size_mm", "station_mm"):
            lines.append(f"{key} = {[float(x) for x in getattr(robot.workspace, key)]}")
        if robot.workspace.joint_ranges_deg:
            ranges = [[float(x) for x in pair] for pair in robot.workspace.joint_ranges_deg]
            lines.append(f"joint_ranges_deg = {ranges}")
    for i in range(chain.n_joints):
        lines += ["", "[[joints]]", *_joint(robot, i)]
    for term, coefficient in zip(
        robot.model.joint_errors.terms, robot.model.joint_errors.coefficients, strict=True
    ):
        slides = chain.kinds[term.joint] == "prismatic"
        value = millimeters(coefficient) if slides else degrees(coefficient)
        lines += [
            "",
            "[[joint_terms]]",
            f"name = {_text(term.name)}",
            f"joint = {term.joint + 1}",
            f"wave = {_text(term.wave)}",
            f"weights = {[int(weight) for weight in term.weights]}",
            f"coefficient_{'mm' if slides else 'deg'} = {value!r}",
        ]
    if robot.free_sets:
        lines += ["", "[free_sets]"]
        lines += [f"{_key(k)} = [{', '.join(map(_text, v))}]" for k, v in robot.free_sets.items()]
    lines += _parts(robot.visuals, robot.folder)
    return "\n".join(lines) + "\n"


def _joint(robot: Robot, i: int) -> Iterable[str]:
    """The lines of one [[joints]]."""
    chain = robot.model.chain
    theta, d, a, alpha, beta = chain.links[i]
    slides = chain.kinds[i] == "prismatic"
    unit, own = ("mm", millimeters) if slides else ("deg", degrees)
    scatter = "repeatability_um" if slides else "repeatability_urad"
    lower, upper = robot.limits[i]
    yield f"kind = {_text(chain.kinds[i])}"
    yield f"theta_deg = {degrees(theta)!r}"
    yield f"d_mm = {millimeters(d)!r}"
    yield f"a_mm = {millimeters(a)!r}"
    yield f"alpha_deg = {degrees(alpha)!r}"
    yield f"beta_deg = {degrees(beta)!r}"
    yield f"lower_{unit} = {own(float(lower))!r}"
    yield f"upper_{unit} = {own(float(upper))!r}"
    yield f"max_speed_{unit}_s = {own(float(robot.speeds[i]))!r}"
    yield f"{scatter} = {millionths(float(robot.repeatability[i]))!r}"
    yield f"mass_kg = {float(robot.masses[i])!r}"
    yield f"center_mm = {[millimeters(x) for x in robot.centers[i]]}"
    yield f"inertia_kg_m2 = {_floats(robot.inertias[i])}"


def _parts(visuals: tuple[Visual, ...], folder: Path) -> list[str]:
    """[colors] and [[parts]]."""
    palette: dict[tuple[float, float, float], str] = {}
    for visual in visuals:
        palette.setdefault(visual.rgb, f"color{len(palette) + 1}")
    lines = ["", "[colors]"] if palette else []
    lines += [f"{name} = {[float(x) for x in rgb]}" for rgb, name in palette.items()]
    for visual in visuals:
        lines += [
            "",
            "[[parts]]",
            f"name = {_text(visual.name)}",
            f"link = {visual.link}",
            f"file = {_text(visual.file.relative_to(folder).as_posix())}",
            f"color = {_text(palette[visual.rgb])}",
            f"collides = {str(visual.collides).lower()}",
        ]
    return lines


def _floats(values: Array) -> list[float]:
    """A row of numbers."""
    return [float(x) for x in values]


def _text(text: str) -> str:
    """A TOML basic string; the escapes of JSON are valid in TOML."""
    return json.dumps("".join(c for c in text if c.isprintable()), ensure_ascii=False)


def _key(text: str) -> str:
    """A TOML key."""
    return text if text.replace("_", "").isalnum() and text.isascii() else _text(text)


def _number(body: str) -> int:
    """Number of a body from its name; see `body_name`."""
    return 0 if body == "base" else int(body.removeprefix("link"))
