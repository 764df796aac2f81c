"""Letters after axis names in rows with two positions, such as Xm beside Xn, or beside X."""

from collections.abc import Collection

AXES = ("x", "y", "z")
MEASURED, NOMINAL, DEVIATION = ("m", "a"), "n", "d"
"""Letters for measured or actual values, nominal ones, and the deviation between both."""


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
