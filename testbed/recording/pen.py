"""The pen of a recording: rows on the story's timelines, styles beside them, phases wiped clean."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index
from calib.errors import MachineError
from testbed.recording.story import Story
from testbed.robots.placements import quaternion_wxyz

Color = tuple[int, ...]
VIRIDIS = np.array(
    [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]], dtype=np.float64
)


class Timeline(Protocol):
    """What a pen has to know of a story."""

    @property
    def n_steps(self) -> int:
        """Steps of the whole timeline."""
        ...


class Stretch(Protocol):
    """What a pen has to know of a phase."""

    @property
    def at(self) -> Index:
        """(k,) step of each item."""
        ...

    @property
    def local(self) -> str:
        """Name of the phase's own timeline."""
        ...


Told = TypeVar("Told", bound=Timeline, covariant=True)


@dataclass(frozen=True, slots=True, eq=False)
class Pen(Generic[Told]):
    """A recording stream and the story it tells."""

    stream: Any
    """Open `rerun.RecordingStream`."""
    story: Told

    def static(self, path: str, what: Any) -> None:
        """Log what holds at all times; styles too, but never a component that has rows."""
        self.stream.log(path, what, static=True)

    def every_step(self, path: str, columns: Any, steps: Index | None = None) -> None:
        """One row per step: of the whole timeline, or of the steps given."""
        import rerun as rr

        at = np.arange(self.story.n_steps) if steps is None else steps
        self.stream.send_columns(
            path, indexes=[rr.TimeColumn("step", sequence=at)], columns=columns
        )

    def rows(self, path: str, phase: Stretch, columns: Any, local: Index | None = None) -> None:
        """One row per item of a phase, on the story's timeline and on the phase's own."""
        import rerun as rr

        index = np.arange(len(phase.at)) if local is None else local
        self.stream.send_columns(
            path,
            indexes=[
                rr.TimeColumn("step", sequence=phase.at[index]),
                rr.TimeColumn(phase.local, sequence=index),
            ],
            columns=columns,
        )

    def at(self, step: int, path: str, what: Any) -> None:
        """Log one thing from `step` on."""
        self.stream.set_time("step", sequence=step)
        self.stream.log(path, what)
        self.stream.reset_time()

    def clear(self, step: int, paths: Iterable[str]) -> None:
        """Wipe entities from `step` on; else the viewer shows their last row for ever."""
        import rerun as rr

        for path in paths:
            self.at(step, path, rr.Clear(recursive=False))

    def transforms(self, path: str, T: Array) -> None:
        """Transform of an entity in its parent: (4, 4) for all times, or one (s, 4, 4) per step."""
        import rerun as rr

        # quaternions: scalar first in MuJoCo, last in Rerun
        xyzw = quaternion_wxyz(T[..., :3, :3])[..., [1, 2, 3, 0]]
        if T.ndim == 2:
            self.static(path, rr.Transform3D(translation=T[:3, 3], quaternion=xyzw))
        else:
            self.every_step(path, rr.Transform3D.columns(translation=T[:, :3, 3], quaternion=xyzw))


Writer = Pen[Story]
"""The pen of a campaign's recording."""


def first(values: ArrayLike, lengths: Index) -> Array:
    """The first lengths[0], then the first lengths[1] ... rows of an array, end to end."""
    table = np.asarray(values)
    return np.concatenate([table[:length] for length in lengths])


def viridis(values: Array, highest: float) -> Array:
    """Colors (m, 3) from 0 to 255 for values from 0 (dark) to `highest` (bright)."""
    place = np.clip(np.asarray(values) / max(highest, 1e-300), 0, 1) * (len(VIRIDIS) - 1)
    low = np.minimum(place.astype(np.int64), len(VIRIDIS) - 2)
    part = (place - low)[:, None]
    return np.asarray((VIRIDIS[low] * (1 - part) + VIRIDIS[low + 1] * part).astype(np.uint8))


APPLICATION = "truebed"


@contextmanager
def strict_mode() -> Iterator[None]:
    """Bad calls raise inside, as they would not by default; the caller's setting comes back."""
    import rerun as rr

    before = rr.strict_mode()
    rr.set_strict_mode(True)
    try:
        yield
    finally:
        rr.set_strict_mode(before)


@contextmanager
def open_stream(path: Path, identity: str, name: str, layout: object) -> Iterator[Any]:
    """A stream into a file, closed with its footer; no clock of this machine gets in.

    Parameters
    ----------
    path : Path
        File to write, replaced if it is there.
    identity, name : str
        Identifier of the recording, and its name for people.
    layout : rerun.blueprint.Blueprint
        Screen to begin with.
    """
    import rerun as rr

    stream = rr.RecordingStream(APPLICATION, recording_id=identity)
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    try:
        path.unlink(missing_ok=True)
        # before the first row: what comes earlier would not be in the file
        stream.save(path, default_blueprint=layout)
    except (OSError, RuntimeError) as error:
        raise MachineError(
            f"the recording cannot be written ({error})", code="F3", where=str(path), field="path"
        ) from error
    try:
        stream.send_recording_name(name)
        stream.send_recording_start_time_nanos(0)
        stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        yield stream
    finally:
        stream.flush()
        stream.disconnect()


ARROW_SIZE = 0.16
"""Longest drawn error before calibration [m]."""


BEFORE_COLOR, AFTER_COLOR = (200, 52, 52), (20, 140, 70)
