"""Greedy selection: each step is the best one, the beginning of a set is a smaller set."""

from importlib import import_module

import numpy as np
import pytest

from calib.design import Problem, greedy
from calib.design.greedy import RIDGE
from calib.errors import InputError
from calib.information.criteria.base import Pool
from calib.information.observability import CRITERIA, IndexName
from tests.calib.design.design_cases import BruteForce, small_criterion, small_pool, whitened_pool
from tests.reference import READABLE30


@pytest.mark.parametrize("criterion", CRITERIA)
def test_every_step_is_the_one_brute_force_takes(criterion: IndexName):
    blocks = whitened_pool(100)
    brute, pool = BruteForce(criterion), Pool(blocks)
    M = np.diag(RIDGE * (blocks**2).sum((0, 1)) / 100)
    outside = np.ones(100, dtype=bool)
    for place in greedy(Problem.of_blocks(blocks, 15, criterion)).indices:
        assert place == brute.best_add(M, pool, outside).place
        M, outside[place] = M + blocks[place].T @ blocks[place], False


@pytest.mark.parametrize("criterion", CRITERIA)
def test_the_beginning_of_a_set_is_the_smaller_set(criterion: IndexName):
    blocks = whitened_pool(60)
    small, large = (
        greedy(Problem.of_blocks(blocks, 6, criterion)),
        greedy(Problem.of_blocks(blocks, 12, criterion)),
    )
    np.testing.assert_array_equal(large.indices[:6], small.indices)
    assert len(set(large.indices.tolist())) == 12


def test_the_units_of_the_columns_do_not_change_the_choice_by_o1():
    blocks = whitened_pool(60)
    units = 10.0 ** np.random.default_rng(0).uniform(-3, 3, 24)
    np.testing.assert_array_equal(
        greedy(Problem.of_blocks(blocks * units, 12, "O1")).indices,
        greedy(Problem.of_blocks(blocks, 12, "O1")).indices,
    )


def test_what_is_known_hugely_of_one_direction_does_not_drown_the_ridge():
    units = np.array([5, 5e3, 2e-7, 1e7, 1e-5])
    for seed in range(12):
        blocks = np.random.default_rng(seed).normal(size=(4, 2, 5)) * units
        found = greedy(Problem.of_blocks(blocks, 3, "D", prior=np.ones((5, 5))))
        assert found.certificate.efficiency > 0.9


@pytest.mark.parametrize(
    ("free", "m", "bar"), [(24, 29, 0.987), (24, 61, 0.994), (30, 29, 0.977), (30, 61, 0.991)]
)
def test_greedy_comes_as_close_to_the_best_set_as_published(free: int, m: int, bar: float):
    blocks = whitened_pool() if free == 24 else whitened_pool(free=READABLE30)
    # a reference study of the same pool, three digits printed
    assert greedy(Problem.of_blocks(blocks, m, "O1")).certificate.efficiency > bar - 0.002


def test_the_ridge_is_not_part_of_the_value():
    blocks = small_pool(1)
    found = greedy(Problem.of_blocks(blocks, 6, "O3"))
    A = blocks[found.indices].reshape(-1, 5)
    assert found.value == pytest.approx(np.linalg.norm(A, -2), rel=1e-12)


def test_too_few_poses_are_refused():
    with pytest.raises(InputError, match="at least 4 poses"):
        greedy(Problem.of_blocks(whitened_pool(60), 3, "O1"))


@pytest.mark.parametrize("name", ["D", "A", "V", "G", "E"])
def test_an_earlier_calibration_takes_the_place_of_the_ridge(name: str):
    blocks, criterion = small_pool(2, 20), small_criterion(name)
    prior = np.diag([0.3, 0.5, 0.2, 0.7, 0.4])
    found = greedy(Problem.of_blocks(blocks, 4, criterion, prior=prior, given=(3,)))
    M, left = prior + blocks[3].T @ blocks[3], set(range(20)) - {3}
    for place in found.indices:
        values = {j: float(criterion.value(M + blocks[j].T @ blocks[j])) for j in sorted(left)}
        assert place == max(values, key=values.__getitem__)
        M, left = M + blocks[place].T @ blocks[place], left - {place}
    assert found.value == pytest.approx(criterion.figure(M, 5), rel=1e-9)


@pytest.mark.usefixtures("uncertified")
@pytest.mark.parametrize("name", ["D", "A", "V"])
def test_the_ridge_is_too_small_to_choose(name: str, monkeypatch):
    blocks, criterion = whitened_pool(200), small_criterion(name, 24)
    module = import_module("calib.design.greedy")
    usual = greedy(Problem.of_blocks(blocks, 12, criterion)).indices
    monkeypatch.setattr(module, "RIDGE", RIDGE / 100)
    np.testing.assert_array_equal(greedy(Problem.of_blocks(blocks, 12, criterion)).indices, usual)
    monkeypatch.setattr(module, "RIDGE", RIDGE * 1e5)
    assert set(greedy(Problem.of_blocks(blocks, 12, criterion)).indices) != set(usual)
