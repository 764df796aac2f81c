"""A film of a recording: the viewer's window, step after step, joined by what encodes here."""

import io
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TypeVar

from calib.errors import InputError, MachineError, refuse
from testbed.cli import viewer
from testbed.disk import atomic_path

T = TypeVar("T")
MOST_FRAMES = 120
"""Pictures of a film: each takes about a second without a graphics card."""
STEPS_PER_SECOND = 24.0
"""As the viewer plays."""
SIZE = (1280, 720)
"""Width and height: the smallest window in which all words of a recording have room."""
NEEDED = "an encoder: the command ffmpeg, or the package imageio-ffmpeg"


def film(rrd: str | Path, out: Path) -> None:
    """Write a recording as a film, as fast as the viewer plays it.

    Parameters
    ----------
    rrd : path
        Recording.
    out : path
        File to write, .mp4 or .gif.

    Raises
    ------
    InputError
        No such recording, or no encoder for this kind of film.
    MachineError
        No viewer came up, or the encoder failed.
    """
    encoder = "" if out.suffix == ".gif" else require_encoder(out)
    with frames(rrd, MOST_FRAMES) as (every, pictures), atomic_path(out) as file:
        rate = STEPS_PER_SECOND / every
        if encoder:
            _encode(encoder, pictures, rate, file)
        else:
            _animate(pictures, rate, file)


@contextmanager
def frames(rrd: str | Path, most: int) -> Iterator[tuple[int, Iterator[bytes]]]:
    """Steps from one picture to the next, and the pictures (PNG), at most so many and the last one.

    They are made one by one, while the block runs.

    Raises
    ------
    InputError, MachineError
        As `viewer.picture`.
    """
    with viewer.headless(viewer.existing(rrd), SIZE) as client:
        # a viewer begins to play as it starts: all that it draws until the notes fade is lost
        client.set_time("step", sequence=0, play_state="paused")
        viewer.paint(client)
        time.sleep(viewer.NOTES_FADE)
        (recording,) = client.get_state().recordings
        last = next(line.end for line in recording.timelines if line.name == "step")
        every = -(-(last + 1) // most)

        def shot(step: int) -> bytes:
            client.set_time("step", sequence=step, play_state="paused")
            return bytes(client.take_screenshot(None))

        yield every, (shot(min(step, last)) for step in range(0, last + every, every))


def ahead(work: Callable[[bytes], T], pictures: Iterator[bytes]) -> Iterator[T]:
    """Each picture worked on, while the viewer takes the next one."""
    with ThreadPoolExecutor(1) as worker:
        under_way: Future[T] | None = None
        for picture in pictures:
            begun = worker.submit(work, picture)
            if under_way is not None:
                yield under_way.result()
            under_way = begun
        if under_way is not None:
            yield under_way.result()


def require_encoder(out: Path) -> str:
    """The encoder of .mp4, wherever it is; C41 where there is none."""
    found = shutil.which("ffmpeg")
    if found is None:
        try:
            found = str(import_module("imageio_ffmpeg").get_ffmpeg_exe())
        except (ImportError, RuntimeError):  # not installed, or without its binary
            raise no_encoder(out) from None
    return found


def no_encoder(out: Path) -> InputError:
    """What to do without an encoder."""
    fix = f"install one of them, or write {out.with_suffix('.gif').name}, which needs none"
    message = f"--video {out} needs {NEEDED}; neither is here"
    return refuse("--video", str(out), code="C41", message=message, fix=fix)


def _encode(encoder: str, pictures: Iterator[bytes], rate: float, file: Path) -> None:
    """A film in H.264, which every browser and slide program plays."""
    words = [encoder, "-loglevel", "error", "-y", "-f", "image2pipe", "-framerate", f"{rate:g}"]
    words += ["-i", "-", "-c:v", "libx264", "-pix_fmt", "yuv420p", "-movflags", "+faststart"]
    pipe = subprocess.PIPE
    with subprocess.Popen([*words, "-f", "mp4", str(file)], stdin=pipe, stderr=pipe) as process:
        assert process.stdin is not None
        try:
            for picture in pictures:
                process.stdin.write(picture)
        except BrokenPipeError:  # it ended, and says why
            pass
        _, said = process.communicate()
    if process.returncode != 0:
        words = said.decode(errors="replace").strip().splitlines()
        message = f"the encoder {encoder} failed: {words[-1] if words else 'it said nothing'}"
        raise MachineError(message, code="M1", fix="write a .gif, which needs no encoder")


def _animate(pictures: Iterator[bytes], rate: float, file: Path) -> None:
    """A film as an animated picture with few colors."""
    from PIL import Image

    def reduced(picture: bytes) -> Image.Image:
        whole = Image.open(io.BytesIO(picture)).convert("RGB")
        # not the usual averages of colors: blue has to stay blue
        return whole.quantize(method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)

    frames = ahead(reduced, pictures)
    first = next(frames)
    first.save(
        file, format="GIF", save_all=True, append_images=frames, duration=round(1000 / rate), loop=0
    )
