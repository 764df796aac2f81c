"""Tables that lie on their side: a row for each joint and axis, and a column for each pose."""

from collections.abc import Sequence

from calib.errors import InputError
from testbed.files.refusal import refusal
from testbed.proposal.data import Found
from testbed.proposal.names import meanings

PLACE, POSE, MATRIX = 3, (6, 7), (12, 16)
"""Numbers of a place, of one with angles or a quaternion, and of a transform."""
NAMED = 3
"""Known names in a first column that make it a column of names."""
TURN = (
    "turn rows into columns: writematrix(Q', 'q.csv') in MATLAB, numpy.savetxt('q.csv', Q.T) in "
    "Python, Paste Special, Transpose in a spreadsheet"
)


def on_its_side(looks: Sequence[Found], n: int) -> InputError | None:
    """The error of files that have a column for each pose of an arm with n joints; else None.

    All tables without names are as wide then, and as long as joints, readings or both are wide.
    """
    for look in looks:
        if look.kind != "program" and look.rows < len(look.head) and _has_names_in_rows(look):
            return _error(look, "names joints or axes in its first column")
    bare = [one for one in looks if one.kind == "bare"]
    seen = {PLACE, *POSE, *MATRIX}
    counts = {n, *seen, *(n + count for count in seen)}
    if not bare or len({one.width for one in bare}) > 1 or len(bare) < len(looks):
        return None
    differ = len({one.rows for one in bare}) > 1  # of one file rows may be few and long
    if all(one.rows in counts and (1 if differ else 2) * one.rows < one.width for one in bare):
        return _error(bare[0], f"has {bare[0].rows} rows of {bare[0].width} numbers")
    return None


def _has_names_in_rows(look: Found) -> bool:
    """Whether a first column holds names of joints and axes, and the line above it none."""
    return len(meanings(look.column(look.head[0]))) >= NAMED > len(look.meanings)


def _error(look: Found, message: str) -> InputError:
    """The error of such a table."""
    return refusal(
        look.called, "file", f"{message}: it seems to lie on its side, with a column for each pose",
        allowed="each row is one measurement", fix=TURN,
    )  # fmt: skip
