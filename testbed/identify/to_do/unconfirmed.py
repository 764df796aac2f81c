"""Joint errors that the readings ask for, and that too few training poses can confirm."""

import numpy as np

from calib.identification.folds import FEWEST_TO_CONFIRM, FOLDS
from testbed.identify.calibration import Calibration

NEEDED = FOLDS * FEWEST_TO_CONFIRM
"""Training poses that can confirm a level of joint errors."""


def unconfirmed(calibration: Calibration) -> str:
    """What may explain what is left, and how it can be confirmed; empty if nothing is asked for."""
    asked = (step for step in calibration.choice.steps if not step.taken and np.isnan(step.before))
    step = next(asked, None)
    if step is None:
        return ""
    split = calibration.split
    poses = calibration.measurements.rows(split.is_train | split.is_test).n_poses
    fewer = "hold out fewer poses, or " if split.stated else f"--train {NEEDED}, or "
    how = f"{fewer if poses > NEEDED else ''}measure more"
    return (
        f"Joint errors ({step.level}, log evidence {step.gain:+.1f}) may explain what is left: "
        f"identify from {NEEDED} poses or more, which can confirm them ({how})."
    )
