"""Which rows of drafts are asked for a fit: all of them, parts, and those that are not far off."""

from collections.abc import Iterator, Sequence
from contextlib import suppress

from calib.errors import InputError
from testbed.files.read import without_strays
from testbed.files.session import Session
from testbed.proposal.drafts import PARTS
from testbed.proposal.fits.draft_fit import DraftFit, fit_of
from testbed.robots.robot import Robot
from testbed.units import counted

MOST = 3
"""Drafts of which rows that are far off are left out, the best ones first."""

Round = tuple[Sequence[Session | None], int, list[DraftFit]]
"""Sessions of the drafts, the number of parts of their rows, and how the best part of each fits."""


def rounds(robot: Robot, sessions: Sequence[Session | None]) -> Iterator[Round]:
    """Ways to ask whether drafts fit, each of them only if the one before found none.

    If a reading was lost and later rows are shifted, a part of the rows still fits. If some rows
    are far off, the others do.

    Parameters
    ----------
    robot : Robot
        Nominal.
    sessions : sequence of Session or None
        Of each draft, as far as it could be read.
    """
    scores: list[float] = []
    for parts in PARTS:
        fits = [fit_of(robot, session, parts) for session in sessions]
        scores = scores or [one.score for one in fits]
        yield sessions, parts, fits
    kept: list[Session | None] = [None] * len(sessions)
    for k in sorted(range(len(scores)), key=scores.__getitem__)[:MOST]:
        session = sessions[k]
        if session is not None:
            with suppress(InputError):  # shots that slipped, which reading the session reports
                kept[k] = without_strays(robot, session)
    yield kept, 1, [fit_of(robot, session, 1) for session in kept]


def without_words(whole: Session | None, kept: Session | None) -> str:
    """How many rows of a draft are far off, where it fits without them; empty where all do."""
    if whole is None or kept is None or len(kept.measurements) == len(whole.measurements):
        return ""
    count = len(whole.measurements) - len(kept.measurements)
    return f", without {counted(count, 'row')} far off"
