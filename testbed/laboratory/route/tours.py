"""Short open tours through points by local search, from the times between them."""

import numpy as np

from calib.arrays import Array, Index

STARTS = 24
"""Tours improved besides the given one: nearest neighbors after each of so many first stops."""
MANY = 250
"""Points above which a search from each of so many starts takes minutes."""
WORK = 10**9
"""Pairs of points that the improvement of one tour looks at, at most."""
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
        place, either way around, makes it shorter. Of more than `MANY` points fewer tours are
        tried, and of a thousand or more they are improved only as often as `WORK` allows.

    References
    ----------
    Croes 1958 (2-opt); Or 1976 (moving a piece).
    """
    n = len(times)
    if n < 3:
        return np.asarray(given)
    starts = STARTS if n <= MANY else max(STARTS * MANY**2 // n**2, 1)
    firsts = np.argsort(times[0, 1:], kind="stable")[:starts] + 1
    tours = [improved(times, np.asarray(given)) if n <= MANY else np.asarray(given)]
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
    for _ in range(max(WORK // len(tour) ** 2, 1)):
        gain, changed = max((_best_turn(times, tour), _best_move(times, tour)), key=lambda c: c[0])
        if gain <= slack:
            return tour
        tour = changed
    return tour


def _best_turn(times: Array, tour: Index) -> tuple[float, Index]:
    """Largest gain of turning tour[i:j] around, 1 <= i < j; past the end nothing is joined."""
    n = len(tour)
    D = times[np.ix_(tour, tour)]
    step = D[np.arange(n - 1), np.arange(1, n)]
    after = np.append(step, 0.0)  # from the last point of a piece to what follows it
    # [i, k]: piece i..k, both ends included
    gain = np.full((n, n), -np.inf)
    np.add(step[:, None], after[None, :], out=gain[1:])
    gain[1:] -= D[:-1]
    gain[1:, :-1] -= D[1:, 1:]  # new neighbors i and k + 1
    gain[np.tri(n, dtype=bool)] = -np.inf
    i, k = np.unravel_index(int(np.argmax(gain)), gain.shape)
    changed = tour.copy()
    changed[i : k + 1] = tour[i : k + 1][::-1]
    return float(gain[i, k]), changed


def _best_move(times: Array, tour: Index) -> tuple[float, Index]:
    """Largest gain of taking out up to three neighbors and putting them elsewhere."""
    best, out = -np.inf, tour
    n = len(tour)
    D = times[np.ix_(tour, tour)]
    step = np.diagonal(D, 1)
    for size in range(1, min(3, n - 2) + 1):
        first = np.arange(1, n - size + 1)
        last = first + size - 1
        gone = D[first - 1, first]
        gone[:-1] += step[last[:-1]] - D[first[:-1] - 1, last[:-1] + 1]
        cheapest = [_cheapest(D, step, *ends) for ends in ((first, last), (last, first))]
        after, added = (np.stack(both, axis=1) for both in zip(*cheapest, strict=True))
        gain = gone[:, None] - added
        k, turned = divmod(int(np.argmax(gain)), 2)
        if gain[k, turned] > best:
            best, i, behind = float(gain[k, turned]), int(first[k]), int(after[k, turned])
            piece, rest = tour[i : i + size], np.delete(tour, np.s_[i : i + size])
            cut = behind + 1 if behind < i else behind + 1 - size
            out = np.concatenate([rest[:cut], piece[::-1] if turned else piece, rest[cut:]])
    return best, out


def _cheapest(D: Array, step: Array, head: Index, tail: Index) -> tuple[Index, Array]:
    """Place (k,) of the tour behind which each of k pieces adds least time, and that time (k,)."""
    added = _added(D, step, head, tail)
    after = np.argmin(added, axis=1)
    return after, added[np.arange(len(head)), after]


def _added(D: Array, step: Array, head: Index, tail: Index) -> Array:
    """Time (k, n) that k pieces add behind each place of the tour without them; inf inside them.

    `head` (k,) comes after that place, and what followed it after `tail` (k,); D (n, n) are times
    between places of the tour, `step` (n - 1,) those between neighbors.
    """
    added = D[head]
    ahead = D[tail, 1:]
    ahead -= step
    added[:, :-1] += ahead
    del ahead
    first, last = np.minimum(head, tail), np.maximum(head, tail)
    row, before = np.arange(len(first)), first - 1
    # where a piece was taken out, what followed it follows; nothing follows the last one
    added[row, before] = D[head, before]
    row, before, behind = row[:-1], before[:-1], last[:-1] + 1
    added[row, before] += D[tail[:-1], behind] - D[before, behind]
    for k in range(int(last[0] - first[0]) + 1):
        added[np.arange(len(first)), first + k] = np.inf
    return added
