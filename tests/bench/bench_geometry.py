"""Poses and the identification Jacobian of 1000 poses, the naive forms beside them.

Naive forward: one 4x4 product per factor and pose. Naive Jacobian: central differences of the
batched forward. Six rows x 42 columns of 1000 poses are 2 MB out: memory decides.
"""

import numpy as np
import pytest

from calib.geometry.chain import Chain, forward
from calib.geometry.frames import log_so3, rot_x, rot_y, rot_z, slide
from calib.geometry.inverse import inverse_kinematics
from calib.geometry.jacobian import pose_and_jacobian
from calib.geometry.model import RobotModel
from calib.single_poses import SinglePoses
from tests.reference import TX60_LINKS, pool_r

CHAIN = Chain(TX60_LINKS).moved(np.full(42, 1e-4))
Q = pool_r(1000)


def naive_forward(q):
    out = []
    for joints in q:
        T = CHAIN.T_world_base
        for (theta, d, a, alpha, beta), value in zip(CHAIN.links, joints, strict=True):
            T = T @ rot_z(value + theta) @ slide(0, 0, d) @ slide(a, 0, 0) @ rot_x(alpha)
            T = T @ rot_y(beta)
        out.append(T @ CHAIN.T_flange_tool)
    return np.array(out)


def difference_jacobian(q, h=1e-6):
    columns = []
    for step in np.eye(42) * h:
        up, down = forward(CHAIN.moved(step), q), forward(CHAIN.moved(-step), q)
        turn = log_so3(up[:, :3, :3] @ np.swapaxes(down[:, :3, :3], 1, 2))
        columns.append(np.concatenate([up[:, :3, 3] - down[:, :3, 3], turn], 1) / (2 * h))
    return np.stack(columns, -1)


@pytest.mark.benchmark(group="forward, 1000 poses")
@pytest.mark.parametrize("form", [forward, naive_forward], ids=["batched", "naive"])
def test_forward(benchmark, form):
    T = benchmark((lambda: forward(CHAIN, Q)) if form is forward else (lambda: naive_forward(Q)))
    assert np.abs(T[:5] - naive_forward(Q[:5])).max() < 1e-13


@pytest.mark.benchmark(group="forward, one pose")
@pytest.mark.parametrize("form", ["compiled", "model", "naive"])
def test_one_pose(benchmark, form):
    """Bar: 5 us compiled."""
    fast, model, q = SinglePoses.of(RobotModel(CHAIN)), RobotModel(CHAIN), Q[0].copy()
    work = {
        "compiled": lambda: fast.pose(q),
        "model": lambda: model.poses(q[None])[0],
        "naive": lambda: naive_forward(q[None])[0],
    }[form]
    assert np.abs(benchmark(work) - naive_forward(q[None])[0]).max() < 1e-13


@pytest.mark.benchmark(group="Jacobian, 1000 poses x 42 numbers")
@pytest.mark.parametrize("form", ["sweep", "differences"])
def test_jacobian(benchmark, form):
    if form == "sweep":
        J = benchmark(lambda: pose_and_jacobian(CHAIN, Q)[1])
    else:
        J = benchmark(lambda: difference_jacobian(Q))
    assert np.abs(J[:5] - difference_jacobian(Q[:5])).max() < 1e-8


@pytest.mark.benchmark(group="inverse kinematics, 1000 poses")
def test_inverse_kinematics(benchmark):
    """Corrections of a program: seeds a few hundredths of a degree from the answer."""
    limits, model = np.tile([-3.0, 3.0], (6, 1)), RobotModel(CHAIN)
    found = benchmark(inverse_kinematics, model, forward(CHAIN, Q), Q + 5e-4, limits)
    assert len(found.status) == len(Q)
