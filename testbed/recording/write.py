"""Write a story as the file that Rerun plays."""

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import Any

from calib.errors import MachineError
from testbed.recording.cell import draw_arm
from testbed.recording.layout import blueprint
from testbed.recording.pen import Pen
from testbed.recording.story import Story, timeline_of

APPLICATION = "truebed"


def write_story(story: Story, path: str | Path) -> None:
    """Write a story as a Rerun recording.

    The same story gives the same content each time, though not the same bytes: the format gives
    every row an identifier of its own.

    Parameters
    ----------
    story : Story
        Of finished things; nothing is computed again but poses of known models.
    path : path
        File to write, replaced if it is there.

    Raises
    ------
    MachineError
        If the file cannot be written.
    """
    import rerun as rr

    timeline = timeline_of(story.chapters)
    with strict_mode(), open_stream(Path(path), story, blueprint(story, timeline)) as stream:
        pen, markdown = Pen(stream, timeline), rr.MediaType.MARKDOWN
        pen.static("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        pen.static("summary", rr.TextDocument(story.summary, media_type=markdown))
        names = [chapter.name for chapter in story.chapters]
        colors = [chapter.color for chapter in story.chapters]
        pen.static("phase", rr.StateConfiguration(values=names, colors=colors))
        draw_arm(pen, "world/robot", story.robot, timeline.q, (story.chain,))
        story.draw(pen)
        for chapter, phase in zip(story.chapters, timeline.phases, strict=True):
            text = "\n".join(line for line in chapter.text if line)
            pen.at(phase.start, "now", rr.TextDocument(text, media_type=markdown))
            pen.at(phase.start, "phase", rr.StateChange(state=chapter.name))
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
def open_stream(path: Path, story: Story, screen: object) -> Iterator[Any]:
    """A stream into a file, closed with its footer; no clock of this machine gets in.

    Parameters
    ----------
    path : Path
        File to write, replaced if it is there.
    story : Story
        Gives the recording its identity and name.
    screen : rerun.blueprint.Blueprint
        Layout to begin with.
    """
    import rerun as rr

    # batches by size alone: the same content in the same chunks, however long drawing takes
    batches = rr.ChunkBatcherConfig(flush_tick=timedelta(days=1))
    stream = rr.RecordingStream(APPLICATION, recording_id=story.identity, batcher_config=batches)
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    try:
        path.unlink(missing_ok=True)
        # before the first row: what comes earlier would not be in the file
        stream.save(path, default_blueprint=screen)
    except (OSError, RuntimeError) as error:
        raise MachineError(
            f"the recording cannot be written ({error})", code="F3", where=str(path), field="path"
        ) from error
    try:
        stream.send_recording_name(story.name)
        stream.send_recording_start_time_nanos(0)
        yield stream
    finally:
        stream.flush()
        stream.disconnect()
