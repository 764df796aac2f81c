"""One robot of many that climb: its rows, what models leave of them, and what they predict."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.model import RobotModel
from calib.identification.levels import Level, joined, with_errors
from calib.identification.many.climb_plan import ClimbPlan, apart
from calib.identification.many.grounds import Ground, Rest
from calib.identification.many.settle import SprungRows
from calib.identification.normal_equations import LEAST_FREE

MANY_TERMS = 64
"""Terms from which their products are worked out joint by joint."""
FAR_BELOW = 0.7
"""Part of the least sum of squares that could tell of more noise than stated, below which springs
are followed no further. Not one: a last step may still trade a little of it against the prior."""


class Fitted(NamedTuple):
    """Springs fitted on a ground, or on what is left of it."""

    numbers: Array
    """(s,) in units of their prior sd."""
    loss: float
    """What they change of the sum of squares of the ground, their prior included."""
    spread: float
    """Log determinant of half the second derivatives of that, as in `ManyBent`."""


Task = tuple["Climber", Ground | Rest, tuple[Level, ...], int]
"""Springs to fit: whose, on what ground, of which model, without which part (-1: of all rows)."""


@dataclass(eq=False)
class Climber:
    """One robot of a climb and what is known of its models so far: n = 6 m rows of m poses."""

    plan: ClimbPlan
    geometry: Array
    """(f, n) columns of the free numbers of the chain, as in `ClimbRows`."""
    bends: Array
    """(3 j, n) columns of the bends of each joint about x, y and z."""
    r: Array
    """(n,) whitened, measured minus predicted after the fit of the geometry."""
    offset: Array
    """(f,) of that fit from what is believed [m, rad]."""
    metres: Array
    """(m, 3, 3) what turns the rows of a position back into metres [m]."""
    scale: float = 1.0
    """Noise in units of the stated one."""
    grounds: dict[tuple[Level, ...], Ground] = field(default_factory=dict)
    """By levels of terms in the order of `apart`."""
    fits: dict[tuple[tuple[Level, ...], int], Fitted] = field(default_factory=dict)
    """By levels, and the part that is left out (-1: of all rows)."""
    rows: dict[Level, SprungRows] = field(default_factory=dict)
    """By level of springs."""
    pushed: dict[bytes, tuple[Array, Array]] = field(default_factory=dict)
    """Columns A (n, k) of the products of springs, and A'A, by the bytes of their places."""
    products: dict[tuple[tuple[Level, ...], bytes], tuple[Array, Array, Array, Array]] = field(
        default_factory=dict
    )
    """These on the ground of some terms: A, Y A, A'S A and A'v, with Y, S, v as in `RowsLeft`."""

    def at_noise(self, scale: float) -> "Climber":
        """The same with rows in units of a noise so many times the stated one."""
        return replace(self, scale=scale, grounds={}, fits={}, rows={}, pushed={}, products={})

    def ground(self, terms: tuple[Level, ...]) -> Ground:
        """All rows under geometry and some levels of terms, in the order of `apart`."""
        if terms not in self.grounds:
            if not terms:
                self.grounds[terms] = self._bare()[0]
            else:
                found = self._columns(*self.plan.fewest[terms[-1]])
                self.grounds[terms] = self.ground(terms[:-1]).widened(*found)
        return self.grounds[terms]

    def _bare(self, moved: Array | None = None) -> tuple[Ground, Array]:
        """Geometry alone, and its step (f,), where something has `moved` the rows (n,)."""
        geometry, r = self.geometry / self.scale, self.r / self.scale
        r = r if moved is None else r - moved
        return Ground.of_geometry(geometry, r, self.plan.precision, self.offset)

    def _columns(self, joints: Index, values: Array) -> tuple[Array, Array]:
        """Columns (k, n) of terms that turn joints (k,) by values (m, k), and their products.

        Of the products (k, k) the lower triangle at least.
        """
        turns = self.bends[2::3].reshape(-1, len(values), 6) / self.scale
        columns = (turns[joints] * values.T[:, :, None]).reshape(len(joints), -1)
        if len(joints) < MANY_TERMS:
            return columns, columns @ columns.T
        # two turns meet in one number at each pose, whatever their values
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
        """N (k, k) and pull (k,) of the products of some springs; linear numbers follow them."""
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
        """Fits of springs without which a question cannot be answered."""
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
        """Mean miss of each pose by a fit to the other parts (poses,) [m]."""
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
        """What the springs of a fit move (n,)."""
        return self.sprung(sprung).bent(self.fits[levels, k].numbers)

    def noise(self, levels: tuple[Level, ...]) -> float:
        """Noise that a model leaves, one or more, in units of the stated one.

        Where much less is left than would tell of more noise than stated, springs are not followed
        to their end: the loss only falls on the way there. Nor are they looked at where the loss
        before them, never less than what is left in the end, is as low.
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
        """The robot with a model's numbers, beside its geometry `near` of some free numbers."""
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
