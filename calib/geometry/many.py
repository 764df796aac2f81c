"""Many robots of one kind as arrays: robots on the first axis, poses on the last and contiguous.

Intermediate arrays have their components before both axes, so that one operation runs over all. The
robots share joints, joint terms and springs, and differ in their numbers; there are no fixtures,
and loads of springs are those of the rigid arm. Results equal those of `RobotModel` to rounding.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.bodies import X, Y, Z
from calib.geometry.frames import exp_so3, log_so3, transform
from calib.geometry.many_springs import ManyLoads, ManySprings
from calib.geometry.model import RobotModel
from calib.shown import Shown

Link: TypeAlias = tuple[Array, ...]
"""Factors c, s, d, a, ca, sa, cb, sb of a link as in `chain.link_rotation_parts`, each
(R or 1, m or 1)."""


class JointValues(NamedTuple):
    """Basis functions of joint errors at commanded joint values, whatever the coefficients."""

    terms: Array
    """(k, R or 1, m) basis functions b_k of the joint terms."""
    springs: ManySprings | None
    """Coefficients of the loads of springs, if there are any."""

    def some(self, which: slice | Index) -> "JointValues":
        """The same for some of the robots."""
        terms = self.terms if self.terms.shape[1] == 1 else self.terms[:, which]
        return JointValues(terms, self.springs and self.springs.some(which))


class ManyStands(NamedTuple):
    """Configurations of R robots at m poses."""

    links: list[Link]
    """From the base on; two per joint for robots on springs, see `ManyModels.bent`."""
    values: JointValues
    """Basis functions of the joint errors."""
    loads: ManyLoads | None
    """Loads of the springs; None without springs."""


@dataclass(frozen=True, slots=True, eq=False)
class ManyModels(Shown):
    """R robots of one kind."""

    like: RobotModel
    """Model with the shared joints, joint terms and springs; `steps` are counted from it."""
    links: Array
    """(R, n, 5) as in `Chain.links` [rad, m]."""
    base: Array
    """(R, 3, 4) rotation and origin of the base in the world [m]."""
    tool: Array
    """(R, 3, 4) rotation and origin of the tool in the flange [m]."""
    coefficients: Array
    """(R, K) of the joint terms, then of the springs [rad or m; kg or kg m for moments]."""

    def __len__(self) -> int:
        return len(self.links)

    def __repr__(self) -> str:
        return f"ManyModels({len(self)} times {self.like!r})"

    @classmethod
    def of(cls, model: RobotModel, count: int, like: RobotModel | None = None) -> "ManyModels":
        """`count` copies of a model; `steps` are counted from `like`, by default the model."""
        chain = model.chain
        parts = (
            chain.links,
            chain.T_world_base[:3],
            chain.T_flange_tool[:3],
            model.joint_errors.coefficients,
        )
        return cls(
            model if like is None else like,
            *(np.broadcast_to(part, (count, *part.shape)) for part in parts),
        )

    @classmethod
    def each(cls, like: RobotModel, models: Sequence[RobotModel]) -> "ManyModels":
        """Several models as arrays; `like` has their joints and terms, and `steps` start there."""
        chains = [model.chain for model in models]
        return cls(
            like,
            np.array([chain.links for chain in chains]),
            np.array([chain.T_world_base[:3] for chain in chains]),
            np.array([chain.T_flange_tool[:3] for chain in chains]),
            np.array([model.joint_errors.coefficients for model in models]),
        )

    @classmethod
    def joined(cls, parts: Sequence["ManyModels"]) -> "ManyModels":
        """The robots of all parts, in order."""
        names = ("links", "base", "tool", "coefficients")
        return cls(
            parts[0].like,
            *(np.concatenate([getattr(part, name) for part in parts]) for name in names),
        )

    def widened(self, wide: RobotModel) -> "ManyModels":
        """The same robots with the joint errors of `wide`, which include those of `like`.

        The coefficients that are new have the values in `wide`.
        """
        coefficients = np.repeat(wide.joint_errors.coefficients[None], len(self), axis=0)
        held = np.isin(wide.joint_errors.names, self.like.joint_errors.names)
        coefficients[:, held] = self.coefficients
        return replace(self, like=wide, coefficients=coefficients)

    def some(self, which: slice | Index) -> "ManyModels":
        """Some of the robots."""
        return replace(
            self,
            links=self.links[which],
            base=self.base[which],
            tool=self.tool[which],
            coefficients=self.coefficients[which],
        )

    def one(self, k: int) -> RobotModel:
        """Robot k as a model of its own."""
        chain = replace(
            self.like.chain,
            links=self.links[k],
            T_world_base=_squared(self.base[k]),
            T_flange_tool=_squared(self.tool[k]),
        )
        errors = replace(self.like.joint_errors, coefficients=self.coefficients[k])
        return replace(self.like, chain=chain, joint_errors=errors)

    def moved(self, step: Array) -> "ManyModels":
        """Robots after steps (R, P) [m, rad], as in `RobotModel.moved`."""
        k = 6 + 5 * self.links.shape[1]
        return replace(
            self,
            links=self.links + step[:, 6:k].reshape(self.links.shape),
            base=_stepped(self.base, step[:, :6]),
            tool=_stepped(self.tool, step[:, k : k + 6]),
            coefficients=self.coefficients + step[:, k + 6 :],
        )

    def steps(self) -> Array:
        """Steps (R, P) from `like` to each robot, as in `RobotModel.step_to` [m, rad]."""
        chain = self.like.chain
        return np.concatenate(
            [
                _step_to(chain.T_world_base, self.base),
                (self.links - chain.links).reshape(len(self), -1),
                _step_to(chain.T_flange_tool, self.tool),
                self.coefficients - self.like.joint_errors.coefficients,
            ],
            axis=1,
        )

    def values(self, q: Array) -> JointValues:
        """Basis functions of the joint errors at commanded joints q (R or 1, m, n) [rad, m]."""
        errors = self.like.joint_errors
        flat = errors.basis(q.reshape(-1, q.shape[2])).reshape(*q.shape[:2], -1)
        terms = np.ascontiguousarray(np.moveaxis(flat, 2, 0))
        springs = None if errors.springs is None else ManySprings.of(errors.springs, q)
        return JointValues(terms, springs)

    def reached(self, q: Array, values: JointValues | None = None) -> Array:
        """Joint values q + dq(q) (n, R or 1, m) reached at commands q (R or 1, m, n) [rad, m].

        `values` are those of q, if already at hand.
        """
        commanded, joints = np.moveaxis(q, 2, 0), self.like.joint_errors.joints
        if not joints:
            return commanded
        n, _, m = commanded.shape
        out = np.broadcast_to(commanded, (n, len(self), m)).copy()
        terms = (self.values(q) if values is None else values).terms
        for k, joint in enumerate(joints):
            out[joint] += self.coefficients[:, k, None] * terms[k]
        return out

    def stands(self, q: Array, values: JointValues | None = None) -> ManyStands:
        """Configurations at commanded joints q (R or 1, m, n) [rad, m]; `values` if at hand."""
        values = self.values(q) if values is None else values
        joints = self.reached(q, values)
        if values.springs is None:
            return ManyStands(self.stiff(joints), values, None)
        loads = values.springs.loads(self.coefficients[:, len(self.like.joint_errors.terms) :])
        bends = values.springs.spread(loads.bends)
        return ManyStands(self.bent(joints, bends), values, loads)

    def stiff(self, joints: Array) -> list[Link]:
        """Links of rigid arms at joint values reached (n, R or 1, m) [rad, m]."""
        turn, slide = self._moves(joints)
        d = self.links[:, :, 1].T[:, :, None]
        shift = np.broadcast_to(d if slide is None else slide + d, turn.shape)
        each = zip(np.cos(turn), np.sin(turn), shift, range(len(turn)), strict=True)
        return [(c, s, along, *self._link(i)) for c, s, along, i in each]

    def bent(self, joints: Array, bends: Array) -> list[Link]:
        """Links of arms with bends (n, 3, R or 1, m or 1) [rad, m], as in `bodies`.

        Two per joint: one of the joint, whose alpha and beta are the bends about x and y, and one
        of the link itself.
        """
        turn, slide = self._moves(joints + bends[:, Z])
        one, none = np.ones((1, 1)), np.zeros((1, 1))
        cosine, sine, found = np.cos(bends[:, :Z]), np.sin(bends[:, :Z]), list[Link]()
        for i, (c, s) in enumerate(zip(np.cos(turn), np.sin(turn), strict=True)):
            gives = cosine[i, X], sine[i, X], cosine[i, Y], sine[i, Y]
            found.append((c, s, none if slide is None else slide[i], none, *gives))
            found.append((one, none, self.links[:, i, 1, None], *self._link(i)))
        return found

    def _moves(self, joints: Array) -> tuple[Array, Array | None]:
        """Angles and slides (n, R, m) of joints reached [rad, m]; None if no joint is prismatic."""
        slides, theta = self.like.chain.prismatic[:, None, None], self.links[:, :, 0].T[:, :, None]
        if not slides.any():
            return joints + theta, None
        return joints * (1 - slides) + theta, joints * slides

    def _link(self, i: int) -> Link:
        """Length a, cosine and sine of alpha and of beta (R, 1) of link i."""
        a, alpha, beta = (self.links[:, i, k, None] for k in (2, 3, 4))
        return a, np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)

    def frames(self, links: Sequence[Link]) -> tuple[Array, Array]:
        """Tool axes x, y, z (3, 3, R, m), the axis first, and origins (3, R, m) in the world [m].

        References
        ----------
        Wen et al. 2022, eq. (1), as in `chain.forward`.
        """
        x, y, z, p = (self.base[:, :, k].T[:, :, None] for k in range(4))
        for c, s, d, a, ca, sa, cb, sb in links:
            x, y = c * x + s * y, c * y - s * x
            p = p + d * z + a * x
            y, z = ca * y + sa * z, ca * z - sa * y
            x, z = cb * x - sb * z, sb * x + cb * z
        tool = self.tool[..., None]
        held = [tool[:, 0, k] * x + tool[:, 1, k] * y + tool[:, 2, k] * z for k in range(4)]
        return np.stack(held[:3]), np.asarray(p + held[3])

    def poses(self, q: Array) -> Array:
        """Tool poses T_world_tool (R, m, 4, 4) at commanded joints q (R or 1, m, n) [m]."""
        return poses_of(*self.frames(self.stands(q).links))

    def poses_at(self, joints: Array) -> Array:
        """Tool poses (R, m, 4, 4) [m] of rigid arms at joint values of `reached` [rad, m]."""
        return poses_of(*self.frames(self.stiff(joints)))


def poses_of(axes: Array, origin: Array) -> Array:
    """Transforms (R, m, 4, 4) of axes (3, 3, R, m) and origins (3, R, m) [m]."""
    return transform(axes.transpose(2, 3, 1, 0), np.moveaxis(origin, 0, 2))


def _stepped(frame: Array, step: Array) -> Array:
    """Frames (R, 3, 4) multiplied on the right by the transforms of steps (R, 6) [m, rad]."""
    moves = np.asarray(step.any(axis=1))
    if not moves.any():
        return frame
    R = frame[:, :, :3]
    turned = R @ exp_so3(step[:, 3:])
    # one Newton step to the nearest rotation: rounding never accumulates
    turned = 1.5 * turned - 0.5 * turned @ (np.swapaxes(turned, 1, 2) @ turned)
    there = np.concatenate([turned, frame[:, :, 3:] + R @ step[:, :3, None]], axis=2)
    return np.where(moves[:, None, None], there, frame)


def _step_to(T: Array, frame: Array) -> Array:
    """Steps (R, 6) from a frame T (4, 4) to frames (R, 3, 4)."""
    back = T[:3, :3].T
    shift = ((frame[:, None, :, 3] - T[:3, 3]) @ T[:3, :3])[:, 0]
    return np.concatenate([shift, log_so3(back @ frame[:, :, :3])], axis=1)


def _squared(frame: Array) -> Array:
    """Homogeneous transform (4, 4) of a frame (3, 4)."""
    return np.vstack([frame, [0.0, 0.0, 0.0, 1.0]])
