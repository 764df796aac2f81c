"""Columns of arms that give way: complex step, differences, and the stiff arm to the bit."""

import numpy as np
import pytest

from calib.arrays import Array
from calib.geometry.chain import BATCH, Chain, forward
from calib.geometry.jacobian import bent_pose_and_jacobian, joint_columns, pose_and_jacobian
from tests.calib.geometry.bent import composed_bodies, random_arm
from tests.calib.slopes import slopes, twist


def moved_tool(chain: Chain, q: Array, bends: Array) -> Array:
    """Tool pose (4, 4), composed slowly; also if the bends are complex."""
    return composed_bodies(chain, q, bends)[-1] @ chain.T_flange_tool


@pytest.mark.parametrize("seed", range(4))
def test_bend_columns_equal_the_complex_step(seed):
    rng, h = np.random.default_rng(seed), 1e-30
    chain = random_arm(rng)
    q, bends = rng.uniform(-2, 2, (4, 6)), rng.normal(0, 0.2, (4, 6, 3))
    T, J = bent_pose_and_jacobian(chain, q, bends)
    assert J.shape == (4, 6, 12 + 5 * 6 + 3 * 6)
    for row in range(4):
        here = moved_tool(chain, q[row], bends[row])
        assert np.abs(T[row] - here).max() < 1e-13
        for k in range(18):
            step = 1j * h * np.eye(18)[k].reshape(6, 3)
            D = moved_tool(chain, q[row], bends[row] + step).imag / h
            W = D[:3, :3] @ here[:3, :3].T
            judge = np.array([*D[:3, 3], W[2, 1], W[0, 2], W[1, 0]])
            # some tens of rounding errors of numbers of order ten
            assert np.abs(J[row, :, 42 + k] - judge).max() < 2e-13


def test_all_columns_equal_central_differences_on_bent_chains_with_slides():
    rng = np.random.default_rng(5)
    for _ in range(4):
        chain = random_arm(rng, ("revolute", "prismatic", "revolute", "revolute", "prismatic"))
        q, bends = rng.normal(size=(10, 5)), rng.normal(0, 0.1, (10, 5, 3))
        J = bent_pose_and_jacobian(chain, q, bends)[1]

        def poses(step, chain=chain, q=q, bends=bends):
            bent = bends + step[37:].reshape(5, 3)
            return bent_pose_and_jacobian(chain.moved(step[:37]), q, bent)[0]

        numeric = slopes(poses, np.zeros(J.shape[2]), 1e-5, minus=twist)
        # third derivatives of order 10 times h^2 / 6, rounding 1e-15 / h
        assert np.abs(J - numeric).max() < 1e-9


@pytest.mark.parametrize("m", [7, BATCH + 7])
def test_without_bends_it_is_the_stiff_arm(m):
    rng = np.random.default_rng(6)
    chain, q = random_arm(rng), rng.uniform(-2, 2, (m, 6))
    T, J = bent_pose_and_jacobian(chain, q, np.zeros((m, 6, 3)))
    T0, J0 = pose_and_jacobian(chain, q)
    assert np.array_equal(T, T0)
    assert np.array_equal(T, forward(chain, q))
    # a slide carries the origin first and the link after it: one more rounding
    assert np.abs(J[:, :, :42] - J0).max() < 1e-13
    assert np.abs(J[:, :, 44::3] - J0[:, :, joint_columns(chain)]).max() < 1e-13


def test_a_bend_about_z_is_a_joint_value():
    rng = np.random.default_rng(7)
    chain, q, bends = random_arm(rng), rng.uniform(-2, 2, (9, 6)), np.zeros((9, 6, 3))
    bends[:, :, 2] = rng.normal(0, 0.1, (9, 6))
    T, J = bent_pose_and_jacobian(chain, q, bends)
    T0, J0 = pose_and_jacobian(chain, q + bends[:, :, 2])
    assert np.array_equal(T, T0)
    assert np.abs(J[:, :, :42] - J0).max() < 1e-13
