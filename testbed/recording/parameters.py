"""The plot of parameter errors in a recording: a row for each, in blocks side by side."""

import re
from collections.abc import Sequence

import numpy as np

from calib.arrays import Array, Bool, Index
from testbed.recording import style
from testbed.recording.chart import SIZE
from testbed.recording.pen import Pen
from testbed.recording.plane import LETTER, LINE, Word, draw_grid, draw_words
from testbed.recording.story import Panel

PARAMETERS = "parameters"
"""Root of the entities."""
TICKS, EDGE = (0, 2, 10, 100), 300.0
LABELLED = (-1, 100), (1, 2), (1, 100)
"""Marks of the plot, those with a number, and where it clips, in stated standard uncertainties."""
BAND = 1.959963984540054
MOST_ROWS = 32
"""Of more parameters only the first have a row, so that names can be read."""
BLOCKS = 4
"""Blocks side by side."""
ROWS = MOST_ROWS // BLOCKS
"""Most rows of a block."""
WIDTH, ROW = (SIZE[0] - 6.0) / BLOCKS, (SIZE[1] - 1.5 * LINE) / ROWS
NAME, LETTERS = 72.0, 9
"""Width of a block that is for the names, and letters that have room in it."""
NUMBER = re.compile(r"\d|$")


def draw_parameters(
    pen: Pen,
    names: Sequence[str],
    error: Array,
    covered: Bool,
    steps: Index,
    root: str = PARAMETERS,
) -> None:
    """Errors of all parameters, each in its row, at some steps of the timeline.

    The axis is asinh, so that 2 and 1000 both fit. Points inside the gray band are covered by the
    stated 95 % interval. Of very many only the first are drawn.

    Parameters
    ----------
    names : sequence of str
        Of the p parameters.
    error : (k, p) array
        In stated standard uncertainties.
    covered : (k, p) array of bool
        Whether the stated interval holds the truth.
    steps : (k,) array of int
        Where the rows lie on the timeline.
    root : str
        Of the entities.
    """
    import rerun as rr

    names, error, covered = names[:MOST_ROWS], error[:, :MOST_ROWS], covered[:, :MOST_ROWS]
    middle, height = middles(len(names)), row_heights(len(names))
    blocks = np.unique(middle)
    low, high = ROW * 0.2, ROW * (ROWS + 0.1)
    # one very thick line: 2-D boxes cannot be filled
    inset = float(place(BAND))
    bands = [[[x, low + inset], [x, high - inset]] for x in blocks]
    band = rr.LineStrips2D(bands, colors=style.BAND_COLOR, radii=inset, draw_order=-30.0)
    pen.static(f"{root}/band", band)
    ticks = [sign * tick for tick in TICKS for sign in (1, -1) if tick or sign > 0]
    lines = [
        [[x + float(place(t)), low], [x + float(place(t)), high]] for x in blocks for t in ticks
    ]
    draw_grid(pen, f"{root}/grid", lines, -20.0)
    draw_words(pen, f"{root}/words", parameter_words(names))
    x = middle + place(np.clip(error, -EDGE, EDGE))
    points = np.stack([x, np.broadcast_to(height, x.shape)], axis=-1).reshape(-1, 2)
    colors = np.where(covered[..., None], style.BLUE, style.VERMILION).astype(np.uint8)
    columns = rr.Points2D.columns(positions=points, colors=colors.reshape(-1, 3))
    pen.every_step(f"{root}/error", columns.partition(np.full(len(steps), len(names))), steps)
    pen.static(f"{root}/error", rr.Points2D.from_fields(radii=rr.Radius.ui_points(4.5)))


def middles(count: int) -> Array:
    """Where on the plane the zero of every parameter's row lies."""
    block = np.arange(count) // rows_of(count)
    return np.asarray(block * WIDTH + NAME + (WIDTH - NAME) / 2)


def rows_of(count: int) -> int:
    """Rows of every block but perhaps the last one: those of the blocks are about equal."""
    return -(-count // BLOCKS)


def row_heights(count: int) -> Array:
    """Height of every parameter's row."""
    return np.asarray((np.arange(count) % rows_of(count) + 0.65) * ROW)


def parameter_words(names: Sequence[str]) -> list[Word]:
    """Names before their rows, and numbers below each block."""
    middle, height = middles(len(names)), row_heights(len(names))
    left = middle - (WIDTH - NAME) / 2
    found = [
        Word(x - (LETTER * len(name) + 8) / 2, y - LINE / 2, name)
        for x, y, name in zip(left, height, map(short_name, names), strict=True)
    ]
    for x in np.unique(middle):
        found += [
            Word(x + float(place(sign * tick)), ROW * (ROWS + 0.2), f"{sign * tick:d}")
            for sign, tick in LABELLED
        ]
    return found


def short_name(name: str) -> str:
    """A name that has room before its row: its word is cut, what comes behind the word stays.

    Examples
    --------
    >>> [short_name(name) for name in ("alpha1", "reflector1.x", "gravity2.upper")]
    ['alpha1', 'reflec1.x', 'gr2.upper']
    """
    word = NUMBER.split(name, maxsplit=1)[0]
    keep = max(1, LETTERS - (len(name) - len(word)))
    return (word[:keep] + name[len(word) :])[:LETTERS]


def place(z: Array | float) -> Array:
    """How far from the middle of its row a normalized error lies."""
    half = (WIDTH - NAME) / 2 - 4
    return np.asarray(half * np.arcsinh(z) / np.arcsinh(EDGE))


def parameter_panel(count: int, root: str = PARAMETERS) -> Panel:
    """The window of the parameter plot with so many rows, all of them in view."""
    title = "Parameter error / stated u"
    if count > MOST_ROWS:
        title = f"Error / u: first {MOST_ROWS} of {count}"
    return Panel(root, title, (0.0, SIZE[0]), (0.0, SIZE[1]))
