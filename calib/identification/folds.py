"""Folds of cross-validation: which training poses choose a model, and which are left out."""

import numpy as np

from calib.arrays import Index
from calib.measurement.observations import Measurements

FOLDS = 4
"""Number of parts of the training poses, each left out in turn to confirm a level."""
FEWEST_TO_CONFIRM = 5
"""Fewest poses per part."""
MANY = 400
"""Largest number of poses that a model is chosen by; of more, as many are drawn."""


def some_poses(
    measurements: Measurements, rng: np.random.Generator, most: int = MANY
) -> Measurements:
    """Rows of at most `most` poses, drawn at random."""
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
