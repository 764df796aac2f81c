"""Whether the files of a session are read as they were meant, each in frames of its own."""

from collections.abc import Sequence

from calib.errors import InputError
from testbed.files.probe import probe
from testbed.files.session import Session
from testbed.files.tried.interpretations import Probe
from testbed.robots.robot import Robot


def probed(robot: Robot, session: Session, *, links: bool = True) -> tuple[Probe, ...]:
    """Other readings tried, for each visit by itself; `links` as in `probe`.

    Held-out rows that stand in another frame than the others look like a wrong reading of the
    file: where each part by itself is read rightly, the proof tells where they stand.

    Raises
    ------
    InputError
        The code of the fault; the message names the reading that fits.
    """
    probes = tuple(probe(robot, one, links=links) for one in session.alone or (session,))
    try:
        for one in probes:
            one.raise_if_wrong()
    except InputError:
        if session.alone or not session.split_stated or session.is_test.all():
            raise
        rows = (~session.is_test, session.is_test)
        parts = [probe(robot, session.rows(some), links=links) for some in rows]
        if any(part.stated is None for part in parts):
            raise
        for part in parts:
            part.raise_if_wrong()
        return (parts[0],)
    return probes


def tried_words(session: Session, probes: Sequence[Probe]) -> tuple[str, ...]:
    """What became of trying other readings, of each visit by its name."""
    if not session.visits:
        return tuple(one.sentence for one in probes)
    several = zip(session.visits, probes, strict=True)
    return tuple(f"session {visit.name}: {one.sentence}" for visit, one in several)
