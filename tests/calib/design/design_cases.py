"""Candidate pools and goals for the design tests, and a criterion that tries every pose."""

import itertools

import numpy as np

from calib.arrays import Array, Bool
from calib.design.blocks import paper_blocks, scaled_blocks
from calib.design.selection import figure_of_rows
from calib.geometry.frames import exp_so3
from calib.geometry.parameters import parameters_of
from calib.information.criteria.base import Criterion, Move, Pool
from calib.information.criteria.named import criterion_named
from calib.information.goals import Goals, goal_matrix
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


def turned_pool(n: int = 20) -> Array:
    """Blocks [I, R] (n, 3, 6) of turns R: two leave unseen what neither moves."""
    turns = exp_so3(np.random.default_rng(0).normal(size=(n, 3)))
    return np.concatenate([np.broadcast_to(np.eye(3), turns.shape), turns], axis=2)


def goal_set(free: tuple[str, ...] = WEN24, n: int = 2000) -> Goals:
    """First n poses of goal set G for pool R."""
    return goal_matrix(tx60(), pool_r(2000, 99)[:n], parameters_of(tx60(), free))


def small_goals(seed: int, p: int = 5, g: int = 6) -> Goals:
    """Random goals for a small pool."""
    rng = np.random.default_rng(seed)
    return Goals(rng.normal(size=(g, 3, p)) * rng.uniform(0.3, 3, (g, 1, 1)), np.ones(g))


def small_criterion(name: str, p: int = 5) -> Criterion:
    """A criterion for a small pool."""
    return criterion_named(name, goals=small_goals(99, p))


def set_value(blocks: Array, indices, criterion: str) -> float:
    """Figure of a pose set by its rows alone."""
    rows = blocks[np.asarray(indices)].reshape(-1, blocks.shape[-1])
    return figure_of_rows(rows, len(indices), criterion_named(criterion))


def best_of_all(blocks: Array, m: int, criterion: str) -> tuple[tuple[int, ...], float]:
    """Best set of m poses by an index, by trying all of them."""
    values = {
        chosen: set_value(blocks, chosen, criterion)
        for chosen in itertools.combinations(range(len(blocks)), m)
    }
    winner = max(values, key=values.__getitem__)
    return winner, values[winner]


class BruteForce:
    """A criterion whose moves come from the value of every candidate set in full."""

    def __init__(self, criterion: Criterion | str) -> None:
        self.real = criterion_named(criterion)

    def __getattr__(self, name: str):
        return getattr(self.real, name)

    def gains(self, M: Array, blocks: Array, sign: float) -> Array:
        gram = np.swapaxes(blocks, 1, 2) @ blocks
        return self.real.value(M + sign * gram) - self.real.value(M)

    def best_add(self, M: Array, pool: Pool, allowed: Bool, _floor: float = -np.inf) -> Move:
        gains = np.where(allowed, self.gains(M, pool.blocks, 1.0), -np.inf)
        return Move(int(gains.argmax()), float(gains.max()), len(gains))

    def best_drop(self, M: Array, blocks: Array) -> Move:
        gains = self.gains(M, blocks, -1.0)
        return Move(int(gains.argmax()), float(gains.max()), len(gains))
