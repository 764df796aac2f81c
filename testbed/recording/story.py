"""The story of one trial as a row of frames: which phase, which joints, which model, at every step.

One timeline, `step`, runs through select, measure, identify and evaluate. The robot glides from
pose to pose and rests where something is known about it; the glide is for the eye, not planned.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from calib.arrays import Array, Index
from testbed.laboratory.truth.laboratory import Setting
from testbed.studies.trial.records import Estimate, Trial

PhaseName = Literal["select", "measure", "identify", "evaluate", "compensate", "coverage"]
PHASES: tuple[PhaseName, ...] = ("select", "measure", "identify", "evaluate")
"""Of every story, in their order; some studies add one of their own."""
LOCAL: dict[PhaseName, str] = {
    "select": "search",
    "measure": "pose",
    "identify": "iteration",
    "evaluate": "test",
    "compensate": "visit",
    "coverage": "robot",
}
"""Name of each phase's own timeline."""
FRAMES_PER_POSE = 6
"""Frames from one pose to the next, the last two at rest; fewer when there are many poses."""
MOST_FRAMES = 900
"""A phase is kept below this by dropping frames, not poses."""
STOPPING: tuple[PhaseName, ...] = ("measure", "evaluate", "compensate")
"""Phases in which the robot goes from stop to stop."""
SELECT_FRAMES, IDENTIFY_FRAMES, COVERAGE_FRAMES, COMPENSATE_FRAMES = 144, 72, 144, 144
"""Length of the phases in which the robot does not have to be anywhere."""


@dataclass(frozen=True, slots=True, eq=False)
class Phase:
    """A stretch of the timeline and where its rows of numbers lie on it."""

    name: PhaseName
    start: int
    stop: int
    """First step after the phase."""
    at: Index
    """(k,) step of each search, pose, iteration or test."""

    @property
    def steps(self) -> Index:
        """Every step of the phase."""
        return np.arange(self.start, self.stop)

    @property
    def local(self) -> str:
        """Name of the phase's own timeline."""
        return LOCAL[self.name]


@dataclass(frozen=True, slots=True, eq=False)
class Story:
    """One estimate of one trial, laid out on the timeline."""

    setting: Setting
    trial: Trial
    estimate: Estimate
    phases: tuple[Phase, ...]
    q: Array
    """(s, n) drawn joint values at every step [rad, m]."""
    known: Array
    """(s,) how far the model in use has moved from nominal (0) to identified (1)."""

    @property
    def n_steps(self) -> int:
        """Steps of the whole timeline."""
        return len(self.q)

    def phase(self, name: PhaseName) -> Phase:
        """The phase with this name."""
        return next(phase for phase in self.phases if phase.name == name)


def tell(
    setting: Setting,
    trial: Trial,
    estimate: Estimate,
    *,
    program: Array | None = None,
    robots: int = 0,
) -> Story:
    """Lay out the frames of one estimate, and of what studies add.

    Parameters
    ----------
    setting, trial, estimate : Setting, Trial, Estimate
        What is told.
    program : (k, n) array, optional
        Joint targets that a compensation study executes [rad, m].
    robots : int
        Robots of a coverage study.
    """
    searches, iterations = len(search_trace(trial)), len(estimate.identification.trace)
    measured, tests = trial.measurements.q, setting.test_q
    lengths: dict[PhaseName, tuple[int, int]] = {
        "select": (searches, max(1, SELECT_FRAMES // searches)),
        "measure": (len(measured), frames_per_pose(len(measured))),
        "identify": (iterations, max(1, IDENTIFY_FRAMES // iterations)),
        "evaluate": (len(tests), frames_per_pose(len(tests))),
    }
    if program is not None:
        lengths["compensate"] = (len(program), COMPENSATE_FRAMES // len(program))
    if robots:
        lengths["coverage"] = (robots, max(1, COVERAGE_FRAMES // robots))
    phases, start = [], 0
    for name, (count, frames) in lengths.items():
        if name in (
            "measure",
            "evaluate",
            "compensate",
        ):  # a pose is known when the robot comes to rest at it
            at = start + frames * np.arange(count) + max(frames - 2, 0)
        else:
            at = start + np.round(np.linspace(0, count * frames - 1, count)).astype(np.int64)
        phases.append(Phase(name, start, start + count * frames, at))
        start += count * frames
    select, measure, identify, evaluate = phases[:4]
    q = np.vstack(
        [
            glide(candidates(setting.pool_q, select.stop), select.stop),
            glide(measured, measure.stop - measure.start),
            np.repeat(measured[-1:], identify.stop - identify.start, axis=0),
            glide(tests, evaluate.stop - evaluate.start),
        ]
    )
    for phase in phases[4:]:
        long = phase.stop - phase.start
        stops = program if phase.name == "compensate" and program is not None else q[-1:]
        q = np.vstack([q, glide(stops, long)])
    known = np.zeros(start)
    known[identify.steps] = eased(np.linspace(0, 1, identify.stop - identify.start))
    known[evaluate.start :] = 1
    return Story(setting, trial, estimate, tuple(phases), q, known)


def search_trace(trial: Trial) -> Array:
    """Best index after each search (t,); a set that was not searched for has its own value."""
    trace = trial.selection.trace
    return trace if len(trace) else np.array([trial.selection.value])


def frames_per_pose(poses: int) -> int:
    """Frames spent on each of so many poses."""
    return max(1, min(FRAMES_PER_POSE, MOST_FRAMES // poses))


def candidates(pool_q: Array, steps: int) -> Array:
    """Evenly spread pool poses (k, n) to leaf through in so many steps."""
    count = max(1, min(len(pool_q), steps // FRAMES_PER_POSE))
    return pool_q[np.arange(count) * len(pool_q) // count]


def glide(stops: Array, steps: int) -> Array:
    """Joint values (steps, n) that go from stop to stop and rest at each [rad, m]."""
    phase = np.arange(steps) * len(stops) / steps
    index = np.minimum(phase.astype(np.int64), len(stops) - 1)
    frames = steps / len(stops)
    # the last two of `frames` steps belong to the stop itself
    part = eased(np.clip((phase - index) * frames / max(frames - 2, 1e-9), 0, 1))
    before = stops[np.maximum(index - 1, 0)]
    return np.asarray(before + part[:, None] * (stops[index] - before))


def eased(part: Array) -> Array:
    """Progress 0 to 1 with a soft start and a soft stop."""
    return np.asarray(part * part * (3 - 2 * part))


def growing(count: int, most: int = 300) -> Index:
    """Lengths (r,) of a cloud that grows to `count` points in at most `most` rows."""
    return np.unique(np.ceil(np.linspace(1, count, min(count, most))).astype(np.int64))


def nice_factor(largest: float, typical: float) -> int:
    """Exaggeration 1, 2, 3, 5, 10, 20 ... that draws `typical` just below `largest` [m]."""
    ratio = largest / max(typical, 1e-12)
    if ratio <= 1:
        return 1
    power = 10 ** int(np.floor(np.log10(ratio)))
    return int(next(f * power for f in (5, 3, 2, 1) if f * power <= ratio * (1 + 1e-12)))
