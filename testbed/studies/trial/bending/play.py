"""How a true arm comes to its poses: hysteresis, what swings after a stop, and a film of it."""

import numpy as np

from calib.arrays import Array
from testbed.laboratory.truth.laboratory import open_laboratory, resting_arm
from testbed.laboratory.truth.moving import STEP, MovingArm
from testbed.laboratory.truth.setting import Setting, journey, validation_start
from testbed.laboratory.truth.springs import ElasticArm, as_bends
from testbed.scenario.scenario import Scenario
from testbed.studies.trial.bending.records import Ways

POSES = 8
"""Held-out poses at most that are approached from both sides."""
SLOW = 8.0
"""Time there and back of a loop of hysteresis [s]."""
WAYS = 3.0
"""A loop goes so many of its widths to either side."""
LEAST = np.radians(2e-3)
"""Width for which the way of joints without friction is made [rad]."""
LOOKS, LONG, REST = 121, 1.2, 4.0
"""What swings is looked at so often, until so much more than the campaign's dwell, and at least
a second; at rest it is after that time or two seconds more than the dwell [s]."""
EVERY = 5
"""Steps from one row of a film to the next."""
BEFORE, AFTER = 300, 400
"""Steps of a film before and after the stop of the motors."""


def moved(scenario: Scenario, setting: Setting) -> Ways:
    """The ways of the true arm of a campaign; no random numbers are drawn."""
    arm, rest = open_laboratory(scenario, setting).truth.simulator, resting_arm(scenario, setting)
    if not isinstance(arm, MovingArm) or rest is None:
        raise RuntimeError("this arm does not move")
    start, pose_time = validation_start(scenario), scenario.tracker.pose_s
    previous = journey(setting.test_q, start, pose_time).previous
    q = setting.test_q[:POSES] + setting.true.joint_errors.offsets(setting.test_q[:POSES])
    travel = q - previous[:POSES]
    command, turn, tool, width, tool_width = loops(arm, rest, q[0])
    dwell, away, seen, apart = waited(arm, q, travel)
    worst = int(away[0].argmax()) % len(q)
    film = [filmed(arm, rest, q[worst], side * travel[worst]) for side in (1.0, -1.0)]
    film_q, film_bends, film_away = (np.concatenate(parts) for parts in zip(*film, strict=True))
    starts = np.array([0, len(film[0][0])])
    return Ways(
        command, turn, tool, width, tool_width, dwell, away, seen, apart, film_q, film_bends,
        film_away, starts, EVERY * STEP,
    )  # fmt: skip


def loops(arm: MovingArm, rest: ElasticArm, q: Array) -> tuple[Array, Array, Array, Array, float]:
    """All motors swing slowly about q (n,): first five fields of `Ways`, once round."""
    widths = 2 * arm.motion.friction / arm.springs.drive
    reach = WAYS * np.maximum(widths, LEAST)
    period = round(SLOW / STEP)
    # one half turn ahead: friction has to be wound up
    turn = np.arange(1, period * 3 // 2 + 1) / period
    command = -np.cos(2 * np.pi * turn)[:, None] * reach
    still = rest.deflections(q[None])
    angles = arm.follow(q + command, every=EVERY)[period // 2 // EVERY - 1 :]
    shown = command[EVERY - 1 :: EVERY][period // 2 // EVERY - 1 :]
    sprung = (angles - still).reshape(len(angles), len(q), -1)[:, :, 0]
    tool = (arm.bent(np.tile(q, (len(angles), 1)), angles) - arm.bent(q[None], still))[:, :3, 3]
    down, up = (part * period // 4 // EVERY for part in (1, 3))
    across = tool[down] - tool[up]
    width = float(np.linalg.norm(across))
    along = tool @ (across / max(width, 1e-15))
    return shown, sprung, along, sprung[down] - sprung[up], width


def waited(arm: MovingArm, q: Array, travel: Array) -> tuple[Array, Array, Array, Array]:
    """Dwells (d,), distances from rest (d, w) and (w,), both ways apart (v,); see `Ways`."""
    own = arm.motion.dwell
    dwell = np.linspace(0.0, max(1.0, LONG * own), LOOKS)
    late = max(REST, own + 2.0, 2 * dwell[-1])
    times = np.unique([*dwell, own, late])
    ways = [arm.looks(q, side * travel, tuple(times))[..., :3, 3] for side in (1, -1)]
    looks = np.concatenate(ways, axis=1)
    away = np.linalg.norm(looks - looks[-1], axis=-1)
    at = int(np.searchsorted(times, own))
    apart = np.linalg.norm(ways[0][at] - ways[1][at], axis=-1)
    return dwell, away[np.searchsorted(times, dwell)], away[at], apart


def filmed(arm: MovingArm, rest: ElasticArm, q: Array, travel: Array) -> tuple[Array, Array, Array]:
    """Motors (f, n), bends (f, n, 3) and tool's distance (f,) beside rest on one approach."""
    path = arm.approach(q, travel)
    first = max(len(path) - BEFORE, 0) // EVERY
    path = np.vstack([path, np.tile(q, (AFTER, 1))])
    angles = arm.follow(path, every=EVERY)[first:]
    motors = path[EVERY - 1 :: EVERY][first : first + len(angles)]
    still = rest.deflections(motors)
    tool, stands = (arm.bent(motors, each)[:, :3, 3] for each in (angles, still))
    bends = as_bends(angles - still, len(q))
    return motors, bends, np.linalg.norm(tool - stands, axis=1)
