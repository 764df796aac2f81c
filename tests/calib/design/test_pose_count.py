"""How many poses: the curves are those of random sets, and the rule lands where it should."""

from functools import cache

import numpy as np
import pytest

from calib.design import Problem, pose_count
from calib.design.pose_count import stable_count
from calib.design.random import draw_set
from calib.errors import InputError
from calib.information.observability import CRITERIA, IndexName, index_of_singular
from calib.information.rank import singular_values
from tests.calib.design.design_cases import paper_pool, set_value, small_pool, whitened_pool


@cache
def repetitions():
    """The curves of all indices, twelve times."""
    problem = Problem.of_blocks(paper_pool(), 120, "D")
    return [
        pose_count(problem, np.random.default_rng(seed), counts=range(4, 121)) for seed in range(12)
    ]


@pytest.mark.slow
@pytest.mark.truth
@pytest.mark.parametrize(("criterion", "low", "high"), [("O1", 52, 60), ("O2", 25, 36)])
def test_the_rule_lands_in_the_published_ranges(criterion: IndexName, low: int, high: int):
    chosen = [curves[CRITERIA.index(criterion)].chosen for curves in repetitions()]
    # MATH 8.1; a single repetition scatters by 3 (O1) or 6 (O2), a median of twelve by 1 or 2
    assert low <= np.median(np.array(chosen, dtype=float)) <= high


def test_the_means_are_those_of_sets_drawn_afresh():
    blocks, rng = whitened_pool(300), np.random.default_rng(5)
    problem = Problem.of_blocks(blocks, 40, "D")
    curve = pose_count(problem, np.random.default_rng(1), counts=[10, 20, 40], sets=200)[1]
    for k, m in enumerate((10, 20, 40)):
        values = [set_value(blocks, rng.choice(300, m, replace=False), "O2") for _ in range(200)]
        # means of 200 sets each: 4 standard deviations of their difference
        assert abs(np.mean(values) - curve.mean[k]) < 4 * curve.sd[k] * np.sqrt(2 / 200)
        assert np.std(values) == pytest.approx(curve.sd[k], rel=0.25)


def test_all_five_curves_are_those_of_the_same_growing_sets():
    blocks, rng = paper_pool(200), np.random.default_rng(3)
    curves = pose_count(Problem.of_blocks(blocks, 150, "D"), np.random.default_rng(3), sets=3)
    orders = [rng.permutation(200) for _ in range(3)]
    for criterion, curve in zip(CRITERIA, curves, strict=True):
        assert curve.criterion == criterion
        np.testing.assert_array_equal(curve.counts, np.arange(4, 151))
        for m in (6, 54, 150):
            rows = [blocks[order[:m]].reshape(-1, 24) for order in orders]
            values = [index_of_singular(singular_values(A), m, criterion, "per_pose") for A in rows]
            # of rows with condition 3e4 and of their squares: about seven digits are alike
            assert curve.mean[m - 4] == pytest.approx(np.mean(values), rel=1e-6)


def test_only_poses_that_may_be_chosen_are_drawn():
    blocks, allowed = whitened_pool(60).copy(), np.arange(60) % 2 == 0
    blocks[~allowed] *= 1e3
    some = pose_count(
        Problem.of_blocks(blocks, 20, "D", allowed=allowed), np.random.default_rng(4), sets=5
    )
    alone = pose_count(
        Problem.of_blocks(blocks[allowed], 20, "D"), np.random.default_rng(4), sets=5
    )
    for here, there in zip(some, alone, strict=True):
        np.testing.assert_array_equal(here.mean, there.mean)


def test_with_repeats_sets_grow_beyond_the_pool_like_sets_drawn_afresh():
    problem = Problem.of_blocks(small_pool(0), 30, "D", repeats=True)
    curve = pose_count(problem, np.random.default_rng(1), counts=[8, 30], sets=300)[1]
    for k, m in enumerate((8, 30)):
        drawn = [draw_set(problem.resize(m), np.random.default_rng([2, i])) for i in range(300)]
        values = [set_value(problem.blocks, chosen, "O2") for chosen in drawn]
        # means of 300 sets each: 4 standard deviations of their difference
        assert abs(np.mean(values) - curve.mean[k]) < 4 * curve.sd[k] * np.sqrt(2 / 300)


def test_the_sum_of_singular_values_settles_only_per_pose():
    problem = Problem.of_blocks(whitened_pool(400), 150, "D")
    raw, per_pose = (
        pose_count(problem, np.random.default_rng(2), sets=30, form=form)
        for form in ("correct", "per_pose")
    )
    for k in (2, 3, 4):
        assert raw[k].chosen is None
        assert per_pose[k].chosen is not None
        np.testing.assert_allclose(raw[k].mean, per_pose[k].mean * np.sqrt(raw[k].counts))


def test_the_rule_compares_ten_values_with_the_ten_before():
    counts = np.arange(5, 105)
    step = np.where(counts < 50, 1.0, 2.0)
    # the windows hold only twos once ten values from 50 on lie behind; a constant settles at once
    assert stable_count(counts, np.full(100, 3.0)) == 15
    assert stable_count(counts[35:], step[35:]) == 60
    assert stable_count(counts, counts) is None  # rises by 10 in 100 at the end: never 0.5 %
    assert stable_count(counts[:19], np.ones(19)) is None  # two windows do not fit
    assert stable_count(counts[:20], np.ones(20)) == 15
    assert stable_count([2, 4, 8], [1.0, 1.0, 1.0], window=1) == 4


def test_a_brute_force_rule_agrees():
    rng = np.random.default_rng(0)
    for _ in range(50):
        mean = 1 - np.exp(-np.arange(80) / rng.uniform(3, 40)) + 0.003 * rng.normal(size=80)
        expected = None
        for k in range(10, 71):
            before, after = mean[k - 10 : k].mean(), mean[k : k + 10].mean()
            if abs(after - before) < 0.005 * before:
                expected = k
                break
        assert stable_count(np.arange(80), mean) == expected


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"counts": [10, 400]}, "the pool has 12"),
        ({"counts": [2, 5]}, "5 numbers need at least 3 poses"),
        ({"counts": [5, 6.5]}, r"counts\[1\] is 6\.5"),
        ({"counts": [6, 5]}, "counts must ascend"),
        ({"counts": []}, "counts must ascend"),
        ({"sets": 0}, "sets is 0"),
        ({"form": "mean"}, "form"),
    ],
)
def test_curves_that_cannot_be_drawn_are_refused(options, says: str):
    problem = Problem.of_blocks(small_pool(0), 12, "D")
    with pytest.raises(InputError, match=says):
        pose_count(problem, np.random.default_rng(0), **options)
