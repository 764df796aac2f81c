"""What a set keeps without a pose: nothing of a direction that only it sees, to rounding."""

import numpy as np
import pytest

from calib.arrays import Array
from calib.design.blocks import information
from tests.calib.design.design_cases import small_criterion, small_pool

BY_DELETION = ["D", "A", "V", "G"]


@pytest.mark.parametrize("name", BY_DELETION)
def test_without_a_pose_that_alone_sees_two_directions_nothing_is_left(name: str):
    # the determinant of what is left is a product of two rounding errors: its sign says nothing
    for seed in range(20):
        blocks = small_pool(seed, 6, 2, 6)
        gains = small_criterion(name, 6).drop(information(blocks[:3]), blocks[:3])
        assert np.isneginf(gains).all()


def ill_conditioned(seed: int) -> Array:
    """Three blocks (3, 2, 6) of six numbers in several units, two of them much alike."""
    rng = np.random.default_rng(seed)
    blocks = small_pool(seed, 3, 2, 6)
    blocks[..., 5] = blocks[..., 4] + 10 ** rng.uniform(-4, -1) * blocks[..., 5]
    return np.asarray(blocks * 10 ** rng.uniform(-3, 3, 6))


@pytest.mark.parametrize("name", BY_DELETION)
def test_rounding_of_ill_conditioned_sets_leaves_nothing_either(name: str):
    # the errors of what is left grow with the condition of the set, to some millions of eps here
    for seed in range(60):
        blocks = ill_conditioned(seed)
        assert np.isneginf(small_criterion(name, 6).drop(information(blocks), blocks)).all()


@pytest.mark.parametrize("name", ["D", "A", "V"])  # G makes the matrix of each swap anew
def test_what_sees_only_what_others_see_is_no_swap(name: str):
    for seed in range(60):
        blocks = ill_conditioned(seed)
        mixed = np.random.default_rng(seed).normal(size=(1, 2, 4)) @ blocks[1:].reshape(4, 6)
        gains = small_criterion(name, 6).swap(information(blocks), blocks[:1], mixed)
        assert np.isneginf(gains).all()


@pytest.mark.parametrize("name", BY_DELETION)
def test_a_millionth_part_of_the_information_is_something(name: str):
    # of directions that one more pose sees a thousand times less well
    for seed in range(20):
        blocks = small_pool(seed, 4, 2, 6)
        blocks[3] *= 1e-3
        gains = small_criterion(name, 6).drop(information(blocks), blocks)
        assert np.isfinite(gains).all()
