"""The robots there are: a model folder becomes a `Robot`, frozen and in SI units."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np

from calib.arrays import Array, frozen
from calib.errors import InputError
from calib.geometry.chain import Chain, chain_names
from calib.geometry.frames import step_transform
from calib.geometry.model import RobotModel
from testbed import assets
from testbed.robots.robot_file import (
    Drawn,
    Frame,
    PrismaticLink,
    RevoluteLink,
    RobotFile,
    TrackerFile,
)
from testbed.robots.strict_toml import did_you_mean, read_toml

ROBOT_FILE, TRACKER_FILE = "robot.toml", "tracker.toml"
TRACKER = "laser_tracker"


@dataclass(frozen=True, slots=True)
class Visual:
    """One drawn part."""

    file: Path
    """Mesh in the frame of its link [m]."""
    rgb: tuple[float, float, float]
    """Color, 0 to 1."""
    collides: bool
    """Whether its convex hull takes part in collision tests."""
    link: int
    """Body it moves with, 0 = base ... n."""
    name: str
    """Name of the part."""


@dataclass(frozen=True, slots=True, eq=False)
class Robot:
    """A robot as its maker describes it."""

    name: str
    """Name of the model folder, e.g. ``staubli_tx60``."""
    title: str
    """Name for people."""
    folder: Path
    """Where its files lie."""
    model: RobotModel
    """Nominal model, no joint errors [m, rad]."""
    limits: Array
    """(n, 2) lower and upper joint limits [rad or m]."""
    speeds: Array
    """(n,) largest joint speeds [rad/s or m/s]."""
    masses: Array
    """(n,) masses of the moving bodies [kg]."""
    centers: Array
    """(n, 3) centers of mass in the body frames of `placements` [m]."""
    inertias: Array
    """(n, 3) principal moments about the centers, axes of the body frames [kg m^2]."""
    repeatability: Array
    """(n,) standard deviation of a joint's repeatability [rad or m]."""
    visuals: tuple[Visual, ...]
    """Parts to draw, the probe included."""
    base_offset: float
    """Height of the floor in the base frame [m]."""
    exclusions: tuple[tuple[str, str], ...]
    """Pairs of bodies (``base``, ``link1`` ...) that are never tested for collision."""
    free_sets: Mapping[str, tuple[str, ...]]
    """Named sets of parameter names a study may free."""
    sources: Mapping[str, str]
    """Where each group of numbers comes from."""


def robot_names() -> list[str]:
    """Names of the shipped robots, sorted."""
    return sorted(file.parent.name for file in assets.models().glob(f"*/{ROBOT_FILE}"))


def body_name(link: int) -> str:
    """Name of a body in MuJoCo: ``base``, ``link1`` ... ``linkn``."""
    return f"link{link}" if link else "base"


def load_robot(name_or_path: str | Path) -> Robot:
    """Load a shipped robot by name, or one's own by the path of its robot.toml or folder.

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
    data = read_toml(path, RobotFile)
    chain = robot_chain(data)
    _check_free_sets(path, data, chain_names(chain.n_joints))
    ranges = np.array([_in_si(joint) for joint in data.joints])
    return Robot(
        name=data.name,
        title=data.title,
        folder=path.parent,
        model=RobotModel(chain),
        limits=frozen(ranges[:, :2]),
        speeds=frozen(ranges[:, 2]),
        masses=frozen([j.mass_kg for j in data.joints]),
        centers=frozen(np.array([j.center_mm for j in data.joints]) / 1e3),
        inertias=frozen([j.inertia_kg_m2 for j in data.joints]),
        repeatability=frozen(ranges[:, 3]),
        visuals=visuals(path, data),
        base_offset=data.floor_mm / 1e3,
        exclusions=tuple((body_name(a), body_name(b)) for a, b in data.never_collide),
        free_sets=MappingProxyType(dict(data.free_sets)),
        sources=MappingProxyType(dict(data.sources)),
    )


def robot_chain(data: RobotFile) -> Chain:
    """Nominal chain of a robot file [m, rad]."""
    return Chain(
        links=frozen(
            [
                [
                    np.radians(j.theta_deg),
                    j.d_mm / 1e3,
                    j.a_mm / 1e3,
                    np.radians(j.alpha_deg),
                    np.radians(j.beta_deg),
                ]
                for j in data.joints
            ]
        ),
        kinds=tuple(j.kind for j in data.joints),
        T_world_base=_transform(data.base),
        T_flange_tool=_transform(data.tool),
    )


def load_tracker_visuals() -> tuple[Visual, ...]:
    """Parts of the tracker, origin where its beam axes meet, z up, beam along x [m].

    Link 0 stands on the floor, link 1 turns about z (azimuth), link 2 also about y (elevation,
    upward negative). The stand is as long as `beam_height_mm` in tracker.toml says.
    """
    path = assets.models() / TRACKER / TRACKER_FILE
    return visuals(path, read_toml(path, TrackerFile))


def visuals(path: Path, data: Drawn) -> tuple[Visual, ...]:
    """Parts of a model file `path`; each mesh must be there, inside the model's folder."""
    folder = path.parent.resolve()
    out = []
    for part in data.parts:
        file = path.parent / part.file
        if not file.resolve().is_relative_to(folder):
            raise InputError(
                f"part {part.name}: {part.file} leads out of the model's folder",
                code="R6",
                where=str(path),
                field=f"parts.{part.name}.file",
                value=part.file,
                allowed=f"files below {folder}",
            )
        if not file.is_file():
            raise InputError(
                f"part {part.name}: no mesh {part.file}",
                code="R7",
                where=str(path),
                field=f"parts.{part.name}.file",
                value=part.file,
                fix=f"python -m testbed.robots.generate {data.name}" if data.drawing else "",
            )
        red, green, blue = data.colors[part.color]
        out.append(Visual(file, (red, green, blue), part.collides, part.link, part.name))
    return tuple(out)


def _robot_path(name_or_path: str | Path) -> Path:
    """Path of the robot.toml meant by a name, a folder or a file."""
    shipped = assets.models() / str(name_or_path) / ROBOT_FILE
    if str(name_or_path) in robot_names():
        return shipped
    path = Path(name_or_path)
    if path.is_dir() and (path / ROBOT_FILE).is_file():
        return path / ROBOT_FILE
    if path.is_file():
        return path
    raise InputError(
        f'there is no robot "{name_or_path}"',
        code="S37",
        field="robot",
        value=str(name_or_path),
        allowed="a shipped name, or the path of a robot.toml",
        fix=did_you_mean(str(name_or_path), robot_names()),
    )


def _transform(frame: Frame) -> Array:
    """The frame as (4, 4) [m]."""
    return step_transform(
        np.concatenate([np.array(frame.position_mm) / 1e3, np.radians(frame.rotation_vector_deg)])
    )


def _in_si(joint: RevoluteLink | PrismaticLink) -> tuple[float, float, float, float]:
    """Lower limit, upper limit, speed and repeatability of a joint [rad or m]."""
    if isinstance(joint, RevoluteLink):
        turn = np.radians([joint.lower_deg, joint.upper_deg, joint.max_speed_deg_s])
        return float(turn[0]), float(turn[1]), float(turn[2]), joint.repeatability_urad * 1e-6
    return (
        joint.lower_mm / 1e3,
        joint.upper_mm / 1e3,
        joint.max_speed_mm_s / 1e3,
        joint.repeatability_um * 1e-6,
    )


def _check_free_sets(path: Path, data: RobotFile, known: tuple[str, ...]) -> None:
    """Every name in a free set is a parameter of this chain, once."""
    for title, names in data.free_sets.items():
        for name in names:
            if name not in known or names.count(name) > 1:
                raise InputError(
                    f'[free_sets] {title}: "{name}" is '
                    + ("there twice" if name in known else "not a parameter"),
                    code="S37",
                    where=str(path),
                    field=f"free_sets.{title}",
                    value=name,
                    fix="" if name in known else did_you_mean(name, known),
                )
