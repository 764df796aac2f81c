"""Sets designed for a goal serve it better than those designed for the parameters, or none."""

import numpy as np
import pytest

from calib.arrays import Array
from calib.design import Problem, exchange
from calib.design.blocks import scaled_blocks
from calib.geometry.parameters import parameters_of
from calib.information.criteria.named import criterion_named
from calib.information.goals import goal_matrix
from tests.reference import READABLE30, SIGMA_POSITION, SIGMA_ROTATION, WEN24, pool_r, tx60

RANDOM_SETS = 50
NOISE = np.array([SIGMA_POSITION] * 3 + [SIGMA_ROTATION] * 3)


def goal_uncertainties(free: tuple[str, ...], n: int, m: int, goals: int, pools: int) -> Array:
    """RMS tool-point u (pools, 3) [m]: mean of random sets, D set, V set, of independent pools."""
    parameters = parameters_of(tx60(), free)
    v = criterion_named("V", goals=goal_matrix(tx60(), pool_r(goals, 99), parameters))
    table = np.empty((pools, 3))
    for k in range(pools):
        rng = np.random.default_rng(k)
        J = tx60().poses_and_jacobian(pool_r(n, 1000 + k))[1]
        blocks = scaled_blocks(J / NOISE[:, None], parameters)

        def u(chosen: Array, blocks: Array = blocks) -> float:
            A = blocks[chosen].reshape(-1, blocks.shape[2])
            return v.figure(A.T @ A, m)

        table[k] = (
            np.mean([u(rng.choice(n, m, replace=False)) for _ in range(RANDOM_SETS)]),
            u(exchange(Problem.of_blocks(blocks, m, "D"), rng).indices),
            u(exchange(Problem.of_blocks(blocks, m, v), rng).indices),
        )
    return table


def check(table: Array, m: int) -> None:
    random, by_d, by_v = table.T
    # fifteen poses for thirty numbers are hardly more than needed: of 40 pools one V set ended in
    # an optimum 0.4 % above a lucky D set's u
    assert (by_v <= by_d * (1.01 if m < 20 else 1.0)).all()
    assert by_v.mean() < by_d.mean()
    assert (by_d <= random).all()


@pytest.mark.truth
@pytest.mark.slow
def test_v_is_not_worse_than_d_and_d_not_worse_than_random_on_the_goal_over_three_pools():
    check(goal_uncertainties(WEN24, 250, 29, 200, 3), 29)


@pytest.mark.study
@pytest.mark.parametrize("m", [15, 29, 61])
@pytest.mark.parametrize("free", [WEN24, READABLE30])
def test_the_same_over_forty_pools_of_a_thousand_poses(free: tuple[str, ...], m: int):
    table = goal_uncertainties(free, 1000, m, 2000, 40) * 1e6
    ratio = table[:, 2] / table[:, 1]
    said = f"p {len(free)}, m {m}: random, D, V {table.mean(0).round(2)} um; "
    print(said + f"V / D {ratio.min():.3f} to {ratio.max():.3f}")  # noqa: T201 - the study's result
    check(table, m)
