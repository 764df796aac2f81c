"""The tool that will be used, where another was measured: what is believed of its tip.

Between the target that was measured and the tip that will be used lies the flange. What the links
carry to it was not seen at the target, or was taken for the place of the target: the tip is as
uncertain as the prior of the links leaves it.
"""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from calib.arrays import Array, FloatOrNan, frozen
from calib.geometry.frames import slide
from calib.geometry.model import RobotModel
from calib.measurement.tool_target import ToolTarget
from calib.uncertainty.statement.belief import Belief
from calib.uncertainty.statement.distance import distance_radius
from calib.uncertainty.statement.stated_point import common_radius, widened
from calib.uncertainty.tool_point import ToolStatement
from testbed.scenario.tool_in_use import ToolInUse


@dataclass(frozen=True, slots=True, eq=False)
class ToolInUseStatement:
    """How near the true tip of the tool in use lies at n poses like those judged."""

    tool: ToolInUse
    worst: tuple[float, float, float]
    """The point of the tool that the rest is of: the worst known one, in the flange's frame [m]."""
    radius_mean: float
    """R95 of the mean of many moves at poses like these [m]."""
    radius_move: FloatOrNan
    """The same of where one move ends; nan where nothing tells how well joints come back [m]."""
    at_poses: Annotated[Array, "n"]
    """(n,) R95 of the mean at each of them [m]."""
    measured_at_poses: Annotated[Array, "n"]
    """(n,) the same of the target that was measured [m]."""
    transfer: Annotated[Array, "n"]
    """(n,) g at the tip: what the model misses, as against the target at the judged poses."""
    probability: float


def tool_statement_of(
    belief: Belief,
    tool: ToolInUse,
    q: Array,
    *,
    target: ToolTarget,
    link_sd: Array,
    repeatability: Array,
) -> ToolInUseStatement:
    """What is believed of the tool in use at joints q (n, j), at the worst known of its points.

    Parameters
    ----------
    belief : Belief
        Of the identified robot, its links under a prior.
    tool : ToolInUse
        The tool.
    q : (n, j) array
        Joints of the judged poses [rad, m].
    target : ToolTarget
        The one that was measured, in the tool's frame as it was identified.
    link_sd : (j, 5) array
        Of the prior [rad, m, m, rad, rad].
    repeatability : (j,) array
        Standard deviation with which each joint comes back; zero where nothing tells it [rad, m].
    """
    found = [(carried(belief, tool, point, link_sd), point) for point in tool.points]
    radii = [common_radius(there.regions(q)) for there, _ in found]
    there, point = found[int(np.argmax(radii))]
    move = float("nan")
    if repeatability.any():
        move = common_radius(there.regions(q, repeatability=repeatability))
    x, y, z = point.tolist()
    return ToolInUseStatement(
        tool, (x, y, z), max(radii), move, _radii(there.regions(q)),
        _radii(belief.regions(q, target=target)), frozen(there.proven.applies(q).transfer),
        belief.probability,
    )  # fmt: skip


def _radii(region: ToolStatement) -> Array:
    """R95 (n,) of each region [m]."""
    return frozen(distance_radius(widened(region)))


def carried(belief: Belief, tool: ToolInUse, point: Array, link_sd: Array) -> Belief:
    """What is believed of a point (3,) of another tool, in the flange's frame [m].

    The tool's numbers are those of the target that was measured: they say nothing of this one. One
    shift of the flange is no number of the last link, along its y; it is as uncertain as the
    link's lengths are.

    Parameters
    ----------
    belief : Belief
        Of the identified robot, its links under a prior.
    tool : ToolInUse
        Whose point it is.
    point : (3,) array
        In the frame of the flange that the tool is stated in [m].
    link_sd : (n, 5) array
        Of the prior [rad, m, m, rad, rad].
    """
    place, n = tool.in_chain(point), belief.model.chain.n_numbers
    own = np.ones(belief.model.n_numbers)
    own[n - 6 : n] = 0.0
    mask = np.outer(own, own)
    covariance = belief.covariance * mask
    links = np.arange(6, n - 6)
    spread = np.diag(covariance)[links]
    # a link that the session held is no better known than any
    covariance[links, links] = np.where(spread > 0, spread, link_sd.ravel() ** 2)
    here = np.arange(n - 6, n - 3)
    covariance[here, here] = tool.sd**2 + np.array([0.0, link_sd[-1, 1], 0.0]) ** 2
    proven = belief.proven
    return replace(
        belief,
        model=_with_tool(belief.model, place),
        covariance=frozen(covariance),
        misfit_covariance=frozen(belief.misfit_covariance * mask),
        proven=replace(  # what is left there is compared with what was left at the target
            proven,
            wide=_with_tool(proven.wide, place),
            target=ToolTarget(),
            absorbed=frozen(proven.absorbed * own[:, None]),
            covariance=frozen(covariance),
        ),
    )


def _with_tool(model: RobotModel, point: Array) -> RobotModel:
    """The same arm with a tool that ends at a point of its flange."""
    return replace(model, chain=replace(model.chain, T_flange_tool=slide(*point)))
