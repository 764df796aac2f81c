"""A tracker for tests: `paper` noise drawn on true poses, apart from the laboratory's own."""

import numpy as np

from calib.arrays import Array
from calib.geometry.frames import exp_so3
from calib.geometry.model import RobotModel
from calib.measurement import tables
from calib.measurement.observations import Measurements
from tests.reference import SIGMA_POSITION, SIGMA_ROTATION


def measured(truth: RobotModel, q: Array, rng: np.random.Generator | None = None) -> Measurements:
    """Poses of a true robot as seen; without `rng` seen perfectly, at the same stated noise."""
    T, m = truth.poses(q), len(q)
    if rng is not None:
        T[:, :3, 3] += rng.normal(size=(m, 3)) * SIGMA_POSITION
        T[:, :3, :3] = exp_so3(rng.normal(size=(m, 3)) * SIGMA_ROTATION) @ T[:, :3, :3]
    return tables.poses(q, T, sd=(SIGMA_POSITION, SIGMA_ROTATION))
