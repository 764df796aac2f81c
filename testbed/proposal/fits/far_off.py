"""The draft that links far from nominal explain, where base and tool alone fit none."""

from collections.abc import Sequence

from testbed.files.probe import probe
from testbed.files.session import Session
from testbed.robots.robot import Robot

MOST = 3
"""Drafts that links are fitted to, the best ones first: each takes a second."""
ALIKE = 2.0
"""Those that leave more than so many times what the best one leaves are not asked."""


def far_off(
    sessions: Sequence[Session | None], scores: Sequence[float], robot: Robot
) -> tuple[int, str] | None:
    """The draft whose readings only links far from nominal explain, in words; None if none is.

    Parameters
    ----------
    sessions : sequence of Session or None
        Of each draft, as far as it could be read.
    scores : sequence of float
        What base and tool alone leave of each [m].
    robot : Robot
        Nominal robot.
    """
    order = sorted(range(len(scores)), key=lambda k: scores[k])
    least = scores[order[0]]
    for k in order[:MOST]:
        session = sessions[k]
        if session is None or scores[k] > ALIKE * least or scores[k] == float("inf"):
            return None
        found = probe(robot, session)
        if found.linked is not None and found.stated is not None:
            left = found.stated.shown
            return k, (
                f"with only base and tool fitted to a nominal {robot.name}, errors are {left}, far "
                f"more than usual, and {found.linked.sentence}"
            )
    return None
