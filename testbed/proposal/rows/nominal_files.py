"""Files whose names say that they hold where the robot was sent, beside what was measured there."""

from collections.abc import Sequence
from pathlib import Path

from testbed.proposal.data import Found
from testbed.proposal.naming.plain import small_words

SENT = {
    "nominal", "nominals", "nom", "commanded", "cmd", "soll", "sollwerte", "sollpunkte", "theo",
    "theoretical", "theoretisch", "planned", "desired",
    "nominell", "nominali", "théorique", "consigne", "teorico", "teórico",
}  # fmt: skip
"""Words of such names; targets may as well be those of a tracker."""
BESIDE = {
    "points", "point", "poses", "pose", "positions", "position", "coordinates", "coords", "xyz",
    "data", "values", "punkte", "posen", "positionen", "koordinaten", "werte", "mm",
}  # fmt: skip
"""Words that may stand beside them: any other one tells of more than this."""


def without_nominal(looks: Sequence[Found]) -> tuple[tuple[Found, ...], tuple[str, ...]]:
    """The other files, and a sentence on each of these.

    Only a file without joints is left aside, beside one with the same columns and poses that
    nothing calls so: as a station of its own it would count targets as measured.
    """
    sent = [one for one in looks if one.has("x", "y", "z") and not one.has("q1") and _says_so(one)]
    said = dict[int, str]()
    for one in sent:
        alike = (each for each in looks if each not in sent and _of_the_same_poses(one, each))
        other = next(alike, None)
        if other is not None:
            said[id(one)] = (
                f"{one.called}: called so, it is taken as where the robot was sent, and "
                f"{other.called}, of the same columns, as what was measured there"
            )
    return tuple(one for one in looks if id(one) not in said), tuple(said.values())


def _of_the_same_poses(one: Found, other: Found) -> bool:
    """Whether two files have the same columns, and the poses of one of them are in the other.

    Not all that was planned is measured. Without names of poses they have as many rows.
    """
    if one.head != other.head:
        return False
    found = one.stems.get("pose_id")
    if found is None:
        return one.rows == other.rows
    names, others = (set(each.column(found.theirs)) for each in (one, other))
    return names <= others or others <= names


def _says_so(look: Found) -> bool:
    """Whether the name of a file, or of a sheet, has such a word, and none that tells of more."""
    each = ({word for word in small_words(name).split() if not word.isdecimal()}
            for name in (Path(look.name).stem, look.sheet or ""))  # fmt: skip
    return any(words & SENT and words <= SENT | BESIDE for words in each)
