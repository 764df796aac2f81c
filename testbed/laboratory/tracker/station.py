"""One tracker station: which poses it sees, and how well the best design from there does."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Bool, Index, frozen
from calib.design.blocks import has_full_rank, information
from calib.errors import CalibError
from calib.geometry.parameters import Parameters
from calib.information.goals import Goals
from testbed.laboratory.bench import Bench

Designer = Callable[[Array], Index]
"""From blocks (V, r, p) of the visible poses to the positions of the chosen ones."""


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """What the tracker sees from one station, and the best design from there."""

    turned_away: int
    """Candidates whose target does not face the station."""
    hidden: int
    """Candidates that face it, but the beam is blocked."""
    visible: int
    """Candidates that can be measured."""
    range_mean: float
    """Mean distance to the visible targets; nan if there are none [m]."""
    design: Index
    """Poses designed, as positions among the candidates."""
    u_mean: float
    """Predicted RMS standard uncertainty of the tool point over the goal; inf: no design [m]."""
    u_worst: float
    """The same at the worst goal pose [m]."""
    fault: str = ""
    """Why there is no design."""


def view_from(
    bench: Bench, q: Array, parameters: Parameters, goals: Goals, designer: Designer
) -> View:
    """What the station of a bench sees of poses q (m, n), and how well the best design does."""
    facing, seen = visible_from(bench, q)
    away, hidden = int((~facing).sum()), int((facing & ~seen).sum())
    left, none = np.flatnonzero(seen), np.zeros(0, dtype=np.int64)
    if not len(left):
        return View(away, hidden, 0, np.nan, none, np.inf, np.inf, "nothing")
    targets = bench.tracker.targets(bench.robot.model.poses(q[left]))
    distance = float(np.linalg.norm(targets - bench.tracker.station, axis=1).mean())
    counted = (away, hidden, len(left), distance)
    blocks = bench.blocks(q[left], parameters)
    try:
        chosen = np.asarray(designer(blocks), dtype=np.int64)
    except CalibError as error:
        return View(*counted, none, np.inf, np.inf, _why(error))
    u = goal_uncertainty(blocks[chosen], goals.rows)
    if not np.isfinite(u).all():
        return View(*counted, none, np.inf, np.inf, "the design cannot tell the parameters apart")
    mean = float(np.sqrt(np.average(u**2, weights=goals.weights)))
    return View(*counted, frozen(left[chosen], np.int64), mean, float(u.max()))


def _why(error: CalibError) -> str:
    """An error as a part of another sentence: without place, code and advice."""
    return f"{error.message}, {error.allowed}" if error.allowed else error.message


def visible_from(bench: Bench, q: Array) -> tuple[Bool, Bool]:
    """Whether (m,) the target faces the tracker, and whether the tracker also sees it."""
    candidates = bench.candidates()
    facing = candidates.faces(q)
    seen = facing.copy()
    if candidates.settings.line_of_sight:
        seen[facing] = candidates.sees(q[facing])
    return facing, seen


def goal_uncertainty(blocks: Array, goal: Array) -> Array:
    """Predicted 3-D standard uncertainty (g,) of the tool point after measuring blocks (m, r, p).

    `goal` (g, 3, p) [m]. Infinite if the rows leave a number undetermined.
    """
    if not has_full_rank(blocks.reshape(-1, blocks.shape[-1])):
        return np.full(len(goal), np.inf)
    return point_u(information(blocks), goal)


def point_u(M: Array, rows: Array) -> Array:
    """3-D standard uncertainty (g,) of the tool point at the goal, from its rows (g, 3, p) [m].

    References
    ----------
    JCGM 102:2011, 6.2: the covariance of a linear function y = J x is J C J'; here C = M^-1, and
    u^2 = tr(J_t M^-1 J_t') adds the variances of the three coordinates.
    """
    lower = np.linalg.cholesky(M)
    g, _, p = rows.shape
    half = np.linalg.solve(lower, rows.reshape(-1, p).T)
    return np.asarray(np.sqrt((half**2).sum(axis=0).reshape(g, 3).sum(axis=1)))
