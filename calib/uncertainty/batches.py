"""Random work in batches of fixed size, each with its own stream: same bits on any threads."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np

from calib.arrays import Array
from calib.errors import refuse
from calib.geometry.chain import COLUMNS
from calib.geometry.frames import exp_so3, log_so3
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.measurement.observations import Measurements
from calib.uncertainty.tool_point import postures

LANES = 32
"""Replicates side by side, as in `calib.kernels`, which is loaded only when it is needed."""


class Lanes:
    """Where the replicates of one chunk are on their way, as the compiled loops want it."""

    def __init__(
        self, model: RobotModel, parameters: Parameters, plan: Measurements, blocks: int
    ) -> None:
        chain, n = model.chain, model.chain.n_joints
        k = len(model.joint_errors.terms)
        self.model, self.free = model, parameters.free_index
        self.x = np.zeros((blocks, len(self.free), LANES))
        alpha, beta = chain.links[:, 3], chain.links[:, 4]
        one, zero = np.ones(n), np.zeros(n)
        row = np.stack(
            [
                *(one, zero, zero, chain.links[:, 2]),
                *(np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)),
            ],
            -1,
        )
        self.links = np.broadcast_to(row[:, :, None], (blocks, n, 8, LANES)).copy()
        self.base, self.tool = (
            np.broadcast_to(_flat(T)[:, None], (blocks, 12, LANES)).copy()
            for T in (chain.T_world_base, chain.T_flange_tool)
        )
        self.terms = np.zeros((blocks, k, LANES))
        at = postures(model, plan.q)
        self.plan = (
            *(np.ascontiguousarray(part.T) for part in (at.cosine, at.sine, at.slide, at.basis)),
            np.array(model.joint_errors.joints, dtype=np.int64),
            chain.prismatic == 0,
        )
        self._reach = np.abs(at.basis).max(axis=1, initial=0.0)

    @property
    def turned(self) -> Array:
        """Largest step of any joint error (B, 32) [rad, m], its terms summed."""
        worst = np.zeros((len(self.x), LANES))
        per_term = np.abs(self.terms) * self._reach[:, None]
        joints = np.array(self.model.joint_errors.joints)
        for joint in np.unique(joints):
            worst = np.maximum(worst, per_term[:, joints == joint].sum(axis=1))
        return worst

    def move(self, step: Array) -> None:
        """Go a step (B, f, 32) further."""
        self.x += step
        chain, n = self.model.chain, self.model.chain.n_joints
        frames = {"base": np.zeros((len(step), 6, LANES)), "tool": np.zeros((len(step), 6, LANES))}
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
        R = np.moveaxis(T[:, :9], 1, -1).reshape(-1, LANES, 3, 3)
        p = np.moveaxis(T[:, 9:], 1, -1)
        t, r = np.moveaxis(step[:, :3], 1, -1), np.moveaxis(step[:, 3:], 1, -1)
        p = p + (R @ t[..., None])[..., 0]
        R = R @ exp_so3(r)
        T[:, :9] = np.moveaxis(R.reshape(-1, LANES, 9), -1, 1)
        T[:, 9:] = np.moveaxis(p, -1, 1)
        R0 = nominal[:3, :3]
        whole = np.concatenate([(p - nominal[:3, 3]) @ R0, log_so3(R0.T @ R)], axis=-1)
        for row, number in enumerate(self.free):
            if first <= number < first + 6:
                self.x[:, row] = whole[..., number - first]


def _flat(T: Array) -> Array:
    """Rotation row by row, then the origin (12,) of a transform (4, 4)."""
    return np.concatenate([T[:3, :3].ravel(), T[:3, 3]])


R = TypeVar("R")
X = TypeVar("X")


def mapped(work: Callable[[X], R], items: Sequence[X], threads: int = 1) -> list[R]:
    """``work`` of each item, in the order of the items, on so many threads."""
    if threads < 1:
        raise refuse("threads", threads, "1 or more", code="C41")
    if threads == 1 or len(items) <= 1:
        return [work(item) for item in items]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(work, items))


def in_chunks(
    work: Callable[[np.random.Generator, int], R],
    rng: np.random.Generator,
    total: int,
    *,
    size: int,
    threads: int = 1,
) -> list[R]:
    """Results of ``work(stream, count)`` for every chunk, in order; counts add up to `total`.

    The streams are children of `rng`, one per chunk: which thread does a chunk, and when, changes
    nothing. Asking again with the same `rng` gives fresh streams.
    """
    counts = [min(size, total - start) for start in range(0, total, size)]
    try:
        streams = rng.spawn(len(counts))
    except TypeError:
        message, fix = "rng cannot make independent streams", "numpy.random.default_rng(seed)"
        raise refuse("rng", code="A3", message=message, fix=f"make it with {fix}") from None
    return mapped(lambda item: work(*item), list(zip(streams, counts, strict=True)), threads)
