"""Readings sorted by the letters of their names, as P1, P10, P2, beside joints without names."""

from collections.abc import Sequence

from testbed.files.dialects.pose_names import numbers_in
from testbed.proposal.data import Found

SHOWN = 3
"""First rows that are named."""


def sorted_by_letters(looks: Sequence[Found]) -> str:
    """What to do about such a file; empty where none is one.

    Its names have numbers, which do not grow from row to row although the letters do; as many
    joints, in another file, have no names.
    """
    for one in looks:
        own = one.stems.get("pose_id")
        names = one.column(own.theirs) if own is not None and one.kind != "program" else ()
        if len(numbers := numbers_in(names)) < SHOWN or list(names) != sorted(names):
            continue
        order = [int(numbers[name]) for name in names]
        if order != sorted(order) and any(
            other is not one and other.rows == one.rows and not other.has("pose_id")
            for other in looks
        ):
            return (
                f"{one.called} is sorted by the letters of its names ({', '.join(names[:SHOWN])} "
                "...): if the joints are in the order of their numbers, sort it by these, or "
                "number the joints in a column pose_id"
            )
    return ""
