"""What the instrument of a test is stated to get wrong in all readings alike."""

import numpy as np

from calib.arrays import Array
from testbed.iso9283.records import CycleTest
from testbed.scenario.instrument import beam_of, errors_of

POSITION, ROTATION = slice(0, 3), slice(3, 6)
"""Rows of a reading."""


class Shared:
    """What the instrument is stated to get wrong in all readings alike, at places (..., 3) [m]."""

    def __init__(self, test: CycleTest, T: Array) -> None:
        self.table, self.T = test.systematic, T

    def rows(self, place: Array) -> Array | None:
        """How readings follow its numbers, in their sd: (k, 6, 14) in the frame of the commands."""
        if self.table is None:
            return None
        errors, R = errors_of(self.table), self.T[:3, :3]
        own = (place - self.T[:3, 3]) @ R
        # how the tool stands does not matter to one point; of two it is taken to stand alike
        tool = np.broadcast_to(np.eye(3), (len(place), 3, 3))
        B = errors.sensitivity(own, tool, beam_of(self.table))
        B = (R @ B.reshape(-1, 2, 3, B.shape[2])).reshape(B.shape)
        return np.asarray(B * np.sqrt(errors.variance))

    def covariance(self, place: Array, rows: slice = POSITION) -> Array | None:
        """Covariance (k, 3, 3) that all readings at each place share [m^2, or rad^2]."""
        B = self.rows(place)
        return None if B is None else np.asarray(B[:, rows] @ np.swapaxes(B[:, rows], 1, 2))

    def of_distance(self, one: Array, two: Array) -> float:
        """Standard uncertainty of the distance of two places (3,) [m]."""
        B = self.rows(np.stack([one, two]))
        if B is None:
            return 0.0
        along = (two - one) / np.linalg.norm(two - one)
        return float(np.linalg.norm(along @ (B[1] - B[0])[POSITION]))
