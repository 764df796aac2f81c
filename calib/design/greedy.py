"""Greedy selection: pose after pose, each the best next one; the first k are a set of k."""

import numpy as np
from numpy.typing import ArrayLike

from calib.design.blocks import checked_blocks
from calib.design.exchange import scorer
from calib.design.selection import Selection, finished
from calib.information.observability import Criterion, index_of

RIDGE = 1e-6
"""Part of the pool's mean information put on the diagonal: before rank p every index is zero."""


def greedy(blocks: ArrayLike, m: int, criterion: Criterion) -> Selection:
    """Pose set of size m, grown by the best next pose.

    The ridge is relative per column, so that O1 chooses the same poses in any units; the value
    reported is without it. `trace` holds the index after each pose, with the ridge.

    Parameters
    ----------
    blocks : (N, r, p) array
        Whitened, scaled rows of each candidate pose.
    m : int
        Poses to choose.
    criterion : Criterion
        ``"O1"`` to ``"O5"``, maximized in its correct form.

    References
    ----------
    MATH 8.3.
    """
    blocks = checked_blocks(blocks, m)
    moves = scorer(blocks, criterion)
    M = np.diag(RIDGE * np.einsum("jrk,jrk->k", blocks, blocks) / len(blocks))
    inside = np.zeros(len(blocks), dtype=bool)
    chosen, trace, evaluated = list[int](), list[float](), 0
    for _ in range(m):
        best = moves.add(M, inside)
        B = blocks[best.place]
        M = M + B.T @ B
        inside[best.place] = True
        chosen.append(best.place)
        evaluated += best.evaluated
        trace.append(float(index_of(M, len(chosen), criterion)))
    return finished(blocks, chosen, criterion, trace=trace, method="greedy", evaluations=evaluated)
