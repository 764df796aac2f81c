"""Films of recordings: as long as they are played, in true colors, or one sentence."""

import io
import sys
from contextlib import contextmanager

import numpy as np
import pytest
from PIL import Image

from calib.errors import InputError, MachineError
from testbed.cli import video, viewer
from testbed.recording import style
from tests.command import call
from tests.recorded import record, small_campaign, timeline
from tests.viewed import needs_driver

ENCODER = """#!{python}
import sys
from pathlib import Path
data = sys.stdin.buffer.read()
if "{says}":
    sys.exit("first line\\n{says}")
Path(sys.argv[-1]).write_bytes(" ".join(sys.argv[1:-1]).encode() + data)
"""


def shot(color):
    """A picture of a dark window with a patch of a color."""
    picture = Image.new("RGB", video.SIZE, (14, 14, 14))
    picture.paste(color, (100, 100, 140, 140))
    data = io.BytesIO()
    picture.save(data, "PNG")
    return data.getvalue()


SHOTS = [shot(style.VERMILION), shot(style.BLUE), shot(style.GHOST_COLOR[:3])]


@pytest.fixture
def shots(monkeypatch):
    """Three pictures, eight steps apart, in place of a viewer."""

    @contextmanager
    def frames(rrd, most):
        yield 8, iter(SHOTS)

    monkeypatch.setattr(video, "frames", frames)


@pytest.fixture
def ffmpeg(monkeypatch, tmp_path):
    """Put a program in place of the encoder: it writes its words and what it reads."""

    def make(says=""):
        program = tmp_path / "ffmpeg"
        program.write_text(ENCODER.format(python=sys.executable, says=says))
        program.chmod(0o755)
        monkeypatch.setenv("PATH", str(tmp_path))

    return make


def test_an_animated_picture_keeps_the_colors_and_the_speed(shots, tmp_path):
    out = tmp_path / "a.gif"
    video.film("a.rrd", out)
    with Image.open(out) as film:
        assert (film.n_frames, film.size) == (3, video.SIZE)
        # 8 steps at 24 a second; the format counts hundredths
        assert film.info["duration"] == pytest.approx(1000 * 8 / 24, abs=10)
        for k, color in enumerate((style.VERMILION, style.BLUE, style.GHOST_COLOR[:3])):
            film.seek(k)
            seen = np.array(film.convert("RGB"))[120, 120].astype(int)
            assert np.abs(seen - color).max() <= 8  # of 256: the palette has as many colors


def test_an_encoder_gets_every_picture_and_their_rate(shots, ffmpeg, tmp_path):
    ffmpeg()
    video.film("a.rrd", tmp_path / "a.mp4")
    data = (tmp_path / "a.mp4").read_bytes()
    assert data.endswith(b"".join(SHOTS))
    assert b"-framerate 3 " in data[:200]


def test_an_encoder_that_fails_is_quoted_and_nothing_is_left(shots, ffmpeg, tmp_path):
    ffmpeg(says="unknown encoder libx264")
    with pytest.raises(MachineError, match=r"failed: unknown encoder libx264; write a \.gif"):
        video.film("a.rrd", tmp_path / "a.mp4")
    assert {path.name for path in tmp_path.iterdir()} == {"ffmpeg"}


def test_without_an_encoder_one_sentence_says_what_to_do(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    (tmp_path / "a.rrd").write_bytes(b"")
    done = call("view", tmp_path / "a.rrd", "--video", tmp_path / "a.mp4")
    assert done.exit_code == 2
    assert done.stderr == (
        f"--video {tmp_path}/a.mp4 needs an encoder: the command ffmpeg, or the package "
        "imageio-ffmpeg; neither is here; install one of them, or write a.gif, which needs none. "
        "[C41]\n"
    )


@pytest.mark.parametrize(("name", "says"), [
    ("a.avi", "a file name that ends in .mp4 or .gif"), ("no/a.gif", "cannot be written"),
])  # fmt: skip
def test_a_film_that_cannot_be_written_is_refused_first(tmp_path, name, says):
    (tmp_path / "a.rrd").write_bytes(b"")
    words = ["view", str(tmp_path / "a.rrd"), "--video", str(tmp_path / name)]
    done = call(*words)
    assert done.exit_code == 2
    assert says in done.stderr


@pytest.mark.parametrize("count", [0, 1, 2, 7])
def test_pictures_are_worked_on_in_their_order_while_the_next_is_taken(count):
    taken, seen = [], []

    def pictures():
        for k in range(count):
            taken.append(k)
            yield bytes([k])

    for k, done in enumerate(video.ahead(lambda picture: picture[0], pictures())):
        seen.append(done)
        assert len(taken) == min(k + 2, count)
    assert seen == list(range(count))


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".gif", ".mp4"])
def test_a_whole_recording_becomes_a_film_as_long_as_it_is_played(tmp_path, monkeypatch, ending):
    """The recording of a campaign from start to end; .mp4 where an encoder is installed."""
    monkeypatch.setattr(video, "MOST_FRAMES", 6)  # as many as show a rate; each takes a second
    monkeypatch.setattr(video, "SIZE", (800, 500))
    monkeypatch.setattr(viewer, "NOTES_FADE", 0.5)
    out = tmp_path / f"film{ending}"
    if ending == ".mp4":
        try:
            video.require_encoder(out)
        except InputError:
            pytest.skip("no encoder on this machine")
    path = record(tmp_path / "campaign.rrd")
    steps = timeline(small_campaign()).n_steps
    with needs_driver():
        video.film(path, out)
    assert out.stat().st_size > 1e5
    if ending == ".gif":
        every = -(-steps // video.MOST_FRAMES)
        with Image.open(out) as film:
            # frames that are alike become one that lasts longer
            lasts = 0.0
            for k in range(film.n_frames):
                film.seek(k)
                lasts += film.info["duration"] / 1e3
            assert film.size == video.SIZE
            # as long as the viewer plays it, in hundredths of a second for each frame
            assert lasts == pytest.approx((steps / every + 1) * every / 24, rel=0.1)


@pytest.mark.slow
def test_frames_go_from_the_first_step_to_the_last(tmp_path, monkeypatch):
    monkeypatch.setattr(viewer, "NOTES_FADE", 0.5)
    monkeypatch.setattr(video, "SIZE", (800, 500))
    path = record(tmp_path / "campaign.rrd")
    steps = timeline(small_campaign()).n_steps
    with needs_driver(), video.frames(path, 4) as (every, pictures):
        found = list(pictures)
    assert every == -(-steps // 4)
    assert len(found) in (4, 5)
    assert len(set(found)) == len(found)
