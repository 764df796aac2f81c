"""What the tool points of many draws scatter: by numpy, or compiled where that pays."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.frames import exp_so3
from calib.geometry.joint_errors import NO_JOINT
from calib.geometry.model import RobotModel
from calib.kernels.loops import compiles
from calib.uncertainty.tool_point import Configurations, configurations, tool_points

MANY_POINTS = 20_000_000
"""Draws times postures from which loops are compiled: numpy takes some 3 s for so many, and so does
compiling where no code is kept. The choice follows the work alone: the bits of a result must not
hang on what is kept."""
PASS = 1000
"""Draws made and moved at once where loops are compiled: they then stay in the cache."""
LANES = 8
"""Postures side by side in one instruction: their number is filled up to a multiple."""
SMALL = 0.05
"""Largest turn [rad] by a step for which the loops have a series; draws with a larger one go
through numpy."""
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Axes whose products are summed."""


@dataclass(frozen=True, slots=True, eq=False)
class PointLoop:
    """Postures, and the points there that deviations are counted from."""

    at: Configurations
    """Of the postures; where loops are compiled, filled up by the last of them."""
    nominal: Array
    """(3, N) points [m]."""
    postures: int
    """Of these N, those that are asked for."""
    compiled: bool
    sums: Array
    """(9, N) of all deviations met so far: x y z, xx yy zz, xy xz yz [m, m^2]."""

    @classmethod
    def of(cls, model: RobotModel, q: Array, nominal: Array, draws: int) -> "PointLoop":
        """Those at joints q (N, n) whose points are `nominal` (N, 3) [m], for so many draws."""
        enough = draws * len(q) >= MANY_POINTS and model.joint_errors.springs is None and compiles()
        width = -(-len(q) // LANES) * LANES if enough else len(q)
        filled = np.minimum(np.arange(width), len(q) - 1)
        at, there = configurations(model, q[filled]), np.ascontiguousarray(nominal[filled].T)
        return cls(at, there, len(q), enough, np.zeros((9, width)))

    def deviations(self, steps: Array) -> Iterator[tuple[slice, Array]]:
        """Draws and their points minus nominal (3, M', N) [m], pass by pass, of steps (M, P)."""
        size = PASS if self.compiled else self.at.rows
        for start in range(0, len(steps), size):
            part = slice(start, start + size)
            found = self._compiled(steps[part]) if self.compiled else None
            if found is None:
                found = tool_points(self.at, steps[part]) - self.nominal[:, None]
                self.sums[:3] += found.sum(axis=1)
                self.sums[3:] += [np.einsum("mn,mn->n", found[i], found[j]) for i, j in PAIRS]
            yield part, found[:, :, : self.postures]

    def moments(self, draws: int) -> tuple[Array, Array]:
        """Mean (N, 3) [m] and covariance (N, 3, 3) [m^2] of so many deviations."""
        sums = self.sums[:, : self.postures].T
        mean = sums[:, :3] / draws
        products = sums[:, [[3, 6, 7], [6, 4, 8], [7, 8, 5]]]
        return mean, (products - draws * mean[:, :, None] * mean[:, None]) / (draws - 1)

    def _compiled(self, steps: Array) -> Array | None:
        """Deviations (3, M, N) of one pass; None where a step is too large for the series."""
        from calib.kernels.points import points

        model, M = self.at.model, len(steps)
        chain, n = model.chain, model.chain.n_joints
        end, turns = 6 + 5 * n, chain.prismatic == 0
        rows = np.ascontiguousarray(steps.T)
        moves = rows[6:end].reshape(n, 5, M)
        place, shifts = self._shifts(steps[:, end + 6 : model.first_fixture])
        turning = shifts[place[turns & (place >= 0)]]
        if max(np.abs(moves[:, [0, 3, 4]]).max(), np.abs(turning).max(initial=0.0)) > SMALL:
            return None
        alpha_and_beta = (f(chain.links[:, c]) for c in (3, 4) for f in (np.cos, np.sin))
        bent = (chain.links[:, 4] != 0) | moves[:, 4].any(axis=1)
        links = np.column_stack([chain.links[:, 2], *alpha_and_beta, bent])
        T, base = chain.T_flange_tool, np.empty((12, 0))
        tool = T[:3, 3, None] + T[:3, :3] @ rows[end : end + 3]
        T = chain.T_world_base
        if rows[:6].any() or not np.array_equal(T, np.eye(4)):
            turned = T[:3, :3] @ exp_so3(steps[:, 3:6])
            origin = T[:3, 3, None] + T[:3, :3] @ rows[:3]
            base = np.concatenate([turned.reshape(M, 9).T, origin])
        postures = np.ascontiguousarray(
            np.stack([self.at.cosine, self.at.sine, self.at.slide], axis=1)
        )
        out = np.empty((3, M, self.nominal.shape[1]))
        points(
            links, moves, tool, base, shifts, place, postures, self.nominal, turns, out, self.sums
        )
        return out

    def _shifts(self, terms: Array) -> tuple[Index, Array]:
        """What steps of terms (M, k) add to joints: which of (j, M, N) is whose, -1 for none."""
        joints, basis = np.array(self.at.model.joint_errors.joints, dtype=np.int64), self.at.basis
        place = np.full(self.at.model.chain.n_joints, -1)
        moved = sorted({*joints[terms.any(axis=0)].tolist()} - {NO_JOINT})
        place[moved] = range(len(moved))
        rows = [terms[:, joints == joint] @ basis[joints == joint] for joint in moved]
        return place, np.array(rows).reshape(len(moved), len(terms), basis.shape[1])
