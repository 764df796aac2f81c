"""Names of poses as programs write them: which of two files are one."""

import re
from collections.abc import Collection, Iterable

WHOLE = re.compile(r"(\d{1,17})\.0*", re.ASCII)
COUNTED = re.compile(r"(\D*)(\d{1,17})", re.ASCII)


def plain(name: str) -> str:
    """A pose's name; 07 is 7."""
    return str(int(name)) if name.isascii() and name.isdigit() and len(name) < 19 else name


def written_alike(name: str) -> str:
    """A pose's name however a program writes it: P001, p 1 and P1 are one, and so are 7.0 and 7.

    Examples
    --------
    >>> [written_alike(name) for name in ("P001", "p 1", "7.0", "P1_2")]
    ['p1', 'p1', '7', 'p1_2']
    """
    name = name.casefold().replace(" ", "")
    if (whole := WHOLE.fullmatch(name)) is not None:
        return str(int(whole[1]))
    counted = COUNTED.fullmatch(name)
    return f"{counted[1]}{int(counted[2])}" if counted is not None else name


def stay_apart(names: Iterable[str]) -> bool:
    """Whether different names of one file stay different where two programs write alike."""
    own = {plain(name) for name in names}
    return len({written_alike(name) for name in own}) == len(own)


def numbers_in(names: Collection[str]) -> dict[str, str]:
    """The number that each name ends with, where all have one behind the same word; else none."""
    counted = {name: COUNTED.fullmatch(name.casefold().replace(" ", "")) for name in names}
    found = {name: one for name, one in counted.items() if one is not None}
    words = {one[1] for one in found.values()}
    numbers = {name: str(int(one[2])) for name, one in found.items()}
    alone = len(found) == len(counted) == len(set(numbers.values()))
    return numbers if alone and len(words) == 1 else {}
