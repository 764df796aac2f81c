"""Tours: the best single change is found, and many points take no hours."""

import tracemalloc

import numpy as np
import pytest

from testbed.laboratory.route import tours
from testbed.laboratory.route.moves import times_between, travel_times
from testbed.laboratory.route.tours import best_tour, length
from tests.hangs import no_hang


def times_of(x):
    """Times (n, n) of moves whose slowest joint decides."""
    return np.abs(x[:, None] - x).max(axis=-1)


def gains(times, tour):
    """Gain of every move of one to three neighbors, either way around, by measuring each tour."""
    n, whole = len(tour), length(times, tour)
    for size in range(1, min(3, n - 2) + 1):
        for i in range(1, n - size + 1):
            rest = np.delete(tour, np.s_[i : i + size])
            for piece in (tour[i : i + size], tour[i : i + size][::-1]):
                for k in range(1, len(rest) + 1):
                    changed = np.concatenate([rest[:k], piece, rest[k:]])
                    yield whole - length(times, changed)


@pytest.mark.parametrize("n", [3, 4, 5, 9, 16])
def test_the_best_move_is_the_best_by_brute_force(n):
    rng = np.random.default_rng(n)
    for _ in range(20):
        times = times_of(rng.uniform(size=(n, 4)))
        tour = np.concatenate([[0], 1 + rng.permutation(n - 1)])
        gain, changed = tours._best_move(times, tour)
        assert sorted(changed) == list(range(n))
        assert changed[0] == 0
        # lengths of a few: their last digits
        assert gain == pytest.approx(max(gains(times, tour)), abs=1e-13)
        assert length(times, tour) - length(times, changed) == pytest.approx(gain, abs=1e-13)


@pytest.mark.slow
def test_hundreds_of_points_take_seconds_and_no_longer_way_than_from_neighbor_to_neighbor(
    monkeypatch,
):
    monkeypatch.setattr(tours, "MANY", 125)  # as 600 points beside the 250 there are
    times = times_of(np.random.default_rng(4).uniform(size=(300, 6)))
    given = np.arange(300)
    with no_hang():  # move by move, from each of 25 starts, it took minutes
        tour = best_tour(times, given)
    assert sorted(tour) == given.tolist()
    nearest = tours.nearest_neighbors(times, int(np.argsort(times[0, 1:], kind="stable")[0]) + 1)
    assert length(times, tour) < 0.97 * length(times, nearest)
    assert length(times, best_tour(times, tour)) <= length(times, tour)


def test_many_poses_take_a_few_tables_of_times_and_not_one_for_each_joint(monkeypatch):
    """Times between all of them have the bits of moves taken one by one."""
    rng = np.random.default_rng(4)
    monkeypatch.setattr(tours, "MANY", 100)  # one search, as of a thousand poses and more
    n, joints = 500, 7
    q, speeds = rng.normal(size=(n, joints)), rng.uniform(0.5, 3.0, joints)
    table = n * n * 8
    tracemalloc.start()
    try:
        times = times_between(q, speeds)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.reset_peak()
        before = tracemalloc.get_traced_memory()[0]
        best_tour(times, np.arange(n))
        searched = tracemalloc.get_traced_memory()[1] - before
    finally:
        tracemalloc.stop()
    np.testing.assert_array_equal(times, travel_times(q[:, None], q[None], speeds))
    # the table and one more; in the search its order, what is added and two in passing
    assert peak < 2.1 * table
    assert searched < 4.1 * table
