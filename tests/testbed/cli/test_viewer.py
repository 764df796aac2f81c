"""The viewer without a screen: pictures, complaints, the page; and a machine that cannot run it."""

import os
import struct
import subprocess

import pytest

from calib.errors import InputError, MachineError
from testbed.cli import viewer
from testbed.cli.viewer import page
from tests import viewed
from tests.recorded import record, small_campaign, timeline


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return record(tmp_path_factory.mktemp("viewer") / "campaign.rrd")


def needs_driver(call, *args, **options):
    """The result of a headless call, or a skip where no Vulkan driver lets a viewer run."""
    try:
        return call(*args, **options)
    except MachineError as error:
        pytest.skip(f"no headless viewer on this machine: {error}")


@pytest.mark.slow
def test_no_view_complains_at_the_start_middle_and_end_of_any_phase(path):
    phases = timeline(small_campaign()).phases
    steps = [step for p in phases for step in (p.start, (p.start + p.stop) // 2, p.stop - 1)]
    assert needs_driver(viewed.view_reports, path, steps) == ()


@pytest.mark.slow
def test_a_picture_has_the_size_of_the_window_and_is_not_blank(path, tmp_path, monkeypatch):
    monkeypatch.setattr(viewer, "NOTES_FADE", 1.0)  # notes on the picture do not matter here
    png = tmp_path / "shot.png"
    needs_driver(viewer.picture, path, png, step=200)
    data = png.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    assert struct.unpack(">II", data[16:24]) == viewer.SIZE
    assert len(data) > 50_000  # an empty window of this size is a few kilobytes


@pytest.mark.slow
def test_a_page_holds_recording_and_viewer_and_asks_no_network(path, tmp_path):
    out = tmp_path / "page.html"
    needs_driver(viewer.html_page, path, out)
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
    with viewer.private_environment() as environment:
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


def test_a_missing_recording_is_named(tmp_path):
    for call in (viewed.verify, viewer.open_viewer, viewed.view_reports):
        with pytest.raises(InputError, match=r"nothing\.rrd"):
            call(tmp_path / "nothing.rrd")


def test_without_a_display_the_browser_viewer_is_offered(monkeypatch, path):
    """The sentence says where; the server answers there and only there."""
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr(viewer.sys, "platform", "linux")
    said = []

    def tell_once(sentence):
        said.append(sentence)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        needs_driver(viewer.open_viewer, path, tell_once)
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
