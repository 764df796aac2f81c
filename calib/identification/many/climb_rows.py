"""Whitened rows of many robots for a climb, with columns for geometry and for all joint bends."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.many import ManyModels
from calib.identification.many.columns import bent_screws
from calib.identification.many.tables import ManyRows, ManyTables
from calib.kernels.robots_plain import system


@dataclass(frozen=True, slots=True, eq=False)
class ClimbRows:
    """Whitened rows of R robots at m poses: n = 6 m rows, pose by pose."""

    r: Array
    """(R, n) measured minus predicted."""
    geometry: Array
    """(R, f, n) columns of the free numbers of the chain."""
    bends: Array
    """(R, 3 j, n) columns of the bends of each joint about x, y and z."""
    metres: Array
    """(R or 1, m, 3, 3) inverse whitening of positions, by which rows become meters [m]."""

    @classmethod
    def of(cls, models: ManyModels, tables: ManyTables, free: Index) -> "ClimbRows":
        """Rows for chains without joint errors; `free` (f,) are places in the full vector."""
        rows = ManyRows.of(models.like, tables, free, "whitened")
        R, j = models.links.shape[:2]
        m = tables.q.shape[1]
        J, r = np.empty((R, 12 + 10 * j, 6, m)), np.empty((6, R, m))
        system(
            models.bent(models.reached(tables.q), np.zeros((j, 3, 1, 1))), models.base, models.tool,
            np.arange(12 + 10 * j), (), np.zeros(3), tables.seen, rows.whitening, rows.used, True,
            J, r, np.empty((3, R, m)),
        )  # fmt: skip
        J = np.ascontiguousarray(J.swapaxes(2, 3)).reshape(R, -1, 6 * m)
        numbers, bends = bent_screws(models.like.chain)
        metres = np.linalg.solve(np.moveaxis(rows.whitening[:3, :3], (0, 1), (2, 3)), np.eye(3))
        seen = np.ascontiguousarray(np.moveaxis(r, 0, 2)).reshape(R, -1)
        return cls(seen, J[:, numbers[free]], J[:, bends.ravel()], np.asarray(metres))
