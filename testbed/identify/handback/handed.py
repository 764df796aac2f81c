"""What a calibration's record says of its hand-back: tolerances of links, the tool in use."""

from dataclasses import dataclass
from typing import Annotated

from calib.arrays import Array
from calib.measurement.tool_target import ToolTarget
from calib.shown import in_a_line
from calib.uncertainty.statement.belief import Belief
from testbed.files.session import Session
from testbed.identify.handback.in_use import ToolInUseStatement, tool_statement_of
from testbed.identify.handback.links import LinkBelief
from testbed.robots.robot import Robot


@dataclass(frozen=True, slots=True, eq=False)
class HandBack:
    """What a calibration's record says of its hand-back."""

    tolerance: Annotated[Array, "n", 5]
    """(n, 5) how far each number of a link may lie from nominal, a standard deviation [rad, m, m,
    rad, rad]."""
    stated_by: str
    """Who states it: the session, the robot's file, or nobody."""
    why: str
    """Why the links of a geometric fit have a prior of that width; empty where they need none."""
    by_prior: Annotated[Array, "c"]
    """(c,) part of the variance of each of the 12 + 5 n numbers of base, links and tool, and of the
    joint terms behind them, that comes from a prior, not from the readings."""
    limits: Annotated[Array, "n", 2]
    """(n, 2) of the joints [rad, m]."""
    in_use: ToolInUseStatement | None
    """What is believed of the tool in use; None without one, or where nothing is believed."""
    tool_refused: str
    """Why nothing is, where a tool in use is stated; else empty."""
    widened: bool = False
    """Whether that is wider than usual because the measurements ask for it."""

    def __repr__(self) -> str:
        return in_a_line(self)


def hand_back(
    robot: Robot,
    session: Session,
    links: LinkBelief,
    by_prior: Array,
    belief: Belief | None,
    q: Array,
    *,
    target: ToolTarget,
    repeatability: Array,
) -> HandBack:
    """What the record says, from what the fit and its proof have found.

    Parameters
    ----------
    robot, session : Robot, Session
        What was calibrated, from what.
    links : LinkBelief
        What was believed of the links.
    by_prior : (12 + 5 n + k,) array
        As in `prior_share`.
    belief : Belief or None
        Of the identified robot.
    q : (n, j) array
        Joints of the poses that the statement is of [rad, m].
    target, repeatability
        As in `tool_statement_of`.
    """
    told = "as the session states" if session.link_sd is not None else ""
    told = told or ("as the robot's file states" if robot.tolerances is not None else "the usual")
    if links.widths.widened:
        told = f"wider than usual, as the measurements ask: log evidence {links.widths.gain:+.1f}"
    in_use, refused = None, ""
    if session.in_use is not None and belief is None:
        refused = (
            f"nothing is stated of the tip of {session.in_use.name}: no region of the target that "
            "was measured is believed either"
        )
    elif session.in_use is not None and belief is not None:
        in_use = tool_statement_of(
            belief, session.in_use, q, target=target, link_sd=links.sd, repeatability=repeatability
        )
    return HandBack(
        links.sd, told, links.why, by_prior, robot.limits, in_use, refused, links.widths.widened
    )
