"""[truth]: how the true robot differs, its presets, and what they ask of the robot."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field

from testbed.scenario.tables import Point, Settings
from testbed.strict import Fault, one_error

if TYPE_CHECKING:
    from testbed.robots.catalog import Robot

MAX_JOINTS = 32

AngleSd = Annotated[float, Field(ge=0.0, le=5.0)]
LengthSd = Annotated[float, Field(ge=0.0, le=50.0)]
Sag = Annotated[float, Field(ge=-1000.0, le=1000.0)]
Amplitude = Annotated[float, Field(ge=0.0, le=1000.0)]
Share = Annotated[float, Field(ge=0.0, le=100.0)]
Stiffness = Annotated[float, Field(gt=0.0, le=1e9)]
PerJoint = Amplitude | Annotated[tuple[Amplitude, ...], Field(min_length=1, max_length=MAX_JOINTS)]
"""One number for every joint, or one per joint."""
Springs = Annotated[tuple[Stiffness, ...], Field(max_length=MAX_JOINTS)]


class TruthSettings(Settings):
    """[truth]: how far the true robot lies from the nominal one; each term is switched alone."""

    preset: Literal["rigid", "wen2022", "soft", "unmodelled", "elastic"]
    perturb: str | tuple[str, ...]
    """Numbers that differ: a free set of the robot, "links" for all link numbers, or names."""
    angle_sd_deg: AngleSd
    length_sd_mm: LengthSd
    twist_share: Share = 1.0
    """alpha and beta of the links have this share of angle_sd_deg."""
    offset_share: Share = 1.0
    """d of the links have this share of length_sd_mm."""
    gravity_mdeg: tuple[Sag, Sag, Sag]
    """g1, g2, g3 of the closed-form sag of joints 2 and 3."""
    harmonic_mdeg: PerJoint
    """h of once and twice a turn."""
    high_harmonic_mdeg: PerJoint = 0.0
    """Three and (0.6 of it) seven times a turn; no model of an identification has them."""
    frame_sd_mm: LengthSd
    """Base and tool frames, per axis."""
    frame_sd_deg: AngleSd
    encoder_mdeg: PerJoint = 0.0
    """Amplitude of the error between two lines of the encoder: the same at every return."""
    encoder_periods: Annotated[int, Field(ge=8, le=1_000_000)] = 1024
    """Encoder lines per turn of the joint."""
    backlash_mdeg: PerJoint = 0.0
    """Full width of the play; a joint rests on one of its sides."""
    backlash_side: Literal["approach", "load", "posture"] = "approach"
    """What decides the side: the last move of the joint; gravity, from the masses of the robot; or
    the closed form tanh(20 sin(q2+q3)) for joint 3 and sign(cos q4 sin q5) for joint 5."""
    thermal_k: Annotated[float, Field(ge=-100.0, le=100.0)] = 0.0
    """How much warmer the links get in the end; lengths and offsets grow with them."""
    thermal_h: Annotated[float, Field(gt=0.0, le=1000.0)] = 1.0
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
    joint_repeatability_mdeg: Annotated[float, Field(ge=0.0, le=1000.0)] | None
    """Every joint, per approach; None: the robot's own (written "robot" in the file)."""


NUMBERS = tuple(
    ("truth", key)
    for key in ("harmonic_mdeg", "high_harmonic_mdeg", "encoder_mdeg", "backlash_mdeg")
)
"""Keys that hold one number or one per joint."""

SOFT: dict[str, object] = {
    "angle_sd_deg": 0.032,
    "twist_share": 0.3,  # 0.0096 deg
    "offset_share": 0.064 / 0.12,
    "harmonic_mdeg": [5.0, 5.0, 5.0, 8.0, 8.0, 8.0],
    "frame_sd_mm": 0.1,
    "frame_sd_deg": 0.01,
}
TRUTH_PRESETS: dict[str, dict[str, object]] = {
    "rigid": {"gravity_mdeg": [0.0, 0.0, 0.0], "harmonic_mdeg": 0.0},
    "wen2022": {"gravity_mdeg": [10.0, 6.0, 8.0], "harmonic_mdeg": 6.0},
    "soft": SOFT | {"gravity_mdeg": [25.0, 15.0, 30.0]},
    "unmodelled": {
        "high_harmonic_mdeg": 2.5,
        "backlash_mdeg": [0.0, 0.0, 8.0, 0.0, 8.0, 0.0],
        "backlash_side": "posture",
    },
    "elastic": SOFT
    | {
        "gravity_mdeg": [0.0, 0.0, 0.0],
        "drive_nm_per_mrad": [90.0, 90.0, 40.0, 12.0, 10.0, 6.0],
        "bearing_nm_per_mrad": [600.0, 500.0, 300.0, 100.0, 80.0, 50.0],
        "payload_kg": 2.0,
    },
}
"""What differs between the presets; the rest is common (project specification, section 5)."""
ALONG = ("harmonic_mdeg", "drive_nm_per_mrad", "bearing_nm_per_mrad")
"""Keys whose lists follow the number of joints; play belongs to joints 3 and 5 of any arm."""
TRUTH_COMMON: dict[str, object] = {
    "angle_sd_deg": 0.02,
    "length_sd_mm": 0.12,
    "frame_sd_mm": 0.0,
    "frame_sd_deg": 0.0,
}


def resolved_truth(
    truth: Mapping[str, Any], *, joints: int, paper_set: bool, sags: bool, at960: bool
) -> dict[str, Any]:
    """[truth] with its preset applied; wrong types are left for the strict check to name.

    `joints` is how many the robot has, `paper_set` whether the set that the paper identifies is one
    of its free sets, `sags` whether the closed form of gravity holds for it; where it does not, a
    file that names no preset leaves the sag out.
    """
    preset = truth.get("preset", "wen2022")
    chosen = TRUTH_PRESETS.get(preset, {}) if isinstance(preset, str) else {}
    filled = TRUTH_PRESETS["wen2022"] | TRUTH_COMMON | chosen | {"preset": preset}
    for key in (*ALONG, "backlash_mdeg"):
        values = filled.get(key)
        if isinstance(values, list):
            rest = [0.0] * (joints - len(values))
            filled[key] = along(values, joints) if key in ALONG else [*values, *rest][:joints]
    if not sags and "preset" not in truth:
        filled["gravity_mdeg"] = [0.0, 0.0, 0.0]
    filled["perturb"] = "wen2022" if paper_set else "links"
    filled["joint_repeatability_mdeg"] = None if at960 else 0.0
    filled |= truth
    if filled["joint_repeatability_mdeg"] == "robot":
        filled["joint_repeatability_mdeg"] = None
    return filled


def along(values: list[float], joints: int) -> list[float]:
    """A preset's list for six axes, spread along an arm of another number of joints.

    Each joint takes the number of the axis that is as far along the six.

    Examples
    --------
    >>> along([5.0, 5.0, 5.0, 8.0, 8.0, 8.0], 7)
    [5.0, 5.0, 5.0, 5.0, 8.0, 8.0, 8.0]
    """
    last = len(values) - 1
    return [values[(i * last) // max(joints - 1, 1)] for i in range(joints)]


def truth_contradictions(truth: TruthSettings) -> list[str]:
    """Sentences, one per contradiction in [truth]; empty if it is sound."""
    found = []
    sprung = bool(truth.drive_nm_per_mrad)
    if sprung and any(truth.gravity_mdeg):
        found.append(
            "[truth] gravity_mdeg and drive_nm_per_mrad would both make the arm droop; "
            "write gravity_mdeg = [0, 0, 0] or drive_nm_per_mrad = []"
        )
    if truth.bearing_nm_per_mrad and not sprung:
        found.append(
            "[truth] bearing_nm_per_mrad is set, but the drives are stiff; "
            "give drive_nm_per_mrad or write bearing_nm_per_mrad = []"
        )
    if truth.payload_kg and not sprung:
        found.append(
            f"[truth] payload_kg is {truth.payload_kg:g}, but no spring feels it; "
            "give drive_nm_per_mrad or write payload_kg = 0"
        )
    if truth.backlash_side == "posture" and (wrong := outside_posture(truth.backlash_mdeg)):
        found.append(
            f'[truth] backlash_side is "posture", which knows joints 3 and 5 only; backlash_mdeg '
            f"has play at {wrong}; write 0 there, or choose another backlash_side"
        )
    return found


def outside_posture(width: float | tuple[float, ...]) -> str:
    """Joints with play that the closed form does not know, in words; empty if there are none."""
    if isinstance(width, float):
        return "every joint" if width else ""
    joints = [str(i + 1) for i, one in enumerate(width) if one and i not in (2, 4)]
    return f"joint{'s' if len(joints) > 1 else ''} {', '.join(joints)}" if joints else ""


CLOSED_FORM = (
    "joints 2 and 3 with level parallel axes on an upright joint 1, and an arm that stands upright "
    "or lies level at joint zero"
)
"""The arms whose joints sag by sines and cosines of q2 and q2 + q3."""
LISTS = (
    "harmonic_mdeg",
    "high_harmonic_mdeg",
    "encoder_mdeg",
    "backlash_mdeg",
    "drive_nm_per_mrad",
    "bearing_nm_per_mrad",
)
"""Keys with one number per joint."""


def truth_faults(truth: TruthSettings, robot: "Robot") -> list[Fault]:
    """Faults of a truth that this robot cannot have."""
    from calib.identification.joint_models import gravity_quarters

    n = robot.model.chain.n_joints
    faults = []
    for key in LISTS:
        value = getattr(truth, key)
        if isinstance(value, tuple) and value and len(value) != n:
            entries = "entry" if len(value) == 1 else "entries"
            message = f"[truth] {key} has {len(value)} {entries}; {robot.name} has {n} joints"
            faults.append(Fault(("truth", key), message, fix="give one per joint", value=value))
    if any(truth.gravity_mdeg) and gravity_quarters(robot.model.chain) is None:
        faults.append(
            Fault(
                ("truth", "gravity_mdeg"),
                f"[truth] gravity_mdeg does not fit this arm, {robot.name}: its sag is no sine of "
                "q2 and q2 + q3",
                allowed=CLOSED_FORM,
                fix='write gravity_mdeg = [0, 0, 0], or preset = "rigid" or "elastic"',
                value=truth.gravity_mdeg,
            )
        )
    slides = [i + 1 for i, kind in enumerate(robot.model.chain.kinds) if kind == "prismatic"]
    if truth.drive_nm_per_mrad and slides:
        faults.append(
            Fault(
                ("truth", "drive_nm_per_mrad"),
                f"[truth] drive_nm_per_mrad is set, and joint {slides[0]} of {robot.name} slides",
                allowed="springs belong to arms whose joints all turn",
                fix="write drive_nm_per_mrad = []",
                value=truth.drive_nm_per_mrad,
            )
        )
    if isinstance(truth.backlash_mdeg, tuple) and any(
        truth.backlash_mdeg[i - 1] for i in slides if i <= len(truth.backlash_mdeg)
    ):
        faults.append(
            Fault(
                ("truth", "backlash_mdeg"),
                f"[truth] backlash_mdeg gives play to joint {slides[0]} of {robot.name}, a slide",
                allowed="play is an angle",
                fix="write 0 there",
                value=truth.backlash_mdeg,
            )
        )
    return faults


def require_truth(robot: "Robot", truth: TruthSettings, *, where: str = "scenario") -> None:
    """Raise one InputError if the robot cannot have this truth."""
    faults = truth_faults(truth, robot)
    if faults:
        raise one_error(faults, where)
