"""One addition, one deletion: the bounded search and the brute force choose the same pose."""

import numpy as np
import pytest

from calib.arrays import Array
from calib.design.blocks import information, is_singular
from calib.design.exchange import TIE, first_best, scorer
from calib.information.observability import CRITERIA, Criterion
from tests.calib.design_cases import BruteForce, paper_pool, small_pool, whitened_pool

POOLS = {"paper": paper_pool(250), "whitened": whitened_pool(250)}


def near_optimal(blocks: Array, m: int, rng: np.random.Generator, criterion: Criterion) -> Array:
    """A random set after a few exchanges: there the candidates lie close together."""
    chosen, brute = rng.choice(len(blocks), m, replace=False), BruteForce(blocks, criterion)
    for _ in range(int(rng.integers(0, 12))):
        inside = np.isin(np.arange(len(blocks)), chosen)
        larger = np.append(chosen, brute.add(information(blocks[chosen]), inside).place)
        chosen = np.delete(larger, brute.drop(information(blocks[larger]), larger).place)
    return np.sort(chosen)


@pytest.mark.parametrize("criterion", CRITERIA)
@pytest.mark.parametrize("pool", POOLS)
def test_bounds_never_miss_the_best_pose(pool: str, criterion: Criterion):
    blocks, rng = POOLS[pool], np.random.default_rng(8)
    fast, brute = scorer(blocks, criterion), BruteForce(blocks, criterion)
    evaluated = 0
    for _ in range(20):
        chosen = near_optimal(blocks, 20, rng, criterion)
        inside = np.isin(np.arange(len(blocks)), chosen)
        M = information(blocks[chosen])
        added = fast.add(M, inside)
        assert added.place == brute.add(M, inside).place
        assert fast.drop(M, chosen).place == brute.drop(M, chosen).place
        evaluated += added.evaluated
    # the point of the bounds: most candidates are never evaluated
    assert evaluated < 0.5 * 20 * len(blocks)


@pytest.mark.parametrize("criterion", CRITERIA)
@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (1, 4), (3, 2), (7, 5), (2, 9)])
def test_blocks_of_any_shape_will_do(shape: tuple[int, int], criterion: Criterion):
    r, p = shape
    for seed in range(20):
        blocks = small_pool(seed, 30, r, p)
        fast, brute = scorer(blocks, criterion), BruteForce(blocks, criterion)
        chosen = np.arange(-(-p // r) + 2)
        inside = np.isin(np.arange(30), chosen)
        M = information(blocks[chosen])
        # O3 of one number, and the like, can tie exactly: compare the value reached, then the place
        place, best = fast.add(M, inside).place, brute.add(M, inside).place
        values = brute.values(M, brute.gram[[place, best]], 1.0)
        assert values[0] == pytest.approx(values[1], rel=1e-9)
        place, best = fast.drop(M, chosen).place, brute.drop(M, chosen).place
        values = brute.values(M, brute.gram[chosen[[place, best]]], -1.0)
        assert values[0] == pytest.approx(values[1], rel=1e-9)


@pytest.mark.parametrize("criterion", CRITERIA)
def test_of_equal_poses_the_lowest_place_wins(criterion: Criterion):
    once = small_pool(3, 10)
    blocks = np.concatenate([once, once, once])
    fast = scorer(blocks, criterion)
    chosen = np.arange(4)
    inside = np.isin(np.arange(30), chosen)
    assert fast.add(information(blocks[chosen]), inside).place < 20
    twice = np.array([0, 1, 2, 3, 10, 11, 12, 13])
    assert fast.drop(information(blocks[twice]), twice).place < 4


def test_values_within_rounding_are_a_tie():
    assert first_best(np.array([1.0, 2.0, 2.0 * (1 + TIE / 2)])) == 1
    assert first_best(np.array([1.0, 2.0, 2.0 * (1 + 4 * TIE)])) == 2
    assert first_best(np.array([-3.0, -1.0, -2.0])) == 1


@pytest.mark.parametrize("criterion", CRITERIA)
def test_a_pose_inside_is_never_added(criterion: Criterion):
    blocks = small_pool(0, 12)
    for outside in range(12):
        inside = np.arange(12) != outside
        assert scorer(blocks, criterion).add(information(blocks), inside).place == outside


def test_a_pose_strong_in_one_direction_does_not_hide_one_good_in_many():
    # gains: log(1 + 20) = 3.0 for twenty strong rows, 4 log(1 + 8/4) = 4.4 for the even pose
    strong = np.zeros((20, 4, 4))
    strong[:, 0, 0] = np.sqrt(20)
    blocks = np.concatenate([strong, np.sqrt(2) * np.eye(4)[None]])
    for criterion in CRITERIA:
        added = scorer(blocks, criterion).add(np.eye(4), np.zeros(21, dtype=bool))
        assert added.place == 20


def test_whether_a_set_is_singular_does_not_depend_on_column_units():
    blocks = small_pool(0, 6)
    units = 10.0 ** np.array([-6, -3, 0, 3, 6])
    assert not is_singular(blocks * units)
    blocks[:, :, 2] = 2 * blocks[:, :, 0] - blocks[:, :, 4]
    assert is_singular(blocks * units)
    assert is_singular(blocks[:2])  # four rows for five numbers
