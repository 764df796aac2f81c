"""Rotation matrices back into the numbers programs write: the inverse of `conventions`."""

import warnings

import numpy as np

from calib.arrays import Array
from calib.geometry.frames import log_so3
from testbed.files.conventions import MATRIX, QUATERNION, VECTOR


def in_form(form: str, old: Array, R: Array) -> Array:
    """Numbers (m, k) of rotations (m, 3, 3), of all that mean the same those nearest to `old`.

    Parameters
    ----------
    form : str
        As in `Stated.form`: matrix, quaternion, rotation_vector, or an Euler sequence.
    old : (m, k) array
        Numbers that stood there before [rad where they are angles].
    R : (m, 3, 3) array
        Rotations.
    """
    if form == MATRIX:
        return R.reshape(-1, 9)
    from scipy.spatial.transform import Rotation

    turns = Rotation.from_matrix(R)
    if form == QUATERNION:
        new = np.roll(turns.as_quat(), 1, axis=1)
        return np.asarray(new * np.where((new * old).sum(axis=1) < 0, -1.0, 1.0)[:, None])
    if form == VECTOR:
        new = log_so3(R)
        angle = np.linalg.norm(new, axis=1, keepdims=True)
        other = new * (1 - 2 * np.pi / np.maximum(angle, 1e-12))
        far = np.linalg.norm(new - old, axis=1) > np.linalg.norm(other - old, axis=1)
        return np.where(far[:, None], other, new)
    with warnings.catch_warnings():
        # where two axes line up only their sum counts: any split of it is right
        warnings.simplefilter("ignore")
        one = turns.as_euler(form)
    # proper Euler sequences (aba) flip their middle angle, the others mirror it
    middle = -one[:, 1] if form[0] == form[2] else np.pi - one[:, 1]
    two = np.stack([one[:, 0] + np.pi, middle, one[:, 2] + np.pi], axis=1)
    ways = [way - 2 * np.pi * np.round((way - old) / (2 * np.pi)) for way in (one, two)]
    far = np.abs(ways[0] - old).max(axis=1) > np.abs(ways[1] - old).max(axis=1)
    return np.where(far[:, None], ways[1], ways[0])
