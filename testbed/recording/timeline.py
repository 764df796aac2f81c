"""The timeline of a recording: its phases as rows of frames, and where the robot is at every step.

One timeline, `step`, runs through all phases. The robot glides from pose to pose and rests where
something is known about it; the glide is for the eye, not planned.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, Index

FRAMES_PER_POSE = 6
"""Frames from one pose to the next, the last two at rest; fewer when there are many poses."""
MOST_FRAMES = 900
"""A phase is kept below this by dropping frames, not poses."""


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """What the robot does during a phase, and when the numbers of the phase are known."""

    steps: int
    at: Index
    """(k,) step of each search, pose, iteration or test, counted from the start of the phase."""
    q: Array | None = None
    """(steps, n) drawn joint values [rad, m]; None: the robot stays where it is."""


@dataclass(frozen=True, slots=True, eq=False)
class Phase:
    """A stretch of the timeline and where its rows of numbers lie on it."""

    name: str
    local: str
    """Name of the phase's own timeline."""
    start: int
    stop: int
    """First step after the phase."""
    at: Index
    """(k,) step of each item."""

    @property
    def steps(self) -> Index:
        """Every step of the phase."""
        return np.arange(self.start, self.stop)


@dataclass(frozen=True, slots=True, eq=False)
class Timeline:
    """Phases end to end, and the robot's joints all along."""

    phases: tuple[Phase, ...]
    q: Array
    """(s, n) drawn joint values at every step [rad, m]."""

    @property
    def n_steps(self) -> int:
        """Steps of the whole timeline."""
        return len(self.q)

    def phase(self, name: str) -> Phase:
        """The phase with this name."""
        return next(phase for phase in self.phases if phase.name == name)

    def moves_on(self, step: int) -> int | None:
        """First step from `step` on at which the robot is not where it was; None if it stays."""
        moved = (self.q[step:] != self.q[step - 1]).any(axis=1)
        return step + int(moved.argmax()) if moved.any() else None


def visit(stops: Array, frames: int = 0) -> Motion:
    """Go from stop to stop (k, n) [rad, m]: an item is known when the robot rests at its stop.

    Each stop gets so many frames, by default as many as keep the phase short.
    """
    count = len(stops)
    frames = frames or max(1, min(FRAMES_PER_POSE, MOST_FRAMES // count))
    at = frames * np.arange(count) + max(frames - 2, 0)
    return Motion(frames * count, at, glide(stops, frames * count))


def spread(count: int, length: int, stops: Array | None = None) -> Motion:
    """Items spread evenly over about `length` steps, while the robot glides from stop to stop."""
    steps = count * max(1, length // count)
    at = np.round(np.linspace(0, steps - 1, count)).astype(np.int64)
    return Motion(steps, at, None if stops is None else glide(stops, steps))


def glide(stops: Array, steps: int) -> Array:
    """Joint values (steps, n) that go from stop to stop and rest at each [rad, m]."""
    phase = np.arange(steps) * len(stops) / steps
    index = np.minimum(phase.astype(np.int64), len(stops) - 1)
    frames = steps / len(stops)
    # the last two of `frames` steps belong to the stop itself; with no more there is no way to it
    moving = frames - 2
    part = np.ones(steps)
    if moving > 0:
        part = eased(np.clip((phase - index) * frames / moving, 0, 1))
    before = stops[np.maximum(index - 1, 0)]
    return np.asarray(before + part[:, None] * (stops[index] - before))


def resting(phase: Phase, count: int) -> Phase:
    """The phase with other items, so many: each where a glide over all of it rests at its stop.

    A single one is there from the beginning.
    """
    if count == 1:
        return replace(phase, at=np.array([phase.start]))
    steps = phase.stop - phase.start
    last = np.ceil((np.arange(count) + 1) * steps / count).astype(np.int64) - 1
    return replace(phase, at=phase.start + last)


def along(start: Array, stops: Array, vias: Sequence[Array], frames: int) -> Array:
    """Joint values (s, n) from stop to stop (k, n), `frames` each, through postures on the way."""
    before, rows, moving = start, [], max(frames - 2, 1)
    for q, between in zip(stops, vias, strict=True):
        corners = np.vstack([before, *between, q])
        legs = np.abs(np.diff(corners, axis=0)).max(axis=1)
        way = np.concatenate([[0.0], np.cumsum(legs)])
        part = eased(np.arange(1, moving + 1) / moving) * way[-1]
        leg = np.clip(np.searchsorted(way, part, side="left") - 1, 0, len(legs) - 1)
        share = (part - way[leg]) / np.maximum(legs[leg], 1e-12)
        points = corners[leg] + share[:, None] * (corners[leg + 1] - corners[leg])
        points[-1] = q
        rows.append(np.vstack([points, np.repeat(q[None], frames - moving, axis=0)]))
        before = q
    return np.vstack(rows)


def eased(part: Array) -> Array:
    """Progress 0 to 1 with a soft start and a soft stop."""
    return np.asarray(part * part * (3 - 2 * part))


def growing(count: int, most: int = 300) -> Index:
    """Lengths (r,) of a cloud that grows to `count` points in at most `most` rows."""
    return np.unique(np.ceil(np.linspace(1, count, min(count, most))).astype(np.int64))
