"""What a tracker gets wrong beyond its noise: the same all campaign long, by drift, or grossly.

What stays the same is twelve numbers, linear in the reading: error = B b with one sensitivity
B (6, 12) per reading and one b (12,) per campaign, so that what plays the error also budgets it: b
is drawn with `variance`, and readings share the covariance B diag(variance) B'.

A station drifts, and nests show it: between two rounds over the nests the station walks at random;
each round shows where it is, up to the noise of the nests, and what it shows is taken off all
readings until the next round.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index
from calib.errors import refuse

NAMES = (
    "range offset",
    "range scale",
    "azimuth sine",
    "azimuth cosine",
    "elevation sine",
    "elevation cosine",
    "target x",
    "target y",
    "target z",
    "target rx",
    "target ry",
    "target rz",
)
"""What each of the twelve numbers is."""


@dataclass(frozen=True, slots=True)
class BiasSize:
    """How large the systematic errors of a tracker may be."""

    range_offset: float
    """Half width of the offset of all ranges [m]."""
    scale: float
    """Standard deviation of the scale of all ranges [m/m]."""
    encoder: tuple[float, float]
    """Amplitude of sin(az + phi1) and sin(2 el + phi2) across the beam: constant [m], per meter."""
    target_offset: float
    """Standard deviation per axis of the target's place on the tool [m]."""
    target_turn: float
    """Half width per axis of the target's rotation on the tool [rad]."""

    @property
    def variance(self) -> Array:
        """(12,) variances of the twelve numbers; they are uncorrelated, with mean zero.

        A sinusoid of random phase, A sin(x + phi), is A cos(phi) sin x + A sin(phi) cos x: its two
        coefficients have variance A^2 / 2 each and are uncorrelated. The amplitude, which depends
        on range, is in the sensitivity.
        """
        return np.array(
            [
                self.range_offset**2 / 3,
                self.scale**2,
                *([0.5] * 4),
                *([self.target_offset**2] * 3),
                *([self.target_turn**2 / 3] * 3),
            ]
        )

    def draw(self, rng: np.random.Generator) -> Array:
        """The twelve numbers (12,) of one campaign."""
        offset = rng.uniform(-1.0, 1.0) * self.range_offset
        scale = rng.standard_normal() * self.scale
        phase = rng.uniform(0.0, 2 * np.pi, 2)
        place = rng.standard_normal(3) * self.target_offset
        turn = rng.uniform(-1.0, 1.0, 3) * self.target_turn
        waves = np.stack([np.cos(phase), np.sin(phase)], axis=1).ravel()
        return np.concatenate([[offset, scale], waves, place, turn])

    def sensitivity(self, target: Array, R: Array, T_world_tracker: Array) -> Array:
        """How readings (m, 6, 12) of target and rotation follow the twelve numbers, world axes.

        Parameters
        ----------
        target : (m, 3) array
            Targets in the world [m].
        R : (m, 3, 3) array
            Rotations R_world_tool of the tool that carries the target.
        T_world_tracker : (4, 4) array
            Station; azimuth is about its z axis from its x axis, elevation up from its xy plane.
        """
        T = T_world_tracker
        x, y, z = ((target - T[:3, 3]) @ T[:3, :3]).T
        distance = np.sqrt(x**2 + y**2 + z**2)
        azimuth, elevation = np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))
        ca, sa, ce, se = (f(a) for a in (azimuth, elevation) for f in (np.cos, np.sin))
        zero = np.zeros_like(ca)
        along = np.stack([ce * ca, ce * sa, se], axis=1)
        sideways = np.stack([-sa, ca, zero], axis=1)
        upward = np.stack([-se * ca, -se * sa, ce], axis=1)
        size = self.encoder[0] + self.encoder[1] * distance
        B = np.zeros((len(target), 6, len(NAMES)))
        for k, (direction, factor) in enumerate(
            (
                (along, np.ones_like(distance)),
                (along, distance),
                (sideways, size * sa),
                (sideways, size * ca),
                (upward, size * np.sin(2 * elevation)),
                (upward, size * np.cos(2 * elevation)),
            )
        ):
            B[:, :3, k] = (direction * factor[:, None]) @ T[:3, :3].T
        B[:, :3, 6:9] = B[:, 3:, 9:] = R
        return B


@dataclass(frozen=True, slots=True, eq=False)
class StationBias:
    """The systematic errors of one campaign."""

    size: BiasSize
    numbers: Array
    """(12,) in the order of `NAMES` [m, m/m, 1, 1, 1, 1, m, m, m, rad, rad, rad]."""

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
