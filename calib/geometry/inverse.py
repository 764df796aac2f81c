"""Inverse kinematics: joint values that bring the tool to given poses, by damped Newton iteration.

The whole model is inverted, joint errors included. Steps are the shortest ones (pseudo-inverse).
For arms of more than six joints the solution is then moved along its null space to the posture
nearest to its seed.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Bool, Index, check, frozen, require_numbers
from calib.errors import refuse
from calib.geometry.frames import rigid
from calib.geometry.inverse_search import (
    NUDGES,
    PoseSearch,
    distance,
    inside,
    into_limits,
    pull_to_seeds,
    retry,
    search,
    turned_back,
    whole_turns_into_limits,
)
from calib.geometry.inverse_search import joint_jacobian as joint_jacobian
from calib.geometry.model import RobotModel
from calib.geometry.operating import AS_USUAL, OperatingConditions
from calib.kinds import checked_kinds
from calib.shown import Shown, length_words

InverseStatus = Literal["reached", "singular", "limits", "out of reach"]
SINGULAR_CONDITION = 1e3
"""From this condition on, turning the tool by 0.01 deg can take joint moves of 10 deg."""

SPARE = 0.1
"""Part of the links' lengths by which errors of the joints may lengthen an arm, and far more."""


@dataclass(frozen=True, slots=True, eq=False)
class Inverse(Shown):
    """One posture per target, and how near it brings the tool."""

    q: Array
    """(m, n) joint values inside the limits, whatever the outcome [rad, m]."""
    position_error: Array
    """(m,) distance of the tool origin from its target [m]."""
    rotation_error: Array
    """(m,) angle of the rotation from the tool to its target [rad]."""
    status: tuple[InverseStatus, ...]
    """(m,) "reached"; "singular": reached, but the joints there are hardly determined by the pose;
    "limits": only reached outside the joint limits; "out of reach": not reached from any seed."""
    condition: Array
    """(m,) condition number of the joint Jacobian there, with angles of tool and joints times the
    characteristic length of 0.3 m."""
    reached: Bool = field(init=False)
    """(m,) whether the tool reaches its target, at a singular posture or not."""

    def __post_init__(self) -> None:
        near = [one in ("reached", "singular") for one in self.status]
        object.__setattr__(self, "reached", frozen(near, np.bool_))

    def __repr__(self) -> str:
        farthest = length_words(float(self.position_error.max(initial=0.0)), um=".3g")
        return f"Inverse({self.reached.sum()} of {len(self)} reached, farthest {farthest})"

    def __len__(self) -> int:
        return len(self.q)


@checked_kinds
def inverse_kinematics(
    model: RobotModel,
    T: ArrayLike,
    seeds: ArrayLike,
    limits: ArrayLike,
    *,
    whole_turns: bool = True,
    position_first: bool = False,
    at: OperatingConditions = AS_USUAL,
) -> Inverse:
    """Joint values at which the tool takes each wanted pose.

    Parameters
    ----------
    model : RobotModel
        Geometry and joint errors.
    T : (m, 4, 4) array_like
        Wanted tool poses T_world_tool [m].
    seeds : (m, n) or (m, s, n) array_like
        Joint values at which each search begins, one or several per target [rad, m]. Of all
        postures that reach a target, the one nearest to its first seed is returned. `spread` gives
        seeds where nothing is known. A revolute joint may be seeded beyond its limits; with
        `whole_turns` distances to such a seed ignore whole turns.
    limits : (n, 2) array_like
        Lower and upper joint limits [rad, m].
    whole_turns : bool
        Whether a joint may begin a whole turn away from its seed, or end one away from where its
        search ended, to be inside its limits.
    position_first : bool
        Whether reaching the position is enough; the angle is then made as small as it can be.
    at : OperatingConditions, optional
        Operating conditions, one row per target.

    Raises
    ------
    InputError
        A1: shapes do not match; A3: T is not rigid, or a lower limit is above its upper one.

    Notes
    -----
    Arms of fewer than six joints reach only some poses. For the others they end at the nearest
    pose, with its distance in the errors and a status that says so; with `position_first` they
    only have to bring the tool origin to the target.

    Examples
    --------
    >>> from calib.geometry.chain import Chain
    >>> arm = RobotModel(Chain([[0, 0, 0.3, 0, 0], [0, 0, 0.2, 0, 0]]))
    >>> T = arm.poses([[0.4, 0.8]])
    >>> found = inverse_kinematics(arm, T, [[0.3, 0.7]], [[-3, 3], [-3, 3]])
    >>> found.status, found.q.round(12).tolist()
    (('reached',), [[0.4, 0.8]])
    """
    n = model.chain.n_joints
    T, limits = check(f"m 4 4, {n} 2", T=T, limits=limits)
    T = rigid(T)
    if (limits[:, 0] > limits[:, 1]).any():
        message = "limits has a lower limit above its upper one"
        raise refuse("limits", limits.tolist(), code="A3", message=message, fix="swap them")
    every = require_numbers("seeds", seeds)
    every = every[:, None] if every.ndim == 2 else every
    (every,) = check(f"{len(T)} s {n}", seeds=every)
    targets, starts = len(T), every.shape[1]
    if not starts:
        raise refuse("seeds", every.shape, "at least one for each target", code="A1")
    at.require_rows(targets, n)
    own = at.rows(np.repeat(np.arange(targets), starts))
    each = np.repeat(T, starts, axis=0), every.reshape(-1, n)
    task = PoseSearch(model, *each, limits, own, whole_turns, position_first)
    begin = into_limits(task, task.seeds)
    q, near, beyond = begin.copy(), np.zeros(len(begin), np.bool_), np.zeros(len(begin), np.bool_)

    def without_limits(rows: Index) -> None:
        """Search from seeds as they are; whole turns may bring inside what the limits stop."""
        some = task.rows(rows)
        there, beyond[rows] = search(some, some.seeds, bounded=False)
        there = whole_turns_into_limits(some, there) if whole_turns else there
        back = beyond[rows] & inside(there, limits)
        q[rows[back]], near[rows[back]] = there[back], True

    if whole_turns and not (kept := inside(task.seeds, limits)).all():
        # the posture nearest to a seed beyond its limits is not one of their other end
        without_limits(np.flatnonzero(~kept))
    rows = np.flatnonzero(~near)
    q[rows], near[rows] = search(task.rows(rows), begin[rows], bounded=True)
    # what no posture comes near to is not searched for again
    far = np.repeat(_too_far(model, T), starts) & ~near
    near |= far
    for nudge in NUDGES if starts == 1 else ():
        q, near = retry(task, q, near, nudge)
    if not near.all():
        # what the limits stop may be out of reach for good
        without_limits(np.flatnonzero(~near))
    near &= ~far
    if not whole_turns:
        # the other end of the range is a whole turn away from a seed beyond this one
        turned = near & turned_back(task, q)
        q, near, beyond = np.where(turned[:, None], begin, q), near & ~turned, beyond | turned
    if n > 6:
        q, near = pull_to_seeds(task, q, near)
    return _best(task, q, near, beyond, targets)


def _too_far(model: RobotModel, T: Array) -> Bool:
    """Whether targets T (m, 4, 4) lie farther away than all links of a turning arm laid end to end.

    Joint errors make nothing longer by the part `SPARE`; slides may be driven without end.
    """
    chain = model.chain
    if chain.prismatic.any():
        return np.zeros(len(T), np.bool_)
    reach = np.linalg.norm(chain.links[:, 1:3], axis=1).sum()
    reach += np.linalg.norm(chain.T_flange_tool[:3, 3])
    away = np.linalg.norm(T[:, :3, 3] - chain.T_world_base[:3, 3], axis=1)
    return np.asarray(away > (1 + SPARE) * reach)


def spread(limits: ArrayLike, count: int) -> Array:
    """Joint values (count, n) [rad, m] that fill the limits (n, 2) evenly, the same every time.

    References
    ----------
    Additive recurrence with the n-dimensional golden ratio, the root of x^(n+1) = x + 1.
    """
    (limits,) = check("n 2", limits=limits)
    n, ratio = len(limits), 2.0
    for _ in range(60):
        ratio = (1 + ratio) ** (1 / (n + 1))
    share = (0.5 + np.outer(np.arange(count), ratio ** -np.arange(1, n + 1))) % 1.0
    return np.asarray(limits[:, 0] + share * (limits[:, 1] - limits[:, 0]))


def _best(task: PoseSearch, q: Array, near: Bool, beyond: Bool, targets: int) -> Inverse:
    """Best of the searches for each target, with its outcome."""
    starts = len(q) // targets if targets else 1
    e, J = task.error(q)
    place, turn = task.missed(e)
    condition = task.conditions(J)
    first = np.repeat(task.seeds[::starts], starts, axis=0)
    # reached before singular before not reached; of equals the nearest to the first seed
    cost = np.where(near, distance(task, q, first), 1e6 + np.linalg.norm(e, axis=1))
    cost = cost + np.where(near & (condition > SINGULAR_CONDITION), 1e3, 0.0)
    if task.position_first:  # an angle of a degree before any distance from the seed
        cost = cost + 1e3 * turn
    pick = np.arange(targets) * starts + cost.reshape(targets, starts).argmin(axis=1)
    outside: Bool = np.any(beyond.reshape(targets, starts), axis=1)
    status: list[InverseStatus] = []
    for k, row in enumerate(pick):
        if near[row]:
            status.append("singular" if condition[row] > SINGULAR_CONDITION else "reached")
        else:
            status.append("limits" if outside[k] else "out of reach")
    return Inverse(
        frozen(q[pick]), frozen(place[pick]), frozen(turn[pick]), tuple(status),
        frozen(condition[pick]),
    )  # fmt: skip
