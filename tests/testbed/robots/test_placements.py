"""Body frames against the chain's own kinematics and scipy's rotations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib.geometry.chain import Chain, forward
from calib.geometry.frames import exp_so3, rot_x, rot_y, rot_z, slide, step_transform
from testbed.robots.placements import link_poses, placements, quaternion_wxyz, tidy

TOLERANCE = 1e-13
"""Products of a dozen transforms of size about 1 in float64 (2e-16 each)."""


def random_chain(rng, kinds=("revolute",) * 6):
    n = len(kinds)
    return Chain(
        rng.normal(size=(n, 5)),
        kinds,
        step_transform(rng.normal(size=6)),
        step_transform(rng.normal(size=6)),
    )


@pytest.mark.parametrize(
    "kinds",
    [("revolute",) * 6, ("prismatic", "revolute", "prismatic"), ("revolute",), ("prismatic",) * 2],
)
def test_the_last_body_carries_the_tool_where_forward_kinematics_says(kinds):
    rng = np.random.default_rng(1)
    for _ in range(20):
        chain = random_chain(rng, kinds)
        q = rng.uniform(-3, 3, (50, len(kinds)))
        poses = link_poses(chain, q)
        assert poses.shape == (50, len(kinds) + 1, 4, 4)
        # lengths grow to about 10 in the longest chain
        np.testing.assert_allclose(
            poses[:, -1] @ placements(chain).tool, forward(chain, q), rtol=0, atol=10 * TOLERANCE
        )


def test_the_tool_hangs_on_the_flange_and_the_base_is_the_first_pose():
    chain = random_chain(np.random.default_rng(2))
    _, flange, tool = placements(chain)
    np.testing.assert_allclose(flange @ chain.T_flange_tool, tool, atol=TOLERANCE)
    np.testing.assert_array_equal(link_poses(chain, np.zeros((1, 6)))[0, 0], chain.T_world_base)


def test_each_joint_moves_only_the_bodies_after_it_and_keeps_its_own_axis():
    rng = np.random.default_rng(3)
    chain = random_chain(rng, ("revolute", "prismatic", "revolute", "revolute"))
    q = rng.uniform(-1, 1, (1, 4))
    before = link_poses(chain, q)[0]
    for joint in range(4):
        moved = q.copy()
        moved[0, joint] += 0.5
        after = link_poses(chain, moved)[0]
        np.testing.assert_array_equal(after[: joint + 1], before[: joint + 1])
        assert np.abs(after[joint + 1 :] - before[joint + 1 :]).max() > 1e-3
        np.testing.assert_allclose(after[joint + 1, :3, 2], before[joint + 1, :3, 2], atol=1e-14)


def test_quarter_turns_come_out_exact_and_nothing_else_is_touched():
    T = tidy(rot_x(np.pi / 2) @ rot_z(-np.pi / 2) @ rot_y(np.pi) @ slide(0.1, 0.2, 0.3))
    assert set(np.abs(T[:3, :3]).ravel()) == {0.0, 1.0}
    assert not np.signbit(T[T == 0]).any()
    small = rot_x(1e-12)
    np.testing.assert_array_equal(tidy(small), small)
    rng = np.random.default_rng(4)
    for w in rng.normal(size=(100, 3)):
        R = step_transform(np.concatenate([np.zeros(3), w]))
        assert np.abs(tidy(R) - R).max() <= 1e-15


def test_quaternions_match_scipy_and_are_exact_near_half_turns():
    rng = np.random.default_rng(5)
    axis = rng.normal(size=(4000, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    axis[:9] = [*np.eye(3), *-np.eye(3), [0.6, 0.8, 0], [0, 0.6, 0.8], [0.8, 0, 0.6]]
    angle = rng.choice([0, 1e-9, 1e-7, 1e-3, 1, np.pi - 1e-3, np.pi - 1e-7, np.pi - 1e-9], 4000)
    R = exp_so3(axis * angle[:, None])
    ours = quaternion_wxyz(R)
    np.testing.assert_allclose(np.linalg.norm(ours, axis=1), 1, atol=1e-15)
    assert (ours[:, 0] >= 0).all()
    # the rotation of the quaternion, not its sign, is what counts at half turns
    back = Rotation.from_quat(ours, scalar_first=True).as_matrix()
    np.testing.assert_allclose(back, R, rtol=0, atol=2e-15)
    theirs = Rotation.from_matrix(R).as_quat(scalar_first=True)
    agreement = np.abs(np.einsum("mi,mi->m", ours, theirs))
    np.testing.assert_allclose(agreement, 1, atol=2e-15)


def test_quaternions_keep_every_leading_axis():
    R = exp_so3(np.random.default_rng(6).normal(size=(2, 3, 5, 3)))
    stacked = quaternion_wxyz(R)
    assert stacked.shape == (2, 3, 5, 4)
    np.testing.assert_array_equal(stacked[1, 2, 4], quaternion_wxyz(R[1, 2, 4]))
