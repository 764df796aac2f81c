"""Are positions so exact that a controller made them? Base and tool then leave rounding alone."""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.model import RobotModel
from testbed.files.frames_fit import Misfit, flange_poses
from testbed.files.rows.shifts import as_read
from testbed.files.session import Session
from testbed.units import significant

MODEL = 1e-6
"""A misfit below this is no measurement but the model of a controller [m]."""
ROUNDED = 1.2
"""A misfit below so many times what the digits of a file leave is a model's, too: the links of a
real robot leave a tenth of a millimeter or more."""
COMMANDED = 1e-5
"""What the digits of joints may leave at most if these are not read back: those beside a pose on a
screen were, whatever a file says, and what an instrument sees scatters by more [m]."""
METERS = tuple(10.0**-k for k in range(3, 7))
TURNS = (*(np.radians(10.0**-k) for k in range(1, 5)), *(10.0**-k for k in range(2, 6)))
"""Steps to which positions [m] and angles [rad] are rounded in files."""
ON_STEP = 1e-5
"""Part of a step that rounding in float64 may leave."""


def exactness(model: RobotModel, session: Session, rows: Index, stated: Misfit) -> str:
    """What to say of rows that the nominal robot explains better than a real one; else empty."""
    if stated.position < MODEL:
        return (
            f"base and tool explain the positions to {significant(stated.position * 1e9, 2)} nm: "
            "these are a controller's own poses, not measurements"
        )
    if stated.position < ROUNDED * _left_by_digits(model, session, rows):
        return (
            f"base and tool explain the positions to {stated.shown}, all that the digits of the "
            "file allow: are these a controller's own poses, not measurements?"
        )
    return ""


def _left_by_digits(model: RobotModel, session: Session, rows: Index) -> float:
    """Root mean square that rounding to the digits of a file leaves of the flange's place [m].

    Rounding to steps g is off by g / sqrt(12) (JCGM 100:2008, F.2.2.1). Joints that were commanded
    are what they are, however few their digits: they leave `COMMANDED` at most, and nothing where
    all joints slide, as real axes that are compensated are off by a few micrometers.
    """
    read = as_read(session, rows)
    joints = moved_by_digits(model, read.q, digit_steps(model, read.q))
    if session.joint_source != "read-back":
        turns = bool((model.chain.prismatic == 0).any())
        joints = min(joints, COMMANDED) if turns else 0.0
    return float(np.sqrt(3 * _step(read.position, METERS) ** 2 / 12 + joints**2))


def digit_steps(model: RobotModel, q: Array) -> Array:
    """Steps (n,) of which all values of a joint (m, n) are multiples [rad, m]; 0 without any."""
    slides = model.chain.prismatic > 0
    return np.array(
        [_step(q[:, j], METERS if slides[j] else TURNS) for j in range(q.shape[1])], dtype=float
    )


def moved_by_digits(model: RobotModel, q: Array, steps: Array) -> float:
    """Root mean square by which joints (m, n) rounded to steps (n,) move the flange [m]."""
    F, variance = flange_poses(model, q), 0.0
    for step, turned in zip(steps, np.diag(steps), strict=True):
        if step > 0:
            moved = flange_poses(model, q + turned)[:, :3, 3] - F[:, :3, 3]
            variance += float(np.square(moved).sum(axis=1).mean()) / 12
    return float(np.sqrt(variance))


def _step(values: Array, steps: Sequence[float]) -> float:
    """The largest of some steps of which all values are multiples; 0 if there is none."""
    found = (one for one in sorted(steps, reverse=True)
             if np.abs(values / one - np.round(values / one)).max() < ON_STEP)  # fmt: skip
    return next(found, 0.0)
