"""Fixtures beside the robot whose places may be unknown: reflectors, anchors, stations, tools."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, check, frozen
from calib.errors import refuse
from calib.geometry.chain import FRAME_AXES
from calib.geometry.frames import (
    inverse,
    nearest_rigid,
    require_rigid,
    step_transform,
    transform_step,
)
from calib.kinds import in_short
from calib.shown import Shown

POINT_AXES = FRAME_AXES[:3]


@dataclass(frozen=True, slots=True, eq=False)
class Fixtures(Shown):
    """Reflectors on the tool, points fixed in the world, further stations and further tools.

    The first station is the world frame and has no numbers: `stations` begins with the second. The
    first tool is that of the chain: `tools` begins with the second, mounted in its place. Their
    coordinates are numbers of the model like any other, named ``reflector1.x``, ``anchor1.x``,
    ``station2.x`` ... ``station2.rz``, ``tool2.x`` ... ``tool2.rz``.

    Examples
    --------
    Distances from two anchors to a reflector whose place on the tool is identified as well:

    >>> import calib
    >>> beside = calib.Fixtures(reflectors=[[0.05, 0, 0.1]], anchors=[[2, 0, 0], [0, 2, 1]])
    >>> arm = calib.RobotModel(calib.Chain([[0, 0.4, 0.1, 0, 0]]), fixtures=beside)
    >>> calib.distances([[0.1], [0.2]], [1.9, 2.1], sd=2e-5, anchor=[0, 1], reflector=0)
    Measurements(2 distance rows, 2 poses)
    >>> arm.names[-9:-5]
    ('reflector1.x', 'reflector1.y', 'reflector1.z', 'anchor1.x')
    """

    reflectors: Array = field(default_factory=lambda: frozen(np.zeros((0, 3))))
    """(k, 3) reflector centers in the tool frame [m]."""
    anchors: Array = field(default_factory=lambda: frozen(np.zeros((0, 3))))
    """(s, 3) points in the world that distances are measured from [m]."""
    stations: Array = field(default_factory=lambda: frozen(np.zeros((0, 4, 4))))
    """(t, 4, 4) T_world_station of the second, third ... station [m]."""
    tools: Array = field(default_factory=lambda: frozen(np.zeros((0, 4, 4))))
    """(u, 4, 4) T_flange_tool of the second, third ... tool [m]."""

    if TYPE_CHECKING:  # the fields are arrays; what is given need not be

        def __init__(
            self,
            reflectors: ArrayLike = ...,
            anchors: ArrayLike = ...,
            stations: ArrayLike = ...,
            tools: ArrayLike = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        values = check(
            "k 3, s 3, t 4 4, u 4 4", **{name: getattr(self, name) for name in self.__slots__}
        )
        for name, frames in zip(("stations", "tools"), values[2:], strict=True):
            for k, T in enumerate(frames):
                require_rigid(T, name, f"{name}[{k}]", k)
        for name, value in zip(self.__slots__, values, strict=True):
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        k, s, t, u = self.counts
        return f"Fixtures({k} reflectors, {s} anchors, {t} further stations, {u} further tools)"

    @property
    def counts(self) -> tuple[int, int, int, int]:
        """Numbers k, s, t, u of reflectors, anchors, further stations and further tools."""
        return len(self.reflectors), len(self.anchors), len(self.stations), len(self.tools)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the 3 k + 3 s + 6 t + 6 u numbers."""
        k, s, t, u = self.counts
        return (
            *(f"reflector{i + 1}.{axis}" for i in range(k) for axis in POINT_AXES),
            *(f"anchor{i + 1}.{axis}" for i in range(s) for axis in POINT_AXES),
            *(f"station{i + 2}.{axis}" for i in range(t) for axis in FRAME_AXES),
            *(f"tool{i + 2}.{axis}" for i in range(u) for axis in FRAME_AXES),
        )

    @property
    def is_length(self) -> tuple[bool, ...]:
        """(3 k + 3 s + 6 t + 6 u,) whether a number is a length [m]; else an angle [rad]."""
        k, s, t, u = self.counts
        return (True,) * (3 * (k + s)) + (True, True, True, False, False, False) * (t + u)

    @property
    def n_numbers(self) -> int:
        """Number of coordinates, 3 k + 3 s + 6 t + 6 u."""
        return self.first_tool + 6 * len(self.tools)

    @property
    def first_station(self) -> int:
        """Index of the first number of the stations among those of the fixtures."""
        return 3 * (len(self.reflectors) + len(self.anchors))

    @property
    def first_tool(self) -> int:
        """Index of the first number of the tools among those of the fixtures."""
        return self.first_station + 6 * len(self.stations)

    @property
    def station_frames(self) -> Array:
        """(1 + t, 4, 4) T_world_station of all stations, the world itself first [m]."""
        return np.concatenate([np.eye(4)[None], self.stations])

    @in_short
    def moved(self, step: ArrayLike) -> "Fixtures":
        """Fixtures after a step [m, rad] in the order of `names`.

        Points are shifted; frames are multiplied on the right by [Exp(r), t; 0, 1].
        """
        (step,) = check(f"{self.n_numbers}", step=step)
        if not len(step):
            return self
        k, _, t, _ = self.counts
        points, frames = np.split(step, [self.first_station])
        moved = [
            nearest_rigid(T @ step_transform(move))
            for T, move in zip(self._frames, frames.reshape(-1, 6), strict=True)
        ]
        return Fixtures(
            self.reflectors + points.reshape(-1, 3)[:k],
            self.anchors + points.reshape(-1, 3)[k:],
            np.array(moved[:t]).reshape(-1, 4, 4),
            np.array(moved[t:]).reshape(-1, 4, 4),
        )

    def step_to(self, other: "Fixtures") -> Array:
        """Step that moves these fixtures to `other`: ``a.moved(a.step_to(b))`` is b."""
        if self.counts != other.counts:
            raise refuse(
                "fixtures",
                allowed="as many reflectors, anchors, stations and tools in both",
                code="A3",
                message=f"fixtures differ in number: {self.counts} and {other.counts}",
            )
        frames = [
            transform_step(inverse(here) @ there)
            for here, there in zip(self._frames, other._frames, strict=True)
        ]
        return np.concatenate(
            [
                (other.reflectors - self.reflectors).ravel(),
                (other.anchors - self.anchors).ravel(),
                np.array(frames).ravel(),
            ]
        )

    @property
    def _frames(self) -> tuple[Array, ...]:
        """(t + u) frames (4, 4), the stations first."""
        return (*self.stations, *self.tools)
