"""Turns of base and stations that readings at one place or along one line do not tell."""

import numpy as np

from calib.arrays import Array
from calib.geometry.model import RobotModel
from calib.measurement.observations import POINT, Measurements
from calib.measurement.residual import linearize


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
        held += [turns[k] for k in _least_told(model, rows, frame)] if extents else turns
    return tuple(name for name in held if name in model.names)


def extents_told(rows: Measurements) -> int:
    """Number of directions in which points lie further apart than their noise: 0 for one place."""
    off = rows.position - rows.position.mean(axis=0)
    noise = np.sqrt(np.trace(rows.covariance[:, :3, :3], axis1=1, axis2=2).mean() / 3)
    extents = np.linalg.svd(off, compute_uv=False) / np.sqrt(len(rows))
    return int((extents > noise).sum())


def _least_told(model: RobotModel, rows: Measurements, frame: str) -> list[int]:
    """The axis of a frame that points most along the line, as a list of one place in x, y, z.

    Of the turns of a frame, those about the line move its points least, beside what a shift does.
    """
    first = model.names.index(f"{frame}.x")
    A: Array = linearize(model, rows).A[:, first : first + 6]
    shifts, turns = A[:, :3], A[:, 3:]
    left = turns - shifts @ np.linalg.lstsq(shifts, turns, rcond=None)[0]
    about = np.linalg.svd(left)[2][-1]
    return [int(np.abs(about).argmax())]
