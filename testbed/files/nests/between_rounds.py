"""The drift of a station off its readings, between two rounds over the nests in proportion."""

from dataclasses import replace

import numpy as np

from calib.arrays import Array, Index, frozen
from calib.geometry.frames import exp_so3
from calib.measurement.corrections import Corrections
from testbed.files.readings import Readings
from testbed.files.session import Drift


def correct_drift(readings: Readings, drift: Drift, begins: Array, middle: Array) -> Readings:
    """Readings with the drift taken off, between two rounds in proportion.

    What the noise of the nests leaves in them goes with them: a step is of two rounds, the first
    among them, in whose frame they are then.
    """
    if not drift.corrected:
        return readings
    before, after, part = _between(readings.order, begins)
    part = part[:, None]
    at = (1 - part) * drift.steps[before] + part * drift.steps[after]
    R = exp_so3(at[:, 3:])
    back = np.swapaxes(R, 1, 2)
    position = (back @ (readings.position - at[:, :3])[..., None])[..., 0]
    rotation = readings.rotation if readings.kind == "point" else back @ readings.rotation
    which = np.column_stack([before, after, np.zeros_like(before)])
    share = np.column_stack([1 - part, part, np.full_like(part, -1.0)])
    left = Corrections(which, frozen(share), frozen(position - middle), drift.covariance)
    return replace(readings, position=position, rotation=rotation, corrections=left)


def _between(order: Index, begins: Array) -> tuple[Index, Index, Array]:
    """Rounds before and after each reading, and how far it is on the way; the ends are held."""
    last = len(begins) - 1
    after = np.searchsorted(begins, order, side="right").clip(1, last) if last else 0 * order
    before = np.maximum(after - 1, 0)
    way = begins[after] - begins[before]
    part = (order - begins[before]) / np.where(way > 0, way, 1.0)
    return before, after, np.clip(part, 0.0, 1.0)
