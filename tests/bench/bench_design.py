"""Pose selection: run with ``pytest tests/bench/bench_design.py --benchmark-only``."""

import numpy as np
import pytest

from calib.arrays import Array
from calib.design.blocks import information
from calib.design.certificate import o1_certificate
from calib.design.detmax import detmax
from calib.design.exchange import scorer
from calib.design.greedy import greedy
from calib.design.pose_count import pose_counts
from calib.geometry.parameters import CHARACTERISTIC_LENGTH, parameters_of
from calib.information.observability import CRITERIA, Criterion
from calib.information.reduction import reduce
from tests.calib.design_cases import paper_pool, whitened_pool
from tests.reference import pool_r, tx60

N, M = 1000, 29


@pytest.fixture(scope="module")
def blocks() -> Array:
    return paper_pool(N)


@pytest.fixture(scope="module")
def chosen() -> Array:
    return np.sort(np.random.default_rng(0).choice(N, M, replace=False))


@pytest.mark.parametrize("criterion", CRITERIA)
def test_one_addition(benchmark, blocks: Array, chosen: Array, criterion: Criterion):
    moves, inside = scorer(blocks, criterion), np.isin(np.arange(N), chosen)
    benchmark(moves.add, information(blocks[chosen]), inside)


def test_one_addition_by_one_singular_value_decomposition_per_candidate(
    benchmark, blocks: Array, chosen: Array
):
    rows = blocks[chosen].reshape(-1, blocks.shape[-1])

    def every() -> int:
        values = [
            np.log(np.linalg.svd(np.vstack([rows, block]), compute_uv=False)).sum()
            for block in blocks
        ]
        return int(np.argmax(values))

    benchmark.pedantic(every, rounds=3)


def test_one_addition_by_batched_eigenvalues(benchmark, blocks: Array, chosen: Array):
    gram = np.swapaxes(blocks, 1, 2) @ blocks
    benchmark(np.linalg.eigvalsh, information(blocks[chosen]) + gram)


@pytest.mark.parametrize("m", [29, 61])
@pytest.mark.parametrize("criterion", CRITERIA)
def test_detmax(benchmark, blocks: Array, criterion: Criterion, m: int):
    benchmark.pedantic(
        lambda: detmax(blocks, m, criterion, np.random.default_rng(1)), rounds=3, warmup_rounds=1
    )


def test_greedy(benchmark, blocks: Array):
    benchmark(greedy, blocks, M, "O1")


def test_curves_of_five_indices_to_150_poses(benchmark, blocks: Array):
    benchmark(lambda: pose_counts(blocks, rng=np.random.default_rng(0)))


def test_certificate(benchmark, chosen: Array):
    benchmark(o1_certificate, whitened_pool(N), chosen)


def test_reduction_of_all_numbers(benchmark):
    model, parameters = tx60(), parameters_of(tx60())
    _, J = model.poses_and_jacobian(pool_r(M))
    rows = J * np.array([1, 1, 1, *[CHARACTERISTIC_LENGTH] * 3])[:, None] * parameters.scale
    benchmark(lambda: reduce(rows.reshape(-1, 42), parameters, model=model))
