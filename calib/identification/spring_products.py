"""Springs within normal equations: columns of products of compliances and moments, and their fit.

The bend of a spring is its compliance times its torque, and the torque is that of the stated
moments plus what each free moment adds, and each tilt of the mounting. So bends are linear in one
product for each spring, and one for each spring and free moment or tilt; models of few or many
springs share these columns. What a tilt makes of a moment that is added is left to the fit itself.
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
"""Most steps of a fit, halved ones counted."""
GAIN = 1e-6
"""A step that promises less than this of the loss is the last one."""

Bowl: TypeAlias = Callable[[Array], tuple[Array, Array, Array]]
"""A loss as in `ModelSprings.bowl`, at numbers in units of their prior sd."""


@dataclass(frozen=True, slots=True, eq=False)
class Products:
    """Where the columns of the products stand: for each spring its torque, moments and tilts."""

    first: int
    """Column of the first one."""
    places: tuple[int, ...] = ()
    """(p,) place of each spring among the 3 n bends."""
    moments: tuple[int, ...] = ()
    """(f,) place of each moment among the 4 n of the links."""
    tilts: int = 0
    """Two, or none."""

    def of(self, errors: JointErrors, sd: Array) -> "ModelSprings":
        """Those of one model whose springs' numbers have some prior sd (s,)."""
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
    """The springs of one model among the columns."""

    columns: Index
    """(p (1 + f),) spring by spring: its torque, then its moments and tilts."""
    load: Array
    """(p,) at which the bend of a spring is its number [N m, N]."""
    moments: int
    """Free moments and tilts f."""
    sd: Array
    """(p + f,) prior sd of the numbers: bends at these loads, then moments, then tilts."""

    def products(self, x: Array) -> Array:
        """(p (1 + f),) at numbers in units of sd."""
        return np.outer(*self.factors(x)).ravel()

    def at(self, x: Array) -> tuple[Array, Array]:
        """Products (p (1 + f),) and their slopes (p (1 + f), p + f) at numbers in units of sd."""
        p, f = len(self.load), self.moments
        give, more = self.factors(x)
        slopes = np.zeros((p, 1 + f, p + f))
        slopes[range(p), :, range(p)] = (self.sd[:p] / self.load)[:, None] * more
        slopes[:, range(1, 1 + f), range(p, p + f)] = give[:, None] * self.sd[p:]
        return self.products(x), slopes.reshape(p * (1 + f), p + f)

    def bowl(self, x: Array, normal: Array, pull: Array) -> tuple[Array, Array, Array]:
        """D'N D + 1 (p + f, p + f) at x, what products of two numbers add to it, and the force.

        D are the slopes there, the force D'(pull - N y) - x (p + f,). A product is what gives times
        what weighs, so N is contracted with one of them at a time.
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
        """What each spring gives (p,), and what weighs on all (1 + f,)."""
        p, more = len(self.load), np.ones(1 + self.moments)
        more[1:] = self.sd[p:] * x[p:]
        return self.sd[:p] * x[:p] / self.load, more


class Bent(NamedTuple):
    """Springs where their fit ended."""

    numbers: Array
    """(p + f,) in units of their prior sd."""
    products: Array
    """(p (1 + f),)."""
    slopes: Array
    """(p (1 + f), p + f) of the products by the numbers."""
    inverse: Array
    """(p + f, p + f) of the second derivative of half the loss."""
    loss: float
    """What the springs change of the loss, their prior included."""
    spread: float
    """Log determinant of that second derivative."""


class Lowest(NamedTuple):
    """Where a fit of springs ended."""

    numbers: Array
    """(p + f,) in units of their prior sd."""
    curvature: Array
    """(p + f, p + f) of half the loss, without what products of two numbers add to it."""
    loss: float
    """What the springs change of the loss, their prior included."""
    spread: float
    """Log determinant of the curvature."""

    @property
    def inverse(self) -> Array:
        """(p + f, p + f) of the curvature."""
        if not len(self.numbers):
            return self.curvature
        return np.asarray(cho_solve(cho_factor(self.curvature), np.eye(len(self.numbers))))


def settled(springs: ModelSprings, normal: Array, pull: Array) -> Bent:
    """Numbers x that minimize y'N y - 2 pull'y + x'x, y their products.

    Parameters
    ----------
    springs : ModelSprings
        Of the model.
    normal : (p (1 + f), p (1 + f)) array
        N, where all linear numbers follow the products.
    pull : (p (1 + f),) array
        Likewise.
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
    """So many numbers of springs where a loss is lowest, searched from zero.

    What gives and what weighs can stand for each other: along that valley the second derivative of
    their products counts, far from its floor it misleads. Of the steps with and without it the one
    is taken that leads lower, halved until it does.

    There are other minima. Six to twelve further starts, drawn from the prior, found a lower one
    in one fit of nine for a measured UR10 (nine sets of 100 poses) and of twenty for virtual arms
    (22 of three kinds), most of levels that the evidence leaves behind. One choice of 31 changed by
    it, for one that missed held-out poses by a hundredth more.
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
    """Newton's step (k,) where that has a minimum, and the one without the bend of the products."""
    plain = np.asarray(dposv(H, force)[1])
    _, step, flaw = dposv(H + bend, force)
    return [plain] if flaw else [np.asarray(step), plain]


def products_of(
    springs: Sequence[SprungJoints], q: Array, first: int, payload: Array | None = None
) -> tuple[Products, Array]:
    """Columns of the products of all springs, and what multiplies their bends (m, p, 1 + f).

    The springs are loaded by the same arm; it is weighed as it stands stiff at joints q (m, n),
    with a payload of each pose (m, 4) if rows state it [kg, kg m].
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
