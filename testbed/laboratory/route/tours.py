"""Short open tours through points by local search, from the times between them."""

import numpy as np

from calib.arrays import Array, Index

STARTS = 24
"""Tours improved besides the given one: nearest neighbors after each of so many first stops."""
GAIN = 1e-9
"""Share of the length that a change must gain, so that rounding cannot keep the search going."""


def best_tour(times: Array, given: Index) -> Index:
    """Shortest of several locally best tours (n,) that start at point 0 and end anywhere.

    Parameters
    ----------
    times : (n, n) array
        Symmetric times between points [s].
    given : (n,) array
        A tour to improve as well: the result is never longer than this one.

    Returns
    -------
    (n,) array
        Points in order; no reversal of a piece and no move of up to three neighbors to another
        place, either way around, makes it shorter.

    References
    ----------
    Croes 1958 (2-opt); Or 1976 (moving a piece).
    """
    n = len(times)
    if n < 3:
        return np.asarray(given)
    firsts = np.argsort(times[0, 1:], kind="stable")[:STARTS] + 1
    tours = [improved(times, np.asarray(given))]
    tours += [improved(times, nearest_neighbors(times, int(first))) for first in firsts]
    return min(tours, key=lambda tour: length(times, tour))


def length(times: Array, tour: Index) -> float:
    """Time of a tour [s]."""
    return float(times[tour[:-1], tour[1:]].sum())


def nearest_neighbors(times: Array, first: int) -> Index:
    """From 0 to `first`, then always to the nearest point left; ties to the lowest index."""
    left = np.ones(len(times), dtype=bool)
    tour = [0, first]
    left[tour] = False
    while left.any():
        tour.append(int(np.argmin(np.where(left, times[tour[-1]], np.inf))))
        left[tour[-1]] = False
    return np.array(tour)


def improved(times: Array, tour: Index) -> Index:
    """The tour after the best change again and again, until none gains."""
    slack = GAIN * max(length(times, tour), 1.0)
    while True:
        gain, changed = max((_best_turn(times, tour), _best_move(times, tour)), key=lambda c: c[0])
        if gain <= slack:
            return tour
        tour = changed


def _best_turn(times: Array, tour: Index) -> tuple[float, Index]:
    """Largest gain of turning tour[i:j] around, 1 <= i < j; past the end nothing is joined."""
    n = len(tour)
    D = times[np.ix_(tour, tour)]
    step = D[np.arange(n - 1), np.arange(1, n)]
    after = np.append(step, 0.0)  # from the last point of a piece to what follows it
    # [i, k]: piece i..k, both ends included
    joined = np.zeros((n, n))
    joined[1:, :-1] = D[1:, 1:]  # new neighbors i and k + 1
    gain = np.full((n, n), -np.inf)
    gain[1:] = step[:, None] + after[None, :] - D[:-1] - joined[1:]
    gain[np.tril_indices(n)] = -np.inf
    i, k = np.unravel_index(int(np.argmax(gain)), gain.shape)
    changed = tour.copy()
    changed[i : k + 1] = tour[i : k + 1][::-1]
    return float(gain[i, k]), changed


def _best_move(times: Array, tour: Index) -> tuple[float, Index]:
    """Largest gain of taking out up to three neighbors and putting them elsewhere."""
    best, out = -np.inf, tour
    n = len(tour)
    for size in range(1, min(3, n - 2) + 1):
        for i in range(1, n - size + 1):
            piece, rest = tour[i : i + size], np.delete(tour, np.s_[i : i + size])
            gone = times[tour[i - 1], piece[0]]
            if i + size < n:
                following = tour[i + size]
                gone += times[piece[-1], following] - times[tour[i - 1], following]
            before, behind = rest, rest[1:]
            for ends in (piece, piece[::-1]):
                added = times[before, ends[0]]
                added[:-1] += times[ends[-1], behind] - times[before[:-1], behind]
                k = int(np.argmin(added))
                if gone - added[k] > best:
                    best = float(gone - added[k])
                    out = np.concatenate([rest[: k + 1], ends, rest[k + 1 :]])
    return best, out
