"""Which training poses are asked for a model, and which of them are left out together in turn."""

import numpy as np

from calib.arrays import Index
from calib.measurement.observations import Measurements

FOLDS = 4
"""Parts of the training poses that are left out in turn to confirm a level."""
FEWEST_TO_CONFIRM = 5
"""Poses in each part."""
MANY = 400
"""Of more poses this many are asked which model they want."""


def some_poses(
    measurements: Measurements, rng: np.random.Generator, most: int = MANY
) -> Measurements:
    """The rows of at most so many poses, drawn at random."""
    pose = measurements.together
    poses = np.unique(pose)
    if len(poses) <= most:
        return measurements
    return measurements.rows(np.isin(pose, rng.permutation(poses)[:most]))


def parts_of(measurements: Measurements, rng: np.random.Generator) -> Index | None:
    """Part (m,) in which each row is left out; None with too few poses to confirm anything."""
    pose = np.unique(measurements.together, return_inverse=True)[1].ravel()
    count = int(pose.max()) + 1
    if count < FOLDS * FEWEST_TO_CONFIRM:
        return None
    return np.asarray(rng.permutation(count)[pose] % FOLDS)
