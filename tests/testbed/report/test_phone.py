"""On the screen of a phone a page has nothing beyond its edge, and pictures can be read."""

import json
import subprocess
from html import escape, unescape
from itertools import pairwise

import pytest

from testbed.cli import handout
from testbed.report.page import Figure, Section, render
from testbed.report.plots import legend_above, log_ticks
from testbed.report.svg import HALF_WIDTH, PHONE, WIDTH, drawing, on_phone, svg_of
from tests.testbed.report.test_page import page

SMALLEST = 7.0
"""Letters of figures [pt], but for one word (tracker)."""
READABLE = 9.0
"""The same on a screen [px]: as large as the small print of web pages, about."""
LABELS = "nominal model", "default estimator", "paper estimator"


def curves(panels, name="a curve"):
    """A figure of so many panels beside each other, on logarithmic axes over three decades."""
    with drawing(1, panels, height=2.15, sharey=True) as (figure, axes):
        for ax in axes:
            for k, name in enumerate(LABELS):
                ax.plot([0.0015 * (k + 1), 1.5], [0, 1], label=name)
            ax.set_xscale("log")
            log_ticks(ax.xaxis, 0.0015, 1.5)
            ax.set_xlabel("error of the tool [mm]")
        legend_above(figure, axes[0])
        curves.drawn = figure
        return svg_of(figure)


def boxes(texts):
    """Where texts stand in a drawing [px]."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    renderer = FigureCanvasAgg(curves.drawn).get_renderer()
    return [text.get_window_extent(renderer) for text in texts if text.get_text()]


@pytest.mark.parametrize("panels", [1, 2, 4])
@pytest.mark.parametrize("small", [False, True])
def test_words_of_a_figure_stand_apart_and_inside_it(panels, small):
    """Also on the screen of a phone, where a panel is a third as wide."""
    svg = on_phone(curves, panels) if small else curves(panels)
    figure = curves.drawn
    width = PHONE if small else WIDTH
    assert f'viewBox="0 0 {72 * width:g} ' in svg
    labels = [boxes(ax.get_xticklabels()) for ax in figure.axes]
    for along in labels:
        assert len(along) >= 2
        assert all(one.x1 < other.x0 for one, other in pairwise(along))
    words = boxes(figure.legends[0].get_texts())
    assert len(words) == len(LABELS)
    for box in [*words, *(box for along in labels for box in along)]:
        assert 0 <= box.x0 < box.x1 <= figure.dpi * width
    assert not any(one.overlaps(other) for k, one in enumerate(words) for other in words[k + 1 :])


def test_panels_stand_below_each_other_on_a_phone_and_the_next_drawing_is_wide_again():
    for panels, columns in ((1, 1), (2, 1), (3, 1), (4, 2)):
        on_phone(curves, panels)
        grids = {ax.get_subplotspec().get_gridspec().ncols for ax in curves.drawn.axes}
        assert grids == {columns}
        assert len(curves.drawn.axes) == panels
    with pytest.raises(ValueError, match="no curve"):
        on_phone(failing)
    assert f'viewBox="0 0 {72 * WIDTH:g} ' in curves(2)


def test_panels_that_belong_together_stand_side_by_side_on_a_phone():
    """Columns of two on a page; the axes come column by column on both."""
    by_column = [(row, column) for column in range(3) for row in range(2)]
    by_row = [(row, column) for row in range(3) for column in range(2)]
    for small, expected in ((False, by_column), (True, by_row)):
        on_phone(two_rows) if small else two_rows()
        spec = [ax.get_subplotspec() for ax in two_rows.axes]
        assert [(one.rowspan.start, one.colspan.start) for one in spec] == expected


def two_rows():
    """Three columns of two panels that belong together."""
    with drawing(2, 3, pairs=True) as (figure, two_rows.axes):
        return svg_of(figure)


def failing():
    raise ValueError("no curve")


FRAME = """<!doctype html><iframe id="f" width="375" height="900" srcdoc="{}"></iframe><script>
f.onload = () => {{
  const page = f.contentDocument, top = page.documentElement;
  page.querySelectorAll("details").forEach(one => one.open = true);
  const seen = [...page.querySelectorAll("div.drawing")].map(box => {{
    const shown = [...box.querySelectorAll("svg")].filter(one => one.getBoundingClientRect().width);
    return {{needs: box.scrollWidth, has: box.clientWidth, count: shown.length,
             scale: shown[0].getScreenCTM().a}};
  }});
  const told = document.createElement("p");
  told.id = "told";
  told.textContent = JSON.stringify({{needs: top.scrollWidth, has: top.clientWidth, seen}});
  document.body.append(told);
}}
</script>"""
"""A window as wide as a small phone's with a page in it, which writes down what scrolls there: 360
pixels and a scroll bar."""


@pytest.mark.skipif(handout.browser() is None, reason="no browser shows pages")
def test_pictures_can_be_read_on_a_phone_and_the_page_does_not_scroll_sideways(tmp_path):
    """A picture drawn for a phone fits it; through any other a hand scrolls, inside its frame."""
    half = f'<svg viewBox="0 0 {72 * HALF_WIDTH:g} 99"><path d="M0 0L331 99"/></svg>'
    first = Figure("A curve.", curves(1), phone=on_phone(curves, 1))
    others = Figure("Two curves.", curves(2)), Figure("Half.", half, "half")
    shown = tmp_path / "phone.html"
    html = render(page(Section("one", "One", others), picture=first))
    shown.write_text(FRAME.format(escape(html)), encoding="utf-8")
    words = [handout.browser(), "--headless", "--disable-gpu", "--no-sandbox", "--dump-dom"]
    words += [f"--user-data-dir={tmp_path / 'own'}", "--virtual-time-budget=5000", shown.as_uri()]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120, check=True)
    told = json.loads(unescape(done.stdout.split('<p id="told">')[1].split("</p>")[0]))
    assert told["has"] > 300
    assert told["needs"] == told["has"]
    for box in told["seen"]:
        assert box["count"] == 1
        assert box["scale"] * SMALLEST >= READABLE, box
    drawn, *wide = told["seen"]
    assert drawn["needs"] == drawn["has"] >= told["has"]  # from edge to edge
    assert all(box["needs"] > box["has"] for box in wide)
