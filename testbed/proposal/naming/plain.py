"""Names of columns in small words, without their units."""

import re
from unicodedata import normalize

from testbed.files.columns import WRITTEN
from testbed.proposal.words import MEASURED, WISHED

BORDER = re.compile(r"(?<=[\u2e80-\ud7af])(?=[a-z])|(?<=[a-z])(?=[\u2e80-\ud7af])")
"""Between a letter and a word of Chinese, Japanese or Korean, which stand together there."""
GLUED = re.compile(
    rf"(r?[xyz])({'|'.join(sorted(w for w in WISHED.union(*MEASURED) if len(w) > 2))})"
)
"""An axis and what is meant of it as one word, as Xmeas and Znom; xm and yt may be other words."""
OPENS = re.compile(r"[\[(/,]")
"""What may stand before a unit, as in X [mm] and X, mm."""

OF_95 = re.compile(r"\b(?:u|unc|uncertainty) (?:95 ?%?|k ?= ?2)(?= |$)")
"""An expanded uncertainty, as U(95) X of Leica and U (k = 2) X."""
BEHIND_95 = re.compile(r"(?:u|unc|uncertainty) (\S{1,20}) (?:95 ?%|k ?= ?2)")
"""The same said behind the axis: U X (k = 2)."""

COUNT = re.compile(r"(?<!\d)\d{1,2}(?!\d)")
"""What may be the number of a joint."""
COUNTED = re.compile(r"[一二三四五六七](?=[轴軸关関])|(?<=[轴軸节節第])[一二三四五六七]")
"""The number of a joint, written as a word in Chinese or Japanese."""
MOST = 8
"""Families of columns that are tried, and numbers of a name that may be those of joints."""

EITHER = "grad"
"""A unit that is deg in one language and gon in another."""

Family = dict[int, str]
"""Columns of joints, by their numbers."""


def without_unit(name: str) -> tuple[str, str]:
    """A name in small words, and the unit that it ends with."""
    text, unit = name.strip(), ""
    body = text[:-1] if text.endswith(("]", ")")) else text
    mark = OPENS.search(body, max(map(body.rfind, "])")) + 1)
    if mark is not None and (last := body[mark.end() :].strip().lower()) in WRITTEN:
        text, unit = text[: mark.start()], WRITTEN[last]
    words = BORDER.sub(" ", re.sub(r"[\s_.:/\-\[\]()]+", " ", text).strip().lower()).split()
    # a letter alone is a unit only behind an axis: pos x m
    long = words[-1:] not in (["c"], ["s"], ["m"], ["n"], ["a"])
    known = long or (words[-1] == "m" and words[-2:-1] in (["x"], ["y"], ["z"]))
    if not unit and len(words) > 1 and known and words[-1] in WRITTEN:
        unit = WRITTEN[words.pop()]
    text = " ".join(GLUED.sub(r"\1 \2", word) if GLUED.fullmatch(word) else word for word in words)
    behind = BEHIND_95.fullmatch(text)
    return f"u95 {behind[1]}" if behind else OF_95.sub("u95", text), unit


def says_either(name: str) -> bool:
    """Whether a name ends with a unit that may be deg or gon."""
    words = re.sub(r"[\s_\[\](),/]+", " ", name.lower()).split()
    return words[-1:] == [EITHER]


def small_words(name: str) -> str:
    """A name in small words, its digits as on a keyboard."""
    text = COUNTED.sub(lambda hit: str("一二三四五六七".index(hit[0]) + 1), normalize("NFKC", name))
    return without_unit(text)[0]
