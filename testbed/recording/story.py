"""What a recording tells: a robot in its cell, and chapters that verbs and studies bring along."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.geometry.chain import Chain, forward
from calib.geometry.frames import leveled, slide, transform
from calib.measurement.observations import Measurements
from testbed.recording.chart import Chart
from testbed.recording.pen import Pen
from testbed.recording.style import Color
from testbed.recording.timeline import Motion, Phase, Timeline
from testbed.robots.placements import link_poses
from testbed.robots.robot import UPRIGHT, Robot


@dataclass(frozen=True, slots=True)
class Panel:
    """A plane in a window of its own."""

    origin: str
    """Root of its entities."""
    title: str
    x: tuple[float, float]
    y: tuple[float, float]
    """What is in view, in the plane's own units."""
    tall: bool = False
    """Beside the cell, of which it takes half; else below it, beside the charts."""


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
    lines: Sequence[str] = ()
    """One for every item, in large letters when it is known; none where nothing is to be said."""
    charts: Sequence[Chart] = ()
    """Shown while the phase lasts."""
    panel: Panel | None = None
    """That of the last chapter that has one of its kind, tall or not, lies on top."""


@dataclass(frozen=True, slots=True, eq=False)
class Window:
    """One of several screens to switch between: a cell, words and charts of its own."""

    name: str
    root: str = ""
    """Of the entities of the cell that no other window shows; the first one has none."""
    hidden: Sequence[str] = ()
    """Entities of the others that it does not show."""
    draw: Callable[[Pen], None] = lambda _: None
    """Draws what is its own at all times."""
    words: str = ""
    """What the names of its words, charts and planes begin with; the first one has none."""
    summary: str = ""
    """In place of the story's, if it has one of its own."""
    chapters: Sequence[Chapter] = ()
    """Its own, each in place of the one of the story with the same name."""
    timeline: Callable[[Timeline], Timeline] = lambda timeline: timeline
    """Where its robot and its items are in the phases of the story."""

    def owns(self, chapter: Chapter) -> bool:
        """Whether a chapter is drawn for this window: its own, or the first window's."""
        return not self.words or any(chapter is one for one in self.chapters)


@dataclass(frozen=True, slots=True, eq=False)
class Story:
    """Everything that a recording holds."""

    identity: str
    """Identifier of the recording."""
    name: str
    """Its name for people."""
    summary: str
    """Beside the cell or below it at all times; Markdown."""
    robot: Robot | None
    """Whose parts are drawn; None where nobody said which robot it is."""
    chain: Chain | None
    """Where they are drawn; None: what moves is a point, and a motion is its places [m]."""
    reach: Array
    """(m, 3) tool positions that the camera keeps in view [m]."""
    station: Array
    """(3,) where the tracker stands, or whatever else is to be behind the robot [m]."""
    draw: Callable[[Pen], None]
    """Draws what is there at all times, beside the robot."""
    chapters: Sequence[Chapter]
    windows: Sequence[Window] = ()
    """On the cell; none: there is but one."""
    has_tracker: bool = True
    """Whether one stands at the station, and has to be in view."""

    @property
    def floor(self) -> float:
        """Height of the floor in the world; without a robot that of the lowest point [m]."""
        if self.robot is None or self.chain is None:
            return float(self.reach[:, 2].min())
        return floor_height(self.chain, self.robot)

    def moving(self, q: Array) -> Array:
        """Places (k, 3) of bodies and tools at joint values (s, n) [m]."""
        if self.chain is None:
            return q
        bodies = link_poses(self.chain, q)[:, :, :3, 3].reshape(-1, 3)
        return np.vstack([bodies, forward(self.chain, q)[:, :3, 3]])

    @property
    def screens(self) -> Sequence[Window]:
        """All windows; the one there is without any."""
        return self.windows or (Window("Cell"),)

    def chapters_in(self, window: Window) -> Sequence[Chapter]:
        """The chapters as a window shows them."""
        own = {chapter.name: chapter for chapter in window.chapters}
        return [own.get(chapter.name, chapter) for chapter in self.chapters]


def numbered(what: str, count: int, says: Iterable[str] = ()) -> list[str]:
    """A line for every item: its number of so many, and what is said of it."""
    found = list(says)
    ends = [f", {text}" for text in found] if found else [""] * count
    return [f"{what} {k + 1} of {count}{end}" for k, end in enumerate(ends)]


def row_word(table: Measurements) -> str:
    """What one row of a table is: a pose, or one of several readings of it."""
    return "pose" if table.n_poses == len(table) else "reading"


def floor_height(chain: Chain, robot: Robot) -> float:
    """Height of the floor in the world [m]; below a base that does not stand upright the room's."""
    T = chain.T_world_base
    if robot.mounting_height is not None and T[2, 2] < UPRIGHT:
        return float(T[2, 3]) - robot.mounting_height
    return float((chain.T_world_base @ slide(0, 0, robot.base_offset))[2, 3])


def stance(T_world_base: Array) -> Array:
    """How a base (4, 4) stands in the room (4, 4), its place aside; none if it stands level."""
    R, axes = T_world_base[:3, :3], leveled(T_world_base)
    turn = np.eye(3) if (axes == R).all() else axes.T @ R
    return transform(turn, np.zeros(3))


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
