"""Rows before and after a move of the instrument or the base that no table says."""

import numpy as np

from calib.arrays import Array, evenly
from testbed.files.frames_fit import FAR, PARTED, TIMES, Frames, fit_frames

FITTED = 300
"""Rows of a part by which its frames are found: of 300 000 rows all of them took 40 s."""
ROUNDS = 2
"""Times the place of the move is asked anew, with frames of both parts."""


def parts_of(F: Array, position: Array, rotation: Array | None) -> int | None:
    """Row from which on readings have other frames than before; None if these explain nothing.

    The longest beginning that one fit brings near is found by halving; then the row is the one at
    which the errors with frames of both parts are least.

    Parameters
    ----------
    F : (m, 4, 4) array
        Flange poses of the nominal robot, in the order of the rows [m].
    position : (m, 3) array
        What was measured [m].
    rotation : (m, 3, 3) array, optional
        The same of full poses.
    """

    def fitted(rows: slice) -> tuple[Frames, float]:
        some = evenly(np.arange(m)[rows], FITTED)
        turned = None if rotation is None else rotation[some]
        frames = fit_frames(F[some], position[some], turned, one_valley=True)
        return frames, frames.misfit(F[some], position[some], turned).score

    m = len(F)
    near, far = PARTED, m
    if m < 2 * PARTED or fitted(slice(0, near))[1] > FAR:
        return None
    while far - near > 1:
        k = (near + far) // 2
        near, far = (k, far) if fitted(slice(0, k))[1] <= FAR else (near, k)
    for _ in range(ROUNDS):
        near = min(max(near, PARTED), m - PARTED)
        before, after = (
            np.square(fitted(rows)[0].position_errors(F, position))
            for rows in (slice(0, near), slice(near, m))
        )
        left = np.concatenate([[0], np.cumsum(before)]) + np.concatenate(
            [[0], np.cumsum(after[::-1])]
        )[::-1]  # fmt: skip
        near = int(np.argmin(left))
    if not PARTED <= near <= m - PARTED:
        return None
    worst = max(fitted(slice(0, near))[1], fitted(slice(near, m))[1])
    return near if worst <= FAR / TIMES else None
