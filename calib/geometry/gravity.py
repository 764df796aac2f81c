"""Gravity torques about three axes of every joint of a serial arm, linear in its mass parameters.

The mass parameters of a body, here its moments, are its mass and its first moments (mass times
center of mass) in its own frame; the last body is the payload, in the flange frame. Gravity is
given in the frame of the base, so that it depends on the mounting and not on the tracker's frame.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, check
from calib.errors import refuse
from calib.geometry.bodies import X, Y, Z, bodies
from calib.geometry.chain import BATCH, Chain, joint_vectors

Axis = Literal["x", "y", "z"]
AXES: tuple[Axis, ...] = ("x", "y", "z")
"""Axes of a body; its joint turns about z, and bends about all three."""
DOWN = (0.0, 0.0, -9.81)
"""Gravity in the frame of the base of an arm that stands upright [m/s^2]."""
MOMENTS = ("m", "hx", "hy", "hz")
"""Order of the four numbers of a body: mass [kg] and first moments [kg m]."""
GUESSED = 10.0
"""Assumed mass of a link of unknown mass, per meter of reach beyond its joint [kg/m]. Only ratios
matter: a factor common to all masses is absorbed by the compliances."""
LEAST = 0.05
"""What every link adds to that reach beside its own length [m]."""


def gravity_regressor(
    chain: Chain, q: ArrayLike, *, gravity: ArrayLike = DOWN, bends: Array | None = None
) -> Array:
    """Regressor G (m, n, 3, n + 1, 4) of the torques that gravity exerts: tau = G pi.

    Body j loads every joint i <= j. About the unit axis a (x, y or z) of joint i,
    tau = a . ([m_j (o_j - o_i) + R_j h_j] x g); along the axis z of a prismatic joint gravity
    exerts the force m_j a . g instead.

    Parameters
    ----------
    chain : Chain
        Geometry of the arm; the pose of its base and its tool play no part.
    q : (m, n) array_like
        Joint values [rad, m].
    gravity : (3,) array_like
        Acceleration of gravity in the frame of the base [m/s^2].
    bends : (m, n, 3) array, optional
        Bends of the arm at which the torques are taken, as in `bodies` [rad, m].

    Returns
    -------
    (m, n, 3, n + 1, 4) array
        By pose, joint, axis, body and moment: torque [N m], or force of a prismatic joint [N], per
        kg of mass and per kg m of first moment.

    Examples
    --------
    >>> level = Chain([[0, 0, 0, np.pi / 2, 0], [0, 0, 0.5, 0, 0]])
    >>> G = gravity_regressor(level, [[0.0, 0.0]])
    >>> (G[0, 1, 2, 2, 0] + 0.0).round(3).item()  # a kilogram half a meter ahead of joint 2
    -4.905
    """
    q = joint_vectors(chain, q)
    (gravity,) = check("3", gravity=gravity)
    m, n = q.shape
    down, slides = chain.T_world_base[:3, :3] @ gravity, np.flatnonzero(chain.prismatic)
    beyond = np.arange(n + 1) >= np.arange(n)[:, None]
    out = np.empty((m, n, 3, n + 1, 4))
    for start in range(0, m, BATCH):
        part = slice(start, start + BATCH)
        at = bodies(chain, q[part], None if bends is None else bends[part])
        G, k = out[part], len(q[part])
        # a . (r x g) = r . (g x a)
        pull = np.cross(down, at.axes).reshape(k, 3 * n, 3)
        lever = (pull @ at.origin.swapaxes(1, 2)).reshape(k, n, 3, n + 1)
        own = np.arange(n)
        G[..., 0] = lever - lever[:, own, :, own].swapaxes(0, 1)[..., None]
        turned = pull @ at.rotation.swapaxes(1, 2).reshape(k, 3, -1)
        G[..., 1:] = turned.reshape(k, n, 3, n + 1, 3)
        for i in slides:
            G[:, i, Z] = 0.0
            G[:, i, Z, :, 0] = (at.axes[:, i, Z] @ down)[:, None]
        G *= beyond[:, None, :, None]
    return out


def torque_slopes(chain: Chain, q: Array, pi: Array, *, gravity: Array, bends: Array) -> Array:
    """Derivative (m, 3 n, 3 n) of the gravity torques by the bends, both ordered joint by axis.

    It is minus the Hessian of the potential energy, hence symmetric: of two axes, the one nearer
    to the tip displaces all bodies beyond it, which changes their torque about the other. The
    column of a bend about z is also the derivative by the joint value.

    Parameters
    ----------
    chain : Chain
        Geometry of the arm.
    q : (m, n) array
        Checked joint values [rad, m].
    pi : (n + 1, 4) or (m, n + 1, 4) array
        Moments of links and payload, the same for all poses or one set for each [kg, kg m].
    gravity : (3,) array
        In the frame of the base [m/s^2].
    bends : (m, n, 3) array
        Bends at which the derivative is taken [rad, m].
    """
    m, n = q.shape
    at, down = bodies(chain, q, bends), chain.T_world_base[:3, :3] @ gravity
    # sums over all bodies from the tip: masses, and first moments about the world, then a joint
    first = pi[..., 0, None] * at.origin + (at.rotation @ pi[..., 1:, None])[..., 0]
    mass = np.cumsum(pi[..., ::-1, 0], axis=-1)[..., ::-1]
    first = np.cumsum(first[:, ::-1], axis=1)[:, ::-1]
    about = first[:, :n] - mass[..., :n, None] * at.origin[:, :n]
    pull, carried = np.cross(down, at.axes), np.cross(at.axes, about[:, :, None])
    for i in np.flatnonzero(chain.prismatic):
        pull[:, i, Z], carried[:, i, Z] = 0.0, mass[..., i, None] * at.axes[:, i, Z]
    order = (3 * np.arange(n)[:, None] + [Z, X, Y]).ravel()  # as the turns follow each other
    one, other = (v.reshape(m, 3 * n, 3)[:, order] for v in (pull, carried))
    upper = np.triu(one @ other.swapaxes(1, 2))
    out = np.empty((m, 3 * n, 3 * n))
    out[:, order[:, None], order] = upper + np.triu(upper, 1).swapaxes(1, 2)
    return out


@dataclass(frozen=True, slots=True, eq=False)
class Weight:
    """The gravity load of an arm: its geometry, its moments, its payload and gravity itself."""

    chain: Chain
    """Geometry that the torques are computed with, as a rule the nominal one."""
    moments: Annotated[Array, "n", 4]
    """(n, 4) mass and first moments of the links in their body frames [kg, kg m]."""
    payload: Annotated[Array, 4] = (0.0, 0.0, 0.0, 0.0)  # type: ignore[assignment]  # an array in __post_init__
    """(4,) mass and first moments of the payload in the flange frame [kg, kg m]."""
    gravity: Annotated[Array, 3] = DOWN  # type: ignore[assignment]  # likewise
    """(3,) in the frame of the base [m/s^2]."""

    def __post_init__(self) -> None:
        moments, payload, gravity = check(
            f"{self.chain.n_joints} 4, 4, 3",
            moments=self.moments,
            payload=self.payload,
            gravity=self.gravity,
        )
        for name, body in (("moments", moments), ("payload", payload[None])):
            if (body[:, 0] < 0).any():
                low = float(body[:, 0].min())
                allowed = "masses of 0 kg or more, first in each row"
                raise refuse(name, low, allowed, code="A3", message=f"{name} has a mass of {low:g}")
        for name, value in (("moments", moments), ("payload", payload), ("gravity", gravity)):
            object.__setattr__(self, name, value)

    def torques(
        self, q: ArrayLike, *, payload: ArrayLike | None = None, bends: Array | None = None
    ) -> Array:
        """Gravity torques (m, n, 3) about x, y, z of every joint [N m]; force along a slide [N].

        Parameters
        ----------
        q : (m, n) array_like
            Joint values [rad, m].
        payload : (m, 4) array_like, optional
            Payload of each pose, in place of that of the arm [kg, kg m].
        bends : (m, n, 3) array, optional
            Bends of the arm at which the torques are taken [rad, m].
        """
        G = gravity_regressor(self.chain, q, gravity=self.gravity, bends=bends)
        return self.torques_by(G, payload)

    def torques_by(self, G: Array, payload: ArrayLike | None = None) -> Array:
        """The same from the regressor G (m, n, 3, n + 1, 4) of `gravity_regressor`."""
        load = np.broadcast_to(self.payload, (len(G), 4))
        if payload is not None:
            (load,) = check(f"{len(G)} 4", payload=payload)
        out = G[..., :-1, :].reshape(*G.shape[:3], -1) @ self.moments.ravel()
        return np.asarray(out + (G[..., -1, :] @ load[:, None, :, None])[..., 0])


def moments_of(masses: ArrayLike, centers: ArrayLike) -> Array:
    """Mass and first moments (k, 4) [kg, kg m] from masses (k,) [kg] and centers (k, 3) [m]."""
    masses, centers = check("k, k 3", masses=masses, centers=centers)
    return np.column_stack([masses, masses[:, None] * centers])


def guessed_moments(chain: Chain) -> Array:
    """Assumed moments (n, 4) [kg, kg m] of the links of an arm whose masses are unknown.

    The mass of a link is in proportion to the reach beyond its joint, and its center lies halfway
    to the next joint; compliances and moments identified from measurements make up for the rest.
    """
    d, a = chain.links[:, 1], chain.links[:, 2]
    left = np.cumsum((np.hypot(d, a) + LEAST)[::-1])[::-1]
    return moments_of(GUESSED * left, np.column_stack([a, np.zeros_like(a), d]) / 2)


def weight_of(
    chain: Chain,
    stands: Chain | None = None,
    moments: Array | None = None,
    payload: Array | None = None,
) -> Weight:
    """Gravity load of an arm, from how its base stands in a world whose z axis points up.

    Parameters
    ----------
    chain : Chain
        Geometry of the arm.
    stands : Chain, optional
        Chain whose base is given in that upright world, if the world of `chain` is another one.
    moments : (n, 4) array, optional
        Moments of the links [kg, kg m]; those of `guessed_moments` if left out.
    payload : (4,) array, optional
        Moments of the payload in the flange frame [kg, kg m]; none by default.
    """
    base = (chain if stands is None else stands).T_world_base
    own = guessed_moments(chain) if moments is None else moments
    heavy = np.zeros(4) if payload is None else payload
    return Weight(chain, own, heavy, gravity=base[:3, :3].T @ DOWN)


def axis_places(axes: Sequence[str]) -> list[int]:
    """Indices 0, 1, 2 of the axes named x, y, z, ascending; other names raise an `InputError`."""
    for axis in axes:
        if axis not in AXES:
            message = f'axes names "{axis}"'
            raise refuse("axes", tuple(axes), "x, y and z", code="A3", message=message)
    return [AXES.index(axis) for axis in AXES if axis in axes]
