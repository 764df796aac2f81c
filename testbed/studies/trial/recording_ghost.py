"""The true robot as a ghost in the recording: what no model knows of it is drawn many times."""

import numpy as np

from calib.arrays import Array
from calib.geometry.bodies import Z
from calib.geometry.chain import Chain
from calib.geometry.jacobian import pose_and_jacobian
from calib.geometry.parameters import CHARACTERISTIC_LENGTH
from testbed.recording.cell import draw_arm
from testbed.recording.pen import Pen
from testbed.recording.style import GHOST_COLOR
from testbed.recording.timeline import Timeline, eased
from testbed.robots.robot import Robot
from testbed.studies.trial.recording_cell import ShownTrial

MOVE = "move"
"""The chapter in which a ghost of its own moves."""


def known(timeline: Timeline) -> Array:
    """How far (s,) the model in use has moved from nominal (0) to identified (1)."""
    identify = timeline.phase("identify")
    part = np.zeros(timeline.n_steps)
    part[identify.steps] = eased(np.linspace(0, 1, identify.stop - identify.start))
    part[identify.stop :] = 1
    return part


def draw_ghost(shown: ShownTrial, robot: Robot, pen: Pen) -> None:
    """The true robot with its deviation from the model in use drawn many times.

    Until identification the model in use is the nominal one; while the solver works the ghost
    closes in on what the identified model still leaves. Where another ghost moves it hides.
    """
    part, q = known(pen.timeline), pen.timeline.q
    values, index = np.unique(part, return_inverse=True)
    bends = shown.ghost * bends_left(shown, q, part)
    chains = (*ghost_chains(shown, shown.ghost, values), shown.setting.nominal.chain)
    for phase in pen.timeline.phases:
        if phase.name == MOVE:
            bends[phase.steps], index[phase.steps] = 0.0, len(values)
    path, across = shown.ghost_path, bends[:, :, :Z] if bends[:, :, :Z].any() else None
    turned = q + bends[:, :, Z]
    draw_arm(pen, path, robot, turned, chains, index.reshape(-1), GHOST_COLOR, across)


def bends_left(shown: ShownTrial, q: Array, known: Array) -> Array:
    """What each joint of the true robot bends beyond the model in use (s, n, 3), about x, y, z.

    `known` (s,) is how far that model has moved from nominal to identified [rad, m].
    """
    models = shown.setting.nominal, shown.estimate.identification.model
    nominal, identified = (model.joint_errors.bends(q) for model in models)
    weight = known[:, None, None]
    left = shown.setting.true.joint_errors.bends(q) - (1 - weight) * nominal - weight * identified
    return left if shown.arm is None else left + shown.arm.bends(q)


def ghost_chains(shown: ShownTrial, factor: int, known: Array) -> tuple[Chain, ...]:
    """Nominal chain moved by `factor` times what is left of the truth at each value of `known`."""
    nominal = shown.setting.nominal.chain
    before = nominal.step_to(shown.setting.true.chain)
    identified = shown.estimate.identification.model.chain
    q = np.vstack([shown.trial.measurements.q, shown.setting.test_q])
    after = smallest_equal(nominal, before - nominal.step_to(identified), q)
    return tuple(nominal.moved(factor * ((1 - w) * before + w * after)) for w in known)


def smallest_equal(chain: Chain, step: Array, q: Array) -> Array:
    """Smallest step (42,) that moves the tool at q as `step` does, to first order [m, rad].

    Two models may describe the same robot with different numbers; what differs only in that would
    otherwise be drawn as links out of place.
    """
    _, J = pose_and_jacobian(chain, q)
    length = CHARACTERISTIC_LENGTH
    rows = np.array([1, 1, 1, length, length, length])
    frame, link = (
        (1, 1, 1, 1 / length, 1 / length, 1 / length),
        (1 / length, 1, 1) + (1 / length,) * 2,
    )
    columns = np.array([*frame, *(link * chain.n_joints), *frame])
    A = (J * rows[:, None] * columns).reshape(-1, len(columns))
    return np.asarray(columns * np.linalg.lstsq(A, A @ (step / columns), rcond=1e-9)[0])
