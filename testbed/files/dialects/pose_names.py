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


def counted_alike(named: Collection[str], seen: Collection[str]) -> list[dict[str, str]] | None:
    """The numbers of the names of two files, where one has words before them: Pose12 is 12.

    Of KUKA, whose data list has XP12 for the point P12 of an inline form, the names without the X.
    None where both have other words, which may tell them apart, where numbers of `seen` lack in the
    other file, or where they are fewer than half of those: R1 and R2 are no poses.
    """
    if (of_points := _without_x(named, seen)) is not None:
        return of_points
    words = [any(not name.strip().isdecimal() for name in names) for names in (named, seen)]
    one, two = numbers_in(named), numbers_in(seen)
    few = not two or 2 * len(two) < len(one)
    if all(words) or few or not set(two.values()) <= set(one.values()):
        return None
    return [one, two]


def _without_x(named: Collection[str], seen: Collection[str]) -> list[dict[str, str]] | None:
    """Both names, those of joints without the X before all of them; None if that matches none."""
    one, two = ({name: written_alike(name) for name in names} for names in (named, seen))
    if not all(name[0] == "x" and len(name) > 1 for name in one.values()):
        return None
    one = {name: own[1:] for name, own in one.items()}
    apart = len(set(one.values())) == len(one) and stay_apart(seen)
    few = not two or 2 * len(two) < len(one)
    return [one, two] if apart and not few and set(two.values()) <= set(one.values()) else None


def numbers_in(names: Collection[str]) -> dict[str, str]:
    """The number that each name ends with, where all have one behind the same word; else none."""
    counted = {name: COUNTED.fullmatch(name.casefold().replace(" ", "")) for name in names}
    found = {name: one for name, one in counted.items() if one is not None}
    words = {one[1] for one in found.values()}
    numbers = {name: str(int(one[2])) for name, one in found.items()}
    alone = len(found) == len(counted) == len(set(numbers.values()))
    return numbers if alone and len(words) == 1 else {}
