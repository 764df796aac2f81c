"""The certificate never claims too much, and claims nearly enough."""

import itertools

import numpy as np
import pytest

from calib.design.blocks import information
from calib.design.certificate import o1_certificate
from calib.design.detmax import detmax
from calib.design.sampling import random_selection
from tests.calib.design_cases import small_pool, whitened_pool
from tests.reference import READABLE30


@pytest.mark.parametrize("iterations", [1, 10, 200])
@pytest.mark.parametrize("seed", range(8))
def test_no_set_at_all_exceeds_the_bound(seed: int, iterations: int):
    blocks = small_pool(seed, 10)
    for m in (3, 5, 8, 10):
        sets = itertools.combinations(range(10), m)
        best = max(np.linalg.slogdet(information(blocks[list(s)]))[1] for s in sets)
        bound = o1_certificate(blocks, range(m), iterations=iterations).bound
        assert best <= bound + 1e-9  # rounding of log determinants of size 10


def test_the_whole_pool_is_certified_as_the_only_set_of_its_size():
    # weights one are the set itself: the tangent touches
    assert o1_certificate(small_pool(1, 9), range(9)).o1_efficiency == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize(
    ("free", "m", "random", "exchange"),
    [
        (24, 29, 0.848, 0.975),
        (24, 61, 0.884, 0.985),
        (30, 29, 0.812, 0.975),
        (30, 61, 0.860, 0.985),
    ],
)
def test_certified_efficiencies_are_the_published_ones(
    free: int, m: int, random: float, exchange: float
):
    blocks = whitened_pool() if free == 24 else whitened_pool(free=READABLE30)
    found = detmax(blocks, m, "O1", np.random.default_rng(0), d=20)
    certificate = o1_certificate(blocks, found.indices)
    assert certificate.d_efficiency >= exchange  # MATH 8.4
    assert certificate.o1_efficiency == pytest.approx(certificate.d_efficiency**0.5)
    rng = np.random.default_rng(1)
    drawn = [random_selection(1000, m, rng) for _ in range(20)]
    log_det = [np.linalg.slogdet(information(blocks[chosen]))[1] for chosen in drawn]
    mean = np.exp((np.array(log_det) - certificate.bound) / free).mean()
    # sd of one random set is about 0.015
    assert mean == pytest.approx(random, abs=4 * 0.015 / np.sqrt(20))
