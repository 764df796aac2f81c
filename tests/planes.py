"""Words of a recording: which lie on each other on a plane, and which do not fit their windows."""

import re
import textwrap
from itertools import combinations

LETTER, LINE, BLANK, ROW, HEADING = 6.3, 15.2, 12.0, 23.0, 58.0
"""Of Markdown in the viewer, measured in pictures of 1600 by 1000 points: mean width of a letter,
heights of a line, of an empty one, of a row of a table, of a heading with the space above it."""
TEXTS = {"now": (545, 173), "summary": (545, 238)}
BESIDE_TALL = {"now": (372, 173), "summary": (372, 238)}
WITHOUT_PLANE = {"now": (545, 430), "summary": (775, 245)}
"""Width and height of the windows of words in the three layouts [points]."""


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
    total = 22.0  # above the first line
    for line in markdown.splitlines():
        if not line:
            total += BLANK
        elif line.startswith("|"):
            total += 0 if re.fullmatch(r"[|:\-]+", line) else ROW
        elif line.startswith("#"):
            total += HEADING + LINE * (len(line) * 1.4 * LETTER > width)
        else:
            letters = int((width - 20 * line.startswith("- ")) / LETTER)
            total += LINE * len(textwrap.wrap(line.removeprefix("- "), letters))
    return total


def unfitting(story):
    """Texts of a story that are higher than their windows, with both heights [points]."""
    panels = [chapter.panel for chapter in story.chapters if chapter.panel is not None]
    windows = TEXTS if any(not panel.tall for panel in panels) else WITHOUT_PLANE
    windows = BESIDE_TALL if any(panel.tall for panel in panels) else windows
    texts = [("summary", story.summary)]
    texts += [("now", "\n".join(filter(None, chapter.text))) for chapter in story.chapters]
    found = [(text[:60], height(text, windows[name][0]), windows[name][1]) for name, text in texts]
    return [one for one in found if one[1] > one[2]]
