"""The serial chain: all its geometric numbers in one frozen value, and its forward kinematics."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, check
from calib.errors import InputError, refuse
from calib.geometry.frames import (
    inverse,
    nearest_rigid,
    require_rigid,
    step_transform,
    transform_step,
)
from calib.kinds import in_short, of_kind
from calib.shown import Shown

JointKind = Literal["revolute", "prismatic"]
BATCH = 1000
"""Poses per pass: a larger batch leaves the cache and is 2.5 times slower."""
COLUMNS = ("theta", "d", "a", "alpha", "beta")
"""Order of the five numbers of a link: Rz(q + theta) Tz(d) Tx(a) Rx(alpha) Ry(beta)."""
FRAME_AXES = ("x", "y", "z", "rx", "ry", "rz")


@dataclass(frozen=True, slots=True, eq=False)
class Chain(Shown):
    """Denavit-Hartenberg chain with Hayati's beta, a base and a tool: 12 + 5 n numbers.

    T_world_tool = T_world_base A_1 ... A_n T_flange_tool with
    A_i = Rz(q_i + theta_i) Tz(d_i) Tx(a_i) Rx(alpha_i) Ry(beta_i); a prismatic joint adds q_i to
    d_i instead. With beta = 0 these are standard (distal) DH parameters, not those of Craig.

    References
    ----------
    Wen et al. 2022, eq. (1); Hayati 1983 for beta.
    """

    links: Array
    """(n, 5) theta [rad], d [m], a [m], alpha [rad], beta [rad]."""
    kinds: tuple[JointKind, ...] = ()
    """(n,) joint kinds; empty means all revolute."""
    T_world_base: Array = field(default_factory=lambda: np.eye(4))
    """(4, 4) base in the world, the frame that measurements are reported in [m]."""
    T_flange_tool: Array = field(default_factory=lambda: np.eye(4))
    """(4, 4) tool in the flange [m]."""

    if TYPE_CHECKING:  # the fields are arrays; what is given need not be

        def __init__(
            self,
            links: ArrayLike,
            kinds: Sequence[str] = ...,
            T_world_base: ArrayLike = ...,
            T_flange_tool: ArrayLike = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        try:
            links, base, tool = check(
                "n 5, 4 4, 4 4",
                links=self.links,
                T_world_base=self.T_world_base,
                T_flange_tool=self.T_flange_tool,
            )
        except InputError as error:
            if (
                error.field == "links"
                and isinstance(error.value, tuple)
                and error.value[1:] == (4,)
            ):
                error = refuse(
                    "links", error.value, "theta, d, a, alpha, beta of each joint", code="A1",
                    message=error.message, fix="add a column of zeros for beta",
                )  # fmt: skip
            raise error from None
        given = self.kinds
        kinds = (given if type(given) is tuple else of_kind("kinds", given, Sequence[str])) or (
            "revolute",
        ) * len(links)
        if len(kinds) != len(links) or set(kinds) - {"revolute", "prismatic"}:
            wanted = f"{len(links)} entries, each revolute or prismatic"
            raise refuse("kinds", kinds, wanted, code="A3")
        require_rigid(base, "T_world_base")
        require_rigid(tool, "T_flange_tool")
        for name, value in zip(self.__slots__, (links, kinds, base, tool), strict=True):
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        slides = sum(kind == "prismatic" for kind in self.kinds)
        return f"Chain({self.n_joints} joints, {slides} of them prismatic)"

    @property
    def n_joints(self) -> int:
        """Number of joints n."""
        return len(self.links)

    @property
    def n_numbers(self) -> int:
        """All geometric numbers, 12 + 5 n."""
        return 12 + 5 * len(self.links)

    @property
    def prismatic(self) -> Array:
        """(n,) 1.0 where the joint slides, else 0.0."""
        return np.array([kind == "prismatic" for kind in self.kinds], dtype=np.float64)

    @in_short
    def moved(self, step: ArrayLike) -> "Chain":
        """Chain after a step (12 + 5 n,) in the order of `chain_names` [m, rad].

        The link numbers are added; base and tool are multiplied on the right by [Exp(r), t; 0, 1],
        so that each moves in its own axes about its own origin.
        """
        (step,) = check(f"{self.n_numbers}", step=step)
        ends = np.stack([self.T_world_base, self.T_flange_tool])
        base, tool = nearest_rigid(ends @ step_transform(np.stack([step[:6], step[-6:]])))
        return Chain(self.links + step[6:-6].reshape(-1, 5), self.kinds, base, tool)

    def step_to(self, other: "Chain") -> Array:
        """Step (12 + 5 n,) [m, rad] to `other`: ``a.moved(a.step_to(b))`` is b."""
        if self.kinds != other.kinds:
            message = f"chains differ in their joints: {self.kinds} and {other.kinds}"
            raise refuse("kinds", code="A3", message=message)
        return np.concatenate(
            [
                transform_step(inverse(self.T_world_base) @ other.T_world_base),
                (other.links - self.links).ravel(),
                transform_step(inverse(self.T_flange_tool) @ other.T_flange_tool),
            ]
        )


@cache
def chain_names(n_joints: int) -> tuple[str, ...]:
    """Names of the 12 + 5 n numbers: ``base.x`` ... ``theta1`` ... ``tool.rz``."""
    return (
        *(f"base.{axis}" for axis in FRAME_AXES),
        *(f"{column}{i + 1}" for i in range(n_joints) for column in COLUMNS),
        *(f"tool.{axis}" for axis in FRAME_AXES),
    )


def link_rotation_parts(
    chain: Chain, q: Array, growth: Array | None = None
) -> Sequence[tuple[Array, Array, Array, Array, Array, Array, Array, Array]]:
    """Factors of A_i for each link: cos and sin of the joint angle, d, a, cos, sin of alpha, beta.

    The first three have one entry per pose (m,), and so has a where `growth` (m,) is given, which
    makes d and a of pose k 1 + growth[k] times as long. The joint value is included.
    """
    d, a = grown_lengths(chain, growth)
    turn = q * (1 - chain.prismatic) + chain.links[:, 0]
    shift = q * chain.prismatic + d
    rows = (np.ascontiguousarray(value.T) for value in (np.cos(turn), np.sin(turn), shift, a))
    cosine, sine = np.cos(chain.links[:, 3:]).T.tolist(), np.sin(chain.links[:, 3:]).T.tolist()
    return list(zip(*rows, cosine[0], sine[0], cosine[1], sine[1], strict=True))


def grown_lengths(chain: Chain, growth: Array | None) -> tuple[Array, Array]:
    """Link lengths d and a [m]: (n,) each, or (m, n), times 1 + `growth` (m,), if that is given."""
    d, a = chain.links[:, 1], chain.links[:, 2]
    if growth is None:
        return d, a
    return (1 + growth)[:, None] * d, (1 + growth)[:, None] * a


def joint_vectors(chain: Chain, q: ArrayLike) -> Array:
    """Joint values (m, n) [rad, m] checked against the chain: every kinematic function starts here.

    Raises
    ------
    InputError
        A1: `q` is no table of n columns; A2: an entry is not finite.
    """
    try:
        (q,) = check("m n", q=q)
    except InputError as error:
        if error.value != (chain.n_joints,):
            raise
        wanted, fix = f"expected (m, {chain.n_joints})", "one pose is a table of one row: [q]"
        raise refuse("q", error.value, wanted, code="A1", message=error.message, fix=fix) from None
    if q.shape[1] != chain.n_joints:
        wanted = f"axis 1 should be {chain.n_joints}, the joints of the chain"
        raise refuse("q", q.shape, wanted, code="A1", message=f"q has shape {q.shape}")
    return q


def on_base(chain: Chain, m: int) -> Iterator[Array]:
    """Axes x, y, z and origin of the base in the world, each repeated for m poses (3, m)."""
    return (np.repeat(chain.T_world_base[:3, k, None], m, 1) for k in range(4))


def after_links(
    chain: Chain, q: Array, growth: Array | None = None
) -> Iterator[tuple[Array, Array, Array, Array]]:
    """Axes x, y, z and origins (3, m) in the world: of the base, then of the frame after each link.

    Joint values q (m, n) are checked already; the last frame is the flange.
    """
    x, y, z, p = on_base(chain, len(q))
    yield x, y, z, p
    for c, s, d, a, ca, sa, cb, sb in link_rotation_parts(chain, q, growth):
        x, y = c * x + s * y, c * y - s * x
        p = p + d * z + a * x
        y, z = ca * y + sa * z, ca * z - sa * y
        x, z = cb * x - sb * z, sb * x + cb * z
        yield x, y, z, p


def forward(chain: Chain, q: ArrayLike) -> Array:
    """Tool poses T_world_tool (m, 4, 4) at joint vectors q (m, n) [rad, m].

    References
    ----------
    Wen et al. 2022, eq. (1).

    Examples
    --------
    >>> chain = Chain([[0, 0.3, 0.1, 0, 0]])
    >>> forward(chain, [[0.0]])[0, :3, 3]
    array([0.1, 0. , 0.3])
    """
    return forward_of(chain, joint_vectors(chain, q))


def forward_of(chain: Chain, q: Array, growth: Array | None = None) -> Array:
    """Tool poses as `forward` gives them, at joint values that are checked already.

    `growth` (m,) is the relative thermal expansion of the lengths d and a at each pose.
    """
    T = np.empty((len(q), 4, 4))
    for start in range(0, len(q), BATCH):
        some = slice(start, start + BATCH)
        *_, (x, y, z, p) = after_links(chain, q[some], None if growth is None else growth[some])
        held(x, y, z, p, chain.T_flange_tool, T[some])
    return T


def held(x: Array, y: Array, z: Array, p: Array, tool: Array, out: Array) -> None:
    """Fill `out` with the poses of a tool on flanges of given axes and origins.

    Parameters
    ----------
    x, y, z, p : (3, m) array
        Axes and origin of the flange in the world [m].
    tool : (4, 4) array
        T_flange_tool [m].
    out : (m, 4, 4) array
        Receives T_world_tool [m].
    """
    flange = np.zeros(out.shape)
    for k, column in enumerate((x, y, z, p)):
        flange[:, :3, k] = column.T
    flange[:, 3, 3] = 1
    np.matmul(flange, tool, out=out)
