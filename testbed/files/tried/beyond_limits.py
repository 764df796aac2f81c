"""Joints beyond the limits by the readings: full turns, other zeros of a table, another order."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from calib.arrays import Array, Bool, frozen
from calib.errors import InputError
from testbed.files.alternatives import ORDER, UNIT
from testbed.files.frames_fit import FAR, Misfit
from testbed.files.probe import probe
from testbed.files.refusal import refusal
from testbed.files.rows.limits import MANY
from testbed.files.session import Session
from testbed.files.tried.quarter_turns import QUARTER, ZEROS
from testbed.robots.controller import BEYOND, UNLIMITED
from testbed.robots.robot import Robot
from testbed.units import listed

CODE = "M20"
QUARTERS = (0, 1, -1, 2, -2, 3, -3)
"""Turns that are tried, the least first."""


def explained(error: InputError, robot: Robot, read: Callable[[Robot], Session]) -> InputError:
    """The error of joints beyond their limits, or a better one: turns, or another order.

    Parameters
    ----------
    error : InputError
        Of reading a session.
    robot : Robot
        Whose limits they are.
    read : callable
        Reads the same session for a robot.
    """
    if error.code != CODE:
        return error
    free = replace(robot, limits=frozen(np.tile([-UNLIMITED, UNLIMITED], (len(robot.limits), 1))))
    try:
        session = read(free)
    except InputError:
        return error
    q = session.measurements.q
    beyond = np.array([_beyond(robot, q + QUARTER * k * _turning(robot)) for k in QUARTERS])
    whole = _beyond(robot, _by_full_turns(robot, q))
    found = probe(free, session, links=False)  # zeros, turns and order are told by frames alone
    turned = not (np.minimum(beyond.min(axis=0), whole) > MANY).any()
    if turned and found.stated is not None and found.wrong is None and found.stated.score <= FAR:
        return _of_ends(error, robot, beyond, whole, found.stated)
    told = (ZEROS, UNIT, ORDER) if turned else (ORDER,)
    if found.wrong is None or found.wrong.alternative.name not in told:
        return error
    try:
        found.raise_if_wrong()
    except InputError as better:
        return better
    return error


def _turning(robot: Robot) -> Bool:
    """Which joints (n,) turn."""
    return np.asarray(robot.model.chain.prismatic == 0)


def _beyond(robot: Robot, q: Array) -> Array:
    """Share (n,) of joints (m, n) that lie beyond their limits."""
    lower, upper = robot.limits.T
    return np.asarray(((q < lower - BEYOND) | (q > upper + BEYOND)).mean(axis=0))


def _by_full_turns(robot: Robot, q: Array) -> Array:
    """Joints (m, n) brought inside their limits by full turns, where these can [rad, m]."""
    lower, upper = robot.limits.T
    out = (q < lower - BEYOND) | (q > upper + BEYOND)
    return np.where(out & _turning(robot), lower + (q - lower) % (4 * QUARTER), q)


def _of_ends(
    error: InputError, robot: Robot, beyond: Array, whole: Array, stated: Misfit
) -> InputError:
    """The error of joints counted by full turns, or of ends with another zero.

    A base takes up the zero of a first joint, and a tool that of a last one. `beyond` (7, n) are
    the shares beyond the limits after turns by `QUARTERS`, `whole` (n,) those after full turns,
    which a table from 0 to 360 deg needs: what the readings say is the same.
    """
    far = np.flatnonzero(beyond[QUARTERS.index(0)] > MANY).tolist()
    ends = {*far} <= {0, robot.model.chain.n_joints - 1} and not (beyond.min(axis=0) > MANY).any()
    counted = not (whole[far] > MANY).any()
    if not far or not (ends or counted):
        return error
    turns = [QUARTERS[int(np.argmin(beyond[:, j] > MANY))] for j in far]
    added = listed([f"{90 * k:+d} deg to q{j + 1}" for j, k in zip(far, turns, strict=True)])
    names = listed([f"q{j + 1}" for j in far])
    round_ = f"{'it counts' if len(far) == 1 else 'they count'} full turns"
    other = "the zero is another than that of its file, which they take up"
    by_turns = f"take 360 deg off the values of {names} above the limits, and add it below"
    by_zero = f"add {added} in the table"
    both = counted and ends
    turned = f"{round_}, as from 0 to 360 deg"
    why = f"{turned}, or {other}" if both else turned if counted else other
    fix = f"if {round_}, {by_turns}; if the zero is another, {by_zero}" if both else (
        by_turns if counted else by_zero
    )  # fmt: skip
    return refusal(
        error.where, f"q{far[0] + 1}",
        f"{names} often {'lies' if len(far) == 1 else 'lie'} outside "
        f"the limits of {robot.name}, and base and tool leave {stated.shown} all the same: {why}",
        code=CODE, allowed=error.allowed, fix=fix,
    )  # fmt: skip
