"""A story as the file that Rerun plays."""

import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import timedelta
from typing import Any

from testbed.machine import RECORDING, require_room
from testbed.recording.cell import draw_arm
from testbed.recording.chart import draw_charts, draw_curves
from testbed.recording.layout import blueprint
from testbed.recording.pen import Pen
from testbed.recording.plane import with_micro
from testbed.recording.story import Story, Window, timeline_of
from testbed.recording.timeline import Timeline

APPLICATION = "truebed"


def story_bytes(story: Story) -> bytes:
    """A story as the content of a Rerun recording (.rrd).

    The same story gives the same content each time, though not the same bytes: the format gives
    every row an identifier of its own. Rerun itself opens no file, so that a full disk is noticed
    where the bytes are written.

    Parameters
    ----------
    story : Story
        Of finished things; nothing is computed again but poses of known models.

    Raises
    ------
    MachineError
        F10: memory or open files are limited to less than Rerun takes.
    """
    require_room(RECORDING)
    with strict_mode(), ended_streams():
        return _drawn(story, timeline_of(story.chapters))


def _drawn(story: Story, timeline: Timeline) -> bytes:
    """Everything a story tells, drawn from its first row to the footer of the file."""
    import rerun as rr

    # batches by size alone: the same content in the same chunks, however long drawing takes
    batches = rr.ChunkBatcherConfig(flush_tick=timedelta(days=1))
    stream = rr.RecordingStream(APPLICATION, recording_id=story.identity, batcher_config=batches)
    stream.set_log_time_enabled(False)  # no clock of this machine gets in
    stream.set_log_tick_enabled(False)
    layout = _Layout(blueprint(story, timeline))
    # before the first row: what comes earlier would not be in the bytes
    content = stream.binary_stream()
    try:
        stream.send_blueprint(layout, make_active=False)
        stream.send_recording_name(story.name)
        stream.send_recording_start_time_nanos(0)
        _draw(story, Pen(stream, timeline))
    finally:
        # read once, for every reading ends in a footer; and always, for Rerun logs what is dropped
        data = content.read() or b""
        stream.disconnect()
        layout.close()
    return bytes(data)


def _draw(story: Story, pen: Pen) -> None:
    """The rows of a story."""
    import rerun as rr

    pen.static("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    names = [chapter.name for chapter in story.chapters]
    colors = [chapter.color for chapter in story.chapters]
    pen.static("phase", rr.StateConfiguration(values=names, colors=colors))
    for chapter, phase in zip(story.chapters, pen.timeline.phases, strict=True):
        pen.at(phase.start, "phase", rr.StateChange(state=chapter.name))
    if story.robot is not None and story.chain is not None:
        draw_arm(pen, "world/robot", story.robot, pen.timeline.q, (story.chain,))
    story.draw(pen)
    for window in story.screens:
        own = Pen(pen.stream, window.timeline(pen.timeline))
        window.draw(own)
        _tell(own, story, window)


def _tell(pen: Pen, story: Story, window: Window) -> None:
    """The words and charts of a window, and what its own chapters draw."""
    import rerun as rr

    markdown, at = rr.MediaType.MARKDOWN, window.words
    summary = with_micro(window.summary or story.summary)
    pen.static(f"{at}summary", rr.TextDocument(summary, media_type=markdown))
    for chapter, phase in zip(story.chapters_in(window), pen.timeline.phases, strict=True):
        text = "\n".join(line for line in chapter.text if line)
        text = re.sub(r"^#+ (.*)", r"**\1**", with_micro(text))  # a heading would stand below a gap
        pen.at(phase.start, f"{at}now", rr.TextDocument(text, media_type=markdown))
        if not chapter.lines or phase.at[0] > phase.start:
            pen.at(phase.start, f"{at}line", rr.TextDocument("", media_type=markdown))
        if chapter.lines:
            words = [f"### {with_micro(line)}" for line in chapter.lines]
            kinds = [markdown] * len(words)
            pen.rows(f"{at}line", phase, rr.TextDocument.columns(text=words, media_type=kinds))
        draw_charts(pen, phase, chapter.charts, at)
        if window.owns(chapter):
            draw_curves(pen, phase, chapter.charts, at)
            chapter.draw(pen, phase)


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
def ended_streams() -> Iterator[None]:
    """Rerun lets go of the streams that were closed inside; each would keep its threads.

    It does so when it is initialized, which also takes away the caller's own global recording:
    that one comes back.
    """
    import rerun as rr

    try:
        yield
    finally:
        before = rr.get_global_data_recording()
        try:
            with suppress(RuntimeError):  # a stream of the caller's own that cannot be flushed
                rr.init(APPLICATION, init_logging=False)
        finally:
            rr.set_global_data_recording(before)


@dataclass(slots=True)
class _Layout:
    """A layout that closes the stream which Rerun draws it into, and would leave open."""

    screen: Any
    """`rerun.blueprint.Blueprint`."""
    stream: Any = None

    def to_blueprint(self) -> "_Layout":
        """What Rerun asks for."""
        return self

    def _log_to_stream(self, stream: Any) -> None:
        """What Rerun does with it."""
        self.stream = stream
        self.screen._log_to_stream(stream)

    def close(self) -> None:
        """End the stream if there was one."""
        if self.stream is not None:
            self.stream.disconnect()
