"""Springs of many models fitted at once, by the steps of `spring_products.lowest` for each."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from calib.arrays import Array, Index
from calib.identification.evidence.spring_products import (
    GAIN,
    STEPS,
    Lowest,
    ModelSprings,
    lowest,
    newton_steps,
)
from calib.identification.many.grounds import RowsLeft

AWAKE = 0.75
"""Fraction of problems still moving; below it those that have ended leave the arrays."""

LITTLE = 3.0
"""Predicted drop of the loss below which a step hardly changes the residual sum of squares, which
is near the number of rows."""


class ManyBent(NamedTuple):
    """Results of Q fits of springs."""

    numbers: Array
    """(Q, s) numbers in units of their prior sd."""
    loss: Array
    """(Q,) change of the loss by the springs, with their prior."""
    spread: Array
    """(Q,) log determinants of the Gauss-Newton matrices of half the loss."""


def settled_many(springs: ModelSprings, normal: Array, pull: Array) -> ManyBent:
    """`spring_products.settled` for Q problems of the same springs.

    `normal` (Q, k, k) has their matrices N, and `pull` (Q, k) their vectors.
    """
    count, s = len(pull), len(springs.sd)
    found = ManyBent(np.zeros((count, s)), np.zeros(count), np.zeros(count))
    here = _Problems(springs, np.arange(count), normal, pull)
    x, share, loss = np.zeros((count, s)), np.ones(count), np.zeros(count)
    awake = np.ones(count, dtype=bool)
    H, bend, force = here.bowls(x)
    for _ in range(STEPS):
        steps = np.zeros((2, *x.shape))
        for k in np.flatnonzero(awake):
            both = newton_steps(H[k], bend[k], force[k])
            steps[0, k], steps[1, k] = both[0], both[-1]
            awake[k] = float(both[0] @ force[k]) >= GAIN
        looking, moved = awake.copy(), np.zeros_like(awake)
        while looking.any():
            tries = [here.losses(x + share[:, None] * step) for step in steps]
            which = (tries[1] < tries[0]).astype(np.int64)
            new = np.minimum(*tries)
            lower = looking & (new < loss)
            step = steps[which, np.arange(len(x))]
            x[lower] += share[lower, None] * step[lower]
            loss[lower], share[lower] = new[lower], np.minimum(1.0, 2 * share[lower])
            moved |= lower
            looking &= ~lower
            share[looking] /= 2
            looking &= share > GAIN
        awake &= moved
        if not awake.any():
            break
        H[awake], bend[awake], force[awake] = (part[awake] for part in here.bowls(x))
        if awake.mean() < AWAKE:
            asleep = ~awake
            found.numbers[here.which[asleep]] = x[asleep]
            found.loss[here.which[asleep]] = loss[asleep]
            found.spread[here.which[asleep]] = np.linalg.slogdet(H[asleep])[1]
            here = here.some(awake)
            x, share, loss = x[awake], share[awake], loss[awake]
            H, bend, force = H[awake], bend[awake], force[awake]
            awake = awake[awake]
    found.numbers[here.which], found.loss[here.which] = x, loss
    found.spread[here.which] = np.linalg.slogdet(H)[1]
    return found


class _Problems(NamedTuple):
    """Fits of the same springs, with their losses and derivatives."""

    springs: ModelSprings
    which: Index
    normal: Array
    pull: Array

    def some(self, which: Array) -> "_Problems":
        """Some of the problems."""
        return _Problems(self.springs, self.which[which], self.normal[which], self.pull[which])

    def factors(self, x: Array) -> tuple[Array, Array]:
        """Compliance (Q, p) of each spring, and the factors (Q, 1 + f) of its loads."""
        p, sd = len(self.springs.load), self.springs.sd
        more = np.concatenate([np.ones((len(x), 1)), sd[p:] * x[:, p:]], axis=1)
        return sd[:p] * x[:, :p] / self.springs.load, more

    def losses(self, x: Array) -> Array:
        """Losses (Q,) at numbers (Q, s)."""
        give, more = self.factors(x)
        y = (give[:, :, None] * more[:, None]).reshape(len(x), -1)
        bowl = y[:, None] @ self.normal @ y[:, :, None]
        pulled = self.pull[:, None] @ y[:, :, None]
        return np.asarray((bowl - 2 * pulled + x[:, None] @ x[:, :, None])[:, 0, 0])

    def bowls(self, x: Array) -> tuple[Array, Array, Array]:
        """`ModelSprings.bowl` for all problems, on the first axis."""
        p, wide, many = len(self.springs.load), 1 + self.springs.moments, len(x)
        give, more = self.factors(x)
        by_more = (self.normal.reshape(many, -1, wide) @ more[:, :, None]).reshape(many, p, wide, p)
        by_give = (give[:, None] @ self.normal.reshape(many, p, -1)).reshape(many, wide, p, wide)
        pushed = by_more.reshape(many, p * wide, p) @ give[:, :, None]
        left = (self.pull[:, :, None] - pushed).reshape(many, p, wide)
        gives, weighs = self.springs.sd[:p] / self.springs.load, self.springs.sd[p:]
        H = np.zeros((many, p + wide - 1, p + wide - 1))
        H[:, :p, :p] = gives[:, None] * (more[:, None, None] @ by_more)[:, :, 0] * gives
        H[:, p:, p:] = weighs[:, None] * (give[:, None, None] @ by_give)[:, 1:, 0, 1:] * weighs
        crossed = (by_give @ more[:, None, :, None])[:, 1:, :, 0]
        H[:, p:, :p] = weighs[:, None] * crossed * gives
        H[:, :p, p:] = H[:, p:, :p].swapaxes(1, 2)
        H[:, range(H.shape[1]), range(H.shape[1])] += 1.0
        bend = np.zeros_like(H)
        bend[:, p:, :p] = -weighs[:, None] * left[:, :, 1:].swapaxes(1, 2) * gives
        bend[:, :p, p:] = bend[:, p:, :p].swapaxes(1, 2)
        weighed = gives * (left @ more[:, :, None])[:, :, 0]
        given = weighs * (give[:, None] @ left)[:, 0, 1:]
        return H, bend, np.concatenate([weighed, given], axis=1) - x


class SprungRows(NamedTuple):
    """Springs of one model in the rows of one robot: n = 6 m rows, pose by pose."""

    springs: ModelSprings
    columns: Array
    """(m, 6, p) columns of the springs' bends."""
    loads: Array
    """(m, p, 1 + f) load of each spring by the stated moments, then per free moment and tilt."""

    def products(self) -> Array:
        """(n, p (1 + f)) columns of all products."""
        every = self.columns[:, :, :, None] * self.loads[:, None]
        return np.asarray(every.reshape(6 * len(every), -1))

    def bent(self, x: Array) -> Array:
        """Change (n,) of the rows by numbers (s,) in units of their prior sd."""
        give, more = self.springs.factors(x)
        each = (self.loads @ more) * give
        return np.asarray((self.columns @ each[:, :, None]).ravel())

    def slopes(self, x: Array) -> Array:
        """Derivative (n, s) of `bent` by these numbers."""
        p, sd = len(self.springs.load), self.springs.sd
        give, more = self.springs.factors(x)
        found = np.empty((*self.columns.shape[:2], len(sd)))
        each = (self.loads @ more) * (sd[:p] / self.springs.load)
        np.multiply(self.columns, each[:, None], out=found[:, :, :p])
        given = self.columns * give
        np.matmul(given, self.loads[:, :, 1:] * sd[p:], out=found[:, :, p:])
        return found.reshape(-1, len(sd))

    def settled(
        self, rows: RowsLeft, most: float = 0.0, loop: Callable[..., None] | None = None
    ) -> Lowest:
        """`spring_products.lowest` for the rows of a `Ground`, by a compiled `loop` if given.

        With `most` above zero it ends early, once the residual sum of squares is below `most` and
        the next step promises less than `LITTLE`.
        """
        springs, p, v = self.springs, len(self.springs.load), rows.v
        gives, weighs = springs.sd[:p] / springs.load, springs.sd[p:]
        if loop is not None:
            x, found = np.zeros(len(springs.sd)), np.zeros(2)
            H, limits = np.eye(len(x)), np.array([STEPS, GAIN, most, LITTLE])
            loads = self.loads.reshape(-1, self.loads.shape[2])
            loop(self.columns, loads, rows.spent, v, gives, weighs, limits, x, H, found)
            return Lowest(x, H, *found.tolist())

        def loss_at(x: Array) -> float:
            h = self.bent(x)
            told = rows.spent @ h
            return float(h @ h - told @ told - 2 * v @ h + x @ x)

        def bowl(x: Array) -> tuple[Array, Array, Array]:
            D = self.slopes(x)
            left = v - rows.times(D[:, :p] @ x[:p])
            H, bend = rows.gram(D), np.zeros((len(x), len(x)))
            H[np.diag_indices(len(H))] += 1.0
            pushed = (left.reshape(-1, 1, 6) @ self.columns)[:, 0]
            crossed = (pushed[:, :, None] * self.loads[:, :, 1:]).sum(axis=0)
            bend[:p, p:] = -gives[:, None] * crossed * weighs
            bend[p:, :p] = bend[:p, p:].T
            return H, bend, D.T @ left - x

        def enough(x: Array, promised: float) -> bool:
            left = v - rows.times(self.bent(x))
            return promised < LITTLE and float(left @ left) < most

        return lowest(len(springs.sd), loss_at, bowl, enough if most else None)
