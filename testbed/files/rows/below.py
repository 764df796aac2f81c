"""Lines below a table that are none of its rows: how many there are, their mean, who made it."""

import re
from collections.abc import Sequence

from testbed.files.dialects.numbers import NUMBER
from testbed.names import some
from testbed.units import counted

MOST = 50
"""Lines that may stand below a table."""
SHOWN = 3
SUMMARY = {
    "total", "totals", "sum", "count", "number", "mean", "average", "avg", "median", "std", "stdev",
    "stddev", "sd", "sigma", "rms", "rmse", "min", "minimum", "max", "maximum", "range",
    "statistics", "summary", "mittel", "mittelwert", "durchschnitt", "summe", "gesamt", "anzahl",
    "standardabweichung", "statistik", "moyenne", "somme", "nombre", "écart", "media", "somma",
    "totale", "numero", "scarto", "promedio", "suma", "número", "desviación", "平均", "合计",
}  # fmt: skip
"""What a line that sums a table up begins with."""
ENDS = {"end", "eof", "ende", "fin", "fine"}
"""The same of a line without numbers."""
DIGIT = re.compile(r"\d+")
RULE = re.compile(r"[-=_*~+.]{3,}")
"""A line that is drawn below a table."""
WORD = re.compile(r"[^\W\d_]+")


def table_ends(rows: Sequence[Sequence[str]]) -> int:
    """How many rows of cells are those of the table: what stands below it are none.

    A line below is a sentence without numbers, a word with one, or begins as a summary does; in any
    case some column of numbers is empty there, and it is not named as the last row is. What else is
    cut or odd stays a row, to be refused.

    Examples
    --------
    >>> table_ends([["P1", "1.5", "2"], ["P2", "2.5", "3"], ["Mean", "2.0"], ["Total points: 2"]])
    2
    >>> table_ends([["P1", "1.5", "2"], ["P2", "2.5"]])
    2
    """
    width, end = len(rows[0]) if rows else 0, len(rows)
    while end > 1 and len(rows) - end < MOST and _may_stand_below(rows[end - 1], width):
        end -= 1
    while end < len(rows) and not all(_lacks(row, rows[end - 1]) for row in rows[end:]):
        end += 1
    return end


def said_below(where: str, below: Sequence[tuple[int, str]]) -> list[str]:
    """A sentence on numbered lines below the table of a file; none if there are none."""
    if not below:
        return []
    texts = [(number, re.sub(r"[\s,;]+", " ", line).strip()[:40]) for number, line in below]
    shown = some([f'line {number} "{text}"' for number, text in texts], SHOWN)
    verb = "is" if len(below) == 1 else "are"
    lines = counted(len(below), "line")
    return [f"{where}: {lines} below the table {verb} not read: {shown}"]


def _may_stand_below(row: Sequence[str], width: int) -> bool:
    """Whether a line is a sentence, a word and its number, a rule, or begins as a summary does."""
    said = [cell for cell in row if cell]
    word = WORD.match(said[0].lstrip("[<(* ")) if said else None
    first = word[0].casefold() if word is not None else ""
    if first in SUMMARY or not said:
        return bool(said)
    if any(NUMBER.fullmatch(cell) for cell in said):
        return _is_pair(said) and len(said) < width
    if len(said) == 1 and RULE.fullmatch(said[0]):
        return True
    return first in ENDS or (
        len(said) < width and (len(said) > 1 or bool(set(" :") & set(said[0])))
    )


def _is_pair(said: Sequence[str]) -> bool:
    """Whether cells are a name without digits and its number: Temperature, 20.5."""
    return len(said) == 2 and WORD.match(said[0]) is not None and not DIGIT.search(said[0])


def _lacks(row: Sequence[str], last: Sequence[str]) -> bool:
    """Whether a line has no number in some column of the last row's, and is not named alike.

    A word and a number may be a row that is cut where rows have words for names.
    """
    said = [cell for cell in row if cell]
    name = next(filter(None, last), "")
    if DIGIT.sub("0", said[0]) == DIGIT.sub("0", name):
        return False
    if _is_pair(said) and NUMBER.fullmatch(said[1]) and not _says_itself(said[0], name):
        return False
    return any(
        NUMBER.fullmatch(cell) and not (k < len(row) and NUMBER.fullmatch(row[k]))
        for k, cell in enumerate(last)
    )


def _says_itself(word: str, name: str) -> bool:
    """Whether a word can be no name of a row, beside that of the last one."""
    first = WORD.match(word)
    known = first is not None and first[0].casefold() in SUMMARY
    return known or word.endswith(":") or bool(DIGIT.search(name))
