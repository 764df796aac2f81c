"""A station that drifts, and the nests that show it: what is left of the drift in the readings.

Between two rounds over the nests the station walks at random; each round shows where it is, up to
the noise of the nests, and what it shows is taken off all readings until the next round.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array

NESTS = ((0.9, 0.9, -0.3), (0.9, -0.9, -0.3), (-0.9, -0.9, -0.3), (-0.9, 0.9, 0.7))
"""Reflectors that stay on the floor and the wall, in the base frame; their places are known [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class StationDrift:
    """A station's random walk and how often it is looked at."""

    rate: float
    """Standard deviation per axis after one second; grows with the root of time [m/s^0.5]."""
    every: float
    """Time between two rounds over the nests; the first is at the start of a visit [s]."""
    nests: Array
    """(k, 3) nests in the world [m]."""

    def rounds(self, elapsed: Array) -> Array:
        """Rounds over the nests (m,) after the first one, up to times (m,)."""
        return np.floor(elapsed / self.every)

    def walk(self, elapsed: Array, rng: np.random.Generator) -> Array:
        """What of the walk the readings still hold (m, 3) [m].

        The whole walk is drawn, from one observation or round to the next, and its value at the
        last round is taken off.

        Parameters
        ----------
        elapsed : (m,) array
            Times of the observations since the visit began, rising [s].
        rng : Generator
            The walk.
        """
        rounds = self.rounds(elapsed)
        stops = np.arange(rounds.max(initial=0.0) + 1) * self.every
        times = np.concatenate([elapsed, stops])
        order = np.argsort(times, kind="stable")
        steps = np.sqrt(np.diff(times[order], prepend=0.0))[:, None]
        place = np.empty((len(times), 3))
        place[order] = np.cumsum(self.rate * steps * rng.standard_normal((len(times), 3)), axis=0)
        return np.asarray(place[: len(elapsed)] - place[len(elapsed) :][rounds.astype(np.int64)])

    def nest_noise(self, elapsed: Array, covariance: Array, rng: np.random.Generator) -> Array:
        """What the noise of the nests leaves in each reading (m, 3), the same within a round [m].

        Parameters
        ----------
        elapsed : (m,) array
            Times of the observations since the visit began [s].
        covariance : (k, 3, 3) array
            Scatter of one observation of each nest; a round takes the mean of all [m^2].
        rng : Generator
            The noise.
        """
        rounds = self.rounds(elapsed).astype(np.int64)
        root = np.linalg.cholesky(covariance.mean(axis=0) / len(covariance))
        shown = rng.standard_normal((int(rounds.max(initial=0)) + 1, 3)) @ root.T
        return np.asarray(-shown[rounds])
