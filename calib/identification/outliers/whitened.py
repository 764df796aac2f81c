"""Residuals of a fit off its free numbers, and what a further change would take from them."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.identification.result import Identification
from calib.information.rank import RANK_TOLERANCE
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.measurement.residual import table_whiteners

TOLD = 1e-6
"""Squared part of a change that must remain beside the free numbers to tell it from theirs."""
ENOUGH = 1.5
"""Coordinates for each number of the change, on either side of the step."""
WAVES = 5
"""Half waves over a session by which something wanders."""
AT_ONCE = 1024
"""Spans of rows whose drops are computed together."""


@dataclass(frozen=True, slots=True, eq=False)
class WhitenedRows:
    """Whitened rows in order of time, projected off the free numbers."""

    whiteners: Array
    r: Array
    """(m, 6) residuals orthogonal to the columns of the free numbers, whose prior is not used."""
    Q: Array
    """(m, 6, f) orthonormal basis of these columns over all rows."""
    square: float
    freedom: int

    @classmethod
    def of(cls, identification: Identification, rows: Measurements) -> "WhitenedRows":
        """Those of rows that a fit is of."""
        seen, parameters = predict(identification.model, rows), identification.parameters
        W = np.where(seen.filled[:, :, None], table_whiteners(rows), 0.0)
        A = W @ (seen.rows[:, :, parameters.free_index] * parameters.free_scale)
        U, s, _ = np.linalg.svd(A.reshape(-1, A.shape[2]), full_matrices=False)
        U = U[:, s > RANK_TOLERANCE * s.max(initial=0.0)]
        r = (W @ seen.residual[:, :, None]).ravel()
        r = r - U @ (U.T @ r)
        freedom = int(seen.filled.sum()) - U.shape[1]
        Q = U.reshape(len(rows), 6, -1)
        return cls(W, r.reshape(len(rows), 6), Q, float(r @ r), freedom)

    def beside(self, plain: Array) -> "WhitenedRows":
        """The same beside changes (m, 6, k) that all rows have."""
        C, Q = (
            self._scaled(plain)[0].reshape(-1, plain.shape[2]),
            self.Q.reshape(-1, self.Q.shape[2]),
        )
        U, s, _ = np.linalg.svd(C - Q @ (Q.T @ C), full_matrices=False)
        U = U[:, s > np.sqrt(TOLD)]
        r = self.r.ravel()
        r = r - U @ (U.T @ r)
        both = np.hstack([Q, U]).reshape(*self.r.shape, -1)
        return WhitenedRows(
            self.whiteners, r.reshape(self.r.shape), both, float(r @ r),
            self.freedom - U.shape[1],
        )  # fmt: skip

    def step(self, plain: Array, first: Index, end: Index) -> tuple[float, int, int, Array]:
        """Largest drop of chi-square by a change of the rows from one on until before another.

        Parameters
        ----------
        plain : (m, 6, k) array
            Derivative of the rows by the change.
        first, end : (s,) array
            First row that each of the spans has, and that it has no more; m where it stays.

        Returns
        -------
        drop, span, rank : float, int, int
            Of the span with the largest drop; its drop is 0 where none has enough coordinates.
        change : (k,) array
            Its numbers.
        """
        C, size = self._scaled(plain)
        until = [
            np.concatenate([np.zeros((1, *one.shape[1:])), np.cumsum(one, axis=0)])
            for one in (
                np.einsum("mri,mrj->mij", C, C),
                np.einsum("mri,mrf->mif", C, self.Q),
                np.einsum("mri,mr->mi", C, self.r),
                self.whiteners.any(axis=2).sum(axis=1, dtype=np.float64),
            )
        ]
        inside = until[3][end] - until[3][first]
        enough = np.minimum(inside, until[3][-1] - inside)
        spans = np.flatnonzero(enough >= ENOUGH * min(plain.shape[2], self.Q.shape[2]))
        best = (0.0, 0, 0, np.zeros(plain.shape[2]))
        for part in np.array_split(spans, range(AT_ONCE, len(spans), AT_ONCE)):
            if not len(part):
                continue
            CC, CQ, b = (one[end[part]] - one[first[part]] for one in until[:3])
            values, axes = np.linalg.eigh(CC - CQ @ np.swapaxes(CQ, 1, 2))
            along = (np.swapaxes(axes, 1, 2) @ b[:, :, None])[..., 0]
            told = values > TOLD
            inverse = np.where(told, 1 / np.where(told, values, 1.0), 0.0)
            drop = (along**2 * inverse).sum(axis=1)
            k = int(np.argmax(drop))
            if drop[k] > best[0]:
                change = axes[k] @ (inverse[k] * along[k])
                best = float(drop[k]), int(part[k]), int(told[k].sum()), change * size
        return best

    def slow(self, plain: Array, span: tuple[int, int]) -> float:
        """Largest drop of chi-square by the same change of a span (first, end) if it comes slowly.

        Linear or settling where the span has all later rows, and coming and going, too, where it
        ends before: as half a wave, at half its height where the span begins and ends.
        """
        m, (first, end) = len(plain), span
        share = np.linspace(0, 1, m)
        shapes = [share, *(1 - np.exp(-share / life) for life in (0.1, 0.3))]
        if end < m:
            middle, half = (first + end - 1) / 2, (end - first) / 2
            away = np.abs(np.arange(m) - middle) / half
            shapes += [
                np.where(away < 2, (1 + np.cos(np.pi * away / 2)) / 2, 0.0),
                np.clip(1.5 - away, 0, 1),
                1 / (1 + away**2),
            ]
        return max(self.drop(plain * shape[:, None, None])[0] for shape in shapes)

    def wandering(self, plain: Array, first: int) -> bool:
        """Whether the same change that wanders explains more than a step from a row on.

        Each beyond what chance explains; the step may have come on top of a linear drift.

        References
        ----------
        Five half waves over the session take 94 % of a step in its middle: sum 8 / (pi k)^2 over
        odd k up to five.
        """
        t = np.linspace(0, 1, len(plain))
        after = (np.arange(len(plain)) >= first).astype(np.float64)
        waves = np.cos(np.pi * np.arange(1, WAVES + 1)[:, None] * t)
        return self._beyond(plain, waves) > self._beyond(plain, np.array([after, t]))

    def _beyond(self, plain: Array, shapes: Array) -> float:
        """Drop of chi-square by a change with each of shapes (s, m), beyond that by chance."""
        every = np.concatenate([plain * shape[:, None, None] for shape in shapes], axis=2)
        gain, rank, _ = self.drop(every)
        return float(gain - rank * (self.square - gain) / max(self.freedom - rank, 1))

    def without(self, plain: Array, change: Array, side: Bool) -> Array:
        """Residuals (m, 6) off the free numbers that a change of the rows of one side leaves."""
        moved = (self.whiteners @ plain @ change) * side[:, None]
        Q = self.Q.reshape(-1, self.Q.shape[2])
        off = moved.ravel() - Q @ (Q.T @ moved.ravel())
        return np.asarray(self.r - off.reshape(self.r.shape))

    def drop(self, plain: Array) -> tuple[float, int, Array]:
        """Drop of chi-square by a change (m, 6, k) of all rows, its rank and its numbers (k,)."""
        C, size = self._scaled(plain)
        flat = C.reshape(-1, C.shape[2])
        CQ = flat.T @ self.Q.reshape(len(flat), -1)
        values, axes = np.linalg.eigh(flat.T @ flat - CQ @ CQ.T)
        along = axes.T @ (flat.T @ self.r.ravel())
        told = values > TOLD
        inverse = np.where(told, 1 / np.where(told, values, 1.0), 0.0)
        change = axes @ (inverse * along)
        return float((along**2 * inverse).sum()), int(told.sum()), change * size

    def _scaled(self, plain: Array) -> tuple[Array, Array]:
        """Whitened columns of length one over all rows, and the factors (k,) that scale them."""
        C = self.whiteners @ plain
        size = np.sqrt((C**2).sum(axis=(0, 1)))
        size = np.where(size > 0, 1 / np.where(size > 0, size, 1.0), 0.0)
        return C * size, size
