"""Rows of many robots for a climb: columns of their geometry and of every bend of every joint."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.many import ManyModels
from calib.identification.many.tables import ManyRows, ManyTables
from calib.kernels.robots_plain import system


@dataclass(frozen=True, slots=True, eq=False)
class ClimbRows:
    """Whitened rows of R robots at m poses, n = 6 m of them pose by pose."""

    r: Array
    """(R, n) measured minus predicted."""
    geometry: Array
    """(R, f, n) columns of the free numbers of the chain."""
    bends: Array
    """(R, 3 j, n) columns of the bends of each joint about x, y and z."""
    metres: Array
    """(R or 1, m, 3, 3) what turns the rows of a position back into metres [m]."""

    @classmethod
    def of(cls, models: ManyModels, tables: ManyTables, free: Index) -> "ClimbRows":
        """Of chains without joint errors; `free` are places in the full vector.

        A joint and its link are taken as two links: one that only turns or slides, whose alpha and
        beta are the bends about x and y, and one that only reaches further.
        """
        rows = ManyRows.of(models.like, tables, free, "whitened")
        R, j = models.links.shape[:2]
        m = tables.q.shape[1]
        reached = models.reached(tables.q)
        cosine, sine, slide = (np.broadcast_to(part, (j, R, m)) for part in models.turns(reached))
        length = np.broadcast_to(models.links[:, :, 1].T[:, :, None], slide.shape)
        links = np.zeros((R, 2 * j, 5))
        links[:, 1::2, 2:] = models.links[:, :, 2:]
        still = np.ones_like(cosine)
        J, r = np.empty((R, 12 + 10 * j, 6, m)), np.empty((6, R, m))
        none: Index = np.zeros(0, dtype=np.int64)
        system(
            links, models.base, models.tool, _between(cosine, still), _between(sine, 0 * still),
            _between(slide - length, length), np.zeros((0, 1, m)), none,
            np.repeat(models.like.chain.prismatic == 0, 2), np.arange(12 + 10 * j), np.zeros(3),
            tables.seen, rows.whitening, rows.used, True, J, r, np.empty((3, R, m)),
        )  # fmt: skip
        J = np.ascontiguousarray(J.swapaxes(2, 3)).reshape(R, -1, 6 * m)
        first = 6 + 10 * np.arange(j)
        own = first[:, None] + [0, 6, 7, 8, 9]
        numbers = np.concatenate([np.arange(6), own.ravel(), np.arange(6) + 6 + 10 * j])
        along = first + (models.like.chain.prismatic != 0)
        bent = np.stack([first + 3, first + 4, along], axis=1).ravel()
        metres = np.linalg.solve(np.moveaxis(rows.whitening[:3, :3], (0, 1), (2, 3)), np.eye(3))
        seen = np.ascontiguousarray(np.moveaxis(r, 0, 2)).reshape(R, -1)
        return cls(seen, J[:, numbers[free]], J[:, bent], np.asarray(metres))


def _between(one: Array, other: Array) -> Array:
    """Rows of two arrays (j, R, m) in turn (2 j, R, m)."""
    return np.stack([one, other], axis=1).reshape(-1, *one.shape[1:])
