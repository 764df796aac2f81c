"""What all pictures share: words, legends, rows, ticks and views; where the tracker stands."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from calib.arrays import Array
from testbed.report.svg import FAINT, HALO, INK
from testbed.units import Mean

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

Look = dict[str, Any]
"""Properties of a line, as matplotlib names them."""
BARS: Look = {"color": "#c9d6e3", "edgecolor": "white", "linewidth": 0.5}
"""Of a histogram."""
SHADES = ("#dfe7ee", "#b9cfe0", "#86aed0", "#4d87b8", "#1f5f97", "#0b3559")
"""Pale to dark blue, told apart in gray too."""
VIEWS = ((0, 1, "from above"), (0, 2, "from the side"))
"""Axes to the right and up of each view of the work space, and its title."""
SPAN = 8.0
"""Times their median up to which errors are drawn on an axis from zero."""
TICKS = tuple(m * 10.0**e for e in range(-7, 5) for m in (1, 2, 5))
"""Of logarithmic axes."""
LETTER = (0.62, 0.85)
"""Width and height of the room that a letter takes, in units of its size: a digit, nearly."""
GAP = 2.0
"""Between words and a curve [pt]."""
ENTRY = 26.0
"""What an entry of a legend takes beside its letters [pt]."""
SIDES = 40.0
"""What the ticks and names of a panel take from its width, nearly [pt]."""
FEET = (0.04, 0.2, 0.36, 0.52, 0.68, 0.84)
"""Heights of words beside an upright line that are tried, as parts of the panel's height."""
CUT_OFF = 0.02
"""Part of the errors, the smallest ones, that a logarithmic axis leaves out."""


def dots(ax: "Axes", points: Array, color: str = FAINT, size: float = 1.6) -> None:
    """Dots (m, 2) of some size [pt] as one path: a tenth of the bytes of a marker each."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    vertices = np.repeat(points, 2, axis=0)
    path = Path(vertices, np.tile([Path.MOVETO, Path.LINETO], len(points)))
    # dots have no length: simplification would drop every one
    path.should_simplify = False
    # not as a patch, whose extent is sought dot by dot as if it were curved
    ax.add_artist(PathPatch(path, edgecolor=color, linewidth=size, capstyle="round", fill=False))
    ax.update_datalim(points)
    ax.autoscale_view()


def label(
    ax: "Axes",
    text: str,
    at: tuple[float, float],
    offset: tuple[float, float],
    *,
    size: float = 7.5,
    **look: Any,
) -> None:
    """Words beside a point of the data; offset and size of the letters are in points."""
    ax.annotate(text, at, xytext=offset, textcoords="offset points", fontsize=size, **look)


def labels_apart(
    ax: "Axes", texts: Sequence[str], at: Array, room: tuple[float, float], *, besides: Array
) -> None:
    """Words beside points (m, 2) of a panel with equal axes, so far as no two meet.

    A text takes the first free place around its point, and is left out if there is none: it may
    lie over no other text and over no other point.

    Parameters
    ----------
    ax : Axes
        With equal scales.
    texts : sequence of str
        One per point.
    at : (m, 2) array
        In data units.
    room : tuple of float
        Width and height of the panel [pt].
    besides : (n, 2) array
        Further points that no text may cover, in data units.
    """
    unit = float(max(np.ptp(at, axis=0) / room)) or 1.0  # one point of the page in data units
    points, taken = at / unit, list[tuple[float, float, float, float]]()
    for k, (text, (x, y)) in enumerate(zip(texts, points, strict=True)):
        wide, high = LETTER[0] * 7.0 * len(text), LETTER[1] * 7.0
        others = np.vstack([np.delete(points, k, axis=0), besides / unit])
        for dx, dy in ((3, 2), (-3 - wide, 2), (3, -2 - high), (-3 - wide, -2 - high),
                       (-wide / 2, 4), (-wide / 2, -4 - high)):  # fmt: skip
            box = (x + dx - 1, y + dy - 1, x + dx + wide + 1, y + dy + high + 1)
            hits = (others > np.array(box[:2]) - 2) & (others < np.array(box[2:]) + 2)
            if not hits.all(axis=1).any() and not any(_meet(box, one) for one in taken):
                taken.append(box)
                label(ax, text, (float(at[k, 0]), float(at[k, 1])), (dx, dy), size=7.0)
                break


def _meet(one: Sequence[float], other: Sequence[float]) -> bool:
    """Whether two boxes (left, bottom, right, top) lie over each other."""
    return all(one[i] < other[i + 2] and other[i] < one[i + 2] for i in (0, 1))


def room_across(ax: "Axes") -> float:
    """Width of a panel inside its ticks and names [pt]."""
    spec, figure = ax.get_subplotspec(), ax.get_figure(root=True)
    assert figure is not None  # a panel of ours
    columns = spec.get_gridspec().ncols if spec else 1
    return float(72 * figure.get_size_inches()[0] / columns - SIDES)


def marked_line(
    ax: "Axes", x: float, text: str, offset: float, *, height: float = 0.97, **look: Any
) -> None:
    """An upright line with words beside it, to the left of it if the offset is negative."""
    ax.axvline(x, **look)
    label(
        ax, text, (x, height), (offset, 0), xycoords=("data", "axes fraction"),
        ha="right" if offset < 0 else "left", va="top" if height > 0.9 else "baseline",
        gid=HALO,
    )  # fmt: skip


def free_place(
    curves: Sequence[tuple[Array, Array]],
    x: float,
    room: tuple[float, float],
    size: tuple[float, float],
) -> tuple[int, float] | None:
    """Where beside an upright line its words cover no rising curve: a side and a height.

    Parameters
    ----------
    curves : sequence of pairs of (m,) arrays
        Places to the right and up of each, both as parts of the panel and never falling.
    x : float
        Of the line, as a part of the panel's width.
    room : tuple of float
        Width and height of the panel [pt].
    size : tuple of float
        Width and height of the words [pt].

    Returns
    -------
    tuple of int and float, or None
        1 to the right of the line, -1 to the left; height of the foot as a part of the panel's.
        None if every place lies over a curve.
    """
    wide, high = ((own + 2 * GAP) / whole for own, whole in zip(size, room, strict=True))
    for foot in FEET:
        for side in (1, -1):
            left, right = (x, x + wide) if side > 0 else (x - wide, x)
            below, above = foot - GAP / room[1], foot + high
            # a rising curve misses a box if it is below it to the end, or above it from the start
            free = all(
                np.interp(right, *curve, left=0.0) < below
                or np.interp(left, *curve, left=0.0) > above
                for curve in curves
            )
            if free and left >= 0 and right <= 1:
                return side, foot
    return None


def key_in_corner(ax: "Axes", text: str, **look: Any) -> None:
    """A short upright line in the upper left corner, and what such a line is beside it."""
    ax.plot([0.04, 0.04], [0.82, 0.96], transform=ax.transAxes, **look)
    label(ax, text, (0.04, 0.84), (4, 0), xycoords="axes fraction", gid=HALO)


def toward(ax: "Axes", station: Array) -> None:
    """A small arrow in a corner that points where the tracker (2,) stands, far outside the view."""
    heading = station / max(float(np.linalg.norm(station)), 1e-12)
    ax.annotate(
        "tracker",
        xy=(0.87 + 0.11 * heading[0], 0.12 + 0.11 * heading[1]),
        xytext=(0.87 - 0.06 * heading[0], 0.12 - 0.06 * heading[1]),
        xycoords="axes fraction",
        ha="right",
        va="center",
        fontsize=6.5,
        color=INK,
        gid=HALO,
        arrowprops={"arrowstyle": "->", "color": INK, "linewidth": 0.8, "shrinkA": 2},
    )


def legend_above(figure: "Figure", ax: "Axes", columns: int | None = None) -> None:
    """One legend for all panels, in a line above them or in so many columns."""
    handles, labels = ax.get_legend_handles_labels()
    columns, wide = columns or len(labels), 72 * figure.get_size_inches()[0]
    wants = [ENTRY + LETTER[0] * 7.5 * len(text) for text in labels]

    def across(count: int) -> float:
        """Width in so many columns, which are filled one after the other [pt]."""
        deep = -(-len(wants) // count)
        return sum(max(wants[k : k + deep]) for k in range(0, len(wants), deep))

    while columns > 1 and across(columns) > wide:
        columns -= 1
    figure.legend(handles, labels, loc="outside upper center", ncols=columns)


def legend_entries(ax: "Axes", looks: Mapping[str, Look]) -> None:
    """Entries of the legend without data."""
    for name, look in looks.items():
        entry: Look = {"markersize": 4.6, "linestyle": "none", "label": name} | look
        ax.plot([], [], **entry)


def rows_of(ax: "Axes", names: Sequence[str]) -> None:
    """One row per name, the first on top."""
    ax.set_yticks(range(len(names)), list(names))
    ax.set_ylim(len(names) - 0.5, -0.5)
    ax.grid(visible=False, axis="y")
    ax.tick_params(axis="y", length=0)


def interval(
    ax: "Axes", y: float, inner: Sequence[float], outer: Sequence[float], color: str
) -> None:
    """An interval as a bar in its row, a wider one around it as a thin line."""
    for ends, width in ((outer, 0.8), (inner, 2.6)):
        ax.plot(ends, [y, y], color=color, linewidth=width)


def view_of(ax: "Axes", i: int, j: int, title: str) -> None:
    """Axes i and j of the work space [mm]."""
    ax.set_title(title)
    ax.set_xlabel(f"{'xyz'[i]} [mm]")
    ax.set_ylabel(f"{'xyz'[j]} [mm]")
    ax.set_aspect("equal", "datalim")


def plain_log(ax: "Axes") -> None:
    """Tick labels 0.01, 0.1, 1 instead of powers of ten."""
    from matplotlib.ticker import FuncFormatter, NullFormatter

    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.yaxis.set_minor_formatter(NullFormatter())


def error_axis(ax: "Axes", values: Array, typical: float) -> None:
    """The upright axis of errors (m,): from zero, or logarithmic where the typical ones are small.

    From zero, errors far below the largest would all lie on the floor.
    """
    top = float(values.max())
    if top <= SPAN * typical:
        ax.set_ylim(0, 1.08 * top or 1.0)
        return
    # of four decades at most
    low = max(float(np.quantile(values, CUT_OFF)), top * 1e-4)
    ax.set_yscale("log")
    ax.set_ylim(0.7 * low, 1.4 * top)
    log_ticks(ax.yaxis, 0.7 * low, 1.4 * top)


def log_ticks(axis: "Axis", low: float, high: float, most: int = 9) -> None:
    """Ticks 1, 2, 5, 10 ... between two values of a logarithmic axis; 1, 10 ... if too many."""
    ticks = [tick for tick in TICKS if low < tick < high]
    if len(ticks) > most:
        ticks = [tick for tick in ticks if f"{tick:e}".startswith("1.0")]
    if axis is axis.axes.xaxis and len(ticks) > 1:
        decade = room_across(axis.axes) / np.log10(high / low)
        while len(ticks) > 2 and any(
            decade * np.log10(b / a) < LETTER[0] * 7.5 * (len(f"{a:g}{b:g}") / 2 + 0.5)
            for a, b in pairwise(ticks)
        ):
            ticks = ticks[::2]
    axis.set_ticks(ticks, [f"{tick:g}" for tick in ticks])
    axis.set_ticks([], minor=True)


def short_ticks(ax: "Axes", axis: str = "y") -> None:
    """At most five ticks, small numbers with one common power of ten."""
    ax.locator_params(axis=axis, nbins=5)  # type: ignore[arg-type]  # "x" or "y"
    ax.ticklabel_format(axis=axis, style="sci", scilimits=(-3, 4), useMathText=True)  # type: ignore[arg-type]  # "x" or "y"


def share_ends(share: Mean) -> tuple[float, float]:
    """Both ends of the interval of a share [%], cut to 0 to 100."""
    return 100 * max(share.low, 0.0), 100 * min(share.high, 1.0)
