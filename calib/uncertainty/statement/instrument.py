"""The errors of an instrument that all its readings share, and how the readings follow them."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.geometry.frames import skew
from calib.geometry.model import RobotModel
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predicted_positions, tool_poses

SOURCES = (
    "range offset",
    "range scale",
    *["tracker's encoders"] * 4,
    *["target's place"] * 3,
    *["target's turn"] * 3,
    *["level of the station"] * 2,
)
"""Source that each of the fourteen numbers belongs to."""
PLACE, TURN, LEVEL = slice(6, 9), slice(9, 12), slice(12, 14)
"""Where the numbers of the target and of the tilts stand among them."""


@dataclass(frozen=True, slots=True)
class InstrumentErrors:
    """How large the errors of an instrument are that all its readings share (k = 1).

    They are fourteen numbers, uncorrelated and with mean zero, and linear in the reading.
    """

    range_offset: float = 0.0
    """Of all ranges [m]."""
    scale: float = 0.0
    """Of all ranges [m/m]."""
    encoder: tuple[float, float] = (0.0, 0.0)
    """Amplitude of sin(az + phi1) and sin(2 el + phi2) across the beam, any phase: constant [m],
    per meter of range."""
    target_offset: float = 0.0
    """Of the target's place on the tool, per axis of the tool [m]."""
    target_turn: float = 0.0
    """Of the target's rotation on the tool, per axis of the tool [rad]."""
    level: float = 0.0
    """Of each of the two tilts of the station against gravity [rad]."""

    @property
    def variance(self) -> Array:
        """(14,) variances of the numbers.

        A sinusoid of random phase, A sin(x + phi), is A cos(phi) sin x + A sin(phi) cos x: its two
        coefficients have variance A^2 / 2 each and are uncorrelated. The amplitude, which depends
        on range, is in the sensitivity.
        """
        return np.array(
            [
                self.range_offset**2,
                self.scale**2,
                *([0.5 if any(self.encoder) else 0.0] * 4),
                *([self.target_offset**2] * 3),
                *([self.target_turn**2] * 3),
                *([self.level**2] * 2),
            ]
        )

    def sensitivity(self, target: Array, R: Array, T_world_station: Array) -> Array:
        """How readings (m, 6, 14) of target and rotation follow the numbers, world axes.

        Parameters
        ----------
        target : (m, 3) array
            Targets in the world [m].
        R : (m, 3, 3) array
            Rotations R_world_tool of the tool that carries the target.
        T_world_station : (4, 4) array
            Where the beam starts; azimuth is about its z axis from its x axis, elevation up from
            its xy plane, tilts are about its x and y axes.
        """
        T = T_world_station
        x, y, z = ((target - T[:3, 3]) @ T[:3, :3]).T
        distance = np.sqrt(x**2 + y**2 + z**2)
        azimuth, elevation = np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))
        ca, sa, ce, se = (f(a) for a in (azimuth, elevation) for f in (np.cos, np.sin))
        zero = np.zeros_like(ca)
        along = np.stack([ce * ca, ce * sa, se], axis=1)
        sideways = np.stack([-sa, ca, zero], axis=1)
        upward = np.stack([-se * ca, -se * sa, ce], axis=1)
        size = self.encoder[0] + self.encoder[1] * distance
        B = np.zeros((len(target), 6, len(SOURCES)))
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
        B[:, :3, PLACE] = B[:, 3:, TURN] = R
        B[:, :3, LEVEL] = skew(T[:3, 3] - target) @ T[:3, :2]
        B[:, 3:, LEVEL] = T[:3, :2]
        return B


def shared_rows(
    errors: InstrumentErrors, model: RobotModel, table: Measurements, T_station_beam: Array
) -> Array:
    """How the rows of a table follow the fourteen numbers (m, 6, 14), axes of each row's station.

    One instrument measures all rows: poses, points and distances.

    Parameters
    ----------
    errors : InstrumentErrors
        Whose amplitudes the columns of the encoders have.
    model : RobotModel
        Where the targets are.
    table : Measurements
        The rows.
    T_station_beam : (s, 4, 4) array
        Where the beam starts in the frame of each of the stations, the first of which is the world.
    """
    p = predicted_positions(model, table)
    stations = model.fixtures.station_frames[table.station]
    R = np.swapaxes(stations[:, :3, :3], 1, 2) @ tool_poses(model, table)[:, :3, :3]
    B = np.zeros((len(table), 6, len(SOURCES)))
    for s in np.unique(table.station):
        rows = table.station == s
        B[rows] = errors.sensitivity(p[rows], R[rows], T_station_beam[s])
    B[~table.is_pose, 3:] = 0.0
    B[table.station > 0, :, LEVEL] = 0.0  # the world is level as its first station is
    far = table.is_distance
    if far.any():
        beam = p[far] - model.fixtures.anchors[table.anchor[far]]
        length = np.linalg.norm(beam, axis=1)
        B[far] = 0.0
        B[far, 0, 0], B[far, 0, 1] = 1.0, length
        B[far, 0, PLACE] = (beam[:, None] @ R[far])[:, 0] / length[:, None]
    return B
