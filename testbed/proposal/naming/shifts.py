"""Names of positions that are such only beside a rotation."""

import re
from collections.abc import Collection

AXES = ("x", "y", "z")
SHIFTS = (("tx", "ty", "tz"), ("t1", "t2", "t3"))
"""Without a rotation these may be targets."""
TURNED = ({"rx", "ry", "rz"}, {"qw", "qx", "qy", "qz"}, {"q0", "qx", "qy", "qz"})
ENTRY = re.compile(r"r ?[0-3] ?[0-3]")
"""An entry of a rotation matrix."""


def shift_names(texts: Collection[str]) -> dict[str, str]:
    """Stems of small words that are a position beside a rotation, if no other is there."""
    there = set(texts)
    entries = {text for text in there if ENTRY.fullmatch(text)}
    if not (len(entries) == 9 or any(there >= own for own in TURNED)) or there & set(AXES):
        return {}
    found = (dict(zip(own, AXES, strict=True)) for own in SHIFTS if there.issuperset(own))
    return next(found, {})
