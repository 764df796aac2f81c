"""The viewer without a screen: pictures, complaints, the page; and a machine that cannot run it."""

import os
import struct
import subprocess
from contextlib import nullcontext

import pytest

from calib.errors import InputError, MachineError
from testbed.cli import viewer, viewer_process
from testbed.cli.viewer import page
from tests import viewed
from tests.command import call
from tests.recorded import record, small_campaign, timeline


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return record(tmp_path_factory.mktemp("viewer") / "campaign.rrd")


@pytest.mark.slow
def test_no_view_complains_at_the_start_middle_and_end_of_any_phase(path):
    phases = timeline(small_campaign()).phases
    steps = [step for p in phases for step in (p.start, (p.start + p.stop) // 2, p.stop - 1)]
    with viewed.needs_driver():
        assert viewed.view_reports(path, steps) == ()


@pytest.mark.slow
def test_a_picture_has_the_size_of_the_window_and_is_not_blank(path, tmp_path, monkeypatch):
    monkeypatch.setattr(viewer, "NOTES_FADE", 1.0)  # notes on the picture do not matter here
    png = tmp_path / "shot.png"
    with viewed.needs_driver():
        viewer.picture(path, png, step=200)
    data = png.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    assert struct.unpack(">II", data[16:24]) == viewer.SIZE
    assert len(data) > 50_000  # an empty window of this size is a few kilobytes


@pytest.mark.slow
def test_a_page_holds_recording_and_viewer_and_asks_no_network(path, tmp_path):
    out = tmp_path / "page.html"
    with viewed.needs_driver():
        viewer.html_page(path, out)
    text = out.read_text(encoding="utf-8")
    assert 10e6 < len(text) < 40e6
    assert text.count("</script>") == 5  # the viewer's own text cannot end a script
    assert "<link" not in text
    assert "src=" not in text[: text.index("<script>")]


def test_page_text_survives_hostile_content():
    text = page("<b>", b"rrd", 'var x = "</script>";', b"wasm", "0")
    assert "<title>&lt;b&gt;</title>" in text
    assert text.count("</script>") == 5


def test_usage_statistics_are_off_and_nothing_is_left_behind():
    with viewer_process.private_environment() as environment:
        folder = environment["XDG_CONFIG_HOME"]
        said = subprocess.run(
            [str(viewer.native()), "analytics", "config"],
            capture_output=True,
            text=True,
            check=True,
            env=environment,
        ).stdout
        assert '"analytics_enabled": false' in said
        assert folder in said
    assert not os.path.exists(folder)  # noqa: PTH110 (a string from the environment)


@pytest.mark.parametrize("step", [-4, 1, 99999])
def test_a_step_that_a_recording_does_not_have_is_refused_with_those_it_has(path, tmp_path, step):
    story = timeline(small_campaign())
    step = story.n_steps if step == 1 else step  # the first one behind the last
    words = ["view", str(path), "--picture", str(tmp_path / "a.png"), "--step", str(step)]
    done = call(*words)
    assert done.exit_code == 2
    firsts = [f"{phase.name} from {phase.start}" for phase in story.phases]
    assert done.stderr == (
        f"--step is {step}; steps run from 0 to {story.n_steps - 1}: {', '.join(firsts[:-1])} and "
        f"{firsts[-1]}; choose one of them. [C41]\n"
    )
    assert not (tmp_path / "a.png").exists()


def test_a_step_without_a_picture_is_refused(path):
    done = call("view", str(path), "--step", "3")
    assert done.exit_code == 2
    assert done.stderr == (
        "--step is 3, but there is no --picture; add --picture FILE.png. [C41]\n"
    )


@pytest.mark.parametrize("asked", [True, False])
def test_a_picture_is_announced_and_shows_the_last_step_unless_told(
    path, tmp_path, monkeypatch, asked
):
    drawn = []

    class Client:
        def set_time(self, timeline, *, sequence, play_state):
            drawn.append((timeline, sequence, play_state))

        def take_screenshot(self, file=None, max_size=0):
            return b"png"

    monkeypatch.setattr(viewer, "headless", lambda *_: nullcontext(Client()))
    monkeypatch.setattr(viewer, "NOTES_FADE", 0.0)
    step = 7 if asked else timeline(small_campaign()).n_steps - 1
    png = tmp_path / "a.png"
    words = ["view", str(path), "--picture", str(png), *(["--step", "7"] if asked else [])]
    done = call(*words)
    assert (done.exit_code, done.stdout) == (0, f"{png}\n")
    assert done.stderr == f"Drawing {png}; this takes up to half a minute.\n"
    assert drawn == [("step", step, "paused")]
    assert png.read_bytes() == b"png"


@pytest.mark.parametrize("part", [0.0, 0.5])
def test_a_step_of_a_recording_cut_short_is_refused_as_one_of_no_recording(path, tmp_path, part):
    whole = path.read_bytes()
    cut = tmp_path / "cut.rrd"
    cut.write_bytes(whole[: int(part * len(whole))])
    with pytest.raises(InputError, match=r"cut\.rrd: is not a recording, or is incomplete"):
        viewer.picture(cut, tmp_path / "a.png", step=3)


def test_a_missing_recording_is_named(tmp_path):
    for opens in (viewed.verify, viewer.open_viewer, viewed.view_reports):
        with pytest.raises(InputError, match=r"nothing\.rrd"):
            opens(tmp_path / "nothing.rrd")


def test_without_a_display_the_browser_viewer_is_offered(monkeypatch, path):
    """The sentence says where; the server answers there and only there."""
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr(viewer.sys, "platform", "linux")
    said = []

    def tell_once(sentence):
        said.append(sentence)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), viewed.needs_driver():
        viewer.open_viewer(path, tell_once)
    assert "no display" in said[0]
    assert "http://127.0.0.1:" in said[0]


def test_a_viewer_that_cannot_start_says_what_is_missing(monkeypatch, path, tmp_path):
    broken = tmp_path / "rerun"
    broken.write_text("#!/bin/sh\nexit 1\n")
    broken.chmod(0o755)
    monkeypatch.setattr(viewer, "native", lambda: broken)
    with pytest.raises(MachineError, match="Vulkan"):
        viewer.picture(path, tmp_path / "shot.png")
    assert not (tmp_path / "shot.png").exists()
