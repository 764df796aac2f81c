"""What the calibration is for: the poses where the tool point must be right, and their weights."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, check, frozen, require_numbers
from calib.errors import refuse
from calib.geometry.jacobian import reflector_rows
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.information.rank import KEEP_TOLERANCE, RANK_TOLERANCE
from calib.kinds import checked_kinds
from calib.shown import Shown

NAME_GOALS = "name the poses or the box where the tool must be right"
FELT = 1e-4
"""A hidden direction matters if it moves the goal by more than this part of what unit steps of the
numbers do: 0.1 um of a millimeter."""
WORTH_NAMING = 0.05
"""Numbers whose part in a direction is below this share of the largest one are not named."""


@dataclass(frozen=True, slots=True, eq=False)
class Goals(Shown):
    """Goal poses for a design: the Jacobian of the tool point by scaled parameters, and weights."""

    rows: Array
    """(g, 3, p) displacement of the tool point per scaled unit of each parameter [m]."""
    weights: Array
    """(g,) share of each pose, summing to one."""

    def __post_init__(self) -> None:
        rows, weights = check("g 3 p, g", rows=self.rows, weights=self.weights)
        if not len(rows):
            message = "the goal has no poses"
            raise refuse(
                "goals", allowed="at least one", code="M29", message=message, fix=NAME_GOALS
            )
        if not rows.any():
            message = "no free number moves the tool point at the goal"
            fix = "free the numbers that matter there"
            raise refuse("goals", code="M29", message=message, fix=fix)
        if (weights < 0).any() or not weights.sum() > 0:
            message = "weights must not be negative, nor all zero"
            raise refuse("weights", code="A3", message=message)
        object.__setattr__(self, "rows", rows)
        object.__setattr__(self, "weights", frozen(weights / weights.sum()))

    def __repr__(self) -> str:
        return f"Goals({len(self.rows)} poses, {self.rows.shape[2]} numbers)"

    @property
    def mean(self) -> Array:
        """C (p, p): tr(C covariance) is the weighted mean squared tool-point uncertainty [m^2]."""
        F = (self.rows * np.sqrt(self.weights)[:, None, None]).reshape(-1, self.rows.shape[2])
        return np.asarray(F.T @ F)


@checked_kinds
def goal_matrix(
    model: RobotModel,
    q_goals: ArrayLike,
    parameters: Parameters,
    *,
    weights: ArrayLike | None = None,
    target: ArrayLike = (0.0, 0.0, 0.0),
) -> Goals:
    """Goals from the joint values of the poses that matter.

    Parameters
    ----------
    model : RobotModel
        Nominal model.
    q_goals : (g, n) array_like
        Joint values of a box of poses, a list, or a path [rad, m].
    parameters : Parameters
        The free numbers and their scale, as in the blocks of the pool.
    weights : (g,) array_like, optional
        Weight of each pose; equal by default.
    target : (3,) array_like
        The tool point, in the tool frame [m].

    Raises
    ------
    InputError
        M29: there are no poses, or no free number moves the tool point there; A3: a weight is
        negative, or all are zero.

    References
    ----------
    u^2 = tr(J_t Sigma J_t'), averaged over the goal poses t; the test-pose criterion of
    Klimchik et al., arXiv 1311.6658.
    """
    q, target = check(f"g {model.chain.n_joints}, 3", q_goals=q_goals, target=target)
    g = len(q)
    share = np.ones(g) if weights is None else require_numbers("weights", weights)
    if g:
        T, J = model.poses_and_jacobian(q)
        rows = reflector_rows(T, J, np.tile(target, (g, 1)))[1]
    else:
        rows = np.zeros((0, 3, model.n_numbers))
    return Goals(rows[:, :, parameters.free] * parameters.free_scale, np.asarray(share))


def hidden_numbers(A: Array, goals: Goals, names: Sequence[str]) -> list[str]:
    """Numbers that move the tool point at the goal along a direction that no measurement shows.

    Parameters
    ----------
    A : (N, f) array
        Whitened Jacobian of what is measured, by the scaled free numbers.
    goals : Goals
        Goal poses, by the same numbers.
    names : sequence of f str
        Names of the numbers.

    Returns
    -------
    list of str
        The largest numbers, at most four, of the unobservable direction that moves the goal most;
        empty if there is none.
    """
    size = np.linalg.norm(A, axis=0)
    size = np.where(size > RANK_TOLERANCE * size.max(), size, size.max())
    # right singular vectors, per unit of each column
    _, singular, Vt = np.linalg.svd(np.linalg.qr(A / size, mode="r"))
    # what a reduction may hold counts as hidden: a joint that rounding alone moves shows nothing
    hidden = Vt[int((singular > KEEP_TOLERANCE * singular[0]).sum()) :].T / size[:, None]
    effect = goals.rows.reshape(-1, A.shape[1]) @ hidden
    if not hidden.size or np.abs(effect).max() < FELT * np.abs(goals.rows @ (1 / size)).max():
        return []
    way = np.abs(hidden @ np.linalg.svd(effect, full_matrices=False)[2][0])
    # equal parts stay in the order of the numbers, whatever rounding made of them
    order = np.argsort(-np.round(way / way.max(), 6), kind="stable")[:4]
    return [names[k] for k in order if way[k] > WORTH_NAMING * way[order[0]]]
