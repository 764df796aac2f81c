"""Springs in normal equations: columns for products of compliances and moments, and their fit.

The bend of a spring is its compliance times its torque, and the torque is that of the stated
moments plus a part for each free moment and each tilt of the mounting. So bends are linear in one
product for each spring, and one for each spring and free moment or tilt; models of few or many
springs share these columns. The effect of a tilt on a free moment, of third order, is neglected
here and left to the final fit.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.linalg.lapack import dposv

from calib.arrays import Array, Index, frozen
from calib.geometry.joint_errors import JointErrors
from calib.geometry.springs import SprungJoints, across

STEPS = 60
"""Most steps of a fit; trials of one step at smaller lengths are not counted."""
GAIN = 1e-6
"""A fit ends when the next step would lower the loss by less than this."""

Bowl: TypeAlias = Callable[[Array], tuple[Array, Array, Array]]
"""Quadratic model of a loss as in `ModelSprings.bowl`, at numbers in units of their prior sd."""


@dataclass(frozen=True, slots=True, eq=False)
class Products:
    """Places of the columns of the products: for each spring its torque, then moments and tilts."""

    first: int
    """Column of the first product."""
    places: tuple[int, ...] = ()
    """(p,) place of each spring among the 3 n bends."""
    moments: tuple[int, ...] = ()
    """(f,) place of each moment among the 4 n of the links."""
    tilts: int = 0
    """Number of tilts: 2 or 0."""

    def of(self, errors: JointErrors, sd: Array) -> "ModelSprings":
        """The springs of one model, whose numbers have prior sd (s,)."""
        springs = errors.springs
        if springs is None:
            return ModelSprings(np.zeros(0, dtype=np.int64), np.zeros(0), 0, np.zeros(0))
        wide = 1 + len(self.moments) + self.tilts
        at = np.array([self.places.index(place) for place in springs.places])
        own = [1 + self.moments.index(k) for k in np.flatnonzero(springs.free)]
        own += range(wide - self.tilts, wide) if springs.tilts else ()
        columns = self.first + wide * at[:, None] + np.array([0, *own])
        return ModelSprings(columns.ravel(), springs.load, len(own), sd)


class ModelSprings(NamedTuple):
    """The springs of one model, and their columns."""

    columns: Index
    """(p (1 + f),) columns of the products, spring by spring: its torque, then moments and tilts.
    """
    load: Array
    """(p,) reference load, at which the bend of a spring is its number [N m, N]."""
    moments: int
    """Number f of free moments and tilts."""
    sd: Array
    """(p + f,) prior sd of the numbers: bends at these loads, then moments, then tilts."""

    def products(self, x: Array) -> Array:
        """Products (p (1 + f),) at numbers (p + f,) in units of sd."""
        return np.outer(*self.factors(x)).ravel()

    def at(self, x: Array) -> tuple[Array, Array]:
        """Products (p (1 + f),), derivative (p (1 + f), p + f) by the numbers in units of sd."""
        p, f = len(self.load), self.moments
        give, more = self.factors(x)
        slopes = np.zeros((p, 1 + f, p + f))
        slopes[range(p), :, range(p)] = (self.sd[:p] / self.load)[:, None] * more
        slopes[:, range(1, 1 + f), range(p, p + f)] = give[:, None] * self.sd[p:]
        return self.products(x), slopes.reshape(p * (1 + f), p + f)

    def bowl(self, x: Array, normal: Array, pull: Array) -> tuple[Array, Array, Array]:
        """Quadratic model of half the loss at x: Gauss-Newton matrix, second-order term, force.

        D is the derivative of the products y at x. The matrix is D'N D + 1 (p + f, p + f); the
        products' second derivatives add the second-order term (p + f, p + f); the force (p + f,) is
        D'(pull - N y) - x. N is contracted with the compliances and with the moments in turn.
        """
        p, wide = len(self.load), 1 + self.moments
        give, more = self.factors(x)
        by_more = (normal.reshape(-1, wide) @ more).reshape(p, wide, p)
        by_give = (give @ normal.reshape(p, -1)).reshape(wide, p, wide)
        left = pull.reshape(p, wide) - by_more @ give
        gives, weighs = self.sd[:p] / self.load, self.sd[p:]
        H = np.eye(p + self.moments)
        H[:p, :p] += gives[:, None] * (more @ by_more) * gives
        H[p:, p:] += weighs[:, None] * (give @ by_give)[1:, 1:] * weighs
        H[p:, :p] = weighs[:, None] * (by_give @ more)[1:] * gives
        H[:p, p:] = H[p:, :p].T
        bend = np.zeros_like(H)
        bend[p:, :p] = -weighs[:, None] * left[:, 1:].T * gives
        bend[:p, p:] = bend[p:, :p].T
        return H, bend, np.concatenate([gives * (left @ more), weighs * (give @ left)[1:]]) - x

    def factors(self, x: Array) -> tuple[Array, Array]:
        """Compliance (p,) of each spring, and factors (1 + f,) of its loads: 1, moments, tilts."""
        p, more = len(self.load), np.ones(1 + self.moments)
        more[1:] = self.sd[p:] * x[p:]
        return self.sd[:p] * x[:p] / self.load, more


class Bent(NamedTuple):
    """Result of a fit of springs within normal equations."""

    numbers: Array
    """(p + f,) numbers in units of their prior sd."""
    products: Array
    """(p (1 + f),) products of these numbers."""
    slopes: Array
    """(p (1 + f), p + f) derivative of the products by the numbers."""
    inverse: Array
    """(p + f, p + f) inverse of the Gauss-Newton matrix of half the loss."""
    loss: float
    """Change of the loss by the springs, with their prior."""
    spread: float
    """Log determinant of the Gauss-Newton matrix."""


class Lowest(NamedTuple):
    """Minimum of a loss by numbers of springs."""

    numbers: Array
    """(p + f,) numbers in units of their prior sd."""
    curvature: Array
    """(p + f, p + f) Gauss-Newton matrix of half the loss, without second derivatives of products.
    """
    loss: float
    """Change of the loss by the springs, with their prior."""
    spread: float
    """Log determinant of the curvature."""

    @property
    def inverse(self) -> Array:
        """(p + f, p + f) inverse of the curvature."""
        if not len(self.numbers):
            return self.curvature
        return np.asarray(cho_solve(cho_factor(self.curvature), np.eye(len(self.numbers))))


def settled(springs: ModelSprings, normal: Array, pull: Array) -> Bent:
    """Numbers x that minimize y'N y - 2 pull'y + x'x, y their products.

    Parameters
    ----------
    springs : ModelSprings
        Springs of the model.
    normal : (p (1 + f), p (1 + f)) array
        N, after elimination of all linear numbers.
    pull : (p (1 + f),) array
        Right-hand side after the same elimination.
    """

    def loss_at(x: Array) -> float:
        y = springs.products(x)
        return float(y @ (normal @ y) - 2 * pull @ y + x @ x)

    found = lowest(len(springs.sd), loss_at, lambda x: springs.bowl(x, normal, pull))
    x = found.numbers
    return Bent(x, *springs.at(x), found.inverse, found.loss, found.spread)


def lowest(
    count: int,
    loss_at: Callable[[Array], float],
    bowl: Bowl,
    enough: Callable[[Array, float], bool] | None = None,
) -> Lowest:
    """Minimize a loss over `count` numbers of springs, from a start at zero.

    Compliances and moments can replace each other. Along that valley the second derivatives of
    their products matter, but far from its floor they mislead. So of Newton's step and the
    Gauss-Newton step the one that leads lower is taken, halved until the loss falls. The search
    ends early if `enough` is true of the numbers and the predicted drop of the loss.

    The loss can have other minima. Six to twelve further starts, drawn from the prior, found a
    lower one in one fit of nine for a measured UR10 (nine sets of 100 poses) and in one of twenty
    for 22 virtual arms of three kinds, mostly for levels that the evidence rejects. One choice of
    31 changed, to a model with 1 % larger errors at held-out poses.
    """
    x, share, loss = np.zeros(count), 1.0, 0.0
    if not count:
        return Lowest(x, np.eye(0), loss, 0.0)
    H, bend, force = bowl(x)
    for _ in range(STEPS):
        steps = newton_steps(H, bend, force)
        promised = float(steps[0] @ force)
        if promised < GAIN or (enough is not None and enough(x, promised)):
            break
        while share > GAIN:
            new, k = min((loss_at(x + share * step), k) for k, step in enumerate(steps))
            if new < loss:
                break
            share /= 2
        else:
            break
        x, loss, share = x + share * steps[k], new, min(1.0, 2 * share)
        H, bend, force = bowl(x)
    return Lowest(x, H, loss, float(np.linalg.slogdet(H)[1]))


def newton_steps(H: Array, bend: Array, force: Array) -> list[Array]:
    """Newton's step (k,) if it leads to a minimum, and the Gauss-Newton step, without `bend`."""
    plain = np.asarray(dposv(H, force)[1])
    _, step, flaw = dposv(H + bend, force)
    return [plain] if flaw else [np.asarray(step), plain]


def products_of(
    springs: Sequence[SprungJoints], q: Array, first: int, payload: Array | None = None
) -> tuple[Products, Array]:
    """Columns of the products of all springs, and the loads (m, p, 1 + f) of the springs.

    All springs belong to the same arm. Loads are torques of the rigid arm at joint values q (m, n)
    [N m, or N along a slide], of the stated moments and then per free moment [1/kg, 1/(kg m)] and
    per tilt [1/rad]. `payload` (m, 4) has that of each pose if the rows state it [kg, kg m].
    """
    if not springs:
        return Products(first), np.zeros((len(q), 0, 1))
    n = springs[0].weight.chain.n_joints
    places = tuple(sorted({int(place) for one in springs for place in one.places}))
    free = np.any([one.free for one in springs], axis=0)
    joint, axis = np.divmod(np.array(places), 3)
    wide = SprungJoints(springs[0].weight, joint, axis, np.ones(len(places)), free)
    q = frozen(q).reshape(-1, n)
    stated, per_moment = wide.torques(q, payload)
    parts = [stated[:, :, None], per_moment]
    if tilts := 2 * any(one.tilts for one in springs):
        weight = wide.weight
        for axis_of in across(weight.gravity):  # torques are linear in gravity
            turned = replace(weight, gravity=np.cross(axis_of, weight.gravity))
            parts.append(replace(wide, weight=turned).torques(q, payload)[0][:, :, None])
    moments = tuple(np.flatnonzero(free).tolist())
    return Products(first, places, moments, tilts), np.concatenate(parts, axis=2)
