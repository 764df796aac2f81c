"""Joints beyond the limits because a table has their zeros elsewhere: told by the readings."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from calib.arrays import Array, frozen
from calib.errors import InputError
from testbed.files.probe import probe
from testbed.files.rows.limits import MANY
from testbed.files.session import Session
from testbed.files.tried.quarter_turns import QUARTER, ZEROS
from testbed.robots.controller import BEYOND, UNLIMITED
from testbed.robots.robot import Robot

CODE = "M20"


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
    if not _may_be(robot, session.measurements.q):
        return error
    found = probe(free, session)
    if found.wrong is None or found.wrong.alternative.name != ZEROS:
        return error
    try:
        found.raise_if_wrong()
    except InputError as better:
        return better
    return error


def _may_be(robot: Robot, q: Array) -> bool:
    """Whether each turning joint (m, n) lies inside its limits after some number of quarters."""
    lower, upper = robot.limits.T
    beyond = np.empty((7, q.shape[1]))
    for k in range(len(beyond)):
        there = q + QUARTER * (k - 3) * (robot.model.chain.prismatic == 0)
        beyond[k] = ((there < lower - BEYOND) | (there > upper + BEYOND)).mean(axis=0)
    return bool((beyond.min(axis=0) <= MANY).all())
