"""Planes of a recording: words that know how much they cover, and thin lines behind them."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from testbed.recording import style
from testbed.recording.pen import Pen

LETTER, LINE = 6.8, 21.0
"""Width of a letter and height of a line of words."""


MICRO = re.compile(r"(?<=[ \[])um\b")
"""Micrometers as other rooms write them."""


def with_micro(text: str) -> str:
    """A text with its micrometers as a report has them.

    Examples
    --------
    >>> with_micro("AP [um]: 80 um, a number")
    'AP [µm]: 80 µm, a number'
    """
    return MICRO.sub("µm", text)


@dataclass(frozen=True, slots=True)
class Word:
    """Words with the middle of their upper edge at a place."""

    x: float
    y: float
    text: str

    @property
    def box(self) -> tuple[float, float, float, float]:
        """Left, top, right and bottom of what they cover."""
        half = (LETTER * len(self.text) + 8.0) / 2
        return self.x - half, self.y, self.x + half, self.y + LINE


def grid_lines(lines: ArrayLike, order: float) -> Any:
    """Thin lines (k, 2, 2) behind what a plane shows; those of the lowest order lie deepest."""
    import rerun as rr

    thin = rr.Radius.ui_points(0.5)
    return rr.LineStrips2D(lines, colors=style.GRID_COLOR, radii=thin, draw_order=order)


def words_of(words: Sequence[Word]) -> Any:
    """Words on a plane."""
    import rerun as rr

    places = [[word.x, word.y] for word in words]
    labels = [with_micro(word.text) for word in words]
    color = style.TEXT_COLOR
    return rr.Points2D(places, labels=labels, show_labels=True, radii=0.01, colors=color)


def draw_grid(pen: Pen, path: str, lines: ArrayLike, order: float) -> None:
    """Thin lines at all times."""
    pen.static(path, grid_lines(lines, order))


def draw_words(pen: Pen, path: str, words: Sequence[Word]) -> None:
    """Words at all times."""
    pen.static(path, words_of(words))
