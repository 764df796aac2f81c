"""The story of a calibration as a row of frames: measured poses, the fit, held-out poses."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.geometry.frames import inverse
from calib.geometry.model import RobotModel
from calib.measurement.prediction import targets
from testbed.identify.records import Calibration, Misses
from testbed.recording.story import frames_per_pose, glide

CalibrationPhaseName = Literal["measure", "identify", "evaluate"]
CALIBRATION_PHASES: tuple[CalibrationPhaseName, ...] = ("measure", "identify", "evaluate")
LOCAL: dict[CalibrationPhaseName, str] = {
    "measure": "pose",
    "identify": "iteration",
    "evaluate": "test",
}
"""Name of each phase's own timeline."""
MOST_POSES = 150
"""Poses the robot goes to in a phase; of more, this many evenly spread ones are shown."""
IDENTIFY_FRAMES = 48


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationPhase:
    """A stretch of the timeline and where its rows lie on it."""

    name: CalibrationPhaseName
    start: int
    stop: int
    """First step after the phase."""
    at: Index
    """(k,) step of each item."""
    rows: Index
    """(k,) rows of the table that are shown; none while identifying."""

    @property
    def local(self) -> str:
        """Name of the phase's own timeline."""
        return LOCAL[self.name]


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationStory:
    """A calibration, laid out on the timeline; everything in the robot's base frame."""

    calibration: Calibration
    phases: tuple[CalibrationPhase, ...]
    q: Array
    """(s, n) drawn joint values at every step [rad, m]."""
    station: Array
    """(4, 4) where the measuring frame is, seen from the base [m]."""

    @property
    def n_steps(self) -> int:
        """Steps of the whole timeline."""
        return len(self.q)

    def phase(self, name: CalibrationPhaseName) -> CalibrationPhase:
        """The phase with this name."""
        return self.phases[CALIBRATION_PHASES.index(name)]

    def vectors(self, misses: Misses) -> Array:
        """(m, 3) what a model misses, base axes [m]."""
        return np.asarray(misses.vector @ self.station[:3, :3].T)

    @property
    def seen(self) -> Array:
        """(m, 3) where the target was seen; of a distance row where it is predicted [m]."""
        fit = self.calibration.fit
        model = fit.identification.model
        return _places(model, self.calibration, self.station) + self.vectors(fit.misses)


def tell_calibration(calibration: Calibration) -> CalibrationStory:
    """Lay out the frames of a calibration."""
    measured = _some(calibration.is_used)
    judged = _some(calibration.is_judged)
    iterations = len(calibration.fit.identification.trace)
    per_measured, per_judged = frames_per_pose(len(measured)), frames_per_pose(len(judged))
    identify = iterations * max(1, IDENTIFY_FRAMES // iterations)
    lengths = (per_measured * len(measured), identify, per_judged * len(judged))
    starts = np.concatenate([[0], np.cumsum(lengths)])
    at = (
        starts[0] + per_measured * np.arange(len(measured)) + max(per_measured - 2, 0),
        starts[1] + np.round(np.linspace(0, identify - 1, iterations)).astype(np.int64),
        starts[2] + per_judged * np.arange(len(judged)) + max(per_judged - 2, 0),
    )
    rows = (measured, np.zeros(0, dtype=np.int64), judged)
    phases = tuple(
        CalibrationPhase(name, int(starts[k]), int(starts[k + 1]), at[k], rows[k])
        for k, name in enumerate(CALIBRATION_PHASES)
    )
    q = calibration.measurements.q
    drawn = np.vstack(
        [
            glide(q[measured], lengths[0]),
            np.repeat(q[measured[-1:]], identify, axis=0),
            glide(q[judged], lengths[2]),
        ]
    )
    base = calibration.fit.identification.model.chain.T_world_base
    return CalibrationStory(calibration, phases, drawn, inverse(base))


def _some(rows: Bool) -> Index:
    """Evenly spread places of true entries, at most `MOST_POSES`."""
    places = np.flatnonzero(rows)
    wanted = min(len(places), MOST_POSES)
    return places[np.unique(np.linspace(0, len(places) - 1, wanted).round().astype(np.int64))]


def _places(model: RobotModel, calibration: Calibration, station: Array) -> Array:
    """(m, 3) predicted target of every row, base frame [m]."""
    table = calibration.measurements
    T = station @ model.poses(table.q)
    offset = targets(model.fixtures, table)
    return np.asarray(T[:, :3, 3] + (T[:, :3, :3] @ offset[:, :, None])[:, :, 0])
