"""Joints whose names stand in cells beside their values, as in messages of ROS.

The k-th name of a message is that of its k-th position, whatever order the joints have there.
"""

from collections.abc import Mapping, Sequence
from itertools import islice

from testbed.files.dialects.numbers import NUMBER
from testbed.proposal.data import Found
from testbed.proposal.naming.plain import COUNT, MOST, Family, small_words
from testbed.proposal.words import RATES

Around = tuple[str, str]
"""Words before and behind the number in a name."""


def families_by_names(
    look: Found, plain: Mapping[str, str], called: Mapping[int, str]
) -> list[Family]:
    """Families of columns of joints by the names in other columns of the same message.

    Parameters
    ----------
    look : Found
        A table with a header.
    plain : dict
        Its names in small words.
    called : dict
        Name of each joint, by its number.
    """
    named: dict[Around, dict[int, str]] = {}
    valued: dict[Around, dict[int, str]] = {}
    for name, text in plain.items():
        for hit in islice(COUNT.finditer(text), MOST):
            around = (text[: hit.start()].strip(), text[hit.end() :])
            valued.setdefault(around, {})[int(hit[0])] = name
    for around, columns in list(valued.items()):
        if (said := _constant(look, columns)) is not None:
            named[around] = said
            del valued[around]
    for name, text in plain.items():
        if said := _listed(look, name):
            named[text, ""] = said
    found = []
    for around, said in named.items():
        at = {k: [n for n, text in said.items() if _is(text, small_words(own))]
              for k, own in called.items()}  # fmt: skip
        if any(len(places) != 1 for places in at.values()):
            continue
        for other, columns in valued.items():
            rates = RATES & set(f"{other[0]} {other[1]}".split())
            if rates or _of(other) != _of(around) or set(columns) != set(said):
                continue
            found.append({k: columns[places[0]] for k, places in at.items()})
    return found


def _constant(look: Found, columns: Mapping[int, str]) -> dict[int, str] | None:
    """The one word of each of some columns; None where they hold numbers, or several words."""
    said = {}
    for number, name in columns.items():
        cells: Sequence[str] = look.column(name)
        if NUMBER.fullmatch(cells[0]) or not cells[0] or len(set(cells)) > 1:
            return None
        said[number] = small_words(cells[0])
    return said


def _listed(look: Found, name: str) -> dict[int, str]:
    """The words of the one list that a column holds, counted from 0; none where it holds others."""
    first = look.column(name)[0]
    if not first.startswith("[") or not any(map(str.isalpha, first)):
        return {}
    if len({*look.column(name)}) > 1:
        return {}
    words = [word.strip(" \"'") for word in first.strip("[] ").split(",")]
    return dict(enumerate(map(small_words, words)))


def _is(text: str, own: str) -> bool:
    """Whether a word is the name of a joint, with another word before it or none."""
    return text == own or text.endswith(f" {own}")


def _of(around: Around) -> str:
    """The message that a column is of: its words but the last one."""
    return around[0].rpartition(" ")[0]
