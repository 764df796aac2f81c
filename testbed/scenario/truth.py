"""What [truth] may not say: together with itself, or of the robot of the scenario."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from testbed.faults import Fault, one_error
from testbed.scenario.laboratory import TruthSettings
from testbed.units import counted, named

if TYPE_CHECKING:
    from testbed.robots.catalog import Robot

PEAK = 1.875
"""Largest speed of a quintic move over its mean speed."""


def truth_contradictions(truth: TruthSettings, pose_s: float) -> Iterator[str]:
    """Contradictions in [truth], and of a motion with the time from pose to pose [s]."""
    sprung = bool(truth.drive_nm_per_mrad)
    if sprung and any(truth.gravity_mdeg):
        yield (
            "[truth] gravity_mdeg and drive_nm_per_mrad would both make the arm droop; "
            "write gravity_mdeg = [0, 0, 0] or drive_nm_per_mrad = []"
        )
    if truth.bearing_nm_per_mrad and not sprung:
        yield (
            "[truth] bearing_nm_per_mrad is set, but the drives are stiff; "
            "give drive_nm_per_mrad or write bearing_nm_per_mrad = []"
        )
    if truth.payload_kg and not sprung:
        yield (
            f"[truth] payload_kg is {truth.payload_kg:g}, but no spring feels it; "
            "give drive_nm_per_mrad or write payload_kg = 0"
        )
    if truth.payloads_kg and not sprung:
        yield (
            "[truth] payloads_kg is set, but no spring feels them; "
            "give drive_nm_per_mrad or write payloads_kg = []"
        )
    fewest, most = truth.transmission_waves
    if fewest > most:
        yield (
            f"[truth] transmission_waves goes from {fewest} to {most}; "
            f"write transmission_waves = [{most}, {fewest}]"
        )
    if truth.backlash_side == "posture" and (wrong := _outside_posture(truth.backlash_mdeg)):
        yield (
            f'[truth] backlash_side is "posture", which covers joints 3 and 5 only; backlash_mdeg '
            f"has play at {wrong}; write 0 there, or choose another backlash_side"
        )
    yield from _of_motion(truth, pose_s)


def _of_motion(truth: TruthSettings, pose_s: float) -> Iterator[str]:
    """Contradictions of a moving arm: with stiff drives, and with the time from pose to pose."""
    if truth.motion and not truth.drive_nm_per_mrad:
        yield (
            "[truth] motion is true, but the drives are stiff; "
            "give drive_nm_per_mrad or write motion = false"
        )
    friction = truth.friction_nm
    if not truth.motion and (any(friction) if isinstance(friction, tuple) else friction):
        yield (
            "[truth] friction_nm is set, but an arm at rest feels none; "
            "write motion = true or friction_nm = 0"
        )
    busy = PEAK * truth.approach_deg / truth.speed_deg_s + truth.dwell_s
    if truth.motion and busy > pose_s:
        yield (
            f"[truth] approach_deg is {truth.approach_deg:g}, speed_deg_s {truth.speed_deg_s:g} "
            f"and dwell_s {truth.dwell_s:g}, which takes {busy:.3g} s; [tracker] pose_s is "
            f"{pose_s:g} from one shot to the next; raise pose_s or speed_deg_s"
        )


def _outside_posture(width: float | tuple[float, ...]) -> str:
    """Joints with play that the closed form does not know, in words; empty if there are none."""
    if isinstance(width, float):
        return "every joint" if width else ""
    joints = [str(i + 1) for i, one in enumerate(width) if one and i not in (2, 4)]
    return named("joint", joints) if joints else ""


CLOSED_FORM = (
    "joints 2 and 3 with level parallel axes on an upright joint 1, and an arm that stands upright "
    "or lies level at joint zero"
)
"""The arms whose joints sag by sines and cosines of q2 and q2 + q3."""
LISTS = (
    "harmonic_mdeg",
    "high_harmonic_mdeg",
    "transmission_mdeg",
    "encoder_mdeg",
    "gear_mdeg",
    "gear_ratio",
    "backlash_mdeg",
    "drive_nm_per_mrad",
    "bearing_nm_per_mrad",
    "friction_nm",
)
"""Keys with one number per joint."""


def truth_faults(truth: TruthSettings, robot: "Robot") -> Iterator[Fault]:
    """Faults of a truth that this robot cannot have."""
    from calib.identification.joint_models import gravity_quarters
    from testbed.robots.robot import NO_MASS

    n = robot.model.chain.n_joints
    for key in LISTS:
        value = getattr(truth, key)
        if isinstance(value, tuple) and value and len(value) != n:
            message = (
                f"[truth] {key} has {counted(len(value), 'entry')}; {robot.name} has {n} joints"
            )
            yield Fault(("truth", key), message, fix="give one per joint", value=value)
    quarters, width = gravity_quarters(robot.model.chain), truth.backlash_mdeg
    played = any(width) if isinstance(width, tuple) else width
    upright = quarters == (0, 0) and n >= 5
    if played and truth.backlash_side == "posture" and not upright:
        yield Fault(
            ("truth", "backlash_side"),
            f'[truth] backlash_side = "posture" does not fit this arm, {robot.name}',
            allowed="an upright arm of five joints or more, joints 2 and 3 level and parallel",
            fix='write backlash_side = "load" or "approach"',
            value=truth.backlash_side,
        )
    if any(truth.gravity_mdeg) and quarters is None:
        yield Fault(
            ("truth", "gravity_mdeg"),
            f"[truth] gravity_mdeg does not fit this arm, {robot.name}: its sag is no sine of q2 "
            "and q2 + q3",
            allowed=CLOSED_FORM,
            fix='write gravity_mdeg = [0, 0, 0], or preset = "rigid" or "elastic"',
            value=truth.gravity_mdeg,
        )
    slides = [i + 1 for i, kind in enumerate(robot.model.chain.kinds) if kind == "prismatic"]
    if truth.drive_nm_per_mrad and slides:
        yield Fault(
            ("truth", "drive_nm_per_mrad"),
            f"[truth] drive_nm_per_mrad is set, and joint {slides[0]} of {robot.name} slides",
            allowed="springs belong to arms whose joints all turn",
            fix="write drive_nm_per_mrad = []",
            value=truth.drive_nm_per_mrad,
        )
    if truth.drive_nm_per_mrad and robot.model.joint_errors.springs is not None:
        yield Fault(
            ("truth", "drive_nm_per_mrad"),
            f"[truth] drive_nm_per_mrad is set, and {robot.name} has springs of its own",
            allowed="an arm gives way by one set of springs",
            fix="choose a preset without springs, or remove [springs] from that file",
            value=truth.drive_nm_per_mrad,
        )
    assumed = [note for note in robot.notes if note.startswith(NO_MASS)]
    if truth.motion and assumed:
        yield Fault(
            ("truth", "motion"),
            f"[truth] motion is true, and of {robot.name} {assumed[0].partition(':')[0]}",
            allowed="an arm with the masses of all that it moves",
            fix="write them into its file, or write motion = false",
            value=truth.motion,
        )
    if isinstance(truth.backlash_mdeg, tuple) and any(
        truth.backlash_mdeg[i - 1] for i in slides if i <= len(truth.backlash_mdeg)
    ):
        yield Fault(
            ("truth", "backlash_mdeg"),
            f"[truth] backlash_mdeg gives play to joint {slides[0]} of {robot.name}, a slide",
            allowed="play is an angle",
            fix="write 0 there",
            value=truth.backlash_mdeg,
        )


def require_truth(robot: "Robot", truth: TruthSettings) -> None:
    """Raise one InputError if the robot cannot have this truth."""
    faults = [*truth_faults(truth, robot)]
    if faults:
        raise one_error(faults, "scenario")
