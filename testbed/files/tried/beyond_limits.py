"""Joints beyond the limits because a table has their zeros elsewhere: told by the readings."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from calib.arrays import Array, frozen
from calib.errors import InputError
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
    """The error of joints beyond their limits, or the better one where quarter turns explain them.

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
    beyond = np.array([_beyond(robot, q, k) for k in QUARTERS])
    if (beyond.min(axis=0) > MANY).any():
        return error
    found = probe(free, session)
    if found.stated is not None and found.wrong is None and found.stated.score <= FAR:
        return _of_ends(error, robot, beyond, found.stated)
    if found.wrong is None or found.wrong.alternative.name != ZEROS:
        return error
    try:
        found.raise_if_wrong()
    except InputError as better:
        return better
    return error


def _beyond(robot: Robot, q: Array, quarters: int) -> Array:
    """Share (n,) of joints (m, n) that lie beyond their limits after turns by quarters."""
    lower, upper = robot.limits.T
    there = q + QUARTER * quarters * (robot.model.chain.prismatic == 0)
    return np.asarray(((there < lower - BEYOND) | (there > upper + BEYOND)).mean(axis=0))


def _of_ends(error: InputError, robot: Robot, beyond: Array, stated: Misfit) -> InputError:
    """The error of a first or last joint with another zero, which base or tool take up.

    `beyond` (7, n) are the shares beyond the limits after turns by `QUARTERS`.
    """
    far = np.flatnonzero(beyond[QUARTERS.index(0)] > MANY).tolist()
    if not far or not {*far} <= {0, robot.model.chain.n_joints - 1}:
        return error
    turns = [QUARTERS[int(np.argmin(beyond[:, j] > MANY))] for j in far]
    added = listed([f"{90 * k:+d} deg to q{j + 1}" for j, k in zip(far, turns, strict=True)])
    return refusal(
        error.where, f"q{far[0] + 1}",
        f"{listed([f'q{j + 1}' for j in far])} often {'lies' if len(far) == 1 else 'lie'} outside "
        f"the limits of {robot.name}, and base and tool leave {stated.shown} all the same: the "
        "zero is another than that of its file, which they take up", code=CODE,
        allowed=error.allowed, fix=f"add {added} in the table",
    )  # fmt: skip
