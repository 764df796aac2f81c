"""Rigid motions between rounds over the same nests, and what shows one."""

import numpy as np

from calib.arrays import Array

FEWEST = 3
"""Nests that show a motion, out of one line."""
FLAT = 0.02
"""Nests are in line if their second principal extent is below this part of the first."""


def best_fit(a: Array, b: Array) -> tuple[Array, Array]:
    """Rotations (..., 3, 3) and shifts (..., 3) with b (..., k, 3) about R a + t, a (k, 3).

    References
    ----------
    Arun, Huang, Blostein 1987; Umeyama 1991 for the determinant.
    """
    center_a, center_b = a.mean(axis=0), b.mean(axis=-2)
    U, _, Vt = np.linalg.svd(np.swapaxes(b - center_b[..., None, :], -1, -2) @ (a - center_a))
    mirror = np.ones(U.shape[:-1])
    mirror[..., 2] = np.linalg.det(U @ Vt)
    R = (U * mirror[..., None, :]) @ Vt
    return R, center_b - R @ center_a


def show_a_turn(places: Array) -> bool:
    """Whether places (k, 3) are three or more, and not in one line."""
    if len(places) < FEWEST:
        return False
    extent = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)
    return bool(extent[1] > FLAT * extent[0])
