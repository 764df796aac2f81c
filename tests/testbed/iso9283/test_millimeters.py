"""Poses that are missed by millimeters are reported in millimeters, quiet ones beside them not."""

import re

import numpy as np
import pytest

from testbed.iso9283.decided import decisions
from testbed.iso9283.figure_words import show, unit
from testbed.iso9283.play import play_test
from testbed.iso9283.read import read_test
from testbed.iso9283.recording import test_story as story_of
from testbed.iso9283.records import StatedFigure
from testbed.iso9283.report import headline, page_of
from testbed.iso9283.shown import shown_test
from testbed.iso9283.words import verdict
from testbed.report.page import Table, render
from tests.reported import THOUSANDS, VERSIONS, read
from tests.testbed.iso9283.made import BIAS, SESSION, path_rows, pose_rows, text_of


@pytest.fixture(scope="module")
def loud(tmp_path_factory):
    """Cycles that are off by some millimeters and scatter by one, and a path beside them."""
    folder = tmp_path_factory.mktemp("loud")
    rng = np.random.default_rng(1)
    turns = 1.5 * rng.standard_normal((5, 30, 3))
    rows = pose_rows(sd=1000.0, bias=50 * BIAS, turns=turns)
    (folder / "cycles.csv").write_text(text_of(rows))
    (folder / "path.csv").write_text(text_of(path_rows(off=(0.0, 4.0, 0.0))))
    limits = SESSION.replace("AP = 200, RP = 60", "AP = 5000, RP = 900")
    limits = limits.replace("position_um = 4", "position_um = 4\nrotation_mdeg = 5")
    (folder / "session.toml").write_text(limits)
    return play_test(read_test(folder))


def test_a_loud_test_names_no_thousands_of_micrometers(loud):
    page = page_of(loud, VERSIONS)
    text = " ".join(read(render(page)).text)
    assert THOUSANDS.findall(text) == []
    # the largest AP is that of P1: 4 mm along x
    assert re.match(
        r"AP is up to 4\.00 mm \(pose P1; 95 % limits 3\.\d\d to 4\.\d\d\)", verdict(loud)
    )
    tables = [block for part in page.sections for block in part.blocks if isinstance(block, Table)]
    captions = " ".join(table.caption for table in tables)
    for kind in ("Pose accuracy and repeatability, mm", "Orientation, deg",
                 "Distance accuracy and repeatability, mm"):  # fmt: skip
        assert kind in captions


def test_a_limit_and_the_figure_beside_it_are_in_one_unit(loud):
    said = {one.name: one.sentence for one in decisions(loud)}
    assert re.match(r"AP limit 5 mm: PASS, the largest upper limit is 4\.\d\d mm", said["AP"])
    # a limit below a millimeter, too, beside figures above
    assert re.match(r"RP limit 0\.9 mm: FAIL, RP is up to \d\.\d\d? mm", said["RP"])
    rows = {row[0]: row for row in headline(loud).rows}
    assert (rows["AP"][-3:-1], rows["RP"][-3:-1]) == (("mm", "5"), ("mm", "0.9"))


def test_the_recording_counts_in_millimeters(loud):
    story = story_of(shown_test(loud))
    for chapter in story.chapters:
        (chart,) = chapter.charts
        assert "[mm]" in chart.title
        assert all(np.abs(curve.values).max() < 30 for curve in chart.curves)
        assert all(re.search(r"\d mm\b", line) for line in chapter.lines)


def figure(value):
    """AP of one pose, known to 10 um [m]."""
    return StatedFigure("AP", "P1", value, value - 2e-5, value + 2e-5, 1e-5, 0.0, 30)


def test_one_figure_has_one_unit_its_limits_included():
    just, over = figure(970e-6), figure(985e-6)
    assert (show(just.size, just), unit(just)) == ("970", "um")
    assert (show(over.size, over), show(over.most, over), unit(over)) == ("0.985", "1.005", "mm")
