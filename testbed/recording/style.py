"""Sizes and colors of what a recording draws, the same for every verb."""

import numpy as np

from calib.arrays import Array

Color = tuple[int, ...]
"""Red, green, blue and perhaps alpha, from 0 to 255."""

ARROW_SIZE = 0.16
"""Longest drawn error before calibration [m]."""
BEFORE_COLOR, AFTER_COLOR = (200, 52, 52), (20, 140, 70)
"""Of errors in the cell."""

SEARCH_PHASE, MEASURE_PHASE = (128, 104, 98), (52, 128, 196)
IDENTIFY_PHASE, EVALUATE_PHASE, MOVE_PHASE = (58, 140, 72), (204, 146, 62), (150, 92, 160)
"""Of like phases on the bar, whatever the verb."""

RED, GREEN = (232, 84, 80), (60, 190, 110)
"""Before and after in the plots."""
LINE_COLOR, STATED_COLOR, MUTED_COLOR = (92, 150, 240), (140, 160, 250), (150, 156, 164)
BAND_COLOR, GRID_COLOR, TEXT_COLOR = (92, 98, 106), (124, 130, 138), (140, 146, 154)
COVERED = (110, 240, 160)
"""Readable on the dark and on the light ground of the viewer's two themes."""

VIRIDIS = np.array(
    [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]], dtype=np.float64
)


def viridis(values: Array, highest: float) -> Array:
    """Colors (m, 3) from 0 to 255 for values from 0 (dark) to `highest` (bright)."""
    place = np.clip(np.asarray(values) / max(highest, 1e-300), 0, 1) * (len(VIRIDIS) - 1)
    low = np.minimum(place.astype(np.int64), len(VIRIDIS) - 2)
    part = (place - low)[:, None]
    return np.asarray((VIRIDIS[low] * (1 - part) + VIRIDIS[low + 1] * part).astype(np.uint8))


def nice_factor(largest: float, typical: float) -> int:
    """Exaggeration 1, 2, 3, 5, 10, 20 ... that draws `typical` just below `largest` [m]."""
    ratio = largest / max(typical, 1e-12)
    if ratio <= 1:
        return 1
    power = 10 ** int(np.floor(np.log10(ratio)))
    return int(next(f * power for f in (5, 3, 2, 1) if f * power <= ratio * (1 + 1e-12)))
