"""Which row of a session was measured first: a drift is asked for in that order."""

from calib.errors import refuse
from testbed.files.session import Session


def require_order(session: Session) -> None:
    """Refuse rows without times where these are to tell the order of the rows.

    Raises
    ------
    InputError
        M35: no row says when it was measured.
    """
    if session.wanted.order == "time" and session.time is None and session.order is None:
        raise refuse(
            "identification.order", "time", code="M35", where=session.where,
            message='[identification] order is "time", and no row says when it was measured',
            fix="give the column time_s, or leave order out: rows then stand in the order of the "
            "file",
        )  # fmt: skip


def order_words(session: Session) -> str:
    """What tells the order of the rows in time."""
    if session.wanted.order == "unknown":
        return ""
    if session.numbered:
        return "their column order"
    if session.time is not None:
        return "their times"
    return "the files" if session.order is None else "the files, held-out ones last"
