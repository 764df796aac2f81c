"""Candidate pools for the design tests, and an exchange scorer that tries every pose."""

import itertools

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.design.blocks import paper_blocks, scaled_blocks
from calib.design.exchange import Move
from calib.design.selection import set_value
from calib.geometry.parameters import parameters_of
from calib.information.observability import Criterion, index_of
from tests.reference import SIGMA_POSITION, SIGMA_ROTATION, WEN24, pool_r, tx60


def paper_pool(n: int = 1000) -> Array:
    """First n poses of pool R in the paper's rows and units, 24 numbers."""
    return paper_blocks(tx60(), parameters_of(tx60(), WEN24), pool_r()[:n])


def whitened_pool(n: int = 1000, free: tuple[str, ...] = WEN24) -> Array:
    """First n poses of pool R, whitened by the noise of the paper's tracker, L = 0.3 m."""
    _, J = tx60().poses_and_jacobian(pool_r()[:n])
    noise = np.array([SIGMA_POSITION] * 3 + [SIGMA_ROTATION] * 3)
    return scaled_blocks(J / noise[:, None], parameters_of(tx60(), free))


def small_pool(seed: int, n: int = 12, r: int = 2, p: int = 5) -> Array:
    """Random blocks (n, r, p) of uneven size."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n, r, p)) * rng.uniform(0.3, 3, (n, 1, 1))


def best_of_all(blocks: Array, m: int, criterion: Criterion) -> tuple[tuple[int, ...], float]:
    """Best set of m poses, by trying all of them."""
    values = {
        chosen: set_value(blocks, chosen, criterion)
        for chosen in itertools.combinations(range(len(blocks)), m)
    }
    winner = max(values, key=values.__getitem__)
    return winner, values[winner]


class BruteForce:
    """Scorer that computes the index of every candidate set in full."""

    def __init__(self, blocks: Array, criterion: Criterion) -> None:
        self.gram = np.swapaxes(blocks, 1, 2) @ blocks
        self.criterion = criterion

    def values(self, M: Array, gram: Array, sign: float) -> Array:
        return index_of(M + sign * gram, 1, self.criterion)

    def add(self, M: Array, inside: Bool) -> Move:
        values = np.where(inside, -1.0, self.values(M, self.gram, 1.0))
        return Move(int(values.argmax()), len(values))

    def drop(self, M: Array, chosen: Index) -> Move:
        values = self.values(M, self.gram[chosen], -1.0)
        return Move(int(values.argmax()), len(values))
