"""Nests on the floor among the readings of a file: targets that no joints belong to."""

from collections import Counter

from testbed.files.dialects.pose_names import written_alike
from testbed.proposal.data import Found

LEAST = 3
"""Number of nests that show how a station turns."""


def nests_of(seen: Found, joints: Found) -> tuple[str, ...]:
    """Targets that were read again and again, and in no row that has joints; none if they are few.

    Their rows have no joints, or in two files a name that no joints have.
    """
    named = seen.stems.get("target")
    if named is None:
        return ()
    rows = list(zip(seen.column(named.theirs), _alone(seen, joints), strict=True))
    moved = {target for target, alone in rows if not alone}
    often = Counter(target for target, alone in rows if alone and target)
    nests = tuple(target for target, count in often.items() if count > 1 and target not in moved)
    return nests if moved and len(nests) >= LEAST else ()


def _alone(seen: Found, joints: Found) -> list[bool]:
    """Whether each row of the readings has no joints."""
    if joints is seen:
        own = [one.theirs for one in seen.meanings
               if one.plain[:1] == "q" and one.plain[1:2].isdigit()]  # fmt: skip
        return [not any(cells) for cells in zip(*map(seen.column, own), strict=True)]
    if not (seen.has("pose_id") and joints.has("pose_id")):
        return [False] * seen.rows
    names, known = (one.column(one.stems["pose_id"].theirs) for one in (seen, joints))
    there = set(map(written_alike, known))
    return [written_alike(name) not in there for name in names]
