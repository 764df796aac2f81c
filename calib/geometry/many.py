"""Many robots of one kind as arrays: robots on the first axis, poses on the last and contiguous.

What is worked out on the way has its components before both, so that one operation runs over all.
Same joints and joint terms, numbers of their own; no springs, no fixtures. What one robot does with
`RobotModel` all of them do here in one pass, to rounding.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.frames import exp_so3, log_so3, transform
from calib.geometry.model import RobotModel
from calib.shown import Shown


@dataclass(frozen=True, slots=True, eq=False)
class ManyModels(Shown):
    """R robots of one kind."""

    like: RobotModel
    """Their joints and joint terms; also where `steps` count from."""
    links: Array
    """(R, n, 5) as in `Chain.links` [rad, m]."""
    base: Array
    """(R, 3, 4) rotation and origin of the base in the world [m]."""
    tool: Array
    """(R, 3, 4) rotation and origin of the tool in the flange [m]."""
    coefficients: Array
    """(R, K) of the joint terms [rad or m]."""

    def __len__(self) -> int:
        return len(self.links)

    def __repr__(self) -> str:
        return f"ManyModels({len(self)} times {self.like!r})"

    @classmethod
    def of(cls, model: RobotModel, count: int, like: RobotModel | None = None) -> "ManyModels":
        """The same model many times; steps count from `like`, from itself if left out."""
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
        """Models of the joints and joint terms of one, from which steps count."""
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
        """The same robots with more joint terms, as `wide` has them behind those of one."""
        more = wide.joint_errors.coefficients[self.coefficients.shape[1] :]
        more = np.broadcast_to(more, (len(self), len(more)))
        return replace(self, like=wide, coefficients=np.hstack([self.coefficients, more]))

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
        """Steps (R, P) that lead here from `like`, as in `RobotModel.step_to` [m, rad]."""
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

    def basis(self, q: Array) -> Array:
        """Values (K, R or 1, m) of the joint terms at commanded joints q (R or 1, m, n)."""
        flat = self.like.joint_errors.basis(q.reshape(-1, q.shape[2]))
        return np.ascontiguousarray(np.moveaxis(flat.reshape(*q.shape[:2], -1), 2, 0))

    def reached(self, q: Array, basis: Array | None = None) -> Array:
        """Joints (n, R or 1, m) where commands q (R or 1, m, n) end [rad, m].

        `basis` (K, R or 1, m) if already at hand.
        """
        commanded, joints = np.moveaxis(q, 2, 0), self.like.joint_errors.joints
        if not joints:
            return commanded
        n, _, m = commanded.shape
        out = np.broadcast_to(commanded, (n, len(self), m)).copy()
        values = self.basis(q) if basis is None else basis
        for k, joint in enumerate(joints):
            out[joint] += self.coefficients[:, k, None] * values[k]
        return out

    def turns(self, joints: Array) -> tuple[Array, Array, Array]:
        """Cosine and sine of the turn and the slide (n, R, m) of each link at joints reached."""
        slides = self.like.chain.prismatic[:, None, None]
        theta, d = self.links[:, :, 0].T[:, :, None], self.links[:, :, 1].T[:, :, None]
        turn = joints * (1 - slides) + theta if slides.any() else joints + theta
        slide = np.broadcast_to(joints * slides + d if slides.any() else d, turn.shape)
        return np.cos(turn), np.sin(turn), slide

    def frames(self, joints: Array) -> tuple[Array, Array]:
        """Tool axes (3, 3, R, m), x, y and z in turn, and origins (3, R, m) at joints reached [m].

        Parameters
        ----------
        joints : (n, R or 1, m) array
            From `reached` [rad, m].

        References
        ----------
        As `chain.forward`; Wen et al. 2022, eq. (1).
        """
        cosine, sine, slide = self.turns(joints)
        x, y, z, p = (self.base[:, :, k].T[:, :, None] for k in range(4))
        for i, (c, s, d) in enumerate(zip(cosine, sine, slide, strict=True)):
            a, alpha, beta = (self.links[:, i, k, None] for k in (2, 3, 4))
            ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
            x, y = c * x + s * y, c * y - s * x
            p = p + d * z + a * x
            y, z = ca * y + sa * z, ca * z - sa * y
            x, z = cb * x - sb * z, sb * x + cb * z
        tool = self.tool[..., None]
        held = [tool[:, 0, k] * x + tool[:, 1, k] * y + tool[:, 2, k] * z for k in range(4)]
        return np.stack(held[:3]), np.asarray(p + held[3])

    def poses(self, q: Array) -> Array:
        """Tool poses T_world_tool (R, m, 4, 4) at commanded joints q (R or 1, m, n) [m]."""
        return self.poses_at(self.reached(q))

    def poses_at(self, joints: Array) -> Array:
        """The same at joints reached (n, R or 1, m), from `reached` [rad, m]."""
        return poses_of(*self.frames(joints))


def poses_of(axes: Array, origin: Array) -> Array:
    """Transforms (R, m, 4, 4) of axes (3, 3, R, m) and origins (3, R, m) [m]."""
    return transform(axes.transpose(2, 3, 1, 0), np.moveaxis(origin, 0, 2))


def _stepped(frame: Array, step: Array) -> Array:
    """Frames (R, 3, 4) multiplied on the right by steps (R, 6)."""
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
    """A frame (3, 4) with its last row (4, 4)."""
    return np.vstack([frame, [0.0, 0.0, 0.0, 1.0]])
