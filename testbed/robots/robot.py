"""The robot of the testbed: nominal model, limits, bodies, and workspace."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calib.arrays import Array
from calib.geometry.frames import inverse
from calib.geometry.gravity import moments_of
from calib.geometry.model import RobotModel
from calib.shown import Shown
from testbed.robots.controller import AS_THE_ARM, Controller
from testbed.robots.parts import IN_PLACE as IN_PLACE
from testbed.robots.parts import Primitive
from testbed.robots.parts import Visual as Visual
from testbed.robots.room import leading_slides, outside
from testbed.robots.source import OwnText
from testbed.units import in_units

SAMPLE = 2000
"""Number of postures in the joint limits from which the reach is derived."""
SHARE = (10.0, 90.0)
"""Percentiles of the tool positions between which the box lies, axis by axis."""
ABOVE = 0.1
"""Height of the tool above the floor below which postures are not used [m]."""
STANDS = 1 / 3
"""Fraction of postures above the floor from which an arm counts as standing on it; others, such as
a SCARA, whose quill reaches below its base, stand on something higher."""
STAND = 0.675
"""Height of the drawn tracker's beam above its floor [m]."""
AWAY = 3.0
"""Distance of the tracker from the box's center, in half diagonals of the box; 2 m or more."""
NEAREST = 2.0
ASIDE = np.radians(-40.0)
"""Direction of the tracker from the base, about the vertical [rad]."""
UPRIGHT = 0.99
"""Cosine of the tilt up to which a base stands upright: 8 deg."""
TURNS = 1.5
"""Number of turns above which a joint is limited to half a turn to either side of its middle."""
STEP = 0.01
"""Proposed numbers are rounded to multiples of this [m]."""
NO_MASS = "no mass is given for what"
"""Beginning of the note on bodies whose masses are assumed."""
IDENTIFIED = "identified from measurements of"
"""Beginning of the source of numbers that a calibration found."""
CONVERTED = "joint axes converted to link numbers"
"""Said of the source of numbers that come from a URDF or MJCF."""


@dataclass(frozen=True, slots=True)
class Reflector:
    """A target that is mounted on the tool."""

    name: str
    """Its name for people."""
    place: tuple[float, float, float]
    """Its center in the tool frame [m]."""


@dataclass(frozen=True, slots=True)
class Workspace:
    """Where an arm works within sight of a tracker, base frame [mm], as in scenarios."""

    box_center_mm: tuple[float, float, float]
    """Center of the box of tool positions."""
    box_size_mm: tuple[float, float, float]
    """Its edges."""
    station_mm: tuple[float, float, float]
    """Where the beam of the tracker starts."""
    joint_ranges_deg: tuple[tuple[float, float], ...] = ()
    """Lowest and highest value of each joint there (mm where it slides); empty: its limits."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Robot(Shown):
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
    """Parts that are meshes, the probe included."""
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
    reflectors: tuple[Reflector, ...] = ()
    """Targets on its tool, if it was calibrated with any."""
    joint_names: tuple[str, ...] = ()
    """(n,) names of the joints in its URDF or MJCF; empty if it does not come from one."""
    notes: tuple[str, ...] = ()
    """Sentences on oddities of its file and on assumed values that the file does not state."""

    def __repr__(self) -> str:
        return f"Robot({self.name!r}: {self.title}, {self.model!r})"

    tolerances: Array | None = None
    """(n, 5) standard deviation of each number of a link from nominal [rad, m, m, rad, rad]; None
    if its file states none."""
    controller: Controller = AS_THE_ARM
    """How its controller counts joints, in tables and programs; by default as the arm."""
    agreement: float | None = None
    """Largest distance from poses by another reader of the file, if it was converted [m]."""
    primitives: tuple[Primitive, ...] = ()
    """Parts that are plain shapes."""
    unread: tuple[int, ...] = ()
    """Moving bodies (1 ... n) with a colliding shape in the file that cannot be read."""
    mounting_height: float | None = None
    """Height of the base frame's origin above the level floor of the room, if its file states it
    [m]; the world's z points up."""
    own_text: OwnText | None = None
    """The URDF or MJCF that it was read from; None if it came from another file."""

    @property
    def parts(self) -> tuple[Visual | Primitive, ...]:
        """All parts, meshes first."""
        return (*self.visuals, *self.primitives)

    @property
    def shapeless(self) -> tuple[int, ...]:
        """Moving bodies (1 ... n) without a colliding part, whose collisions are not tested."""
        solid = {part.link for part in self.parts if part.collides}
        return tuple(k for k in range(1, self.model.chain.n_joints + 1) if k not in solid)

    @property
    def partly(self) -> tuple[int, ...]:
        """Moving bodies (1 ... n) of which only some colliding shapes of the file were read."""
        return tuple(k for k in self.unread if k not in self.shapeless)

    @property
    def scatter_is_assumed(self) -> bool:
        """Whether its file states no repeatability of the joints."""
        return self.sources.get("repeatability", "").startswith("assumed")

    @property
    def lacks_meshes(self) -> bool:
        """Whether meshes that its file names were missing, or no use, and allowed to be."""
        told = (note for note in self.notes if note.startswith("mesh "))
        return any(" is missing" in note or " counts as missing" in note for note in told)

    @property
    def moments(self) -> Array | None:
        """(n, 4) masses and first moments of its links [kg, kg m]; None where some are assumed."""
        if any(note.startswith(NO_MASS) for note in self.notes) or not self.masses.any():
            return None
        return moments_of(self.masses, self.centers)


def body_name(link: int) -> str:
    """Name of a body in MuJoCo: ``base``, ``link1`` ... ``linkn``."""
    return f"link{link}" if link else "base"


def reflector_frames(robot: Robot) -> tuple[str, ...]:
    """What each reflector is called in URDF and MJCF: as people call it, if nothing else is.

    Without %, which means a value to MuJoCo.
    """
    n = robot.model.chain.n_joints
    taken = {"world", "base", "flange", "tool", "tool0"}
    taken |= {name for k in range(1, n + 1) for name in (f"link{k}", f"link_{k}")}
    frames: list[str] = []
    for reflector in robot.reflectors:
        name = reflector.name.replace("%", "_")
        while name in taken:
            name = f"reflector_{name}"
        taken.add(name)
        frames.append(name)
    return tuple(frames)


def workspace(robot: Robot) -> Workspace:
    """The workspace that a robot states, else one derived from its reach.

    A fixed sample of postures in the joint limits is used: the answer belongs to the robot.

    Examples
    --------
    >>> from testbed.robots.catalog import load_robot
    >>> workspace(load_robot("staubli_tx60")).box_size_mm
    (900.0, 1200.0, 800.0)
    """
    return robot.workspace or workspace_of_reach(robot)


def workspace_of_reach(robot: Robot) -> Workspace:
    """A box that holds the middle 80 % of the reach along each axis, and a tracker beside it."""
    lower, upper = (ranges := joint_ranges(robot)).T
    q = np.random.default_rng(0).uniform(lower, upper, (SAMPLE, len(lower)))
    if not robot.controller.plain:
        q = robot.controller.holding(q)
        inside = ((q >= lower) & (q <= upper)).all(axis=1) & robot.controller.allows(q)
        q = q[inside] if inside.any() else q
    T = inverse(robot.model.chain.T_world_base) @ robot.model.poses(q)
    place = T[:, :3, 3]
    above = place[:, 2] > robot.base_offset + ABOVE
    if robot.mounting_height is not None:
        up = robot.model.chain.T_world_base[2, :3]
        above &= place @ up > ABOVE - robot.mounting_height
    place = place[above] if above.mean() > STANDS else place
    low, high = np.percentile(place, SHARE, axis=0)
    center, size = (low + high) / 2, np.maximum(high - low, STEP)
    away = max(AWAY * float(np.linalg.norm(size)) / 2, NEAREST)
    start, aside = _stand(robot, center)
    station = start + away * aside
    station = outside(robot.model.chain, robot.limits, station, aside)
    kept: tuple[tuple[float, float], ...] = ()
    if not np.array_equal(ranges, robot.limits):
        slides = robot.model.chain.prismatic.astype(bool)[:, None]
        kept = tuple((float(a), float(b)) for a, b in in_units(ranges, slides).round(6))
    return Workspace(in_mm(center), in_mm(size), in_mm(station), kept)


def _stand(robot: Robot, center: Array) -> tuple[Array, Array]:
    """From where and in which direction a tracker goes aside, both (3,) in the base frame [m].

    About the vertical, as high as a drawn tracker is over the floor: that of an upright base, or
    what the file states of another, such as on a wall or a rail. Where it states nothing, as high
    as the center of the box.
    """
    up, z = robot.model.chain.T_world_base[2, :3], np.array([0.0, 0.0, 1.0])
    if up[2] >= UPRIGHT:
        start = np.array([center[0], center[1], robot.base_offset + STAND])
        return start, np.array([np.cos(ASIDE), np.sin(ASIDE), 0.0])
    # away from a wall, across a rail, along x below a ceiling
    ahead = np.cross(up, z) if leading_slides(robot.model.chain) else z - up[2] * up
    if np.linalg.norm(ahead) < 1 - UPRIGHT:
        ahead = np.array([1.0, 0.0, 0.0]) - up[0] * up
    ahead = ahead / np.linalg.norm(ahead)
    if robot.mounting_height is not None:
        center = center + (STAND - robot.mounting_height - up @ center) * up
    return center, np.cos(ASIDE) * ahead + np.sin(ASIDE) * np.cross(up, ahead)


def joint_ranges(robot: Robot) -> Array:
    """The joint limits (n, 2), but no more than a turn where a joint may turn on and on."""
    middle, reach = robot.limits.mean(axis=1), np.ptp(robot.limits, axis=1) / 2
    many = (reach > TURNS * np.pi) & ~robot.model.chain.prismatic.astype(bool)
    reach = np.where(many, np.pi, reach)
    return np.where(many[:, None], np.stack([middle - reach, middle + reach], 1), robot.limits)


def in_mm(point: Array) -> tuple[float, float, float]:
    """A point (3,) [m] in mm, rounded to whole centimeters."""
    x, y, z = (np.round(point / STEP) * STEP * 1e3).round(6) + 0.0
    return float(x), float(y), float(z)
