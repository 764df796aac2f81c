"""What a letter behind the axes means where a row holds two places: Xm beside Xn, or beside X."""

from collections.abc import Collection

AXES = ("x", "y", "z")
MEASURED, NOMINAL, DEVIATION = ("m", "a"), "n", "d"
"""Measured or actual, nominal, and the deviation of the two."""


def stems_of_letters(texts: Collection[str]) -> dict[str, str]:
    """Stems of names such as xm, where those of another place beside them tell what they mean.

    Alone they tell nothing: xm may be x in meters. Beside a place with a letter of what was
    measured, a place without a letter is where the robot was sent.
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
