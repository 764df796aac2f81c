"""Tool-point uncertainty as a map: cells of the workspace, each with what its postures show."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, check, frozen
from calib.errors import refuse
from calib.kinds import checked_kinds
from calib.shown import Shown, length_words
from calib.uncertainty.statement.stated_point import widened
from calib.uncertainty.tool_point import ToolStatement

MOST_CELLS = 10_000_000
BLOCK = 20_000
"""Postures at a time: 40 MB of Jacobian."""


@dataclass(frozen=True, slots=True, eq=False)
class ToolMap(Shown):
    """u_3D over a grid of cells; nan where no posture came by."""

    corner: Array
    """(3,) lowest corner of the grid in the world [m]."""
    cell: float
    """Edge of a cell [m]."""
    count: Index
    """(a, b, c) postures in each cell."""
    mean: Array
    """(a, b, c) root mean square of u_3D over the postures of a cell [m]."""
    worst: Array
    """(a, b, c) largest u_3D there [m]: the same point can be reached well and badly."""
    covariance: Array
    """(a, b, c, 3, 3) mean covariance there, world axes [m^2]."""

    def __repr__(self) -> str:
        size = " x ".join(map(str, self.count.shape))
        worst = length_words(float(np.nanmax(self.worst)), um=".3g")
        return f"ToolMap({size} cells of {self.cell:g} m, largest u {worst})"

    @property
    def centers(self) -> tuple[Array, Array, Array]:
        """Coordinates x (a,), y (b,), z (c,) of the cell centers [m]."""
        x, y, z = (
            self.corner[k] + self.cell * (np.arange(size) + 0.5)
            for k, size in enumerate(self.count.shape)
        )
        return x, y, z


@checked_kinds
def tool_map(
    regions: Callable[[Array], ToolStatement], q: ArrayLike, *, cell: float = 0.05
) -> ToolMap:
    """Map the tool-point uncertainty over the places that joints q (N, n) reach.

    Parameters
    ----------
    regions : callable
        What is stated at joints (k, n), such as `Belief.regions`; a factor above the chi-square one
        counts in u.
    q : (N, n) array_like
        Many postures, e.g. uniform within the joint limits, or a program [rad, m].
    cell : float
        Edge of the cells [m].
    """
    (q,) = check("k n", q=q)
    if not len(q) or not (np.isfinite(cell) and cell > 0):
        message = f"{len(q)} postures, cells of {cell} m"
        allowed = "at least one posture and an edge above zero"
        raise refuse("cell", cell, allowed, code="A3", message=message)
    parts = [regions(q[start : start + BLOCK]) for start in range(0, len(q), BLOCK)]
    position = np.concatenate([part.position for part in parts])
    sigma = np.concatenate([widened(part) for part in parts])
    where = np.floor(position / cell).astype(np.int64)
    first = where.min(axis=0)
    shape = tuple(int(n) for n in where.max(axis=0) - first + 1)
    if np.prod([float(n) for n in shape]) > MOST_CELLS:
        message = f"cells of {cell} m make a grid of {' x '.join(map(str, shape))}"
        allowed, fix = f"at most {MOST_CELLS} cells", "take larger cells"
        raise refuse("cell", cell, allowed, code="A3", message=message, fix=fix)
    flat = np.ravel_multi_index(tuple((where - first).T), shape)
    size = int(np.prod(shape))
    count = np.bincount(flat, minlength=size)
    filled = np.where(count > 0, count, np.nan)
    square = np.trace(sigma, axis1=1, axis2=2)
    worst = np.full(size, -np.inf)
    np.maximum.at(worst, flat, np.sqrt(square))
    mean = np.stack(
        [
            np.bincount(flat, sigma[:, i, j], minlength=size) / filled
            for i in range(3)
            for j in range(3)
        ],
        axis=-1,
    )
    return ToolMap(
        frozen(first * cell),
        float(cell),
        frozen(count.reshape(shape), np.int64),
        frozen(np.sqrt(np.bincount(flat, square, minlength=size) / filled).reshape(shape)),
        frozen(np.where(count > 0, worst, np.nan).reshape(shape)),
        frozen(mean.reshape(*shape, 3, 3)),
    )
