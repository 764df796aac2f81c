"""Names of positions that are clear only by other columns: a second position, or a rotation."""

import re
from collections.abc import Collection

AXES = ("x", "y", "z")
MEASURED, NOMINAL, DEVIATION = ("m", "a"), "n", "d"
"""Letters for measured or actual values, nominal ones, and the deviation between both."""
SHIFTS = (("tx", "ty", "tz"), ("t1", "t2", "t3"))
"""Without a rotation these may be targets."""
VECTORS = {"tvec": AXES, "rvec": ("rx", "ry", "rz"), "rotvec": ("rx", "ry", "rz")}
"""Places and rotation vectors whose three numbers OpenCV leaves without names."""
TURNED = ({"rx", "ry", "rz"}, {"qw", "qx", "qy", "qz"}, {"q0", "qx", "qy", "qz"})
ENTRY = re.compile(r"r ?[0-3] ?[0-3]")
"""An entry of a rotation matrix."""


def stems_of_letters(texts: Collection[str]) -> dict[str, str]:
    """Stems of names such as xm, if the names of another position beside them make it clear.

    Alone such names are ambiguous: xm may be x in meters. Beside a position with a letter for
    measured values, a position without a letter is the commanded one.
    """
    there = {
        letter
        for letter in ("", *MEASURED, NOMINAL, DEVIATION)
        if all(f"{axis}{letter}" in texts for axis in AXES)
    }
    measured, sent = there & set(MEASURED), there & {"", NOMINAL}
    if len(measured) == 1 and len(sent) == 1:
        kinds = dict.fromkeys(measured, "") | dict.fromkeys(sent, "command_")
    elif not measured and sent == {"", NOMINAL}:
        kinds = {NOMINAL: "command_"}
    else:
        return {}
    if DEVIATION in there:
        kinds[DEVIATION] = "difference_"
    return {f"{axis}{letter}": f"{kind}{axis}" for letter, kind in kinds.items() for axis in AXES}


def shift_names(texts: Collection[str]) -> dict[str, str]:
    """Stems of small words that are a position beside a rotation, if no other is there."""
    there = set(texts)
    entries = {text for text in there if ENTRY.fullmatch(text)}
    if not (len(entries) == 9 or any(there >= own for own in TURNED)) or there & set(AXES):
        return {}
    found = (dict(zip(own, AXES, strict=True)) for own in SHIFTS if there.issuperset(own))
    return next(found, {})


def counted_vectors(texts: Collection[str]) -> dict[str, str]:
    """Stems of three numbers of a vector that are counted from 0 or 1, as tvec_0 or rvec1."""
    found: dict[str, str] = {}
    for word, stems in VECTORS.items():
        own = sorted(text for text in texts if re.fullmatch(rf"{word} ?[0-3]", text))
        if [text[-1] for text in own] in (["0", "1", "2"], ["1", "2", "3"]):
            found |= dict(zip(own, stems, strict=True))
    return found
