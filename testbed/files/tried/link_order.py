"""Link numbers in Craig's order that were taken for the standard one, by the readings."""

from dataclasses import replace

import numpy as np

from calib.geometry.model import RobotModel
from testbed.files.alternatives import Alternative, Interpretation
from testbed.files.frames_fit import FAR, Misfit
from testbed.files.rows.shifts import misfit_of

BEHIND = (2, 3)
"""Of a line of links: a and alpha, which lie behind its joint in the standard order."""
IN_CRAIGS_ORDER = Alternative(
    "links",
    "if alpha and a in a line of its links are those before the joint (Craig's order, modified "
    "Denavit-Hartenberg)",
    "call these columns alpha_i-1 and a_i-1 in the table, and write robot.toml anew by truebed new "
    "robot; or move alpha_deg and a_mm up by one of its [[joints]]",
    "M32",
    "ROBOT",
)


def in_craigs_order(
    model: RobotModel, read: Interpretation
) -> tuple[Alternative, Misfit, Interpretation] | None:
    """What the readings leave if the lines of links are in Craig's order; None if that is far.

    Positions decide, as of rotations nobody knows yet how they turn. What stands before the first
    joint is in the base.
    """
    links = np.array(model.chain.links)
    links[:-1, BEHIND], links[-1, BEHIND] = links[1:, BEHIND], 0.0
    other = replace(model, chain=replace(model.chain, links=links))
    places = replace(read, rotation=None, numbers=None)
    left = misfit_of(other, places)
    return (IN_CRAIGS_ORDER, left, places) if left.score <= FAR else None
