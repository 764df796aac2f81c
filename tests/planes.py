"""Words of a recording: which lie on each other on a plane, and which do not fit their windows."""

import re
import textwrap
from itertools import combinations

LETTER, LINE, BLANK, ROW, HEADING, ABOVE = 6.0, 15.2, 15.0, 23.0, 30.4, 20.0
"""Of Markdown in the viewer, measured in pictures: mean width of a letter, heights of a line, of an
empty one, of a row of a table, of a heading with the gap below it, and of the margins."""
TEXTS = {"now": (487, 128), "summary": (487, 173)}
BELOW_NAMES = {"now": (487, 127), "summary": (487, 150)}
BESIDE_TALL = {"now": (348, 300), "summary": (615, 209)}
WITHOUT_PLANE = {"now": (487, 300), "summary": (615, 209)}
"""Width and height of the windows of words in the four layouts, in a viewer of 1280 by 720."""
LOW = (633, 194)
"""Width and height of the windows of planes below, in a viewer of 1280 by 720 [points]."""


def overlaps(words):
    """Pairs of words that lie on each other."""
    return [
        (one.text, two.text)
        for one, two in combinations(words, 2)
        if one.box[0] < two.box[2] - 1 and two.box[0] < one.box[2] - 1
        and one.box[1] < two.box[3] - 1 and two.box[1] < one.box[3] - 1
    ]  # fmt: skip


def height(markdown, width):
    """Height of a text in a window so wide [points]."""
    total = ABOVE
    for line in markdown.splitlines():
        if not line:
            total += BLANK
        elif line.startswith("|"):
            total += 0 if re.fullmatch(r"[|:\-]+", line) else ROW
        elif line.startswith("#"):
            total += HEADING + LINE * (len(line) * LETTER > width)
        else:
            letters = int((width - 20 * line.startswith("- ")) / LETTER)
            total += LINE * len(textwrap.wrap(line.removeprefix("- "), letters))
    return total


def unfitting(story):
    """Texts of a story that are higher than their windows, with both heights [points]."""
    panels = [chapter.panel for chapter in story.chapters if chapter.panel is not None]
    whole = BELOW_NAMES if story.windows else TEXTS
    windows = whole if any(not panel.tall for panel in panels) else WITHOUT_PLANE
    windows = BESIDE_TALL if any(panel.tall for panel in panels) else windows
    texts = [("summary", story.summary)]
    texts += [("summary", window.summary) for window in story.windows if window.summary]
    chapters = [*story.chapters, *(one for window in story.windows for one in window.chapters)]
    texts += [("now", "\n".join(filter(None, chapter.text))) for chapter in chapters]
    found = [(text[:60], height(text, windows[name][0]), windows[name][1]) for name, text in texts]
    return [one for one in found if one[1] > one[2]]
