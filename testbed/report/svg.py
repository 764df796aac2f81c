"""The drawing surface of all figures: one style, and a figure turned into small, repeatable SVG."""

import io
import logging
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, ParamSpec

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, SOFT, FAINT = "#1a1a1a", "#6b6b6b", "#c4c4c4"
DARK, MIDDLE, LIGHT = "#0072b2", "#a63a00", "#c58600"
"""Blue, vermilion, amber: Okabe and Ito's hues (2008), so dark that each has three times the
contrast to white; told apart by all eyes, in gray by marker."""
FONT = "'Liberation Sans', Arial, Helvetica, sans-serif"

HALO = "halo"
"""Name that gives words a thin white edge: they can be read over lines, and hide none of them."""
EDGE = 'paint-order="stroke" stroke="#ffffff" stroke-opacity="0.9" stroke-width="2"'

TICKS = {"color": SOFT, "labelcolor": INK, "labelsize": 7.5, "major.width": 0.6, "minor.width": 0.4}
STYLE: Any = {
    "svg.hashsalt": "truebed",
    "svg.fonttype": "none",
    "font.family": "DejaVu Sans",
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 8.0,
    "axes.labelcolor": INK,
    "axes.edgecolor": SOFT,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.5,
    **{f"{axis}tick.{key}": value for axis in "xy" for key, value in TICKS.items()},
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "lines.linewidth": 1.3,
    "lines.markersize": 4.0,
    "axes.unicode_minus": True,
}
WIDTH, HALF_WIDTH = 7.1, 4.6
"""Width of a full figure [in], the text width of an A4 page; and of those of half its width, which
are scaled less."""
PHONE = 3.75
"""Width of a figure drawn for the screen of a phone [in]: shown on 360 pixels, letters of 7 points
are 9 pixels high."""
FLATTER = 0.85
"""Height of a panel there, over its height beside others."""
_for_phone: ContextVar[bool] = ContextVar("_for_phone", default=False)
P = ParamSpec("P")


def on_phone(draw: Callable[P, str], *args: P.args, **options: P.kwargs) -> str:
    """The same figure drawn for the screen of a phone: panels below each other, as wide as it.

    Only for figures whose words name no panel by its place.
    """
    token = _for_phone.set(True)
    try:
        return draw(*args, **options)
    finally:
        _for_phone.reset(token)


@contextmanager
def drawing(
    rows: int = 1,
    columns: int = 1,
    *,
    height: float = 2.6,
    width: float = WIDTH,
    pairs: bool = False,
    **share: Any,
) -> Iterator[tuple["Figure", "list[Axes]"]]:
    """A figure and its axes, row by row, inside the house style [in]; for a phone if asked so.

    Columns of two panels that belong together stay `pairs`: a phone shows one below the other, and
    the axes are column by column.
    """
    # it tells, at length, that it may not keep its list of fonts at home: no matter for a person
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    from testbed.report.margins import Margins

    if _for_phone.get():
        panels, width = rows * columns, PHONE
        share.pop("width_ratios", None)  # of panels beside each other
        columns = 2 if pairs or columns >= 4 else 1
        stacked = -(-panels // columns)
        height *= stacked / rows * (FLATTER if stacked > rows else 1.0)
        rows = stacked
    with rc_context(STYLE):
        figure = Figure(figsize=(width, height), layout=Margins())
        axes = figure.subplots(rows, columns, squeeze=False, **share)
        by_column = pairs and not _for_phone.get()
        yield figure, [ax for line in (axes.T if by_column else axes) for ax in line]


def svg_of(figure: "Figure") -> str:
    """The figure as an `<svg>` element to stand inside HTML: same bytes for the same figure.

    Prolog, metadata and every id that nothing refers to are left out, and the style sheet, which
    would reach the whole page, is moved into attributes of the element.
    """
    from matplotlib import rc_context

    buffer = io.StringIO()
    with rc_context(STYLE):
        engine = figure.get_layout_engine()
        if engine is not None:
            # savefig would draw everything once more just to lay it out, for any engine but None
            engine.execute(figure)
            figure.set_layout_engine(None)
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return tidy(buffer.getvalue())


def tidy(text: str) -> str:
    """An SVG document cut down to an element that can share a page with others."""
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>\s*", "", text, flags=re.DOTALL)
    text = re.sub(r"<style type=\"text/css\">.*?</style>\s*", "", text, flags=re.DOTALL)
    text = re.sub(r"<!--.*?-->\s*", "", text, flags=re.DOTALL)
    text = re.sub(r"<defs>\s*</defs>\s*", "", text)
    text = text.replace(f'<g id="{HALO}">', f"<g {EDGE}>")
    used = set(re.findall(r"(?:href=\"|url\()#([^\")]+)", text))

    def keep(match: "re.Match[str]") -> str:
        """Only ids that something refers to."""
        return match.group(0) if match.group(1) in used else ""

    text = re.sub(r"\s+id=\"([^\"]+)\"", keep, text)
    text = text.replace("'DejaVu Sans'", FONT.replace('"', "'"))
    text = re.sub(r"<svg ([^>]*)>", _opening, text, count=1)
    return re.sub(r"\n\s*", "\n", text).strip() + "\n"


def _opening(match: "re.Match[str]") -> str:
    """The opening tag, as wide as its column and with the joins of the dropped style sheet.

    Hidden from screen readers, which would say every number of an axis: the caption says it.
    """
    attributes = re.sub(r"\b(?:width|height|version)=\"[^\"]*\"\s*", "", match.group(1)).strip()
    return f'<svg {attributes} aria-hidden="true" stroke-linejoin="round" stroke-linecap="butt">'
