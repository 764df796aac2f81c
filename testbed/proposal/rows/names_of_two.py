"""Names that are of a pose and of a reflector at once, as exports of points have: P1_SMR1."""

import re
from collections.abc import Sequence

from calib.errors import InputError
from testbed.files.refusal import refusal
from testbed.files.rows.shifts import FEWEST
from testbed.proposal.data import Found
from testbed.units import counted

BOTH = re.compile(r"(.*\w)[_\-. :/](\w+)")
"""What stands before and behind the last mark."""
MOST = 20
"""Reflectors of one tool at most; more words behind a mark are no names of these."""


def names_of_two(looks: Sequence[Found]) -> InputError | None:
    """The error of readings whose names have to be parted; None if there are none.

    These are the names of a table, each once, that have as many poses before a mark as another file
    has rows, most of them with each of a few words behind it.
    """
    for look in looks:
        others = {one.rows for one in looks if one is not look}
        if look.kind != "table" or not look.has("pose_id", "x", "y", "z") or look.has("target"):
            continue
        column = look.stems["pose_id"].theirs
        cells = look.column(column)
        found = [one for cell in cells if (one := BOTH.fullmatch(cell)) is not None]
        poses = {one[1] for one in found}
        targets = list(dict.fromkeys(one[2] for one in found))
        whole = len(found) == len(cells) == len(set(cells))
        full = len(poses) >= FEWEST and 2 * len(cells) > len(poses) * len(targets)
        if whole and full and 1 < len(targets) <= MOST and len(poses) in others - {len(cells)}:
            one = found[0]
            return refusal(
                str(look.path), column,
                f'has names of a pose and a target in one, as "{cells[0][:40]}": '
                f"{counted(len(poses), 'pose')}, {counted(len(targets), 'target')} each",
                code="M31", allowed="the two have a column each",
                fix=f"part them into pose_id ({one[1][:20]}) and target ({one[2][:20]})",
            )  # fmt: skip
    return None
