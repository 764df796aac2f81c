"""A test after ISO 9283: what was measured, and the figures that come out of it."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index
from calib.measurement.iso_memory import CycleMemory
from calib.shown import ResultTable, Shown, length_words
from testbed.gates.text import SourceFile
from testbed.jobsheet.sheet import JobSheet
from testbed.scenario.systematic import SystematicTable

STANDARD = "ISO 9283:1998"
"""The edition whose figures these are; its text is not reproduced."""
POSE_CYCLES, PATH_CYCLES = 30, 10
"""Cycles that the standard asks for: of poses and distances, of paths."""
PROBABILITY = 0.95
"""That the limits of a figure hold it."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Visits(Shown):
    """Poses that were visited n times each, from one direction of approach or from several."""

    pose: tuple[str, ...]
    """(e,) name of the pose of each entry; one that is reached from g directions has g entries."""
    approach: tuple[str, ...]
    """(e,) its direction of approach; empty where none is said."""
    command: Array
    """(e, 3) commanded positions [m]."""
    position: Array
    """(e, n, 3) attained positions, cycles in the order of their numbers [m]."""
    command_rotation: Array | None
    """(e, 3, 3) R_world_tool; None where nothing says them."""
    rotation: Array | None
    """(e, n, 3, 3); None where none were measured."""
    noise: Array | None
    """(e, 3, 3) covariance of one reading, world axes; None where none is stated [m^2]."""
    turn_noise: Array | None
    """(e, 3, 3) of its rotation, world axes [rad^2]."""
    time: Array | None
    """(e, n) since the first reading [s]."""
    number: Index | None = None
    """(e, n) what the file calls each cycle; None: 1, 2, 3."""

    def called(self, entry: int, cycle: int) -> int:
        """What the file calls a cycle of an entry."""
        return cycle + 1 if self.number is None else int(self.number[entry, cycle])

    @property
    def names(self) -> tuple[str, ...]:
        """(e,) what each entry is called."""
        pairs = zip(self.pose, self.approach, strict=True)
        return tuple(f"{pose} from {way}" if way else pose for pose, way in pairs)

    @property
    def cycles(self) -> int:
        """Cycles of each entry, n."""
        return int(self.position.shape[1])


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PathRuns(Shown):
    """One commanded path and the n measured ones."""

    name: str
    points: tuple[str, ...]
    """(m,) what the commanded points are called."""
    command: Array
    """(m, 3) [m]."""
    runs: tuple[Array, ...]
    """n measured paths (k, 3) [m]."""
    place: tuple[str, ...]
    """(n,) file and line where each begins."""
    matched: bool
    """Whether the k-th point of each run is that of the command."""
    noise: Array | None
    """(3, 3) covariance of one reading, mean over the path [m^2]."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CycleTest(Shown):
    """What was read."""

    name: str
    files: tuple[SourceFile, ...]
    visits: Visits | None
    paths: tuple[PathRuns, ...]
    fitted: bool | None
    """Whether readings are to be brought into the frame of the commands by a best fit; None: the
    session does not say, and they are taken as they are."""
    speed_percent: float | None
    conditions: str
    """Payload, tool and temperature in words; empty where nobody said."""
    date: str
    job: JobSheet
    systematic: SystematicTable | None
    limits: dict[str, float]
    """Largest allowed figures by name [m]."""
    uncertainty: str
    """Where the noise of a reading comes from; empty where none is stated."""
    simulated: bool
    warnings: tuple[str, ...]
    notes: tuple[str, ...]


SCATTERS = ("RP", "RD", "RT")
"""Figures that the noise of the instrument makes larger."""


@dataclass(frozen=True, slots=True)
class StatedFigure:
    """One figure at one pose, pair of poses or path."""

    name: str
    """AP, RP, ... as the standard calls them; AP_x ... are signed parts."""
    where: str
    value: float
    """[m], or [rad] of an angle."""
    lower: float
    """95 % confidence limits, of the scatter of the cycles and what the instrument is stated to
    get wrong in all readings alike."""
    upper: float
    u: float
    """Standard uncertainty."""
    floor: float
    """What it reads, on average, where there is nothing to see; nan where nothing tells."""
    cycles: int
    angle: bool = False
    shared: float = 0.0
    """Part of u that all readings of the instrument share; more cycles do not lower it."""
    typical_u: float = 0.0
    """Median u of all figures of its name, which decides the digits of all of them; 0: its own."""
    noise: float = float("nan")
    """What the stated noise alone reads in endlessly many cycles: of scatter; nan where no noise is
    stated, and of what it does not make larger."""

    @property
    def size(self) -> float:
        """How large it is, whatever its sign."""
        return abs(self.value)

    @property
    def own(self) -> float:
        """Of its size, what is the robot's own at least: scatter less what the noise alone reads.

        In squares, as variances add; of scatter that is not equal in all directions even more is
        the robot's own.
        """
        return self.size if np.isnan(self.noise) else _less(self.size, self.floor)

    @property
    def own_least(self) -> float:
        """Of its lower limit, what is the robot's own: both are of endlessly many cycles."""
        return self.least if np.isnan(self.noise) else _less(self.least, self.noise)

    @property
    def most(self) -> float:
        """Upper limit of its size."""
        return max(abs(self.lower), abs(self.upper))

    @property
    def least(self) -> float:
        """Lower limit of its size."""
        return 0.0 if self.lower <= 0 <= self.upper else min(abs(self.lower), abs(self.upper))


def _less(size: float, noise: float) -> float:
    """What is left of a scatter without some noise."""
    return float(np.sqrt(max(size**2 - noise**2, 0.0)))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PoseDrift(Shown):
    """Drift of one pose over blocks of cycles."""

    where: str
    hours: Array
    """(b,) middle of each block since the first reading [h]."""
    AP: Array
    """(b,) [m]"""
    RP: Array
    """(b,) [m]"""
    chance: Array
    """(2,) what 95 % of random orders of these cycles stay below, of dAP and dRP [m]."""
    p_values: Array
    """(2,) share of these orders that change as much."""

    @property
    def changes(self) -> Array:
        """Largest changes (2,) of AP and RP against the first block [m]."""
        both = (self.AP, self.RP)
        return np.array([np.abs(figures[1:] - figures[0]).max() for figures in both])


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PathShown(Shown):
    """What the picture of a path needs."""

    name: str
    command: Array
    """(m, 3) [m]"""
    along: Array
    """(m,) length of the commanded path up to each point [m]."""
    mean: Array
    """(m, 3) mean attained path [m]."""
    AT: Array
    """(m,) [m]"""
    RT: Array
    """(m,) [m]"""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CycleResult(Shown):
    """All figures of a test."""

    test: CycleTest
    """With the readings in the frame of the commands."""
    figures: tuple[StatedFigure, ...]
    drifts: tuple[PoseDrift, ...]
    drift_p_value: float
    """Of all poses together; nan where nothing tells."""
    paths: tuple[PathShown, ...]
    frame: str
    """How the frames of readings and commands go together, in words."""
    memory: CycleMemory | None = None
    """Whether cycles follow their neighbors; None without poses."""

    def __repr__(self) -> str:
        worst = ((name, self.worst(name)) for name in ("AP", "RP"))
        sizes = [
            f"{name} {length_words(figure.size, um='.3g')}" for name, figure in worst if figure
        ]
        return f"CycleResult({self.test.name!r}: {', '.join(sizes) or 'no poses'})"

    def tables(self) -> dict[str, ResultTable]:
        """``figures`` with their 95 % limits, u and floor [um, mdeg]."""
        scale = np.array([np.degrees(1e3) if one.angle else 1e6 for one in self.figures])
        sizes = {
            name: scale * np.array([getattr(one, name) for one in self.figures])
            for name in ("value", "lower", "upper", "u", "floor")
        }
        words = {
            "figure": [one.name for one in self.figures],
            "where": [one.where for one in self.figures],
        }
        last = {
            "unit": ["mdeg" if one.angle else "um" for one in self.figures],
            "cycles": [one.cycles for one in self.figures],
        }
        return {"figures": ResultTable({**words, **sizes, **last})}

    def of(self, *names: str) -> tuple[StatedFigure, ...]:
        """Figures of some names."""
        return tuple(figure for figure in self.figures if figure.name in names)

    def worst(self, name: str) -> StatedFigure | None:
        """The largest one of a name."""
        return max(self.of(name), key=lambda figure: figure.size, default=None)
