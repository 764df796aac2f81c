"""What [truth] asks of its robot: one number per joint, and springs only where joints turn."""

from typing import TYPE_CHECKING

from testbed.mistakes import Fault, one_error
from testbed.settings_truth import TruthSettings

if TYPE_CHECKING:
    from testbed.robots.catalog import Robot

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
    from calib.identification.extended import gravity_quarters

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
