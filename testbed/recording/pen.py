"""The pen of a recording: rows on its timelines, styles beside them, entities wiped clean."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from calib.arrays import Array, Index
from testbed.recording.style import Color
from testbed.recording.timeline import Phase, Timeline, growing
from testbed.robots.placements import quaternion_wxyz


@dataclass(frozen=True, slots=True, eq=False)
class Pen:
    """A recording stream and the timeline it runs on."""

    stream: Any
    """Open `rerun.RecordingStream`."""
    timeline: Timeline

    def static(self, path: str, what: Any) -> None:
        """Log what holds at all times; styles too, but never a component that has rows."""
        self.stream.log(path, what, static=True)

    def every_step(self, path: str, columns: Any, steps: Index | None = None) -> None:
        """One row per step: of the whole timeline, or of the steps given."""
        import rerun as rr

        at = np.arange(self.timeline.n_steps) if steps is None else steps
        self.stream.send_columns(
            path, indexes=[rr.TimeColumn("step", sequence=at)], columns=columns
        )

    def rows(self, path: str, phase: Phase, columns: Any, local: Index | None = None) -> None:
        """One row per item of a phase, on the whole timeline and on the phase's own."""
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

    def grow(
        self,
        path: str,
        phase: Phase,
        archetype: Any,
        values: Mapping[str, Array],
        style: Mapping[str, Any],
        *,
        begin: int = 0,
        each: int = 1,
    ) -> None:
        """Things that come one by one in a phase, and then stay.

        They are of one of Rerun's archetypes. `values` has rows by component: with item
        ``begin + k`` of the phase come the next `each` of them. `style` holds for all.
        """
        lengths = growing(len(next(iter(values.values()))) // each)
        shown = {name: first(value, each * lengths) for name, value in values.items()}
        columns = archetype.columns(**shown).partition(each * lengths)
        self.rows(path, phase, columns, begin + lengths - 1)
        self.static(path, archetype.from_fields(**style))

    def grow_arrows(
        self,
        path: str,
        phase: Phase,
        origins: Array,
        vectors: Array,
        color: Color,
        radius: float,
        begin: int = 0,
    ) -> None:
        """Arrows (k, 3) that come one by one and stay [m]."""
        import rerun as rr

        arrows = {"origins": origins, "vectors": vectors}
        style = {"radii": radius, "colors": color}
        self.grow(path, phase, rr.Arrows3D, arrows, style, begin=begin)

    def at(self, step: int, path: str, what: Any) -> None:
        """Log one thing from `step` on."""
        self.stream.set_time("step", sequence=step)
        self.stream.log(path, what)
        self.stream.reset_time()

    def clear(self, step: int, *paths: str) -> None:
        """Wipe entities from `step` on; else the viewer shows their last row for ever.

        What would go after the last step stays: a step for that alone would be the one that the
        viewer opens at, and show nothing.
        """
        import rerun as rr

        for path in paths if step < self.timeline.n_steps else ():
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


def first(values: Array, lengths: Iterable[int]) -> Array:
    """The first lengths[0], then the first lengths[1] ... rows of an array, end to end."""
    return np.concatenate([values[:length] for length in lengths])
