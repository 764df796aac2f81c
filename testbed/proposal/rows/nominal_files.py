"""Files whose names say that they hold where the robot was sent, beside what was measured there."""

from collections.abc import Sequence
from pathlib import Path

from testbed.proposal.data import Found
from testbed.proposal.naming.plain import small_words

SENT = {
    "nominal", "nominals", "nom", "target", "targets", "commanded", "command", "commands", "cmd",
    "soll", "sollwerte", "sollpunkte", "theo", "theoretical", "theoretisch", "planned", "desired",
    "nominell", "nominali", "théorique", "consigne", "teorico", "teórico",
}  # fmt: skip
"""Words of such names."""


def without_nominal(looks: Sequence[Found]) -> tuple[tuple[Found, ...], tuple[str, ...]]:
    """The other files, and a sentence on each of these.

    Only a file beside one with the same columns is left aside, which nothing calls so: as a station
    of its own it would count targets as measured.
    """
    sent = [one for one in looks if one.has("x", "y", "z") and _says_so(one)]
    said = dict[int, str]()
    for one in sent:
        other = next((each for each in looks if each not in sent and each.head == one.head), None)
        if other is not None:
            said[id(one)] = (
                f"{one.called}: called so, it is taken as where the robot was sent, and "
                f"{other.called}, of the same columns, as what was measured"
            )
    return tuple(one for one in looks if id(one) not in said), tuple(said.values())


def _says_so(look: Found) -> bool:
    """Whether the name of a file, or of a sheet, has such a word."""
    return any(SENT & set(small_words(name).split()) for name in (Path(look.name).stem,
               look.sheet or ""))  # fmt: skip
