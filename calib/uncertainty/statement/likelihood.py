"""The restricted likelihood of sizes of misfit, the scale of the noise profiled out.

Every size and every scale on a grid: many sizes share one pass over the rows, all scales one system
of numbers, or with a prior five. The scale needs closer steps than the systems do, which lie
smoothly between sizes: the more rows and repeats, the better these tell it.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Bool, Index, frozen
from calib.uncertainty.statement.evidence import NoiseRepeats, PositionRows, reduced
from calib.uncertainty.statement.likelihood_systems import systems_of

STEP = float(np.log(1.15)) / 2
"""Logarithmic step of the sizes that are tried: 7 %."""
SMALLEST, LARGEST = 0.03, 1e4
"""Sizes tried, in standard deviations of the noise per axis; zero as well."""
AT_ONCE = 24
"""Sizes looked at together: most rows deny all but the first fifty."""
NODES = np.array([-4.0, -2.0, 0.0, 2.0, 4.0])
"""Scales of the noise at which the system of numbers is solved, in their standard deviations."""
REACH = 5.0
"""Standard deviations about the most likely scale within which scales are tried."""
HOPELESS = 30.0
"""Fall of the log-likelihood beyond which no larger size is looked at."""
WIDE, STRIDE = 200, 8
"""Numbers from which on every eighth size is tried first, then all about the best of these."""
DOUBT = 0.1
"""Standard deviation of the logarithm of the noise scale, where no repeats tell it."""
OF_ITS_SD = 4.0
"""Steps of the scale for each standard deviation with which rows and repeats tell it: between two
of them the log-likelihood misses at most .01 of its largest."""


@dataclass(frozen=True, slots=True, eq=False)
class Likelihood:
    """Restricted log-likelihood of sizes of misfit, the scale of the noise profiled out."""

    size: Array
    """(g,) in stated standard deviations of the noise per axis; the first is zero."""
    value: Array
    """(g,) logarithm, up to a constant."""
    noise_scale: Array
    """(g,) most likely factor on the stated noise at each size."""
    trusted: Array
    """(g,) as `value`, of no more noise than stated unless repeats show it."""

    def limit(self, drop: float) -> float:
        """Largest size within `drop` of the best; inf if beyond.

        No more noise than stated is taken for what a misfit may be: real ones have other forms than
        the one assumed, and even noise of another size may be more like them than that is.
        """
        level = self.trusted.max() - drop
        return float(np.sqrt(last_within(self.trusted, self.size**2, level)))


def likelihood(
    rows: PositionRows,
    unit: float,
    repeats: NoiseRepeats | None,
    before: PositionRows | None = None,
) -> Likelihood | None:
    """Restricted likelihood of sizes of misfit; None where the rows show no more than the numbers.

    Parameters
    ----------
    rows : PositionRows
        Of all poses.
    unit : float
        Stated noise per axis, in which sizes are counted [m].
    repeats : NoiseRepeats or None
        What repeats say of the scale of the noise; else it is known within `DOUBT`.
    before : PositionRows, optional
        Those of a prior, which no noise widens.

    References
    ----------
    V = g^2 (N + t^2 D), H = A'inv(V)A + Lambda0: with the size t counted in scaled noise, -2 l =
    ln|V| + ln|H| + y'Py + (what is known of g). Without a prior one system of numbers per t does,
    whatever g is; with one, ln|H| and g^2 y'Py are of fourth order in ln g, through those at
    `NODES`.
    """
    both = rows if before is None or not len(before.y) else rows.joined(before)
    A = reduced(both.A, None if before is None else before.A)
    n, p, freedom = len(rows.y), A.shape[1], len(A) - A.shape[1]
    if freedom < 1:
        return None
    grid = Grid.of(repeats)
    t, reach = grid.t, grid.reach
    lam = unit**2 * rows.lam
    nodes = grid.nodes if n < len(A) else np.zeros(1)
    systems = systems_of(np.column_stack([A, both.y]), lam, nodes)
    found = np.full((3, len(nodes), len(t)), np.nan)  # what is known of a size, whatever the scale
    value = np.full((2, len(t)), -np.inf)
    hopeless = HOPELESS + missed(n)

    def look(at: Index, many: int) -> None:
        """Fill in some sizes, ever larger ones, as long as these are not hopeless."""
        for start in range(0, len(at), many):
            part = at[start : start + many]
            found[:2, :, part] = systems.eliminated(t[part])
            found[2, :, part] = np.log1p(t[part, None] ** 2 * lam).sum(axis=1)[:, None]
            value[:, part] = grid.likeliest(found[:, :, part], n, p)
            before = value[:, : part[-1]].max(axis=1, initial=-np.inf)
            if (value[:, part[-1]] < before - hopeless).all():
                break  # larger ones are less likely still

    every = np.arange(len(t))
    if p > WIDE:
        look(every[::STRIDE], STRIDE // 2)
        near = every[max(0, int(value[0].argmax()) - STRIDE - 2 * reach) :]
        look(near[np.isneginf(value[0, near])], STRIDE)
    else:
        look(every, AT_ONCE)
    return Likelihood(*map(frozen, grid.profile(found, n, p)))


def last_within(value: Array, at: Array, level: float) -> float:
    """Largest `at` (k,) where values (k,) reach a level: straight between two; inf if beyond.

    Zero, the first of them, where none does.
    """
    within = np.flatnonzero(value >= level)
    if not len(within):
        return 0.0
    if within[-1] + 1 == len(at):
        return float(np.inf)
    ends = slice(within[-1], within[-1] + 2)
    return float(np.interp(-level, -value[ends], at[ends]))


def missed(rows: int) -> float:
    """Most that the log-likelihood of some rows lacks at a scale halfway between two of `log_g`."""
    return rows * (STEP / 2) ** 2


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Sizes and scales of the noise that are tried."""

    repeats: NoiseRepeats | None
    """What tells the scale; None where it is known within `DOUBT`."""
    center: float
    """Its most likely logarithm, by that alone."""
    sd: float
    """Standard deviation of it."""
    t: Array
    """(k,) sizes in scaled noise; the first is zero."""
    log_g: Array
    """(g,) logarithms of the scale, by the steps of the sizes."""

    @classmethod
    def of(cls, repeats: NoiseRepeats | None) -> "Grid":
        """By what repeats say of the scale of the noise, else known within `DOUBT`."""
        center, sd = (0.0, DOUBT) if repeats is None else (repeats.log_scale, repeats.log_scale_sd)
        reach = int(np.ceil(REACH * sd / STEP))
        log_g = center + STEP * np.arange(-reach, reach + 1.0)
        t = SMALLEST * np.exp(STEP * np.arange(-reach, _count() + reach))
        return cls(repeats, center, sd, np.concatenate([[0.0], t]), log_g)

    @property
    def reach(self) -> int:
        """Scales on either side of the most likely one."""
        return len(self.log_g) // 2

    @property
    def nodes(self) -> Array:
        """(5,) scales at which a system with a prior is solved."""
        return np.asarray(self.center + NODES * self.sd)

    def of_both(self, found: Array, n: int, p: int, log_g: Array | None = None) -> Array:
        """Log-likelihood (..., k, g) by size and scale, of n rows and p numbers.

        `found` are ln|H|, y'Py and ln|1 + t^2 lam| (..., 3, nodes, k); one node: without a prior.
        """
        log_g = self.log_g if log_g is None else log_g
        logarithm, square, of_rows = np.moveaxis(found, -3, 0)
        less = np.exp(-2 * log_g)
        if found.shape[-2] == 1:
            left = square[..., 0, :, None] * less
            value = logarithm[..., 0, :, None] + 2 * (n - p) * log_g + left
        else:
            powers, wanted = (
                np.vander(x, len(NODES)) for x in (NODES * self.sd, log_g - self.center)
            )
            between = np.linalg.solve(powers.T, wanted.T).T  # polynomials
            quadratic = between @ (square * np.exp(2 * self.nodes[:, None]))
            value = np.swapaxes(between @ logarithm, -1, -2) + 2 * n * log_g
            value += np.swapaxes(quadratic, -1, -2) * less
        return np.asarray(-value / 2 - of_rows[..., 0, :, None] / 2 - self._known(log_g))

    def likeliest(self, found: Array, n: int, p: int) -> Array:
        """Log-likelihoods (2, k) at the most likely scale, and at that of no untold noise."""
        value = self.of_both(found, n, p)
        return np.array([value.max(axis=1), value[:, self._told(self.log_g)].max(axis=1)])

    def _told(self, log_g: Array) -> Bool:
        """Scales of no more noise than stated, unless repeats show it."""
        return np.asarray(log_g <= self.center) | (self.repeats is not None)

    def _known(self, log_g: Array) -> Array:
        """What minus the log-likelihood has from what is known of the scale."""
        if self.repeats is None:
            return np.asarray((log_g - self.center) ** 2 / (2 * self.sd**2))
        return self.repeats.against(log_g)

    def profile(self, found: Array, n: int, p: int) -> tuple[Array, Array, Array, Array]:
        """Sizes (s,), and of each its log-likelihood (..., s) and most likely scale (..., s).

        Last, the log-likelihoods (..., s) of no more noise than is told. From what is `found` (...,
        3, nodes, k) of sizes in scaled noise, as in `of_both`: not a number where nobody looked.
        """
        looked = np.flatnonzero(~np.isnan(found).all(axis=(*range(found.ndim - 1),)))
        found = found[..., : looked[-1] + 3]  # two that nobody looked at stand for all
        # size = t g: equal steps in both logarithms, so that every size meets every scale there is
        sizes, last = np.arange(_count())[:, None], len(self.log_g)
        best = np.full((*found.shape[:-3], 1 + len(sizes)), -np.inf)
        scale, unseen, trusted = np.ones(best.shape), np.zeros(best.shape, dtype=bool), best.copy()
        for part, log_g in self._scales(n):
            value = self.of_both(found if part == 0.0 else _between(found, 1 - part), n, p, log_g)
            shift = np.rint((log_g - part * STEP - self.log_g[0]) / STEP).astype(np.int64)
            place = np.minimum(sizes + last - shift - (part > 0.0), found.shape[-1] - 1)
            none = self.of_both(found[..., :1], n, p, log_g)
            every = np.concatenate([none, value[..., place, np.arange(len(log_g))]], axis=-2)
            unseen |= np.isnan(every).any(axis=-1)
            every[np.isnan(every)] = -np.inf
            top = every.argmax(axis=-1)
            value = np.take_along_axis(every, top[..., None], axis=-1)[..., 0]
            more = value > best
            best[more], scale[more] = value[more], np.exp(log_g)[top[more]]
            told = every[..., self._told(log_g)].max(axis=-1, initial=-np.inf)
            trusted = np.maximum(trusted, told)
        for one in best, trusted:
            least = one.max(axis=-1, keepdims=True) - 2 * HOPELESS
            np.copyto(one, np.maximum(one, least), where=unseen)
        size = SMALLEST * np.exp(STEP * sizes[:, 0] + self.log_g[self.reach])
        return np.append(0.0, size), best, scale, trusted

    def _scales(self, rows: int) -> Iterator[tuple[float, Array]]:
        """Scales by the part of a step that each lies above one of `log_g`.

        References
        ----------
        Rows tell the logarithm of the scale with a variance of 1 / (2 rows), no less.
        """
        sd = (2 * rows + self.sd**-2) ** -0.5
        steps = int(np.ceil(OF_ITS_SD * STEP / sd))
        far = min(int(np.ceil(REACH * self.sd / STEP * steps)), self.reach * steps)
        place = np.arange(-far, far + 1)
        for part in np.unique(place % steps):
            yield part / steps, self.center + STEP * place[place % steps == part] / steps


def _between(found: Array, part: float) -> Array:
    """Values (..., k) at a part of a step above each size but none, from those at sizes (..., k).

    References
    ----------
    Lagrange's polynomial through the four sizes about; straight on beyond the first and the last.
    """
    own = found[..., 1:]
    ends = 2 * own[..., [0, -1]] - own[..., [1, -2]]
    f = np.concatenate([ends[..., :1], own, ends[..., 1:], ends[..., 1:]], axis=-1)
    a, b, c, d = part + 1, part, part - 1, part - 2
    shares = -b * c * d / 6, a * c * d / 2, -a * b * d / 2, a * b * c / 6
    value = sum(share * f[..., k : k + own.shape[-1]] for k, share in enumerate(shares))
    return np.concatenate([found[..., :1], value], axis=-1)


def _count() -> int:
    """Sizes tried beside zero."""
    return int(np.log(LARGEST / SMALLEST) / STEP) + 1
