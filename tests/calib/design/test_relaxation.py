"""Continuous relaxation: weights that are a design, bounds that only fall, the known optimum."""

import itertools

import numpy as np
import pytest

from calib.design import Problem, relaxation
from calib.design.blocks import information
from calib.design.relaxation import Grams
from calib.errors import InputError
from calib.information.criteria.named import criterion_named
from calib.information.goals import Goals
from tests.calib.design.design_cases import small_criterion, small_pool, whitened_pool


def test_the_continuous_optimum_of_a_quadratic_meets_kiefer_and_wolfowitz():
    X = np.array(list(itertools.product([-1.0, 0, 1], repeat=2)))
    F = np.column_stack([np.ones(9), X, X**2, X[:, 0] * X[:, 1]])
    found = relaxation(
        Problem.of_blocks(F[:, None], 6, "D", repeats=True), iterations=20_000, tolerance=1e-11
    )
    w = found.w / 6
    M = (F * w[:, None]).T @ F
    leverage = np.einsum("ij,ij->i", F @ np.linalg.inv(M), F)
    # the largest leverage is p, and is reached wherever there is weight
    assert leverage.max() == pytest.approx(6, abs=1e-9)
    # Kiefer 1961; w is flat at the optimum: 1e-9 of p is about 1e-6 of a weight
    corner, edge, center = w[[0, 2, 6, 8]], w[[1, 3, 5, 7]], w[4]
    np.testing.assert_allclose(corner, 0.145790892, atol=1e-5)
    np.testing.assert_allclose(edge, 0.080160853, atol=1e-5)
    assert center == pytest.approx(0.096193023, abs=1e-5)
    assert np.linalg.det(M) == pytest.approx(0.0114269987, abs=1e-10)


@pytest.mark.parametrize("name", ["D", "A", "V", "G", "E"])
@pytest.mark.parametrize("repeats", [False, True])
def test_weights_are_a_design_and_the_bound_only_falls(name: str, repeats: bool):
    blocks, criterion = small_pool(0, 40), small_criterion(name)
    found = relaxation(
        Problem.of_blocks(
            blocks, 8, criterion, prior=0.1 * np.eye(5), given=(0, 3), repeats=repeats
        )
    )
    assert found.w.sum() == pytest.approx(8)
    assert found.w.min() >= 0
    assert repeats or found.w.max() <= 1 + 1e-9
    assert repeats or (found.w[[0, 3]] == 0).all()
    rows = blocks * np.sqrt(found.w)[:, None, None]
    M = 0.1 * np.eye(5) + information(blocks[[0, 3]]) + information(rows)
    np.testing.assert_allclose(found.M, M, rtol=1e-9, atol=1e-9)
    assert (np.diff(found.trace) <= 0).all()
    assert found.trace[-1] == found.bound
    # weights that are themselves allowed cannot pass the bound, and come near it
    value = float(criterion.value(M))
    assert value <= found.bound + 1e-9 * abs(value)
    assert criterion.efficiency(value, found.bound, 5) > (0.99 if name in "DAV" else 0.85)


def test_packed_products_are_the_products():
    blocks, rng = small_pool(1, 9), np.random.default_rng(0)
    w, S = rng.random(9), information(small_pool(2, 3))
    gram = np.swapaxes(blocks, 1, 2) @ blocks
    packed = Grams(blocks)
    np.testing.assert_allclose(packed.weighted_sum(w), np.tensordot(w, gram, 1), rtol=1e-12)
    np.testing.assert_allclose(packed.traces(S), np.einsum("ij,nij->n", S, gram), rtol=1e-12)


@pytest.mark.slow
def test_a_bound_within_a_thousandth_of_the_last_is_reached_in_few_steps():
    blocks = whitened_pool(400)
    few, many = (
        relaxation(Problem.of_blocks(blocks, 29, "D"), iterations=k, tolerance=1e-6).bound
        for k in (400, 4000)
    )
    # D-efficiency: the bound after 400 steps is a thousandth above that after 4000 at most
    assert np.exp((few - many) / 24) < 1.001


def test_a_criterion_that_is_not_concave_is_refused():
    with pytest.raises(InputError, match="O2 has no relaxation"):
        relaxation(Problem.of_blocks(small_pool(0), 5, "O2"))


@pytest.mark.parametrize("name", ["V", "G"])
def test_a_goal_that_no_pose_teaches_anything_about_is_bounded_by_what_is_known(name: str):
    blocks, rows = small_pool(0), np.zeros((1, 3, 5))
    blocks[:, :, 2], rows[0, 0, 2] = 0, 1
    criterion = criterion_named(name, goals=Goals(rows, np.ones(1)))
    found = relaxation(Problem.of_blocks(blocks, 5, criterion, prior=np.diag([0, 0, 4.0, 0, 0])))
    assert found.figure == pytest.approx(0.5, rel=1e-9)
    assert found.w.sum() == pytest.approx(5)
