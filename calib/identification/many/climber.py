"""One robot of many that climb: its rows, and evidence and errors of models fitted to them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.model import RobotModel
from calib.identification.evidence.model_equations import LEAST_FREE
from calib.identification.levels import Level, joined, with_errors
from calib.identification.many.climb_plan import ClimbPlan, apart
from calib.identification.many.grounds import Ground, Rest
from calib.identification.many.settle import SprungRows

MANY_TERMS = 64
"""Number of terms from which the products of their columns are computed joint by joint."""
FAR_BELOW = 0.7
"""Fraction of the smallest sum of squares that could show more noise than stated; below it the fit
of springs stops early. Less than one, since a last step may still trade a little against the prior.
"""


class Fitted(NamedTuple):
    """Result of fitting springs on a `Ground` or on a `Rest` of it."""

    numbers: Array
    """(s,) in units of their prior sd."""
    loss: float
    """Change of the sum of squares of the ground, with the springs' prior."""
    spread: float
    """Log determinant of the curvature of half that loss, as in `ManyBent`."""


Task = tuple["Climber", Ground | Rest, tuple[Level, ...], int]
"""Springs to fit: robot, ground, levels of the model, and part that is left out (-1: none)."""


@dataclass(eq=False)
class Climber:
    """One robot of a climb, n = 6 m rows of m poses, with the fits of its models so far."""

    plan: ClimbPlan
    geometry: Array
    """(f, n) columns of the free numbers of the chain, as in `ClimbRows`."""
    bends: Array
    """(3 j, n) columns of the bends of each joint about x, y and z."""
    r: Array
    """(n,) whitened residual after the fit of the geometry, measured minus predicted."""
    offset: Array
    """(f,) that fit minus the prior mean [m, rad]."""
    metres: Array
    """(m, 3, 3) inverse whitening of positions, by which rows become meters [m]."""
    scale: float = 1.0
    """Noise in units of the stated one."""
    grounds: dict[tuple[Level, ...], Ground] = field(default_factory=dict)
    """Ground of each model of terms; keys are levels in the order of `apart`."""
    fits: dict[tuple[tuple[Level, ...], int], Fitted] = field(default_factory=dict)
    """Fitted springs by levels and the part that is left out (-1: none)."""
    rows: dict[Level, SprungRows] = field(default_factory=dict)
    """Rows of the springs by their level."""
    pushed: dict[bytes, tuple[Array, Array]] = field(default_factory=dict)
    """Columns A (n, k) of the products of springs, and A'A; keys are the bytes of their places."""
    products: dict[tuple[tuple[Level, ...], bytes], tuple[Array, Array, Array, Array]] = field(
        default_factory=dict
    )
    """A, Y A, A'S A and A'v of these on the ground of some terms; Y, S, v as in `RowsLeft`."""

    def at_noise(self, scale: float) -> "Climber":
        """The same robot with rows in units of a noise `scale` times the stated one."""
        return replace(self, scale=scale, grounds={}, fits={}, rows={}, pushed={}, products={})

    def ground(self, terms: tuple[Level, ...]) -> Ground:
        """Ground of a model of geometry and some levels of terms, in the order of `apart`."""
        if terms not in self.grounds:
            if not terms:
                self.grounds[terms] = self._bare()[0]
            else:
                found = self._columns(*self.plan.fewest[terms[-1]])
                self.grounds[terms] = self.ground(terms[:-1]).widened(*found)
        return self.grounds[terms]

    def _bare(self, moved: Array | None = None) -> tuple[Ground, Array]:
        """Ground and step (f,) of geometry alone, after subtracting `moved` (n,) from the rows."""
        geometry, r = self.geometry / self.scale, self.r / self.scale
        r = r if moved is None else r - moved
        return Ground.of_geometry(geometry, r, self.plan.precision, self.offset)

    def _columns(self, joints: Index, values: Array) -> tuple[Array, Array]:
        """Columns (k, n) of terms that turn joints (k,) by values (m, k), and A A' (k, k) of them.

        Of A A' only the lower triangle is sure to be filled.
        """
        turns = self.bends[2::3].reshape(-1, len(values), 6) / self.scale
        columns = (turns[joints] * values.T[:, :, None]).reshape(len(joints), -1)
        if len(joints) < MANY_TERMS:
            return columns, columns @ columns.T
        # two joints' columns have one inner product per pose, which their terms only multiply
        products = np.empty((len(joints), len(joints)))
        for joint in np.unique(joints):
            own = np.flatnonzero(joints == joint)
            before = slice(own[-1] + 1)
            met = (turns * turns[joint]).sum(axis=2)[joints[before]]
            products[own, before] = values[:, own].T @ (met.T * values[:, before])
        return columns, products

    def sprung(self, level: Level) -> SprungRows:
        """Rows of a level of springs."""
        if level not in self.rows:
            springs, places, loads = self.plan.springs[level]
            columns = self.bends[places].reshape(len(places), -1, 6).transpose(1, 2, 0)
            self.rows[level] = SprungRows(
                springs, np.ascontiguousarray(columns) / self.scale, loads
            )
        return self.rows[level]

    def normal(
        self, sprung: Level, levels: tuple[Level, ...], ground: Ground | Rest
    ) -> tuple[Array, Array]:
        """N (k, k) and pull (k,) of the products of springs, with the linear numbers eliminated."""
        terms, columns = apart(self.plan, levels)[0], self.plan.springs[sprung][0].columns.tobytes()
        key = terms, columns
        if key not in self.products:
            if columns not in self.pushed:
                P = self.sprung(sprung).products()
                self.pushed[columns] = P, P.T @ P
            whole, (P, square) = self.ground(terms).rows, self.pushed[columns]
            told = whole.spent @ P
            self.products[key] = P, told, square - told.T @ told, whole.v @ P
        P, spent, N, pull = self.products[key]
        if isinstance(ground, Rest):
            told = ground.told(P, spent)
            N, pull = N - told.T @ told, pull - ground.pulled @ told
        return N, pull

    def tasks(self, levels: tuple[Level, ...], left_out: bool) -> Iterable[Task]:
        """Fits of springs that are still needed to answer a question about a model."""
        terms, sprung = apart(self.plan, levels)
        if sprung is None:
            return
        ground = self.ground(terms)
        for k in range(len(self.plan.part)) if left_out else (-1,):
            if (levels, k) not in self.fits:
                yield self, self._on(ground, k), levels, k

    def _on(self, ground: Ground, k: int) -> "Ground | Rest":
        """A ground without part k of the poses; all of it for -1."""
        if k < 0:
            return ground
        rows = (6 * self.plan.part[k][:, None] + np.arange(6)).ravel()
        return ground.rest(k, rows)

    def evidence(self, levels: tuple[Level, ...]) -> float:
        """Log evidence of a model, up to a constant of all models; see `NormalEquations.solved`."""
        terms, sprung = apart(self.plan, levels)
        ground = self.ground(terms)
        loss, spread = ground.loss, ground.spread
        if sprung is not None:
            fitted = self.fits[levels, -1]
            loss, spread = loss + fitted.loss, spread + fitted.spread
        return (self.plan.constant - loss - spread) / 2

    def missed(self, levels: tuple[Level, ...]) -> Array:
        """Mean position error (poses,) of each pose, by a fit without its part [m]."""
        terms, sprung = apart(self.plan, levels)
        pose, away = self.plan.pose, np.full(len(self.plan.pose), np.nan)
        for k, rows in enumerate(self.plan.part):
            rest = self._on(self.ground(terms), k)
            assert isinstance(rest, Rest)
            left = rest.left(None if sprung is None else self.bent(levels, sprung, k))
            left = self.metres[rows] @ (self.scale * left).reshape(-1, 6)[:, :3, None]
            away[rows] = np.sqrt((left[:, :, 0] ** 2).sum(axis=1))
        return np.asarray(np.bincount(pose, away) / np.bincount(pose))

    def bent(self, levels: tuple[Level, ...], sprung: Level, k: int) -> Array:
        """Change (n,) of the predicted rows by the springs of a fit."""
        return self.sprung(sprung).bent(self.fits[levels, k].numbers)

    def noise(self, levels: tuple[Level, ...]) -> float:
        """Noise that a model leaves, in units of the stated one; one or more.

        If the residual is already far too small to show more noise than stated, the fit of springs
        stops early, since it could only reduce the loss further. Springs are not fitted at all if
        the loss without them, an upper bound of the final residual, is small enough.
        """
        terms, sprung = apart(self.plan, levels)
        ground, least = self.ground(terms), LEAST_FREE * len(self.r)
        if self.scale * np.sqrt(ground.loss / least) <= 1.0:
            return 1.0
        under, left = ground.rows, ground.rows.v
        if sprung is not None:
            rows = self.sprung(sprung)
            enough = FAR_BELOW * least if self.scale == 1.0 else 0.0
            bent = rows.settled(under, enough, self.plan.loop)
            left = left - under.times(rows.bent(bent.numbers))
        if self.scale * float(np.sqrt(left @ left / least)) <= 1.0:  # whatever is learned
            return 1.0
        learned = float((under.spent**2).sum())
        if sprung is not None:
            moved = under.times(rows.slopes(bent.numbers))
            learned += float(np.trace(bent.inverse @ (moved.T @ moved)))
        return max(1.0, self.scale * float(np.sqrt(left @ left / max(len(left) - learned, least))))

    def moved(self, levels: tuple[Level, ...], near: RobotModel, free: Sequence[str]) -> RobotModel:
        """The robot after the fit of a model; its `free` numbers of geometry move from `near`."""
        terms, sprung = apart(self.plan, levels)
        under = self.ground(terms).rows
        left, moved = under.v, np.zeros(len(self.r))
        found: dict[str, float] = {}
        if sprung is not None:
            fitted, sd = self.fits[levels, -1], self.plan.springs[sprung][0].sd
            moved = self.bent(levels, sprung, -1)
            left = left - under.times(moved)
            found |= zip(sprung.names, (sd * fitted.numbers).tolist(), strict=True)
        turns = self.bends[2::3].reshape(-1, len(self.plan.pose), 6) / self.scale
        pushed = (turns * left.reshape(-1, 6)).sum(axis=2)
        for level in terms:
            joints, values = self.plan.terms[level]
            x = (values.T * pushed[joints]).sum(axis=1)
            found |= zip(level.names, (level.sd * x).tolist(), strict=True)
            bends = np.zeros(turns.shape[:2])
            np.add.at(bends, joints, values.T * x[:, None])
            moved = moved + (turns * bends[:, :, None]).sum(axis=0).ravel()
        found |= zip(free, self._bare(moved)[1].tolist(), strict=True)
        wide = with_errors(near, joined(levels))
        return wide.moved(np.array([found.get(name, 0.0) for name in wide.names]))
