"""Are positions so exact that a controller made them? Base and tool then leave rounding alone."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.model import RobotModel
from testbed.files.alternatives import Interpretation
from testbed.files.frames_fit import Misfit, flange_poses
from testbed.files.rows.shifts import as_read, misfit_of
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
SHOWN = 1e-5, np.radians(0.01)
"""Steps of places [m] and of joints [rad] that the screens of controllers round to: trackers write
places finer, so joints beside such places were copied from a screen, whatever a file says. That
holds where the links are those of a drawing: identified ones may leave no more than an instrument
does, and no controller has them."""
DRAWN = 1e-6, 1e-9
"""Links of a drawing are multiples of the first, as far as the second [m]."""
METERS = tuple(10.0**-k for k in range(3, 7))
TURNS = (*(np.radians(10.0**-k) for k in range(1, 5)), *(10.0**-k for k in range(2, 6)))
"""Steps to which positions [m] and angles [rad] are rounded in files."""
ON_STEP = 1e-5
"""Part of a step that rounding in float64 may leave."""


def exactness(model: RobotModel, session: Session, rows: Index, stated: Misfit) -> str:
    """What to say of rows that the nominal robot explains better than a real one; else empty.

    A controller computes its poses from one source of joints, be it the other one of a session.
    """
    read, back = as_read(session, rows), session.joint_source == "read-back"
    said = _exactness(model, read, stated, read_back=back)
    if said or session.read_back is None:
        return said
    other = replace(read, q=session.read_back[rows])
    return _exactness(model, other, misfit_of(model, other), read_back=not back)


def _exactness(model: RobotModel, read: Interpretation, left: Misfit, *, read_back: bool) -> str:
    """The same by one source of joints."""
    if left.position < MODEL:
        return (
            f"base and tool explain the positions to {significant(left.position * 1e9, 2)} nm: "
            "these are a controller's own poses, not measurements"
        )
    if left.position < ROUNDED * _left_by_digits(model, read, read_back=read_back):
        return (
            f"base and tool explain the positions to {left.shown}, all that the digits of the "
            "file allow: are these a controller's own poses, not measurements?"
        )
    return ""


def _left_by_digits(model: RobotModel, read: Interpretation, *, read_back: bool) -> float:
    """Root mean square that rounding to the digits of a file leaves of the flange's place [m].

    Rounding to steps g is off by g / sqrt(12) (JCGM 100:2008, F.2.2.1). Joints that were commanded
    are what they are, however few their digits: they leave `COMMANDED` at most, and nothing where
    all joints slide, as real axes that are compensated are off by a few micrometers. Places that
    are touched again and again are a drawing's, in round numbers: no file has rounded them.
    """
    place = 0.0 if _share_places(read) else step_of(read.position, METERS)
    steps = digit_steps(model, read.q)
    turns = model.chain.prismatic == 0
    shown = steps[turns] <= SHOWN[1] * (1 + ON_STEP)
    if not read_back and place >= SHOWN[0] and turns.all() and shown.any() and _is_drawn(model):
        read_back, steps = True, np.minimum(steps, SHOWN[1])  # one that never moved has any step
    joints = moved_by_digits(model, read.q, steps)
    if not read_back:
        joints = min(joints, COMMANDED) if turns.any() else 0.0
    return float(np.sqrt(3 * place**2 / 12 + joints**2))


def _share_places(read: Interpretation) -> bool:
    """Whether most rows lead with other joints to a place that another row has, to its digits."""
    places, joints = (len(np.unique(one, axis=0)) for one in (read.position, read.q))
    return 2 * places < joints


def _is_drawn(model: RobotModel) -> bool:
    """Whether all links have lengths as a drawing states them."""
    lengths = model.chain.links[:, 1:3]
    return bool((np.abs(lengths - DRAWN[0] * np.round(lengths / DRAWN[0])) < DRAWN[1]).all())


def digit_steps(model: RobotModel, q: Array) -> Array:
    """Steps (n,) of which all values of a joint (m, n) are multiples [rad, m]; 0 without any."""
    slides = model.chain.prismatic > 0
    return np.array(
        [step_of(q[:, j], METERS if slides[j] else TURNS) for j in range(q.shape[1])], dtype=float
    )


def moved_by_digits(model: RobotModel, q: Array, steps: Array) -> float:
    """Root mean square by which joints (m, n) rounded to steps (n,) move the flange [m]."""
    F, variance = flange_poses(model, q), 0.0
    for step, turned in zip(steps, np.diag(steps), strict=True):
        if step > 0:
            moved = flange_poses(model, q + turned)[:, :3, 3] - F[:, :3, 3]
            variance += float(np.square(moved).sum(axis=1).mean()) / 12
    return float(np.sqrt(variance))


def step_of(values: Array, steps: Sequence[float]) -> float:
    """The largest of some steps of which all values are multiples; 0 if there is none."""
    found = (one for one in sorted(steps, reverse=True)
             if np.abs(values / one - np.round(values / one)).max() < ON_STEP)  # fmt: skip
    return next(found, 0.0)
