"""V and G with inputs that all readings share: the plain fit's error, exact gains, a true bound."""

import itertools

import numpy as np
import pytest

from calib.arrays import Array
from calib.design import Problem, certify, exchange
from calib.design.blocks import information
from calib.information.criteria.base import Criterion, Pool
from calib.information.criteria.lazy import best_swap
from calib.information.criteria.named import criterion_named
from tests.calib.design.design_cases import BruteForce, goal_set, small_goals, whitened_pool

P, K = 5, 3
NAMES = ("V", "G")
KNOWN = np.diag([*np.zeros(P), *np.ones(K)])
"""Each input in its own standard deviation."""


def wide_pool(seed: int, n: int = 12, r: int = 3, p: int = P, k: int = K) -> Array:
    """Random blocks (n, r, p + k) of uneven size."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n, r, p + k)) * rng.uniform(0.3, 3, (n, 1, 1))


def total(name: str, g: int = 6) -> Criterion:
    """The criterion for a small pool."""
    return criterion_named(name, goals=small_goals(99, P, g), inputs=K)


def variance(name: str, chosen: Array, g: int = 6) -> float:
    """What plain least squares makes of noise and inputs, from its pseudoinverse alone."""
    A, B = np.split(chosen.reshape(-1, P + K), [P], axis=1)
    F = np.linalg.pinv(A)
    of_numbers = F @ (np.eye(len(A)) + B @ B.T) @ F.T
    rows = small_goals(99, P, g).rows
    each = np.einsum("gip,pq,giq->g", rows, of_numbers, rows)
    return float(each.max() if name == "G" else each.mean())


@pytest.mark.parametrize("name", NAMES)
def test_the_value_is_the_mean_square_error_of_plain_least_squares(name: str):
    for seed in range(5):
        chosen = wide_pool(seed)[:4]
        value = float(total(name).value(information(chosen)))
        # condition below 1e3, squared in M
        assert -value == pytest.approx(variance(name, chosen), rel=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_a_set_that_rounding_alone_tells_apart_is_worse_than_any(name: str):
    """Two rows for three numbers: a factor with roots is found, one without has a pivot of zero."""
    seen = np.array([[0.0, 3.0, -2.0, 1.0], [2.0, 1.0, -3.0, 1.0]])
    criterion = criterion_named(name, goals=small_goals(99, 3), inputs=1)
    both = np.stack([seen.T @ seen, np.eye(4)])
    assert criterion.value(both[0]) < -1e12
    values = criterion.value(both)
    assert values[0] < -1e12
    assert values[1] == criterion.value(both[1])


@pytest.mark.parametrize("name", NAMES)
def test_inputs_without_effect_change_nothing(name: str):
    goals, blocks = small_goals(99, P), wide_pool(3)
    blocks[..., P:] = 0.0
    plain = criterion_named(name, goals=goals)
    M, own = information(blocks[:5]), information(blocks[:5, :, :P])
    assert total(name).value(M) == pytest.approx(plain.value(own), rel=1e-12)
    assert total(name).add(M, blocks[5:]) == pytest.approx(
        plain.add(own, blocks[5:, :, :P]), rel=1e-9
    )


@pytest.mark.parametrize("name", NAMES)
def test_gains_are_those_of_the_pseudoinverse(name: str):
    criterion, blocks = total(name), wide_pool(7)
    here, M = variance(name, blocks[:5]), information(blocks[:5])
    added = [here - variance(name, blocks[[0, 1, 2, 3, 4, j]]) for j in range(5, 12)]
    dropped = [here - variance(name, np.delete(blocks[:5], i, axis=0)) for i in range(5)]
    assert criterion.add(M, blocks[5:]) == pytest.approx(np.array(added), rel=1e-8, abs=1e-9 * here)
    assert criterion.drop(M, blocks[:5]) == pytest.approx(
        np.array(dropped), rel=1e-8, abs=1e-9 * here
    )
    swapped = criterion.swap(M, blocks[:2], blocks[5:7])
    for i, j in itertools.product(range(2), range(2)):
        after = np.append(np.delete(blocks[:5], i, axis=0), blocks[[5 + j]], axis=0)
        assert swapped[i, j] == pytest.approx(here - variance(name, after), rel=1e-8)
    # what all readings share can make a pose do harm
    assert min(added) < 0


@pytest.mark.parametrize("name", NAMES)
def test_the_best_moves_are_those_of_brute_force(name: str):
    """With more goals than the bound of G looks at."""
    rng = np.random.default_rng(5)
    blocks = np.concatenate([whitened_pool(80), rng.normal(size=(80, 6, K))], axis=2)
    criterion = criterion_named(name, goals=goal_set(n=40), inputs=K)
    pool, brute = Pool(blocks), BruteForce(criterion)
    for seed in range(3):
        chosen = np.sort(np.random.default_rng(seed).choice(80, 10, replace=False))
        outside, M = ~np.isin(np.arange(80), chosen), information(blocks[chosen])
        added, best = criterion.best_add(M, pool, outside), brute.best_add(M, pool, outside)
        assert added.place == best.place
        assert added.gain == pytest.approx(best.gain, rel=1e-6)
        assert criterion.best_drop(M, blocks[chosen]).place == (
            brute.best_drop(M, blocks[chosen]).place
        )
        places = np.flatnonzero(outside)
        gains = criterion.swap(M, blocks[chosen], blocks[places])
        i, j = np.unravel_index(gains.argmax(), gains.shape)
        swap = best_swap(criterion, M, blocks[chosen], pool, outside)
        assert (swap.leaving, swap.entering) == (i, places[j])


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_no_set_beats_the_bound_and_the_search_finds_almost_the_best(name: str):
    for seed in range(2):
        blocks = wide_pool(seed, n=10)
        problem = Problem.of_blocks(blocks, 4, total(name), prior=KNOWN)
        found = exchange(problem, np.random.default_rng(seed))
        sets = [np.array(places) for places in itertools.combinations(range(10), 4)]
        least = min(variance(name, blocks[places]) for places in sets)
        limit = certify(problem, found.indices)
        assert limit is not None
        assert limit.figure_bound <= np.sqrt(least) * (1 + 1e-12)
        assert found.value == pytest.approx(np.sqrt(variance(name, blocks[found.indices])))
        # exchanges of two end in local optima: of 210 sets, hardly worse than the best
        assert found.value <= 1.05 * np.sqrt(least)


@pytest.mark.slow
def test_the_search_for_the_whole_beats_the_search_for_the_noise():
    """A pool half of whose poses see a large shared input that the noise does not tell of."""
    rng, goals = np.random.default_rng(2), goal_set(n=30)
    A = whitened_pool(200)
    shared = rng.normal(size=(200, 6, 1)) * np.where(np.arange(200) < 100, 3.0, 0.1)[:, None, None]
    blocks = np.concatenate([A, shared], axis=2)
    whole = criterion_named("V", goals=goals, inputs=1)
    by_noise = exchange(Problem.of_blocks(A, 12, criterion_named("V", goals=goals)), rng)
    prior = np.zeros((25, 25))
    prior[-1, -1] = 1.0
    by_whole = exchange(Problem.of_blocks(blocks, 12, whole, prior=prior), rng)
    counted = float(np.sqrt(-whole.value(information(blocks[by_noise.indices]))))
    assert by_whole.value < 0.9 * counted
