"""DETMAX: brute force takes the same path, small optima are found, the published bars are met."""

import json
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from calib.design import Problem, detmax, random_selection, random_sets
from calib.design.blocks import has_full_rank, information
from calib.errors import InputError
from calib.information.criteria.base import Pool
from calib.information.observability import CRITERIA, IndexName, index_of
from tests.calib.design.design_cases import (
    BruteForce,
    best_of_all,
    paper_pool,
    set_value,
    small_pool,
    whitened_pool,
)

pytestmark = pytest.mark.usefixtures("uncertified")
REFERENCE = Path(__file__).parents[4] / "shared/reference/exchange_reference.json"


@pytest.fixture(scope="module")
def paper():
    return paper_pool()


@pytest.mark.parametrize("criterion", CRITERIA)
@pytest.mark.parametrize("make", [paper_pool, whitened_pool])
def test_brute_force_takes_the_same_path(make, criterion: IndexName):
    blocks = make(50)
    start = random_selection(50, 15, np.random.default_rng(4))
    problem = Problem.of_blocks(blocks, 15, criterion)
    options = {"a": 4, "b": 2, "c": 1, "d": 6, "start": start}
    runs = [
        detmax(replace(problem, criterion=moves), np.random.default_rng(1), **options)
        for moves in (problem.criterion, BruteForce(criterion))
    ]
    np.testing.assert_array_equal(runs[0].indices, runs[1].indices)
    np.testing.assert_array_equal(runs[0].trace, runs[1].trace)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("criterion", "m", "bar"),
    [("O1", 29, 6.55), pytest.param("O1", 61, 6.58, marks=pytest.mark.study)],
)
def test_the_published_bars_of_o1_are_met(paper, criterion: IndexName, m: int, bar: float):
    found = detmax(Problem.of_blocks(paper, m, criterion), np.random.default_rng(0))
    assert found.value >= bar
    assert (
        random_sets(Problem.of_blocks(paper, m, criterion), np.random.default_rng(1)).values
        < found.value
    ).all()


@pytest.mark.slow
def test_the_published_bar_of_o2_is_met(paper):
    found = detmax(Problem.of_blocks(paper, 29, "O2"), np.random.default_rng(0))
    assert found.value >= 5.9e-5
    assert (
        random_sets(Problem.of_blocks(paper, 29, "O2"), np.random.default_rng(1)).values
        < found.value
    ).all()


@pytest.mark.slow
@pytest.mark.parametrize("criterion", CRITERIA)
def test_the_best_of_all_sets_is_found_where_all_can_be_tried(criterion: IndexName):
    missed = 0
    for seed in range(2):
        blocks = small_pool(seed)
        winner, value = best_of_all(blocks, 5, criterion)
        found = detmax(Problem.of_blocks(blocks, 5, criterion), np.random.default_rng(seed))
        assert found.value <= value * (1 + 1e-12)
        missed += tuple(found.indices) != winner
    # an exchange may end in a local optimum; with 80 shakes of 12 poses it has tried most sets
    assert missed == 0


# OEIS A003433: largest determinants of n x n matrices of signs
@pytest.mark.parametrize(("n", "best"), [(4, 16), (5, 48), (6, 160), (7, 576), (8, 4096)])
def test_saturated_two_level_designs_reach_the_largest_determinant(n: int, best: int):
    if REFERENCE.exists():
        table = next(iter(json.loads(REFERENCE.read_text()).values()))
        assert table[str(n)] == best
    signs = 1.0 - 2.0 * ((np.arange(2 ** (n - 1))[:, None] >> np.arange(n - 1)) & 1)
    rows = np.column_stack([np.ones(len(signs)), signs])
    found = detmax(Problem.of_blocks(rows[:, None], n, "O1"), np.random.default_rng(2))
    assert abs(np.linalg.det(rows[found.indices])) == pytest.approx(best, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("criterion", CRITERIA)
def test_no_addition_followed_by_a_deletion_improves_a_finished_search(criterion: IndexName):
    for seed in range(12):
        blocks = small_pool(seed, 40)
        brute, pool = BruteForce(criterion), Pool(blocks)
        # d = 1 shakes the set once; the start of each seed is another
        found = detmax(Problem.of_blocks(blocks, 6, criterion), np.random.default_rng(seed), d=1)
        inside = np.isin(np.arange(40), found.indices)
        added = brute.best_add(information(blocks[inside]), pool, ~inside)
        larger = np.append(found.indices, added.place)
        dropped = brute.best_drop(information(blocks[larger]), blocks[larger])
        kept = np.delete(larger, dropped.place)
        # 1e-9: the square root of information loses half the digits of the condition
        assert set_value(blocks, kept, criterion) <= found.value * (1 + 1e-9)


@pytest.mark.parametrize("criterion", CRITERIA)
def test_the_result_is_a_set_with_the_value_it_claims(criterion: IndexName):
    blocks = whitened_pool(150)
    found = detmax(Problem.of_blocks(blocks, 12, criterion), np.random.default_rng(3), d=6)
    assert len(found) == 12 == len(set(found.indices.tolist()))
    assert (np.diff(found.indices) > 0).all()
    assert 0 <= found.indices[0] <= found.indices[-1] < 150
    M = information(blocks[found.indices])
    # two ways: singular values of rows, and the information matrix (condition 10 to 100)
    assert found.value == pytest.approx(float(index_of(M, 12, criterion)), rel=1e-9)
    assert found.value == pytest.approx(found.trace[-1], rel=1e-9)
    assert (np.diff(found.trace) >= 0).all()
    assert len(found.trace) == found.searches


@pytest.mark.parametrize("criterion", CRITERIA)
def test_the_result_is_never_worse_than_its_start(criterion: IndexName):
    blocks = whitened_pool(100)
    good = detmax(Problem.of_blocks(blocks, 10, criterion), np.random.default_rng(0), d=3)
    again = detmax(
        Problem.of_blocks(blocks, 10, criterion), np.random.default_rng(1), d=1, start=good.indices
    )
    assert again.value >= good.value * (1 - 1e-12)


def test_the_same_seed_gives_the_same_set_and_another_seed_another_path():
    blocks = whitened_pool(100)
    first, second, other = (
        detmax(Problem.of_blocks(blocks, 10, "O1"), np.random.default_rng(seed), d=5)
        for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first.indices, second.indices)
    np.testing.assert_array_equal(first.trace, second.trace)
    assert not np.array_equal(first.trace, other.trace)


def test_it_stops_after_d_searches_in_a_row_without_gain():
    found = detmax(Problem.of_blocks(whitened_pool(60), 10, "O1"), np.random.default_rng(1), d=7)
    rises = np.flatnonzero(np.diff(found.trace, prepend=0.0) > 0)
    assert found.searches == rises[-1] + 1 + 7


def test_a_smaller_shake_follows_after_a_searches_without_gain(monkeypatch):
    module = import_module("calib.design.detmax")
    shakes, shake = [], module.shake

    def watch(problem, chosen, swaps, rng):
        after = shake(problem, chosen, swaps, rng)
        shakes.append(len(set(chosen.tolist()) - set(after.tolist())))
        return after

    monkeypatch.setattr(module, "shake", watch)
    found = detmax(
        Problem.of_blocks(whitened_pool(60), 10, "O1"), np.random.default_rng(1), a=3, b=2, c=1, d=6
    )
    fails = found.searches - 1 - np.flatnonzero(np.diff(found.trace, prepend=0.0) > 0)[-1]
    assert fails == 6
    assert shakes[-6:] == [2, 2, 1, 1, 1, 1]


def test_the_whole_pool_is_its_own_best_set():
    found = detmax(Problem.of_blocks(small_pool(0, 6), 6, "O2"), np.random.default_rng(0))
    assert found.indices.tolist() == list(range(6))


def test_a_pool_of_twins_ends_and_repeats_none():
    blocks = np.repeat(small_pool(2, 8), 3, axis=0)
    for criterion in CRITERIA:
        found = detmax(Problem.of_blocks(blocks, 6, criterion), np.random.default_rng(0), d=10)
        assert len(set(found.indices.tolist())) == 6
        assert has_full_rank(blocks[found.indices].reshape(-1, 5))


@pytest.mark.parametrize(
    ("m", "change", "says"),
    [
        (81, None, "the pool has 80"),
        (3, None, "24 numbers need at least 4 poses"),
        (20, "nan", r"blocks\[5, 2, 3\] is nan"),
        (20, "blind", "cannot tell the 24 numbers apart"),
    ],
)
def test_what_cannot_be_selected_is_refused_with_numbers(m: int, change: str | None, says: str):
    blocks = whitened_pool(80).copy()
    if change == "nan":
        blocks[5, 2, 3] = np.nan
    if change == "blind":
        blocks[:, :, 7] = blocks[:, :, 8]
    with pytest.raises(InputError, match=says):
        detmax(Problem.of_blocks(blocks, m, "O1"), np.random.default_rng(0))


@pytest.mark.parametrize("start", [[0, 1, 2], [0, 1, 2, 2, 3], [0, 1, 2, 3, 80], [0, 1, 2, 3, -1]])
def test_a_start_that_is_no_set_is_refused(start: list[int]):
    with pytest.raises(InputError, match="start"):
        detmax(Problem.of_blocks(whitened_pool(80), 5, "O1"), np.random.default_rng(0), start=start)


@pytest.mark.parametrize("constant", ["b", "c", "d"])
def test_constants_that_never_stop_are_refused(constant: str):
    with pytest.raises(InputError, match=f"{constant} is 0"):
        detmax(
            Problem.of_blocks(whitened_pool(80), 5, "O1"), np.random.default_rng(0), **{constant: 0}
        )


@pytest.mark.parametrize("constant", ["b", "c"])
@pytest.mark.parametrize(("m", "most"), [(5, 5), (75, 5), (40, 40)])
def test_more_swaps_than_there_are_poses_are_refused(constant: str, m: int, most: int):
    """More than the set has, or than the pool has beside it; nothing is clipped in silence."""
    problem = Problem.of_blocks(whitened_pool(80), m, "O1")
    with pytest.raises(
        InputError, match=rf"{constant} is {most + 1}; expected at most {most}; the set has"
    ):
        detmax(problem, np.random.default_rng(0), **{constant: most + 1})
    found = detmax(problem, np.random.default_rng(0), a=1, d=2, **{constant: most})
    assert len(found.indices) == m


def test_the_paper_s_swaps_shrink_with_a_small_pool_and_repeats_need_none_beside():
    blocks = whitened_pool(80)
    found = detmax(Problem.of_blocks(blocks, 79, "O1"), np.random.default_rng(0), d=2)
    assert len(found.indices) == 79
    again = Problem.of_blocks(blocks, 78, "O1", repeats=True)
    assert len(detmax(again, np.random.default_rng(0), b=78, d=2).indices) == 78


def test_an_unknown_index_is_refused():
    with pytest.raises(InputError, match="O9"):
        detmax(Problem.of_blocks(whitened_pool(80), 5, "O9"), np.random.default_rng(0))
