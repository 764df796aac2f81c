"""What stands in the laboratory of a scenario: [truth], [tracker] and [cell]."""

from typing import Annotated, Literal

from pydantic import Field

from testbed.bounds import LENGTH_SD, shown
from testbed.scenario.tables import MAX_JOINTS, Point, RotationVector, Settings, Side, Text

AngleSd = Annotated[float, Field(ge=0.0, le=5.0)]
LengthSd = Annotated[float, Field(ge=0.0, le=50.0)]
Sag = Annotated[float, Field(ge=-1000.0, le=1000.0)]
Amplitude = Annotated[float, Field(ge=0.0, le=1000.0)]
Share = Annotated[float, Field(ge=0.0, le=100.0)]
Stiffness = Annotated[float, Field(ge=1e-3, le=1e9)]
PerJoint = Amplitude | Annotated[tuple[Amplitude, ...], Field(min_length=1, max_length=MAX_JOINTS)]
"""One number for every joint, or one per joint."""
Springs = Annotated[tuple[Stiffness, ...], Field(max_length=MAX_JOINTS)]
Friction = Annotated[float, Field(ge=0.0, le=1e5)]
Ratio = Annotated[float, Field(ge=1.0, le=10_000.0)]
Waves = Annotated[int, Field(ge=8, le=200)]
"""Waves a turn: more than the harmonics have."""


TruthPreset = Literal[
    "rigid", "wen2022", "soft", "unmodelled", "elastic", "payloads", "drives", "gears", "moving"
]


class TruthSettings(Settings):
    """[truth]: how far the true robot lies from the nominal one; each term is switched alone."""

    preset: TruthPreset
    """Fills in every key of this table that the file does not give."""
    perturb: str | tuple[str, ...]
    """Numbers that differ: a free set of the robot, "links" for all link numbers, or names."""
    angle_sd_deg: AngleSd
    """Standard deviation of the true angles of the links about the nominal ones."""
    length_sd_mm: LengthSd
    """The same of the lengths."""
    twist_share: Share = 1.0
    """alpha and beta of the links have this share of angle_sd_deg."""
    offset_share: Share = 1.0
    """d of the links have this share of length_sd_mm."""
    gravity_mdeg: tuple[Sag, Sag, Sag]
    """g1, g2, g3 of the closed-form sag of joints 2 and 3."""
    harmonic_mdeg: PerJoint
    """h of the error once a turn, whose amplitude is 0.5 to 1.5 h, drawn for each joint; that twice
    a turn is half as large."""
    high_harmonic_mdeg: PerJoint = 0.0
    """Three and (0.6 of it) seven times a turn; no model of an identification has them."""
    frame_sd_mm: LengthSd
    """Base and tool frames, per axis."""
    frame_sd_deg: AngleSd
    """The same of their rotation, per axis."""
    transmission_mdeg: PerJoint = 0.0
    """Standard deviation, around the turn, of gear errors at all numbers of waves in the range
    below together; no model of an identification has them all."""
    transmission_waves: tuple[Waves, Waves] = (10, 40)
    """Fewest and most waves a turn."""
    encoder_mdeg: PerJoint = 0.0
    """Amplitude of the error between two lines of the encoder: the same at every return."""
    encoder_periods: Annotated[int, Field(ge=8, le=1_000_000)] = 1024
    """Encoder lines per turn of the joint."""
    gear_mdeg: PerJoint = 0.0
    """Amplitude of the error once a turn of the motor; twice a turn it is half of that."""
    gear_ratio: Ratio | Annotated[tuple[Ratio, ...], Field(min_length=1, max_length=MAX_JOINTS)] = (
        100.0
    )
    """Turns of the motor per turn of the joint; need not be whole."""
    backlash_mdeg: PerJoint = 0.0
    """Full width of the play; a joint rests on one of its sides."""
    backlash_side: Literal["approach", "load", "posture"] = "approach"
    """What decides the side: the last move of the joint; gravity, from the masses of the robot; or
    the closed form tanh(20 sin(q2+q3)) for joint 3 and sign(cos q4 sin q5) for joint 5."""
    thermal_k: Annotated[float, Field(ge=-100.0, le=100.0)] = 0.0
    """How much warmer the links get in the end; lengths and offsets grow with them."""
    thermal_h: Annotated[float, Field(ge=1e-6, le=1000.0)] = 1.0
    """Time after which 63 % of it is reached."""
    thermal_um_per_m_k: Annotated[float, Field(ge=0.0, le=100.0)] = 23.0
    """Expansion of the links."""
    drive_nm_per_mrad: Springs = ()
    """Stiffness of each drive about its axis, one per joint; empty: a stiff arm."""
    bearing_nm_per_mrad: Springs = ()
    """Stiffness of each bearing and its link about the body's x and y; empty: stiff."""
    payload_kg: Annotated[float, Field(ge=0.0, le=1000.0)] = 0.0
    """Mass beyond the robot's own that hangs on a sprung arm."""
    payload_center_mm: Point = (0.0, 0.0, 50.0)
    """Its center of mass in the flange frame."""
    payloads_kg: Annotated[
        tuple[Annotated[float, Field(ge=0.0, le=1000.0)], ...], Field(max_length=20)
    ] = ()
    """What hangs there instead while poses of the pool are visited, in turn; rows say so. Held-out
    poses have payload_kg. Empty: always that."""
    motion: bool = False
    """Whether the sprung arm moves: the next six keys, played by MuJoCo. Else it is at rest."""
    speed_deg_s: Annotated[float, Field(ge=0.1, le=2000.0)] = 60.0
    """Largest speed of a joint in the last part of a move."""
    speed_mm_s: Annotated[float, Field(ge=0.0, le=20_000.0)] = 0.0
    """Largest speed of the tool there; 0: that of the joints decides alone."""
    approach_deg: Annotated[float, Field(ge=0.1, le=90.0)] = 10.0
    """Last part of each move that is played, of the joint that moves farthest."""
    dwell_s: Annotated[float, Field(ge=0.0, le=60.0)] = 1.0
    """From the stop of the motors until the tracker looks."""
    friction_nm: (
        Friction | Annotated[tuple[Friction, ...], Field(min_length=1, max_length=MAX_JOINTS)]
    ) = 0.0
    """Dry friction of each joint, between its drive's spring and the link."""
    damping: Annotated[float, Field(ge=0.0, le=5.0)] = 0.05
    """Of every spring, as a share of the critical damping of what it carries on average."""
    joint_repeatability_mdeg: Annotated[float, Field(ge=0.0, le=1000.0)] | None
    """Standard deviation of every joint that turns, anew at each approach; one that slides keeps
    the robot's own, none at 0. None: the robot's own (written "robot" in the file)."""


Micrometres = Annotated[float, Field(ge=0.0, le=10_000.0)]
Noise = Annotated[float, Field(ge=shown(LENGTH_SD.least, "um"), le=10_000.0)]
"""Standard deviation [um or mdeg]: so small that squares of it stay numbers, at least."""
HalfAngle = Annotated[float, Field(ge=1e-3, le=180.0)]
Seconds = Annotated[float, Field(ge=1e-3, le=86_400.0)]
Shots = Annotated[int, Field(ge=0, le=5000)]


SYSTEMATIC = (
    "range_offset_um",
    "scale_um_per_m",
    "encoder_um",
    "target_offset_um",
    "level_mdeg",
    "target_turn_mdeg",
)
"""Sizes of what a tracker gets wrong all campaign long; the last one shows in full poses only."""


class PaperTracker(Settings):
    """[tracker] preset "paper": isotropic noise, the robot's repeatability included in it."""

    preset: Literal["paper"] = "paper"
    """The tracker as Wen et al. 2022 assume it."""
    station_mm: Point = (2600.0, -2000.0, 300.0)
    """Beam origin in the base frame; the tracker stands level there, on a wall too."""
    measures: Literal["pose", "point"] = "pose"
    """Whole poses of a 6-D target, or positions of one reflector."""
    reflector_mm: Point = (0.0, 0.0, 0.0)
    """Reflector in the tool frame; only for measures = "point"."""
    position_um: Noise = 17.5
    """Standard deviation per axis."""
    rotation_mdeg: Noise = 11.0
    """Standard deviation per axis."""
    acceptance_deg: HalfAngle = 180.0
    """The target is seen within this angle about the tool's z axis; 180: from anywhere."""
    pose_s: Seconds = 10.0
    """From one shot to the next; what warms up or drifts does so meanwhile."""


class At960Tracker(Settings):
    """[tracker] preset "at960": spherical noise, constant and per metre of range."""

    preset: Literal["at960"] = "at960"
    """A tracker after the data sheet of a Leica AT960."""
    station_mm: Point = (2600.0, -2000.0, 300.0)
    """Beam origin in the base frame; the tracker stands level there, on a wall too."""
    measures: Literal["pose", "point"] = "pose"
    """Whole poses of a 6-D target, or positions of one reflector."""
    reflector_mm: Point = (0.0, 0.0, 0.0)
    """Reflector in the tool frame; only for measures = "point"."""
    range_um: tuple[Noise, Micrometres] = (2.0, 0.15)
    """Along the beam: constant, per metre."""
    transverse_um: tuple[Noise, Micrometres] = (3.0, 1.5)
    """Across the beam: constant, per metre."""
    centering_um: Micrometres = 2.5
    """Standard deviation per axis of how the target sits in its holder, anew at each shot."""
    rotation_mdeg: tuple[Noise, Noise, Noise] = (2.0, 2.0, 3.5)
    """Pitch, yaw, roll of the target, about its own axes."""
    acceptance_deg: HalfAngle = 180.0
    """The target is seen within this angle about the tool's z axis; 180: from anywhere."""
    pose_s: Seconds = 10.0
    """From one shot to the next; what warms up or drifts does so meanwhile."""
    systematic: bool = False
    """Whether the station has errors of its own, drawn once per campaign: the next six keys."""
    range_offset_um: Micrometres = 2.5
    """Half width of the offset of all ranges."""
    scale_um_per_m: Micrometres = 0.2
    """Standard deviation of the scale of all ranges."""
    encoder_um: tuple[Micrometres, Micrometres] = (7.5, 3.0)
    """Amplitude across the beam, constant and per metre, of the errors that go with sin(azimuth)
    and sin(2 elevation)."""
    target_offset_um: Micrometres = 2.5
    """Standard deviation per axis of where the target sits on the tool."""
    target_turn_mdeg: Micrometres = 5.0
    """Half width per axis of how the target is turned on the tool."""
    level_mdeg: Micrometres = 0.0
    """Standard deviation of each of two tilts of the station; all positions turn about it."""
    drift_um_per_sqrt_h: Micrometres = 0.0
    """Random walk of the station, per axis; 0: it stands still."""
    nests_s: Seconds = 600.0
    """The nests are measured when a visit begins and again after this time; what they show is
    taken off until the next time."""
    outliers: Shots = 0
    """Shots of each visit that are grossly wrong, with [fixtures] of each run of the program in it;
    the data does not say which."""
    outlier_mm: Annotated[float, Field(ge=0.0, le=10_000.0)] = 0.5
    """Standard deviation per axis of a wrong shot."""
    outlier_deg: Annotated[float, Field(ge=0.0, le=180.0)] = 0.1
    """Standard deviation per axis of its rotation."""
    missed: Shots = 0
    """Shots of each visit that fail, with [fixtures] of each run: their rows are missing."""


TrackerSettings = Annotated[PaperTracker | At960Tracker, Field(discriminator="preset")]
MAX_FIXTURES = 30
"""Reflectors, anchors or further stations of one campaign."""
Places = Annotated[dict[str, Point], Field(max_length=MAX_FIXTURES)]


class FixtureSettings(Settings):
    """[fixtures]: further targets and stations, and distances from fixed points.

    The robot runs its program once for each target from each place: one reflector is followed at a
    time, and every run approaches the poses anew.
    """

    reflectors_mm: Places = Field(default_factory=dict)
    """Reflectors in the tool frame, by name. Where points are measured the first one is the tool
    point: its place is known, and the calibration is judged there. None: the target of
    [tracker]."""
    stations_mm: Annotated[tuple[Point, ...], Field(max_length=MAX_FIXTURES)] = ()
    """Where the tracker stands a second, third ... time: beam origins in the base frame, axes about
    parallel to the world's. The first is [tracker] station_mm; its frame is the world."""
    anchors_mm: Places = Field(default_factory=dict)
    """Fixed points in the base frame, by name, that distances are measured from."""
    ranged: tuple[str, ...] = ()
    """Reflectors whose distance from every anchor is measured; empty: the first one."""
    distance_um: tuple[Noise, Micrometres] = (5.0, 1.0)
    """Standard deviation of a distance: constant, per metre."""
    free: tuple[str, ...] = ()
    """Reflectors and anchors whose places the calibration finds; all others are known. Further
    stations always are found."""
    place_sd_mm: LengthSd = 0.5
    """How far what is found really lies from the places above, per axis."""
    turn_sd_deg: AngleSd = 0.05
    """How far further stations are really turned, per axis."""


MAX_OBSTACLES = 100


class BoxObstacle(Settings):
    """[[cell.obstacle]] kind "box"."""

    kind: Literal["box"] = "box"
    """A box."""
    size_mm: tuple[Side, Side, Side]
    """Full lengths of its edges."""
    position_mm: Point
    """Its center in the base frame."""
    rotation_vector_deg: RotationVector = (0.0, 0.0, 0.0)
    """Turn of its axes against the base frame."""


class MeshObstacle(Settings):
    """[[cell.obstacle]] kind "mesh": it collides as its convex hull and blocks beams as it is."""

    kind: Literal["mesh"] = "mesh"
    """A mesh from a file."""
    file: Annotated[Text, Field(min_length=1)]
    """OBJ or STL, relative to the scenario file and below its folder."""
    unit: Literal["mm", "m"] = "mm"
    """Of the file's coordinates, which name none themselves."""
    position_mm: Point = (0.0, 0.0, 0.0)
    """The mesh's origin in the base frame."""
    rotation_vector_deg: RotationVector = (0.0, 0.0, 0.0)
    """Turn of the mesh's axes against the base frame."""


ObstacleSettings = Annotated[BoxObstacle | MeshObstacle, Field(discriminator="kind")]


class CellSettings(Settings):
    """[cell]: obstacles, besides the floor."""

    obstacle: Annotated[tuple[ObstacleSettings, ...], Field(max_length=MAX_OBSTACLES)] = ()
    """What stands in the cell: the robot does not touch it, and it blocks the beam."""
