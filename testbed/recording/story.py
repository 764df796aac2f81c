"""What a recording tells: a robot in its cell, and chapters that verbs and studies bring along."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from calib.arrays import Array
from calib.geometry.chain import Chain
from calib.geometry.frames import slide
from testbed.recording.pen import Pen
from testbed.recording.style import Color
from testbed.recording.timeline import Motion, Phase, Timeline
from testbed.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class Panel:
    """A plane beside the cell, in a window of its own."""

    origin: str
    """Root of its entities."""
    title: str
    x: tuple[float, float]
    y: tuple[float, float]
    """What is in view, in the plane's own units."""
    columns: tuple[float, float, float] = (2.5, 1.2, 1)
    """Widths of cell, texts and this window, relative to each other."""


@dataclass(frozen=True, slots=True, eq=False)
class Chapter:
    """One phase of a recording: how long it lasts, what is drawn in it and what it says."""

    name: str
    """On the bar of phases."""
    local: str
    """Name of the phase's own timeline, on which its items are numbered from zero."""
    color: Color
    """On the bar of phases."""
    motion: Motion
    text: Sequence[str]
    """Lines of Markdown that explain the screen, a heading first; empty ones are left out."""
    draw: Callable[[Pen, Phase], None]
    """Draws everything that begins in this phase, once the place of all phases is known."""
    plots: Mapping[str, str] = field(default_factory=dict)
    """Root and title of the curve windows, held on the phase's stretch of the timeline."""
    panel: Panel | None = None
    """Shown beside the cell; that of the last chapter that has one lies on top."""


@dataclass(frozen=True, slots=True, eq=False)
class Story:
    """Everything that a recording holds."""

    identity: str
    """Identifier of the recording."""
    name: str
    """Its name for people."""
    summary: str
    """Beside the cell at all times; Markdown."""
    robot: Robot
    """Whose parts are drawn."""
    chain: Chain
    """Where they are drawn."""
    reach: Array
    """(m, 3) tool positions that the camera keeps in view [m]."""
    station: Array
    """(3,) where the tracker stands, or whatever else is to be behind the robot [m]."""
    draw: Callable[[Pen], None]
    """Draws what is there at all times, beside the robot."""
    chapters: Sequence[Chapter]


def floor_height(chain: Chain, robot: Robot) -> float:
    """Height of the floor in the world [m]."""
    return float((chain.T_world_base @ slide(0, 0, robot.base_offset))[2, 3])


def timeline_of(chapters: Sequence[Chapter]) -> Timeline:
    """Chapters laid end to end; the first one says where the robot is."""
    phases, q, start = [], np.zeros((0, 0)), 0
    for chapter in chapters:
        motion = chapter.motion
        stop = start + motion.steps
        phases.append(Phase(chapter.name, chapter.local, start, stop, start + motion.at))
        drawn = np.repeat(q[-1:], motion.steps, axis=0) if motion.q is None else motion.q
        q = np.vstack([q, drawn]) if start else drawn
        start = stop
    return Timeline(tuple(phases), q)
