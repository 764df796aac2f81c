"""Names of columns in small words, without their units."""

import re

from testbed.files.columns import WRITTEN

BORDER = re.compile(r"(?<=[\u2e80-\ud7af])(?=[a-z])|(?<=[a-z])(?=[\u2e80-\ud7af])")
"""Between a letter and a word of Chinese, Japanese or Korean, which stand together there."""
ENDS = re.compile(r"^(.*?)[\s_]*[\[(/,]\s*([^\])]+?)\s*[\])]?$")


def without_unit(name: str) -> tuple[str, str]:
    """A name in small words, and the unit that it ends with."""
    text, unit = name.strip(), ""
    ends = ENDS.match(text)
    if ends and ends[2].strip().lower() in WRITTEN:
        text, unit = ends[1], WRITTEN[ends[2].strip().lower()]
    words = BORDER.sub(" ", re.sub(r"[\s_.:/\-\[\]()]+", " ", text).strip().lower()).split()
    # a letter alone is a unit only behind an axis: pos x m
    long = words[-1:] not in (["c"], ["s"], ["m"], ["n"], ["a"])
    known = long or (words[-1] == "m" and words[-2:-1] in (["x"], ["y"], ["z"]))
    if not unit and len(words) > 1 and known and words[-1] in WRITTEN:
        unit = WRITTEN[words.pop()]
    return " ".join(words), unit
