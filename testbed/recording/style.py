"""Sizes and colors of what a recording draws, the same for every verb."""

import numpy as np

from calib.arrays import Array

Color = tuple[int, ...]
"""Red, green, blue and perhaps alpha, from 0 to 255."""

ARROW_SIZE = 0.16
"""Longest drawn error before calibration [m]."""

BLUE, VERMILION = (0, 114, 178), (213, 94, 0)
"""After and before, better and worse, inside and outside: of Okabe and Ito's colors these two are
told apart by everybody, and in gray."""
SKY, ORANGE, LEAF, PINK = (86, 180, 233), (230, 159, 0), (0, 158, 115), (204, 121, 167)
"""More of their colors, where neither is better."""
BEFORE_COLOR, AFTER_COLOR = VERMILION, BLUE
GHOST_COLOR = (176, 40, 170, 110)
"""The true robot: a color no robot has."""
CANDIDATE_COLOR, CHOSEN_COLOR, BEAM_COLOR = (120, 132, 146), BLUE, (52, 58, 68, 230)

SEARCH_PHASE, MEASURE_PHASE = (128, 104, 98), (52, 128, 196)
IDENTIFY_PHASE, EVALUATE_PHASE, MOVE_PHASE = (24, 128, 118), (204, 146, 62), (150, 92, 160)
"""Of like phases on the bar, whatever the verb."""

LINE_COLOR, STATED_COLOR, MUTED_COLOR = SKY, PINK, (150, 156, 164)
BAND_COLOR, GRID_COLOR, TEXT_COLOR = (58, 63, 70), (66, 71, 78), (176, 182, 190)
"""In the plots; readable on the dark and on the light ground of the viewer's two themes."""

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
