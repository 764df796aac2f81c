"""Kinematics and identification Jacobian against composition, complex step and closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib.errors import InputError
from calib.geometry.chain import Chain, chain_names, forward
from calib.geometry.jacobian import joint_columns, matrix_rows, pose_and_jacobian, reflector_rows
from tests.calib.slopes import slopes
from tests.reference import TX60_LINKS, pool_r

X, Y, Z = np.eye(3)
LINK = (("turn", Z), ("slide", Z), ("slide", X), ("turn", X), ("turn", Y))


def elementary(kind, axis, value):
    """One 4x4 factor; works for complex values, so that it can judge derivatives."""
    T = np.eye(4, dtype=np.asarray(value).dtype)
    if kind == "slide":
        T[:3, 3] = value * axis
    else:
        K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        T[:3, :3] = np.eye(3) + np.sin(value) * K + (1 - np.cos(value)) * (K @ K)
    return T


def composed(chain, q, step):
    """The slow witness: plain composition of every factor, frame steps to first order."""

    def frame(s):
        K = np.array([[0, -s[5], s[4]], [s[5], 0, -s[3]], [-s[4], s[3], 0]])
        T = np.eye(4, dtype=step.dtype)
        T[:3, :3] += K
        T[:3, 3] = s[:3]
        return T

    T = chain.T_world_base @ frame(step[:6])
    for i, (row, kind) in enumerate(zip(chain.links, chain.kinds, strict=True)):
        values = row + step[6 + 5 * i : 11 + 5 * i]
        values = values + np.eye(5)[int(kind == "prismatic")] * q[i]
        for (shape, axis), value in zip(LINK, values, strict=True):
            T = T @ elementary(shape, axis, value)
    return T @ chain.T_flange_tool @ frame(step[-6:])


def complex_step_jacobian(chain, q):
    """Rows [dp; dr] in world axes from imaginary parts of T: no subtraction, no truncation."""
    h, columns = 1e-30, []
    R = composed(chain, q, np.zeros(chain.n_numbers))[:3, :3]
    for k in range(chain.n_numbers):
        step = np.zeros(chain.n_numbers, dtype=complex)
        step[k] = 1j * h
        D = composed(chain, q, step).imag / h
        W = D[:3, :3] @ R.T
        columns.append([*D[:3, 3], W[2, 1], W[0, 2], W[1, 0]])
    return np.array(columns).T


def random_chain(rng, n=6, kinds=()):
    nominal = Chain(rng.uniform(-1, 1, (n, 5)), kinds)
    return nominal.moved(rng.normal(size=nominal.n_numbers))


def test_the_candle_of_the_tx60_stands_at_0_20_670_mm():
    T = forward(Chain(TX60_LINKS), np.zeros((1, 6)))[0]
    assert np.abs(T[:3, 3] - [0, 0.020, 0.670]).max() < 1e-12
    assert np.abs(T[:3, :3] - np.eye(3)).max() < 1e-15


@pytest.mark.parametrize("chains", [60, pytest.param(1000, marks=pytest.mark.study)])
def test_poses_and_jacobian_equal_composition_and_complex_step(chains):
    rng = np.random.default_rng(0)
    for trial in range(chains):
        prismatic = rng.random(6) < 0.2
        kinds = tuple("prismatic" if p else "revolute" for p in prismatic)
        chain = random_chain(rng, 6, kinds) if trial % 4 else Chain(TX60_LINKS)
        q = rng.uniform(-3, 3, 6)
        if trial % 3 == 0:
            q[4] = rng.choice([0.0, 1e-9, 1e-5])  # wrist singular or nearly so
        T, J = pose_and_jacobian(chain, q[None])
        assert np.abs(T[0] - composed(chain, q, np.zeros(chain.n_numbers))).max() < 1e-13
        judge = complex_step_jacobian(chain, q)
        # 30 products of numbers of order 1: some tens of rounding errors
        assert np.abs(J[0] - judge).max() <= 1e-12 * max(1.0, np.abs(judge).max())


@given(st.integers(1, 8), st.integers(0, 2**32 - 1))
@settings(max_examples=40, deadline=None)
def test_forward_equals_the_sweep_for_any_number_of_joints(n, seed):
    rng = np.random.default_rng(seed)
    chain, q = random_chain(rng, n), rng.uniform(-3, 3, (5, n))
    T, J = pose_and_jacobian(chain, q)
    assert J.shape == (5, 6, 12 + 5 * n)
    assert np.abs(T - forward(chain, q)).max() < 1e-14


def test_twelve_rows_hold_six_freedoms():
    q = pool_r(200)
    chain = Chain(TX60_LINKS).moved(np.random.default_rng(3).normal(size=42) * 0.1)
    T, J = pose_and_jacobian(chain, q)
    H = matrix_rows(T, J).reshape(-1, 42)
    Jp, Jw = J[:, :3].reshape(-1, 42), J[:, 3:].reshape(-1, 42)
    left, right = H.T @ H, 2 * Jw.T @ Jw + Jp.T @ Jp
    assert np.abs(left - right).max() <= 1e-12 * np.abs(left).max()


def test_matrix_rows_are_the_derivative_of_the_pose_columns():
    rng = np.random.default_rng(4)
    chain, q = random_chain(rng), rng.uniform(-2, 2, 6)
    T, J = pose_and_jacobian(chain, q[None])
    H = matrix_rows(T, J)[0]
    for k in range(42):
        step = np.zeros(42, dtype=complex)
        step[k] = 1e-30j
        D = composed(chain, q, step).imag / 1e-30
        assert np.abs(H[:, k] - D[:3].T.ravel()).max() < 1e-12


def test_reflector_rows_equal_those_of_a_tool_moved_to_the_reflector():
    rng = np.random.default_rng(5)
    chain, q, offset = random_chain(rng), rng.uniform(-2, 2, (20, 6)), np.array([0.05, 0.03, 0.08])
    T, J = pose_and_jacobian(chain, q)
    p, rows = reflector_rows(T, J, np.tile(offset, (20, 1)))
    at = chain.moved(np.r_[np.zeros(36), offset, np.zeros(3)])
    T2, J2 = pose_and_jacobian(at, q)
    assert np.abs(p - T2[:, :3, 3]).max() < 1e-14
    assert np.abs(rows[..., :36] - J2[:, :3, :36]).max() < 1e-13


def test_joint_columns_are_the_derivative_by_the_joint_value():
    rng = np.random.default_rng(6)
    chain = random_chain(rng, 4, ("revolute", "prismatic", "revolute", "prismatic"))
    q = rng.uniform(-1, 1, (1, 4))
    _, J = pose_and_jacobian(chain, q)
    numeric = slopes(lambda q: forward(chain, q)[:, :3, 3], q)
    assert np.abs(J[:, :3, joint_columns(chain)] - numeric).max() < 1e-8  # difference quotient


def test_a_chain_moved_by_its_step_to_another_is_that_other():
    rng = np.random.default_rng(7)
    a, b = random_chain(rng), random_chain(rng)
    c = a.moved(a.step_to(b))
    q = rng.uniform(-2, 2, (10, 6))
    assert np.abs(forward(b, q) - forward(c, q)).max() < 1e-13
    assert np.abs(a.step_to(a)).max() < 1e-15


def test_chunks_do_not_change_the_numbers():
    q = pool_r(1000)[:700]
    chain = Chain(TX60_LINKS)
    T, J = pose_and_jacobian(chain, np.vstack([q, q]))  # crosses the chunk border
    T1, J1 = pose_and_jacobian(chain, q)
    assert np.array_equal(T[:700], T1)
    assert np.array_equal(T[700:], T1)
    assert np.array_equal(J[700:], J1)


def test_names_follow_the_columns():
    names = chain_names(6)
    assert len(names) == 42
    assert names[0] == "base.x"
    assert names[6:11] == ("theta1", "d1", "a1", "alpha1", "beta1")
    assert names[-1] == "tool.rz"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Chain(np.zeros((6, 4))), r"shape \(6, 4\).*add a column of zeros for beta"),
        (lambda: Chain(np.full((1, 5), np.nan)), r"links\[0, 0\] is nan"),
        (lambda: Chain(np.zeros((2, 5)), ("revolute",)), "2 entries"),
        (lambda: Chain(np.zeros((1, 5)), T_world_base=-np.eye(4)), "not a rigid transform"),
        (lambda: forward(Chain(np.zeros((2, 5))), np.zeros((3, 6))), "axis 1 should be 2"),
        (lambda: forward(Chain(np.zeros((2, 5))), "abc"), "not an array of numbers"),
    ],
)
def test_bad_geometry_is_refused_by_name(make, message):
    with pytest.raises(InputError, match=message):
        make()
