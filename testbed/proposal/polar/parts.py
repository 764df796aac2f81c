"""Ways to read a table of directions and ranges: units, what is up, and which way angles grow."""

from collections.abc import Iterator
from itertools import product

import numpy as np

from testbed.proposal.data import Document, Found
from testbed.proposal.names import Meaning
from testbed.proposal.naming.plain import says_either, without_unit
from testbed.proposal.polar.names import HEIGHTS, SURVEYED
from testbed.proposal.sizes import by_size, signed

TURN, FULL = 6.4, 360.0
"""Angles are never larger where they are in radians, or in degrees."""
REACH = 20.0
"""Ranges are never longer where they are in meters [m]."""


def is_polar(look: Found) -> bool:
    """Whether a table has directions and ranges."""
    return look.has("range", "azimuth") and any(map(look.has, HEIGHTS))


def polar_ways(look: Found) -> Iterator[tuple[dict[str, str], Document, tuple[str, ...]]]:
    """Columns, further keys of [points], and what is taken without being said."""
    stems = look.stems
    reach, azimuth = stems["range"], stems["azimuth"]
    height = next(stems[stem] for stem in HEIGHTS if look.has(stem))
    directions = (azimuth, height)
    told = {_unit(one) for one in directions} - {""}
    units = tuple(told) if len(told) == 1 else _angles_by_size(look, directions)
    lengths = (_unit(reach),) if _unit(reach) else by_size(look, [reach.theirs], REACH, ("mm", "m"))
    kinds = ("zenith", "elevation") if height.plain == "vertical" else (height.plain,)
    senses = ("counterclockwise", "clockwise")
    if without_unit(azimuth.theirs)[0].startswith(SURVEYED):
        senses = senses[::-1]
    for unit, length, kind, sense in product(units, lengths, kinds, senses):
        named = [(azimuth, "azimuth", unit), (height, kind, unit), (reach, "range", length)]
        columns = {
            f"{stem}_{_unit(one) or assumed}": one.theirs
            for one, stem, assumed in named if not one.known
        }  # fmt: skip
        said = [f"directions: {azimuth.theirs} is taken to grow {sense}, seen from above"]
        if len(kinds) > 1:
            away = "from the zenith" if kind == "zenith" else "above the horizon"
            said.append(f"directions: {height.theirs} is taken as the angle {away}")
        if not all(map(_unit, directions)):
            said.append(f"directions: no column states its unit; assumed: {unit}")
        if not _unit(reach):
            said.append(f"ranges: no column states its unit; assumed: {length}")
        keys: Document = {"azimuth": sense} if sense == "clockwise" else {}
        yield columns, keys, tuple(said)


def _unit(one: Meaning) -> str:
    """The unit that a column says; empty where it says none, or one that is two."""
    if one.known:
        return one.stem.rpartition("_")[2]
    return "" if says_either(one.theirs) else one.unit


def _angles_by_size(look: Found, columns: tuple[Meaning, ...]) -> tuple[str, ...]:
    """Units that angles may have, the likely one first."""
    values = np.abs(signed(look, [one.theirs for one in columns]))
    most = float(np.nan_to_num(values).max(initial=0.0))
    usual = ("gon", "deg") if most > FULL else ("deg", "gon")
    return (*usual, "rad") if most > TURN else ("rad", *usual)
