"""Joint springs: how far gravity bends an arm, and the derivatives by compliances and moments."""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from calib.arrays import LATER, Array, Bool, Index, check, frozen, whole_numbers, wrong_shape
from calib.errors import refuse
from calib.geometry.chain import BATCH
from calib.geometry.frames import exp_so3
from calib.geometry.gravity import AXES, MOMENTS, Weight, gravity_regressor, torque_slopes
from calib.shown import Shown

UNSAID = 2.0
"""Payload that may hang on the flange without being stated [kg]."""


class _Loaded(NamedTuple):
    """The numbers of springs, taken apart."""

    give: Array
    """(p,) bend of each spring at its reference load [rad, m]."""
    moments: Array
    """(n + 1, 4) of links and payload, or (m, n + 1, 4) where each pose has its own [kg, kg m]."""
    gravity: Array
    """(3,) in the frame of the base [m/s^2]."""
    by_tilt: Array
    """(2, 3) derivative of `gravity` by the two tilts if these are numbers, else (0, 3)
    [m/s^2/rad]."""

    def rows(self, part: slice) -> "_Loaded":
        """The same for a slice of the poses."""
        return self if self.moments.ndim == 2 else self._replace(moments=self.moments[part])

    def load(self, shares: Array) -> Array:
        """Loads (m, p) of the springs, in units of `SprungJoints.load`, from `shares`."""
        if self.moments.ndim == 2:
            return np.asarray(shares @ self.moments.ravel())
        return np.asarray((shares @ self.moments.reshape(len(self.moments), -1, 1))[..., 0])


@dataclass(frozen=True, slots=True, eq=False)
class SprungJoints(Shown):
    """Linear springs about chosen axes of chosen joints, loaded by gravity.

    Each spring has one number, its bend at the reference load `load` [rad, or m along a slide]: at
    a torque tau the bend is number * tau / load, so that number / load is the compliance. Moments
    of the links may be numbers too; measurements tell only their products with the compliances. So
    may the mounting: two rotations of gravity about axes perpendicular to it, x and y of the base
    of an upright arm.
    """

    weight: Weight
    """What loads the springs, on nominal links."""
    joint: Annotated[Index, "p"]
    """(p,) joint of each spring, 0-based."""
    axis: Annotated[Index, "p"]
    """(p,) axis of each spring: 0, 1, 2 for x, y, z of `bodies`."""
    load: Annotated[Array, "p"]
    """(p,) reference load: there the bend of a spring is its number [N m, or N along a slide]."""
    free: Annotated[Bool, "n", 4]
    """(n, 4) which moments are numbers: the number is added to that of `weight` [kg, kg m]."""
    passes: int = 1
    """1: loads of the rigid arm; each further pass takes the loads of the arm as bent so far."""
    tilts: bool = False
    """Whether two tilts of gravity from the direction in `weight` are numbers too [rad]."""
    bearings: Annotated[float, LATER] = 1.0
    """Prior sd of bends about x and y, in units of the usual one (`information.sizes`)."""
    unsaid: Annotated[float, LATER] = UNSAID
    """Unstated payload that the prior of the free moments allows for [kg]."""

    def __post_init__(self) -> None:
        n = self.weight.chain.n_joints
        (load,) = check("p", load=self.load)
        for name, most in (("joint", n), ("axis", 3)):
            places = whole_numbers(name, getattr(self, name))
            if places.shape != load.shape:
                raise wrong_shape(name, places.shape, f"one per load, {len(load)}")
            if ((places < 0) | (places >= most)).any():
                message, wanted = f"{name} is {places.tolist()}", f"each 0 to {most - 1}"
                raise refuse(name, places.tolist(), wanted, code="A3", message=message)
            object.__setattr__(self, name, places)
        if len(np.unique(self.places)) < len(load):
            message, fix = "a joint has two springs about one axis", "leave one of them out"
            raise refuse("axis", code="A3", message=message, fix=fix)
        free = frozen(self.free, np.bool_)
        if free.shape != (n, 4):
            raise wrong_shape("free", free.shape, f"expected ({n}, 4)")
        if not (load > 0).all():
            message, fix = "load must be positive", "leave out springs that nothing loads"
            raise refuse("load", load.tolist(), code="A3", message=message, fix=fix)
        if self.passes < 1:
            message = f"passes is {self.passes}"
            raise refuse("passes", self.passes, "1 or more", code="A3", message=message)
        object.__setattr__(self, "load", load)
        object.__setattr__(self, "free", free)

    def __repr__(self) -> str:
        return f"SprungJoints({len(self.load)} springs, {self.free.sum()} free moments)"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the s numbers: ``spring2.z`` ..., ``moment6.m`` ..., ``tilt1``, ``tilt2``."""
        springs = zip(self.joint, self.axis, strict=True)
        return (
            *(f"spring{joint + 1}.{AXES[axis]}" for joint, axis in springs),
            *(f"moment{i + 1}.{MOMENTS[k]}" for i, k in np.argwhere(self.free)),
            *(("tilt1", "tilt2") if self.tilts else ()),
        )

    @property
    def is_length(self) -> tuple[bool, ...]:
        """(s,) whether a number is a length [m]; else an angle [rad] or a moment [kg, kg m]."""
        along = (self.weight.chain.prismatic[self.joint] > 0) & (self.axis == 2)
        return (*along.tolist(), *(False,) * (int(self.free.sum()) + 2 * self.tilts))

    @property
    def places(self) -> Index:
        """(p,) index of each spring among the 3 n bends, joint by joint."""
        return 3 * self.joint + self.axis

    @property
    def kind(self) -> tuple[object, ...]:
        """Key that is equal for springs which the same numbers bend alike."""
        weight = self.weight
        parts = (
            *(weight.chain.links, weight.chain.prismatic, weight.moments, weight.payload),
            *(weight.gravity, self.joint, self.axis, self.load, self.free),
        )
        return self.passes, self.tilts, *(part.tobytes() for part in parts)

    def bends(self, q: Array, numbers: Array, payload: Array | None = None) -> Array:
        """Static bends (m, n, 3) [rad, m] of the arm at checked joint values q (m, n) [rad, m].

        `numbers` (s,) are those of `names`; `payload` (m, 4) gives each pose one of its own in
        place of that of `weight` [kg, kg m].
        """
        whole = self._loaded(numbers, payload)
        bends = np.zeros((*q.shape, 3))
        for start in range(0, len(q), BATCH):
            part = slice(start, start + BATCH)
            at = whole.rows(part)
            for turn in range(self.passes):
                shares = self.shares(q[part], at.gravity, bends[part] if turn else None)
                bends[part] = self._spread(at.give * at.load(shares))
        return bends

    def bends_and_slopes(
        self, q: Array, numbers: Array, payload: Array | None = None
    ) -> tuple[Array, Array]:
        """Bends (m, n, 3), and the derivative (m, p, s) of the p springs' bends by all s numbers.

        Exact for any number of passes: the bends of one pass change the loads of the next.
        """
        at = self._loaded(numbers, payload)
        p, f = len(at.give), int(self.free.sum())
        give, free = at.give[:, None], np.append(self.free.ravel(), [False] * 4)
        bends, slopes = np.zeros((*q.shape, 3)), np.zeros((len(q), p, len(numbers)))
        for turn in range(self.passes):
            bent = bends if turn else None
            if turn:
                slopes = give * (self._stiffness(q, at, bends)[:, :, self.places] @ slopes)
            shares = self.shares(q, at.gravity, bent)
            load = at.load(shares)
            slopes[:, range(p), range(p)] += load
            slopes[:, :, p : p + f] += give * shares[:, :, free]
            for k, change in enumerate(at.by_tilt, start=p + f):
                # torques are linear in gravity
                slopes[:, :, k] += at.give * at.load(self.shares(q, change, bent))
            bends = self._spread(at.give * load)
        return bends, slopes

    def bends_of_many(self, q: Array, numbers: Array) -> Array:
        """Bends (M, m, p) of the springs at joints q (m, n) for M sets of numbers (M, s)."""
        if self.passes > 1 or self.tilts:
            every = np.array([self.bends(q, own) for own in numbers])
            return every[:, :, self.joint, self.axis]
        p = len(self.load)
        stated, per_moment = self.torques(q)
        loads = stated + np.moveaxis(per_moment @ numbers[:, p:].T, -1, 0)
        return np.asarray(loads * (numbers[:, :p] / self.load)[:, None])

    def torques(self, q: Array, payload: Array | None = None) -> tuple[Array, Array]:
        """Torques (m, p) of the stated moments on the rigid arm's springs, and per free moment.

        The torques are in N m, or N along a slide; the second array (m, p, f) is their derivative
        by each free moment [per kg, per kg m].
        """
        at = self._loaded(np.zeros(len(self.names)), payload)
        G = gravity_regressor(self.weight.chain, q, gravity=self.weight.gravity)
        own = G[:, self.joint, self.axis].reshape(len(q), len(self.load), -1)
        return at.load(own), own[:, :, np.flatnonzero(self.free)]

    def slopes_by_joint(self, q: Array, numbers: Array, payload: Array | None = None) -> Array:
        """Derivative (m, p, n) of the springs' bends by the joint values."""
        at, bends = self._loaded(numbers, payload), np.zeros((*q.shape, 3))
        slopes = np.zeros((len(q), len(at.give), q.shape[1]))
        for _ in range(self.passes):
            K = self._stiffness(q, at, bends)
            slopes = at.give[:, None] * (K[:, :, 2::3] + K[:, :, self.places] @ slopes)
            shares = self.shares(q, at.gravity, bends)
            bends = self._spread(at.give * at.load(shares))
        return slopes

    def _loaded(self, numbers: Array, payload: Array | None = None) -> "_Loaded":
        """Bends, moments and gravity that the numbers (s,) stand for."""
        p, f = len(self.load), int(self.free.sum())
        moments = np.vstack([self.weight.moments, self.weight.payload])
        moments[:-1][self.free] += numbers[p : p + f]
        if payload is not None:
            moments = np.tile(moments, (len(payload), 1, 1))
            moments[:, -1] = payload
        gravity, by_tilt = self.weight.gravity, np.zeros((0, 3))
        if self.tilts:
            gravity, by_tilt = tilted(gravity, numbers[p + f :])
        return _Loaded(numbers[:p], moments, gravity, by_tilt)

    def shares(self, q: Array, gravity: Array, bends: Array | None) -> Array:
        """Load (m, p, 4 n + 4) of each spring per unit moment, in units of `load` [1/kg, 1/(kg m)].

        Gravity is (3,) in the frame of the base [m/s^2], `bends` (m, n, 3) as in `bodies`.
        """
        return self.shares_by(gravity_regressor(self.weight.chain, q, gravity=gravity, bends=bends))

    def shares_by(self, G: Array) -> Array:
        """The same from the regressor G (m, n, 3, n + 1, 4) of `gravity_regressor`."""
        m, n, axes, bodies, moments = G.shape
        own = G.reshape(m, n, axes, bodies * moments)[:, self.joint, self.axis]
        return np.asarray(own / self.load[:, None])

    def _stiffness(self, q: Array, at: "_Loaded", bends: Array) -> Array:
        """Derivative (m, p, 3 n) of the springs' loads, in units of `load`, by all bends."""
        K = torque_slopes(self.weight.chain, q, at.moments, gravity=at.gravity, bends=bends)
        return np.asarray(K[:, self.places] / self.load[:, None])

    def _spread(self, bent: Array) -> Array:
        """Bends (m, n, 3) of all joints from those of the springs (m, p)."""
        out = np.zeros((len(bent), self.weight.chain.n_joints, 3))
        out[:, self.joint, self.axis] = bent
        return out


def tilted(gravity: Array, tilts: Array) -> tuple[Array, Array]:
    """Gravity (..., 3) [m/s^2] after tilts (..., 2) [rad], and its derivative (..., 2, 3)."""
    u, v = across(gravity)
    first, second = exp_so3(tilts[..., :1] * u), exp_so3(tilts[..., 1:] * v)
    turned = first @ second @ gravity
    after = (first @ np.cross(v, second @ gravity)[..., None])[..., 0]
    return turned, np.stack([np.cross(u, turned), after], axis=-2)


def across(gravity: Array) -> Array:
    """Two unit axes (2, 3) perpendicular to gravity; x and y of the base if it points along -z."""
    down = gravity / np.linalg.norm(gravity) if gravity.any() else np.array([0.0, 0.0, -1.0])
    one = np.eye(3)[np.abs(down).argmin()]
    one = one - down * (down @ one)
    one = one / np.linalg.norm(one)
    return np.array([one, np.cross(one, down)])
