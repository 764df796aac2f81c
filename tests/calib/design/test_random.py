"""Random sets: fair, reproducible, and judged like any other."""

import numpy as np
import pytest

from calib.design import (
    Problem,
    best_of_random,
    detmax,
    exchange,
    fedorov,
    random_selection,
    random_set,
    random_sets,
)
from calib.design.random import nonsingular_set
from calib.errors import InputError
from calib.information.observability import CRITERIA, IndexName
from tests.calib.design.design_cases import small_pool, turned_pool, whitened_pool


def test_a_random_set_is_ascending_without_repeats_and_reproducible():
    one, same = (random_selection(50, 20, np.random.default_rng(7)) for _ in range(2))
    np.testing.assert_array_equal(one, same)
    assert (np.diff(one) > 0).all()
    assert not one.flags.writeable


def test_every_pose_is_drawn_equally_often():
    rng = np.random.default_rng(0)
    hits = np.bincount(np.concatenate([random_selection(20, 5, rng) for _ in range(4000)]))
    # each is binomial(4000, 1/4): mean 1000, sd 27.4; largest of 20 stays below 4 sd
    assert np.abs(hits - 1000).max() < 4 * 27.4


@pytest.mark.parametrize("criterion", CRITERIA)
def test_the_best_of_many_is_the_largest_of_all_values(criterion: IndexName):
    blocks = whitened_pool(100)
    drawn = random_sets(Problem.of_blocks(blocks, 12, criterion), np.random.default_rng(0), sets=30)
    assert drawn.indices.shape == (30, 12)
    assert drawn.best.value == drawn.values.max()
    np.testing.assert_array_equal(drawn.best.indices, drawn.indices[drawn.values.argmax()])
    np.testing.assert_array_equal(drawn.best.trace, np.maximum.accumulate(drawn.values))
    # a second way for one of the indices: O2 is the inverse condition number
    if criterion == "O2":
        A = blocks[drawn.indices[3]].reshape(-1, 24)
        assert drawn.values[3] == pytest.approx(1 / np.linalg.cond(A), rel=1e-9)


def test_a_pool_full_of_twins_is_told_apart_from_one_that_is_merely_unlucky(monkeypatch):
    blocks = np.repeat(small_pool(0, 3, 2, 5), 400, axis=0)
    problem = Problem.of_blocks(blocks, 8, "D")
    assert len(nonsingular_set(problem, np.random.default_rng(0))) == 8
    monkeypatch.setattr("calib.design.random.DRAWS", 10)
    blind = blocks.copy()
    blind[:1199, :, 4] = 0  # one pose in 1200 sees the last number
    blind[1199, :, 4] = 1
    for criterion in ("D", "O2"):
        alone = Problem.of_blocks(blind, 3, criterion)
        assert 1199 in nonsingular_set(alone, np.random.default_rng(3))


@pytest.mark.parametrize("search", [detmax, exchange, fedorov])
def test_a_size_that_no_set_can_do_with_is_refused(search):
    """Two frames seen by their origins: of two turns one axis always stays the same."""
    problem = Problem.of_blocks(turned_pool(), 2, "D")
    with pytest.raises(InputError, match="no set of 2 poses was found that tells all numbers"):
        search(problem, np.random.default_rng(0))
    assert len(search(problem.resize(3), np.random.default_rng(0))) == 3


@pytest.mark.parametrize("m", [0, 51])
def test_a_size_the_pool_cannot_give_is_refused(m: int):
    with pytest.raises(InputError, match="1 to 50"):
        random_selection(50, m, np.random.default_rng(0))


def test_no_sets_at_all_are_refused():
    with pytest.raises(InputError, match="sets is 0"):
        best_of_random(Problem.of_blocks(small_pool(0), 6, "O1"), np.random.default_rng(0), sets=0)


def test_one_random_set_is_the_first_of_many_and_carries_its_certificate():
    blocks = whitened_pool(100)
    one = random_set(Problem.of_blocks(blocks, 12, "D"), np.random.default_rng(4))
    many = random_sets(Problem.of_blocks(blocks, 12, "D"), np.random.default_rng(4), sets=1)
    np.testing.assert_array_equal(one.indices, many.indices[0])
    assert one.value == many.values[0]
    assert one.certificate.efficiency < 0.97


def test_only_allowed_poses_are_drawn_and_not_those_already_measured():
    blocks, allowed = whitened_pool(60), np.arange(60) % 2 == 0
    best = best_of_random(
        Problem.of_blocks(blocks, 10, "A", given=(0, 1), allowed=allowed),
        np.random.default_rng(0),
        sets=20,
    )
    assert set(best.indices) <= set(range(2, 60, 2))
    assert (np.diff(best.trace) <= 0).all()  # an uncertainty: smaller is better


@pytest.mark.parametrize("criterion", ["O1", "O2", "O3", "O4", "O5", "D", "E", "A"])
def test_a_set_that_leaves_a_number_undetermined_has_the_worst_figure(criterion: str):
    """Two of six: what their last singular value has is rounding, which O1 would take for size."""
    problem = Problem.of_blocks(turned_pool(), 2, criterion)
    drawn = random_sets(problem, np.random.default_rng(0), sets=20)
    worst = 0.0 if problem.criterion.larger_is_better else np.inf
    assert (drawn.values == worst).all()
    three = random_sets(Problem.of_blocks(turned_pool(), 3, criterion), np.random.default_rng(0))
    assert (three.values != worst).all()
    assert np.isfinite(three.values).all()
