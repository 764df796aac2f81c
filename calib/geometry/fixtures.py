"""What stands beside the robot and may be unknown: reflectors, anchors, further stations."""

from dataclasses import dataclass, field

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

POINT_AXES = FRAME_AXES[:3]


@dataclass(frozen=True, slots=True, eq=False)
class Fixtures:
    """Reflectors on the tool, points fixed in the world, and where further stations stand.

    The first station is the world frame and has no numbers: `stations` holds the second, the third
    and so on. All of them are numbers of the model like any other, named ``reflector1.x``,
    ``anchor1.x``, ``station2.x`` ... ``station2.rz``.
    """

    reflectors: Array = field(default_factory=lambda: frozen(np.zeros((0, 3))))
    """(k, 3) reflector centers in the tool frame [m]."""
    anchors: Array = field(default_factory=lambda: frozen(np.zeros((0, 3))))
    """(s, 3) points in the world that distances are measured from [m]."""
    stations: Array = field(default_factory=lambda: frozen(np.zeros((0, 4, 4))))
    """(t, 4, 4) T_world_station of the second, third ... station [m]."""

    def __post_init__(self) -> None:
        reflectors, anchors, stations = check(
            "k 3, s 3, t 4 4",
            reflectors=self.reflectors,
            anchors=self.anchors,
            stations=self.stations,
        )
        for k, T in enumerate(stations):
            require_rigid(T, "stations", f"stations[{k}]", k)
        for name, value in zip(self.__slots__, (reflectors, anchors, stations), strict=True):
            object.__setattr__(self, name, value)

    @property
    def counts(self) -> tuple[int, int, int]:
        """Reflectors, anchors and further stations."""
        return len(self.reflectors), len(self.anchors), len(self.stations)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the 3 k + 3 s + 6 t numbers."""
        k, s, t = self.counts
        return (
            *(f"reflector{i + 1}.{axis}" for i in range(k) for axis in POINT_AXES),
            *(f"anchor{i + 1}.{axis}" for i in range(s) for axis in POINT_AXES),
            *(f"station{i + 2}.{axis}" for i in range(t) for axis in FRAME_AXES),
        )

    @property
    def is_length(self) -> tuple[bool, ...]:
        """Whether a number is a length [m]; all others are angles [rad]."""
        k, s, t = self.counts
        return (True,) * (3 * (k + s)) + (True, True, True, False, False, False) * t

    @property
    def n_numbers(self) -> int:
        """3 k + 3 s + 6 t."""
        k, s, t = self.counts
        return 3 * (k + s) + 6 * t

    @property
    def station_frames(self) -> Array:
        """(1 + t, 4, 4) T_world_station of all stations, the world itself first [m]."""
        return np.concatenate([np.eye(4)[None], self.stations])

    def moved(self, step: ArrayLike) -> "Fixtures":
        """Fixtures after a step [m, rad]: points add, stations move in their own axes."""
        (step,) = check(f"{self.n_numbers}", step=step)
        k, s, _ = self.counts
        points, frames = step[: 3 * (k + s)].reshape(-1, 3), step[3 * (k + s) :].reshape(-1, 6)
        stations = [
            nearest_rigid(T @ step_transform(move))
            for T, move in zip(self.stations, frames, strict=True)
        ]
        return Fixtures(
            self.reflectors + points[:k],
            self.anchors + points[k:],
            np.array(stations).reshape(-1, 4, 4),
        )

    def step_to(self, other: "Fixtures") -> Array:
        """Step that moves these fixtures to `other`: ``a.moved(a.step_to(b))`` is b."""
        if self.counts != other.counts:
            raise refuse(
                "fixtures",
                allowed="as many reflectors, anchors and stations in both",
                code="A3",
                message=f"fixtures differ in number: {self.counts} and {other.counts}",
            )
        frames = [
            transform_step(inverse(here) @ there)
            for here, there in zip(self.stations, other.stations, strict=True)
        ]
        return np.concatenate(
            [
                (other.reflectors - self.reflectors).ravel(),
                (other.anchors - self.anchors).ravel(),
                np.array(frames).ravel(),
            ]
        )
