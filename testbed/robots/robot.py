"""What a robot is to the testbed: a nominal model, its limits, its bodies and what is drawn."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from calib.arrays import Array
from calib.geometry.model import RobotModel

Affine: TypeAlias = tuple[tuple[float, ...], ...]
"""Rows of a (4, 4) matrix that takes places in a mesh file to the frame of a link [m]."""
IN_PLACE: Affine = tuple(tuple(float(i == k) for k in range(4)) for i in range(4))


@dataclass(frozen=True, slots=True)
class Visual:
    """One drawn part."""

    file: Path
    """Mesh file, in the frame of its link [m] unless `affine` is given."""
    rgb: tuple[float, float, float]
    """Color, 0 to 1."""
    collides: bool
    """Whether its convex hull takes part in collision tests."""
    link: int
    """Body it moves with, 0 = base ... n."""
    name: str
    """Name of the part."""
    affine: Affine = IN_PLACE
    """Places in the file to places in the frame of the link; a scale may be part of it."""


@dataclass(frozen=True, slots=True)
class Workspace:
    """Where an arm is at work and a tracker sees it, base frame [mm], as in scenarios."""

    box_center_mm: tuple[float, float, float]
    """Center of the box of tool positions."""
    box_size_mm: tuple[float, float, float]
    """Its edges."""
    station_mm: tuple[float, float, float]
    """Where the beam of the tracker starts."""
    joint_ranges_deg: tuple[tuple[float, float], ...] = ()
    """Lowest and highest value of each joint there (mm where it slides); empty: its limits."""


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
    """Nominal model; it has joint errors if they are known from a calibration [m, rad]."""
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
    workspace: Workspace | None = None
    """Where it works unless the scenario states it; None: derived from its reach."""
    joint_names: tuple[str, ...] = ()
    """(n,) names of the joints in its URDF or MJCF; empty if it does not come from one."""
    notes: tuple[str, ...] = ()
    """What is odd in its file, or was assumed because the file leaves it open; sentences."""
    agreement: float | None = None
    """Largest distance from the poses another reader finds in the file, if converted [m]."""


def body_name(link: int) -> str:
    """Name of a body in MuJoCo: ``base``, ``link1`` ... ``linkn``."""
    return f"link{link}" if link else "base"
