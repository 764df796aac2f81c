"""The state of many fits on their way, 32 side by side, as the compiled loops want it."""

import numpy as np

from calib.arrays import Array
from calib.geometry.chain import COLUMNS
from calib.geometry.frames import exp_so3, log_so3
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.measurement.observations import Measurements
from calib.uncertainty.tool_point import configurations

WIDTH = 32
"""Replicates side by side, as in `calib.kernels`, which is loaded only when it is needed."""


class Batch:
    """Replicates of one plan: how far each has moved, and what the loops take from that."""

    def __init__(
        self, model: RobotModel, parameters: Parameters, plan: Measurements, blocks: int
    ) -> None:
        chain, n = model.chain, model.chain.n_joints
        k = len(model.joint_errors.terms)
        self.model, self.free = model, parameters.free_index
        self.x = np.zeros((blocks, len(self.free), WIDTH))
        alpha, beta = chain.links[:, 3], chain.links[:, 4]
        one, zero = np.ones(n), np.zeros(n)
        row = np.stack(
            [
                *(one, zero, zero, chain.links[:, 2]),
                *(np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)),
            ],
            -1,
        )
        self.links = np.broadcast_to(row[:, :, None], (blocks, n, 8, WIDTH)).copy()
        self.base, self.tool = (
            np.broadcast_to(_flat(T)[:, None], (blocks, 12, WIDTH)).copy()
            for T in (chain.T_world_base, chain.T_flange_tool)
        )
        self.terms = np.zeros((blocks, k, WIDTH))
        at = configurations(model, plan.q, plan.conditions)
        self.configurations = (
            *(np.ascontiguousarray(part.T) for part in (at.cosine, at.sine, at.slide, at.basis)),
            np.array(model.joint_errors.joints, dtype=np.int64),
            chain.prismatic == 0,
        )
        self._reach = np.abs(at.basis).max(axis=1, initial=0.0)

    @property
    def turned(self) -> Array:
        """Largest step of any joint error (B, 32) [rad, m], its terms summed."""
        worst = np.zeros((len(self.x), WIDTH))
        per_term = np.abs(self.terms) * self._reach[:, None]
        joints = np.array(self.model.joint_errors.joints)
        for joint in np.unique(joints):
            worst = np.maximum(worst, per_term[:, joints == joint].sum(axis=1))
        return worst

    def move(self, step: Array) -> None:
        """Go a step (B, f, 32) further."""
        self.x += step
        chain, n = self.model.chain, self.model.chain.n_joints
        frames = {"base": np.zeros((len(step), 6, WIDTH)), "tool": np.zeros((len(step), 6, WIDTH))}
        for row, number in enumerate(self.free):
            x = self.x[:, row]
            if number < 6:
                frames["base"][:, number] = step[:, row]
            elif number >= 12 + 5 * n:
                self.terms[:, number - 12 - 5 * n] = x
            elif number >= 6 + 5 * n:
                frames["tool"][:, number - 6 - 5 * n] = step[:, row]
            else:
                i, column = divmod(int(number) - 6, 5)
                link = self.links[:, i]
                if COLUMNS[column] == "theta":
                    link[:, 0], link[:, 1] = np.cos(x), np.sin(x)
                elif COLUMNS[column] == "d":
                    link[:, 2] = x
                elif COLUMNS[column] == "a":
                    link[:, 3] = chain.links[i, 2] + x
                else:
                    to = 4 if COLUMNS[column] == "alpha" else 6
                    angle = chain.links[i, column] + x
                    link[:, to], link[:, to + 1] = np.cos(angle), np.sin(angle)
        for name, nominal, first in (
            ("base", chain.T_world_base, 0),
            ("tool", chain.T_flange_tool, 6 + 5 * n),
        ):
            if frames[name].any():
                self._turn(getattr(self, name), frames[name], nominal, first)

    def _turn(self, T: Array, step: Array, nominal: Array, first: int) -> None:
        """Multiply frames (B, 12, 32) on the right by their steps; keep x the whole way so far."""
        R = np.moveaxis(T[:, :9], 1, -1).reshape(-1, WIDTH, 3, 3)
        p = np.moveaxis(T[:, 9:], 1, -1)
        t, r = np.moveaxis(step[:, :3], 1, -1), np.moveaxis(step[:, 3:], 1, -1)
        p = p + (R @ t[..., None])[..., 0]
        R = R @ exp_so3(r)
        T[:, :9] = np.moveaxis(R.reshape(-1, WIDTH, 9), -1, 1)
        T[:, 9:] = np.moveaxis(p, -1, 1)
        R0 = nominal[:3, :3]
        whole = np.concatenate([(p - nominal[:3, 3]) @ R0, log_so3(R0.T @ R)], axis=-1)
        for row, number in enumerate(self.free):
            if first <= number < first + 6:
                self.x[:, row] = whole[..., number - first]


def _flat(T: Array) -> Array:
    """Rotation row by row, then the origin (12,) of a transform (4, 4)."""
    return np.concatenate([T[:3, :3].ravel(), T[:3, 3]])
