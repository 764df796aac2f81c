"""What a tracker gets wrong beyond its noise: the same all campaign long, by drift, or grossly.

What stays the same is fourteen numbers, linear in the reading: error = B b with one sensitivity
B (6, 14) per reading and one b (14,) per campaign, so that what plays the error also budgets it: b
is drawn with `variance`, and readings share the covariance B diag(variance) B'.

A station drifts, and nests show it: between two rounds over the nests the station walks at random;
each round shows where it is, up to the noise of the nests, and what it shows is taken off all
readings until the next round.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index
from calib.errors import refuse
from calib.uncertainty.statement.instrument import InstrumentErrors


def draw(size: InstrumentErrors, rng: np.random.Generator) -> Array:
    """The fourteen numbers (14,) of one campaign; offset and target's turn are uniform."""
    offset = rng.uniform(-1.0, 1.0) * np.sqrt(3) * size.range_offset
    scale = rng.standard_normal() * size.scale
    phase = rng.uniform(0.0, 2 * np.pi, 2)
    place = rng.standard_normal(3) * size.target_offset
    turn = rng.uniform(-1.0, 1.0, 3) * np.sqrt(3) * size.target_turn
    tilts = rng.standard_normal(2) * size.level
    waves = np.stack([np.cos(phase), np.sin(phase)], axis=1).ravel()
    return np.concatenate([[offset, scale], waves, place, turn, tilts])


@dataclass(frozen=True, slots=True, eq=False)
class StationBias:
    """The systematic errors of one campaign."""

    size: InstrumentErrors
    numbers: Array
    """(14,) in the order of `SOURCES` [m, m/m, 1 x 4, m x 3, rad x 3, rad x 2]."""

    def errors(self, target: Array, R: Array, T_world_tracker: Array) -> Array:
        """Errors (m, 6) of readings of targets (m, 3) on tools R (m, 3, 3), world axes [m, rad]."""
        return np.asarray(self.size.sensitivity(target, R, T_world_tracker) @ self.numbers)


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


@dataclass(frozen=True, slots=True)
class GrossErrors:
    """Wrong and failed observations of each visit."""

    outliers: int = 0
    """Grossly wrong ones; nothing in the data marks them."""
    position_sd: float = 0.0
    """Of an outlier, per axis [m]."""
    rotation_sd: float = 0.0
    """Of an outlier, per axis [rad]."""
    missed: int = 0
    """Failed ones; their rows are missing."""


def some_rows(m: int, count: int, rng: np.random.Generator, key: str) -> Index:
    """Rows (count,) of m, each one once."""
    if count > m:
        message = f"[tracker] {key} is {count}; the visit has {m} shots"
        fix = f"write {key} = {max(m - 1, 0)} or fewer"
        raise refuse(f"tracker.{key}", count, code="M27", message=message, fix=fix)
    return np.asarray(rng.permutation(m)[:count])
