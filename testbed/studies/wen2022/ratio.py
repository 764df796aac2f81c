"""The ratio of the paper's protocol split into parts, and means over robots and pools.

With several pools, the unit of every interval is the pool with its robots, so that intervals
include the variation between sets chosen from different pools; with one pool the robot is the unit.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index
from testbed.studies.over_robots import mean_over_robots, share_over_robots
from testbed.studies.wen2022 import paper
from testbed.studies.wen2022.records import Reexamined
from testbed.units import Mean

PRINTED = "printed"


@dataclass(frozen=True, slots=True, eq=False)
class Split:
    """The ratio of the paper's protocol and its parts; means over the 24 numbers."""

    truth: str
    """Kind of robots, or `PRINTED`, whose intervals have no width."""
    trial: str
    """The optimal set."""
    poses: int
    ratio: Mean
    """u_best / u_rand."""
    repeats: Mean
    """u_r of the optimal set over u_r of the random one."""
    counted: Mean
    """u_r / u_rand, due to the further parts of the random side (times u_best / u_r of the optimal
    set, which is 1 if u_c is zero)."""
    geometric: tuple[float, ...]
    """(3,) geometric means of these three; the first is the product of the others."""
    shares: tuple[Mean, ...]
    """(3,) shares of u_r, u_p, u_w in the variance of u_rand."""
    p_over_r: Mean
    w_over_r: Mean


def over(values: Array, pool: Index, *, probability: float = 0.95) -> Mean:
    """Mean of one figure per robot (R,) with its interval over units.

    Parameters
    ----------
    values : (R,) array
        One figure per robot.
    pool : (R,) array
        Pool of each robot, 0 to P - 1, equally often. With one pool the robots are the units.
    """
    return mean_over_robots(_of_units(values, pool), probability=probability)


def share_over(values: Array, points: int, pool: Index) -> Mean:
    """Mean of one share per robot (R,), each of `points` points, with its interval."""
    each = _of_units(values, pool)
    return share_over_robots(each, points * len(values) / len(each))


def _of_units(values: Array, pool: Index) -> Array:
    """Means over the robots of each pool; with one pool the values of the robots."""
    if not pool.any():
        return values
    return np.array([values[pool == p].mean() for p in range(int(pool.max()) + 1)])


def over_pools(values: Array) -> Mean:
    """Mean of one figure per pool (P,); with one pool the interval is infinite."""
    return Mean(float(values[0]), float("inf")) if len(values) < 2 else mean_over_robots(values)


def printed_split() -> Split:
    """Table 3 split into parts; u_rand is the root sum of squares of its printed parts."""
    parts = [paper.table3(column)[None] for column in paper.PARTS]
    return split_of(None, PRINTED, 0, parts, np.zeros(len(paper.PARAMETERS)))


def combined(u_c: Array, *parts: Array) -> Array:
    """Contributors (..., f) and u_c (f,) as root sum of squares, eqs. (8) and (9) [m or rad]."""
    return np.hypot(np.sqrt(sum(part**2 for part in parts)) if parts[1:] else parts[0], u_c)


def split_of(
    kind: Reexamined | None, trial: str, poses: int, parts: Sequence[Array], u_c: Array
) -> Split:
    """The split for u_r of the optimal set, u_r, u_p, u_w of random ones (R, f), and u_c (f,).

    For robots of one kind, or as printed (1, f).
    """
    repeated, u_r, u_p, u_w = parts
    best, random = combined(u_c, repeated), combined(u_c, u_r, u_p, u_w)

    def mean(figures: Array) -> Mean:
        """Over the numbers, then over the units."""
        each = figures.mean(axis=1)
        return Mean(float(each[0]), 0.0) if kind is None else over(each, kind.pool)

    three = (best / random, repeated / u_r, best / repeated * (u_r / random))
    ratio, repeats, counted = map(mean, three)
    return Split(
        PRINTED if kind is None else kind.truth,
        trial,
        poses,
        ratio,
        repeats,
        counted,
        geometric=tuple(float(np.exp(np.log(part).mean())) for part in three),
        shares=tuple(mean(part**2 / random**2) for part in (u_r, u_p, u_w)),
        p_over_r=mean(u_p / u_r),
        w_over_r=mean(u_w / u_r),
    )
