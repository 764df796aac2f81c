"""Names for people: which one was meant, and lists of them."""

from collections.abc import Collection, Sequence
from difflib import get_close_matches
from unicodedata import normalize

LONG = 100
"""Letters of a name beyond which no other one is taken for it: comparing takes their square."""
PART_ALIKE = 0.75
"""Least likeness to one word of a name: short words share letters by chance (nothing, moving)."""


def did_you_mean(word: str, known: Collection[str]) -> str:
    """``did you mean "x"?`` or an empty text; names of hundreds of letters are not compared."""
    near = [name for name in known if max(len(name), len(word)) <= LONG]
    close = get_close_matches(word, near, 1)
    return f'did you mean "{close[0]}"?' if close else ""


def name_meant(word: str, known: Collection[str]) -> str:
    """As `did_you_mean`, also where a name was cut short or written in other letters.

    Examples
    --------
    >>> name_meant("UR10", ["staubli_tx60", "universal_ur10"])
    'did you mean "universal_ur10"?'
    """
    letters = {name: _letters(name) for name in sorted(known) if len(name) <= LONG}
    wanted = _letters(word[: LONG + 1])
    if 2 <= len(wanted) <= LONG:
        for fits in (str.__eq__, str.startswith, str.__contains__):
            for name, own in letters.items():
                if fits(own, wanted):
                    return f'did you mean "{name}"?'
    if hint := did_you_mean(word, known):
        return hint
    parts = {part.lower(): name for name in letters for part in name.split("_") if len(part) > 2}
    close = get_close_matches(word.lower()[:LONG], parts, 1, PART_ALIKE)
    return f'did you mean "{parts[close[0]]}"?' if close else ""


def _letters(name: str) -> str:
    """Letters and digits of a name, small and without marks above them."""
    plain = normalize("NFKD", name).encode("ascii", "ignore").decode()
    return "".join(filter(str.isalnum, plain.lower()))


def choice_of(word: str, known: Collection[str]) -> str:
    """``did you mean "x"?``, or what there is to choose from."""
    return did_you_mean(word, known) or f"there is {some(sorted(known), 60) or 'nothing'}"


def some(names: Sequence[str], most: int = 12) -> str:
    """Names for people: the first ones, and how many more there are."""
    return ", ".join(names[:most]) + f" and {len(names) - most} more" * (len(names) > most)
