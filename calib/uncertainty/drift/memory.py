"""Noise that remembers: a test on residuals in time order, and what drift leaves in the estimate.

A drift averages over its own memory, not over all rows: the base follows it, a link hardly does.
The test needs poses in random order; on a tour the misfit of neighbors passes for drift. Whether
the order is random the poses themselves tell: the same test is asked of where they stand. If it is
not, visits of one pose still may change places, which share what the model misses there.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from calib.arrays import Array, Bool, Index, check
from calib.identification.identify import Identification
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.shown import Shown, length_words
from calib.uncertainty.drift.beside_drift import rows_in_time
from calib.uncertainty.statement.gain import estimator_gain, of_all_numbers
from calib.uncertainty.statement.likelihood import last_within
from calib.uncertainty.statement.misfit import DROP
from calib.uncertainty.statement.shape import MisfitShape

KERNEL_ROWS = 8.0
"""Memory of the test's kernel [rows]."""
PERMUTATIONS = 500
BLOCK = 2_000_000
"""Rows of permuted residuals at a time: 48 MB."""
MEMORIES = (3.0, 10.0, 30.0)
"""Memories of a drift that are tried [rows]."""
SIZES = 0.15 * 1.45 ** np.arange(9)
"""Standard deviations of a drift that are tried beside zero, in those of the noise."""
REMEMBERS = 0.05
"""A p-value below this adds what a drift leaves to the statement."""


@dataclass(frozen=True, slots=True, eq=False)
class SlowDrift(Shown):
    """The largest drift that the rows allow, and what it leaves in the estimate."""

    sd: float
    """Standard deviation per axis [m]."""
    memory: float
    """Rows over which it is forgotten."""
    covariance: Annotated[Array, "P", "P"]
    """(P, P) of all numbers [m, rad]."""

    def __repr__(self) -> str:
        return f"SlowDrift({length_words(self.sd, um='.3g')}, memory {self.memory:g} rows)"


def memory_p(
    residual: Array, order: Index, rng: np.random.Generator, alike: Sequence[Index] | None = None
) -> float:
    """Chance of rows that follow their neighbors in time as these do, if noise forgets.

    Parameters
    ----------
    residual : (m, d) array
        Whitened position residuals, or whatever else is asked.
    order : (m,) array
        Place of each row in time.
    rng : numpy.random.Generator
        Of the permutations.
    alike : sequence of (k, c) arrays of int, optional
        Rows that may change places, as `interchangeable` finds them; by default all.

    References
    ----------
    T = sum over j < k of exp(-|j - k| / 8) r_j'r_k, the rows of each kind about their mean;
    `PERMUTATIONS` orders.
    """
    (residual,) = check("m d", residual=residual)
    m = len(residual)
    alike = [np.arange(m)[:, None]] if alike is None else alike
    residual = residual.copy()
    for rows in alike:
        residual[rows] -= residual[rows].mean(axis=(0, 1))
    in_time = np.argsort(order, kind="stable")
    seen = _likeness(residual[in_time][:, None])[0]
    larger = sum(
        int((_likeness(residual[which[:, in_time].T]) >= seen).sum())
        for which in permuted(m, alike, rng)
    )
    return (1 + larger) / (1 + PERMUTATIONS)


def permuted(m: int, alike: Sequence[Index], rng: np.random.Generator) -> Iterator[Index]:
    """Orders (c, m) of m rows, `PERMUTATIONS` in all; rows `alike` (k, c) change places."""
    block = max(1, BLOCK // max(m, 1))
    for k in range(0, PERMUTATIONS, block):
        count = min(block, PERMUTATIONS - k)
        which = np.tile(np.arange(m), (count, 1))
        for rows in alike:
            drawn = np.argsort(rng.random((count, len(rows))), axis=1)
            which[:, rows.ravel()] = rows[drawn].reshape(count, -1)
        yield which


def interchangeable(order: Index, pose: Index, held_out: Bool, seen: Array) -> tuple[Index, ...]:
    """Rows that may change places if poses come in random order: (k, c), rows in time, per kind.

    What the model misses is the same in all rows of a pose, so poses change places, not rows. A
    pose that identifies is missed by less than a held-out one, all of which share the error of the
    numbers: each stays among its like. So do poses of as many rows, and those of one station, tool,
    target or load: what is wrong with these, they share, and most often they come in blocks. Poses
    that see what no other does change places among themselves.

    Parameters
    ----------
    order, pose : (m,) arrays
        Place in time and pose of each row; no pose both identifies and is held out.
    held_out : (m,) array of bool
        Rows not identified from.
    seen : (m, d) array
        What each row looks at, and with which load; see `seen_by_rows`.
    """
    kinds: dict[tuple[bool, int, bytes], list[Index]] = {}
    in_time = np.argsort(order, kind="stable")
    numbers = pose[in_time]
    by_pose = np.argsort(numbers, kind="stable")
    starts = np.flatnonzero(np.diff(numbers[by_pose])) + 1
    for rows in np.split(in_time[by_pose], starts):
        what = seen[rows[np.lexsort(seen[rows].T)]].tobytes()
        kinds.setdefault((bool(held_out[rows[0]]), len(rows), what), []).append(rows)
    alike: dict[tuple[bool, int, bytes], list[Index]] = {}
    for (test, count, what), poses in kinds.items():
        alike.setdefault((test, count, what if len(poses) > 1 else b""), []).extend(poses)
    return tuple(map(np.array, alike.values()))


def seen_by_rows(table: Measurements) -> Array:
    """What each row (m, d) looks at, from where, and with which load."""
    load = table.conditions.moments
    seen = np.column_stack([table.target_key, *([] if load is None else [load])])
    return np.ascontiguousarray(seen + 0.0)  # minus zero is no other place


def visits_of_poses(order: Index, pose: Index, seen: Array) -> tuple[Index, ...]:
    """Rows that may change places in whatever order poses come: visits (k, c) of one pose, of each.

    What the model misses at a pose is the same at each visit that sees the same. Rows between which
    no other pose stands are one visit.

    Parameters
    ----------
    order, pose : (m,) arrays
        Place in time and pose of each row.
    seen : (m, d) array
        What each row looks at, and from which side the arm came.
    """
    in_time = np.argsort(order, kind="stable")
    edges = np.flatnonzero(np.diff(pose[in_time])) + 1
    alike: dict[tuple[int, bytes], list[Index]] = {}
    for rows in np.split(in_time, edges):
        rows = rows[np.lexsort(seen[rows].T)]
        alike.setdefault((int(pose[rows[0]]), seen[rows].tobytes()), []).append(rows)
    return tuple(np.array(visits) for visits in alike.values() if len(visits) > 1)


def _likeness(residual: Array) -> Array:
    """T (k,) of residuals (m, k, d) in time order, by what is remembered of the rows before."""
    keep, before, total = np.exp(-1 / KERNEL_ROWS), np.zeros(residual.shape[1:]), 0.0
    for now in residual:
        total = total + (now * before).sum(axis=1)
        before = keep * (before + now)
    return np.asarray(total)


def whitened_positions(identification: Identification, table: Measurements) -> Array:
    """Position residuals (m, 3) of poses and points in units of their noise."""
    seen = predict(identification.model, table)
    values, axes = np.linalg.eigh(table.covariance[:, :3, :3])
    root = (axes / np.sqrt(values)[:, None]) @ np.swapaxes(axes, 1, 2)
    return np.asarray((root @ seen.residual[:, :3, None])[..., 0])


def drift(
    identification: Identification,
    train: Measurements,
    train_order: Index,
    held_out: Measurements,
    held_out_order: Index,
    *,
    shape: MisfitShape,
    misfit: float,
) -> SlowDrift:
    """The largest drift that the positions allow beside noise and misfit.

    Parameters
    ----------
    identification : Identification
        From `train`.
    train, held_out : Measurements
        Poses and points.
    train_order, held_out_order : (m,) and (n,) arrays
        Place of each row in time, one numbering for both.
    shape : MisfitShape
        Of a misfit of 1 m per axis.
    misfit : float
        Its most likely size [m].

    References
    ----------
    V = N + misfit^2 D + s^2 exp(-|j - k| / L) x I3, x flat or with its prior; the pair of largest
    s^2 L within `DROP` of the largest restricted likelihood. In the estimate
    F (s^2 exp(-|j - k| / L) x I3) F'.
    """
    some = rows_in_time(identification, train, train_order, held_out, held_out_order)
    beside = some.beside(shape, misfit)
    gaps = np.maximum(np.diff(some.order), 1)  # what came at once came one after the other
    squares = (some.noise_sd * np.append(0.0, SIZES)) ** 2
    value = np.array(
        [
            [beside.alone(), *(beside.likelihood(v**0.5, np.exp(-gaps / L)) for v in squares[1:])]
            for L in MEMORIES
        ]
    )
    level = value.max() - DROP
    largest = np.array([min(last_within(one, squares, level), squares[-1]) for one in value])
    longest = int(np.argmax(largest * MEMORIES))
    sd, memory = float(np.sqrt(largest[longest])), MEMORIES[longest]
    F = estimator_gain(identification, train)[:, :, :3]
    left = sd**2 * sum_of_remembered(F, train_order, memory)
    return SlowDrift(sd, memory, of_all_numbers(identification, left))


def sum_of_remembered(F: Array, order: Index, memory: float) -> Array:
    """Sum of exp(-|t_j - t_k| / L) F_j F_k' (f, f) over all rows F (m, f, 3), at places t (m,).

    What each row meets of those before it fades on the way to the next: no m x m matrix is formed.
    """
    in_time = np.argsort(order, kind="stable")
    keep = np.exp(-np.diff(order[in_time]) / memory)
    F = F[in_time]
    before = np.zeros_like(F)
    for k, kept in enumerate(keep):
        before[k + 1] = kept * (before[k] + F[k])
    across = np.tensordot(F, before, ((0, 2), (0, 2)))
    return np.asarray(np.tensordot(F, F, ((0, 2), (0, 2))) + across + across.T)
