"""What rows that no frames bring near their joints have in common, where they follow each other."""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.frames import length, target_points
from testbed.files.frames_fit import Frames
from testbed.units import MM, fixed, significant

IN_A_ROW = "rows one after the other"
"""By which a note on a run is known."""
FEWEST = 4
"""Rows one after the other that are named as one: fewer may be as many wrong shots."""
FACTORS = {1e3: "m among mm", 25.4: "inches among mm", 10.0: "cm among mm", 1e-3: "mm among m"}
"""By which readings in another unit than the others would fit."""
ALIKE = 0.2
"""Rows are off by the same if they differ from their mean by less than this part of it."""


def runs_of(places: Sequence[int]) -> list[Index]:
    """Stretches of `FEWEST` or more places that follow each other."""
    some = np.sort(np.asarray(places, dtype=np.int64))
    parts = np.split(some, np.flatnonzero(np.diff(some) > 1) + 1)
    return [part for part in parts if len(part) >= FEWEST]


def run_words(F: Array, position: Array, frames: Frames, near: float) -> str:
    """How far the rows of a run are off, and what explains all of them.

    Parameters
    ----------
    F : (m, 4, 4) array
        Flange poses of the nominal robot.
    position : (m, 3) array
        Readings [m].
    frames : Frames
        Which most rows of the file fit.
    near : float
        Error up to which a reading fits [m].
    """
    errors = frames.position_errors(F, position)
    low, high = (fixed(end * MM, 0) for end in (errors.min(), errors.max()))
    text = f"{low if low == high else f'{low} to {high}'} mm off"
    for factor, units in FACTORS.items():
        if (frames.position_errors(F, position * factor) <= near).all():
            return f"{text}, and all of them fit {factor:g} times as large ({units}?)"
    off = position - target_points(F, frames.arm) @ frames.R.T - frames.t
    on_tool = (np.swapaxes(frames.R @ F[:, :3, :3], 1, 2) @ off[:, :, None])[:, :, 0]
    for each, where in (
        (on_tool, "on the tool (another tool or reflector, or one that was not in its place?)"),
        (off, "before the instrument (was it pushed, or the base moved?)"),
    ):
        mean = each.mean(axis=0)
        if length(each - mean).max() <= max(ALIKE * np.linalg.norm(mean), near):
            size = significant(float(np.linalg.norm(mean)) * MM)
            return f"{text}, all of them by the same {size} mm {where}"
    return text
