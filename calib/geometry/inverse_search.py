"""The search behind `inverse_kinematics`: damped Newton from many postures, with or without limits.

The error of a posture is e = [p_T - p (m); L Log(R_T R') (m)] with the characteristic length L. Its
exact derivative by the joints is -[Jp; L Jr^-1(e_r) Jw] (1 + d dq/dq), so steps converge
quadratically, and the search for a target out of reach ends at the nearest pose. Where the position
comes first, L is so small that angles take nothing from it.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.geometry.bodies import Z
from calib.geometry.frames import log_so3, right_jacobian_inverse
from calib.geometry.jacobian import bent_pose_and_jacobian, joint_columns, pose_and_jacobian
from calib.geometry.joint_errors import JointErrors
from calib.geometry.model import RobotModel
from calib.geometry.operating import AS_USUAL, OperatingConditions
from calib.geometry.parameters import CHARACTERISTIC_LENGTH as L

ARRIVED = 1e-9
"""Distance [m] and angle [rad] within which a tool has reached its target."""
LAST = 1e-4
"""Factor on L where the position comes first: its square times the angle that remains (0.1 rad at
a lever of 1 m) stays below `ARRIVED`."""
DONE = 1e-15
"""Error at which a search ends, having nothing left to improve [m]."""
STILL = 1e-7
"""A search ends when the linear model predicts that a step lowers e'e by less than this part."""
ITERATIONS = 150
ENDED = 1e-13
"""Step below which the pull toward the seed has ended, in scaled joints."""
LONGEST = 0.5
"""Longest step of any joint in one iteration [rad, or that times 0.3 m]: far starts do not jump."""
NUDGES = (0.1, -0.1)
"""Offset from its seed at which a failed search begins again [rad, or that times 0.3 m]."""
EQUALS = 1e-6
"""Weight of whole turns in a distance, which only decides between postures otherwise equal."""
DAMPING = (1e-9, 1e-6, 1e3)
"""Levenberg damping [m^2 per scaled joint squared]: below the first it is set to zero, the second
is the least after a step that failed, and above the third the search ends."""


def joint_jacobian(
    model: RobotModel, q: Array, at: OperatingConditions = AS_USUAL
) -> tuple[Array, Array]:
    """Poses (m, 4, 4) and their exact derivative by the commanded joints (m, 6, n).

    Rows are [dp (m); dr (rad)] in world axes; joint errors that depend on the joints are included.
    """
    errors = model.joint_errors
    growth = errors.growth(at)
    if errors.springs:
        T, J = bent_pose_and_jacobian(model.chain, q, errors.bends(q, at), growth)
        bent, springs = J[:, :, model.chain.n_numbers :], errors.springs
        give = bent[:, :, springs.places] @ springs.slopes_by_joint(
            q, errors.of_springs, at.moments
        )
        J = bent[:, :, Z::3]
        return T, J + J @ _error_slopes(errors, q) + give
    T, J = pose_and_jacobian(model.chain, q + errors.offsets(q, at), growth)
    J = J[:, :, joint_columns(model.chain)]
    return T, J + J @ _error_slopes(errors, q) if errors.terms else J


def _error_slopes(errors: JointErrors, q: Array) -> Array:
    """Derivative (m, n, n) of the joint offsets dq by the joint values q, of all wave terms."""
    weights = np.array([term.weights for term in errors.terms], dtype=np.float64)
    weights = weights.reshape(-1, q.shape[1])
    cosine = np.array([term.wave == "cos" for term in errors.terms], dtype=np.bool_)
    phase = q @ weights.T
    slope = np.where(cosine, -np.sin(phase), np.cos(phase)) * errors.coefficients[: len(cosine)]
    out = np.zeros((len(q), q.shape[1], q.shape[1]))
    for k, term in enumerate(errors.terms):
        if term.is_wave:
            out[:, term.joint] += slope[:, k, None] * weights[k]
    return out


@dataclass(frozen=True, slots=True, eq=False)
class PoseSearch:
    """Targets T (s, 4, 4) and seeds (s, n), one per search, with what all searches share."""

    model: RobotModel
    T: Array
    seeds: Array
    limits: Array
    at: OperatingConditions = AS_USUAL
    whole_turns: bool = True
    position_first: bool = False
    """Whether reaching the position is enough, the angle then being as small as it can be."""

    def rows(self, which: Index) -> "PoseSearch":
        """Some of the searches."""
        some = self.T[which], self.seeds[which], self.limits, self.at.rows(which)
        return PoseSearch(self.model, *some, self.whole_turns, self.position_first)

    @property
    def lever(self) -> float:
        """Length that multiplies angles in an error [m]."""
        return LAST * L if self.position_first else L

    @property
    def unit(self) -> Array:
        """(n,) joint step that is one scaled unit: 1 m, or 1/L rad."""
        return np.where(self.model.chain.prismatic, 1.0, 1 / L)

    def error(self, q: Array) -> tuple[Array, Array]:
        """Scaled errors (s, 6) [m], and minus their derivative (s, 6, n) by the scaled joints."""
        here, J = joint_jacobian(self.model, q, self.at)
        turn = log_so3(self.T[:, :3, :3] @ np.swapaxes(here[:, :3, :3], 1, 2))
        lever = self.lever
        J = np.concatenate([J[:, :3], lever * right_jacobian_inverse(turn) @ J[:, 3:]], axis=1)
        return np.hstack([self.T[:, :3, 3] - here[:, :3, 3], lever * turn]), J * self.unit

    def missed(self, e: Array) -> tuple[Array, Array]:
        """Distances (s,) [m] and angles (s,) [rad] of scaled errors (s, 6)."""
        return np.linalg.norm(e[:, :3], axis=1), np.linalg.norm(e[:, 3:], axis=1) / self.lever

    def near(self, e: Array) -> Bool:
        """Whether scaled errors (s, 6) count as none."""
        place, turn = self.missed(e)
        near = (place <= ARRIVED) & (self.position_first | (turn <= ARRIVED))
        return np.asarray(near, dtype=np.bool_)

    def conditions(self, J: Array) -> Array:
        """Condition number (s,) of derivatives (s, 6, n) of `error`, rescaled to angles times L."""
        scale = np.repeat([1.0, L / self.lever], 3)[:, None]
        s = np.linalg.svd(J * scale, compute_uv=False)
        return np.asarray(s[:, 0] / np.maximum(s[:, -1], 1e-16 * s[:, 0]))


def search(task: PoseSearch, q: Array, *, bounded: bool) -> tuple[Array, Bool]:
    """Damped Newton from postures q (s, n): where each search ends, and whether at its target."""
    q = q.copy()
    lower, upper = task.limits.T if bounded else (np.full(q.shape[1], s * np.inf) for s in (-1, 1))
    e, J = task.error(q)
    cost, damping = (e**2).sum(axis=1), np.zeros(len(q))
    active = np.flatnonzero(cost > DONE**2)
    least, first, most = DAMPING
    for _ in range(ITERATIONS):
        if not len(active):
            break
        # trial step
        scaled = _step(J[active], e[active], q[active], damping[active], (lower, upper))
        new = np.clip(q[active] + scaled * task.unit, lower, upper)
        e_new, J_new = task.rows(active).error(new)
        cost_new, old = (e_new**2).sum(axis=1), cost[active]
        # gain ratio: cost saved over what the linear model promised
        moved = (J[active] @ ((new - q[active]) / task.unit)[:, :, None])[..., 0]
        hoped = old - ((e[active] - moved) ** 2).sum(axis=1)
        good = cost_new < old
        gain = np.where(good, (old - cost_new) / np.maximum(hoped, 1e-300), -1.0)
        # accept, then trust more or less
        at = active[good]
        q[at], e[at], J[at], cost[at] = new[good], e_new[good], J_new[good], cost_new[good]
        factor = np.where(gain > 0.75, 0.2, np.where(gain > 0.25, 1.0, 4.0))
        after = damping[active] * factor
        after = np.where(good, np.where(after < least, 0.0, after), np.maximum(after, first))
        damping[active] = after
        # ended: arrived, nothing is left to gain, or rounding and damping leave no step
        end = (cost[active] <= DONE**2) | (hoped < STILL * old) | (after > most)
        end |= ~good & (old < (10 * DONE) ** 2)
        active = active[~end]
    return q, task.near(e)


def _step(J: Array, e: Array, q: Array, damping: Array, bounds: tuple[Array, Array]) -> Array:
    """Shortest damped step (s, n) in scaled joints that removes the errors (s, 6).

    Joints at a limit that the step would cross are held, and the step is taken with the others.
    """
    lower, upper = bounds
    held = np.zeros(q.shape, dtype=bool)
    for _ in range(q.shape[1] + 1):
        step = _damped_step(np.where(held[:, None, :], 0.0, J), e, damping)
        out = ((q <= lower) & (step < 0)) | ((q >= upper) & (step > 0))
        if not (out & ~held).any():
            break
        held |= out
    size = np.abs(step).max(axis=1, keepdims=True) / L
    return np.asarray(step * np.minimum(1.0, LONGEST / np.maximum(size, 1e-300)))


def _damped_step(J: Array, e: Array, damping: Array) -> Array:
    """Pseudo-inverse steps V diag(s / (s^2 + damping)) U' e, (s, n)."""
    U, s, Vt = np.linalg.svd(J, full_matrices=False)
    square = s**2 + damping[:, None]
    # singular directions carry no undamped step
    sound = s > 1e-12 * s[:, :1]
    gain = np.where(sound, s / np.where(sound, square, 1.0), 0.0)
    along = gain * (np.swapaxes(U, 1, 2) @ e[:, :, None])[..., 0]
    return np.asarray((np.swapaxes(Vt, 1, 2) @ along[:, :, None])[..., 0])


def retry(task: PoseSearch, q: Array, near: Bool, nudge: float) -> tuple[Array, Bool]:
    """Search again from seeds shifted by `nudge` where a search failed, as at a singular seed."""
    lost = np.flatnonzero(~near)
    if not len(lost):
        return q, near
    some, q, near = task.rows(lost), q.copy(), near.copy()
    aside = nudge * L * task.unit * (-1.0) ** np.arange(q.shape[1])
    start = np.clip(into_limits(some, some.seeds) + aside, *task.limits.T)
    there, arrived = search(some, start, bounded=True)
    q[lost[arrived]], near[lost[arrived]] = there[arrived], True
    return q, near


def pull_to_seeds(task: PoseSearch, q: Array, near: Bool) -> tuple[Array, Bool]:
    """Move postures that reach their targets toward their seeds, in the null space of the task."""
    rows = np.flatnonzero(near)
    if not len(rows):
        return q, near
    some, out = task.rows(rows), q.copy()
    x = q[rows]
    seeds = unwound(some, x, some.seeds)
    active = np.arange(len(x))
    for _ in range(ITERATIONS):
        if not len(active):
            break
        # toward the seed in the null space, and back onto the target
        e, J = some.rows(active).error(x[active])
        away, nothing = (seeds[active] - x[active]) / task.unit, np.zeros(len(active))
        step = away - _damped_step(J, (J @ away[:, :, None])[..., 0] - e, nothing)
        size = np.abs(step).max(axis=1)
        x[active] += step * np.minimum(1.0, 0.2 * L / np.maximum(size, 1e-300))[:, None] * task.unit
        active = active[size >= ENDED]
    # accepted where it still reaches, inside the limits, and is no farther from the seed
    better = some.near(some.error(x)[0]) & inside(x, task.limits)
    better &= distance(task, x, some.seeds) <= distance(task, q[rows], some.seeds)
    out[rows[better]] = x[better]
    return out, near


def inside(q: Array, limits: Array) -> Bool:
    """Whether postures (s, n) are inside the limits (n, 2)."""
    return np.asarray(((q >= limits[:, 0]) & (q <= limits[:, 1])).all(axis=1), dtype=np.bool_)


def distance(task: PoseSearch, q: Array, seeds: Array) -> Array:
    """Distance (s,) of postures (s, n) from their seeds, in scaled joints.

    For a seed beyond its limits whole turns count by `EQUALS` alone.
    """
    turned = np.linalg.norm((q - seeds) / task.unit, axis=1)
    near = np.linalg.norm((q - unwound(task, q, seeds)) / task.unit, axis=1)
    return np.asarray(np.where(near < turned, near + EQUALS * turned, turned))


def unwound(task: PoseSearch, q: Array, seeds: Array) -> Array:
    """Seeds (s, n); joints seeded beyond limits are moved by whole turns nearest to q (s, n)."""
    lower, upper = task.limits.T
    may = task.whole_turns * (task.model.chain.prismatic == 0)
    beyond = may * ((seeds < lower) | (seeds > upper))
    return np.asarray(seeds + beyond * 2 * np.pi * np.round((q - seeds) / (2 * np.pi)))


def whole_turns_into_limits(task: PoseSearch, q: Array) -> Array:
    """Postures (s, n) with revolute joints moved by whole turns into their limits if possible."""
    lower, upper = task.limits.T
    turns = 2 * np.pi * (1 - task.model.chain.prismatic)
    safe = np.where(turns > 0, turns, 1.0)
    up, down = np.ceil((lower - q) / safe), np.ceil((q - upper) / safe)
    return np.asarray(q + turns * (np.maximum(up, 0) - np.maximum(down, 0)))


def into_limits(task: PoseSearch, q: Array) -> Array:
    """Seeds (s, n) moved inside the limits: by whole turns if allowed, then to the nearest one."""
    lower, upper = task.limits.T
    if not task.whole_turns:
        return np.asarray(np.clip(q, lower, upper))
    turned = whole_turns_into_limits(task, q)
    lost = ((turned < lower) | (turned > upper)) & (task.model.chain.prismatic == 0)
    # the nearest limit is found regardless of whole turns
    over, under = (q - upper) % (2 * np.pi), (lower - q) % (2 * np.pi)
    nearest = np.where(over < under, upper, lower)
    return np.asarray(np.where(lost, nearest, np.clip(turned, lower, upper)))


def turned_back(task: PoseSearch, q: Array) -> Bool:
    """Whether postures (s, n) have a joint over half a turn from its seed beyond the limits."""
    lower, upper = task.limits.T
    outside = (task.seeds < lower) | (task.seeds > upper)
    far = (np.abs(q - task.seeds) > np.pi) & (task.model.chain.prismatic == 0)
    return np.asarray((outside & far).any(axis=1), dtype=np.bool_)


def joint_condition(model: RobotModel, q: Array, at: OperatingConditions = AS_USUAL) -> Array:
    """Condition number (m,) of the joint Jacobian; angles of tool and joints count times 0.3 m."""
    task = PoseSearch(model, model.poses(q, at), q, np.zeros((q.shape[1], 2)), at)
    return task.conditions(task.error(q)[1])
