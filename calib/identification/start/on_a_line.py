"""Turns of base and stations that readings at one place or along one line do not tell."""

import numpy as np

from calib.arrays import Array
from calib.geometry.model import RobotModel
from calib.measurement.observations import POINT, Measurements
from calib.measurement.residual import linearize

SURE = 3.7
"""Readings of one place, in units of their noise, are an (m, 3) matrix of norm below sqrt(m) +
sqrt(3) + t but for a chance of exp(-t^2 / 2), here 0.1 % (Davidson and Szarek 2001, II.13)."""


def untold_turns(model: RobotModel, measured: Measurements) -> tuple[str, ...]:
    """Names of turns of base and stations that no reading tells, whatever the links are.

    A tip that touches two sockets sees the base turned about the line through them as much as the
    links are wrong: a fit that frees this turn moves along it without end. One place tells no turn.

    Parameters
    ----------
    model : RobotModel
        With base and stations about where they are.
    measured : Measurements
        Those of a station count if they are points, and as near to one line as their noise.
    """
    held = list[str]()
    for station in np.unique(measured.station).tolist():
        rows = measured.rows(np.flatnonzero(measured.station == station))
        if (rows.kind != POINT).any() or (extents := extents_told(rows)) > 1:
            continue
        frame = f"station{station + 1}" if station else "base"
        turns = [f"{frame}.r{axis}" for axis in "xyz"]
        held += [turns[_least_told(model, rows, frame)]] if extents else turns
    return tuple(name for name in held if name in model.names)


def extents_told(rows: Measurements) -> int:
    """Number of directions in which points lie further apart than their noise: 0 for one place."""
    off = rows.position - rows.position.mean(axis=0)
    noise = np.linalg.cholesky(rows.covariance[:, :3, :3].mean(axis=0))
    extents = np.linalg.svd(np.linalg.solve(noise, off.T), compute_uv=False)
    return int((extents > np.sqrt(len(rows)) + np.sqrt(3) + SURE).sum())


def _least_told(model: RobotModel, rows: Measurements, frame: str) -> int:
    """The axis of a frame that points most along the line, by its place in x, y, z.

    Of the turns of a frame, those about the line move its points least, beside what a shift does.
    """
    first = model.names.index(f"{frame}.x")
    A: Array = linearize(model, rows).A[:, first : first + 6]
    shifts, turns = A[:, :3], A[:, 3:]
    left = turns - shifts @ np.linalg.lstsq(shifts, turns, rcond=None)[0]
    about = np.linalg.svd(left)[2][-1]
    return int(np.abs(about).argmax())
