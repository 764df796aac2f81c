"""A report to hand out: printed by whatever browser is there, or with the recording in it."""

import os
import sys
from pathlib import Path

import pytest

from calib.errors import MachineError
from testbed.cli import handout, viewer
from tests.reported import pages

PAGE = '<main><p>one &amp; only</p><a href="campaign.rrd">recording</a><footer>x</footer></main>'


@pytest.fixture
def page(tmp_path):
    path = tmp_path / "report.html"
    path.write_text(PAGE)
    return path


def browser_that(tmp_path, monkeypatch, does):
    """A program in the place of a browser, first on PATH."""
    folder = tmp_path / "bin"
    folder.mkdir()
    program = folder / handout.BROWSERS[0]
    program.write_text(f"#!{sys.executable}\nimport sys\n{does}\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")
    return handout.require_browser()


def test_what_the_browser_prints_stands_beside_the_page(page, tmp_path, monkeypatch):
    prints = (
        "out = next(w for w in sys.argv if w.startswith('--print-to-pdf='))[15:]\n"
        "open(out, 'w').write('%PDF of ' + sys.argv[-1])"
    )
    by = browser_that(tmp_path, monkeypatch, prints)
    assert by == str(tmp_path / "bin" / handout.BROWSERS[0])
    pdf = handout.print_pdf(page, by)
    assert pdf == tmp_path / "report.pdf"
    assert pdf.read_text() == f"%PDF of {page.as_uri()}"


@pytest.mark.parametrize("does", ["sys.exit(3)", "pass"])
def test_a_browser_that_fails_or_prints_nothing_leaves_nothing(page, tmp_path, monkeypatch, does):
    by = browser_that(tmp_path, monkeypatch, does)
    with pytest.raises(MachineError, match="did not print the page"):
        handout.print_pdf(page, by)
    assert not (tmp_path / "report.pdf").exists()


def test_a_browser_that_is_there_prints_pages(page):
    if handout.browser() is None:
        pytest.skip("no browser on PATH prints pages")
    printed = handout.print_pdf(page, handout.require_browser()).read_bytes()
    assert printed.startswith(b"%PDF")
    assert pages(printed) == 1


def test_the_recording_is_inside_the_page_and_its_link_leads_there(page, tmp_path, monkeypatch):
    player = "<script>let it = \"play & 'go'\"</script>"
    monkeypatch.setattr(viewer, "html_page", lambda _, out: Path(out).write_text(player))
    out = handout.with_recording(page, tmp_path / "campaign.rrd")
    text = out.read_text()
    assert out.name == "report_with_recording.html"
    assert text.count("</main>") == 1
    assert '<a href="#recording">' in text
    assert "<script>" not in text  # it lies escaped in an attribute
    assert text.index("<iframe") < text.index("<footer>") < text.index("</main>")
    assert page.read_text() == PAGE


def test_the_viewer_starts_in_a_page_within_a_page():
    script = "let it = new URL(document.currentScript.src, location.href).toString();"
    text = viewer.page("title", b"", script, b"", "1.0")
    assert "let it = new URL(document.baseURI).toString();" in text
    assert "location.href" not in text
