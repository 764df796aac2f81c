"""The compiled loops against plain numpy: moments of tool points, noisy tables, gradients."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.frames import exp_so3
from calib.geometry.parameters import parameters_of
from calib.kernels import points, replicates
from calib.measurement.noise import isotropic_covariance, with_joint_noise
from calib.measurement.observations import Measurements
from calib.measurement.residual import stacked
from calib.uncertainty import point_moments as room
from calib.uncertainty.point_moments import PAIRS, chunk_sums, point_moments
from calib.uncertainty.refit import Lanes, freeze
from calib.uncertainty.tool_point import postures, propagate
from tests.calib.uncertainty.test_monte_carlo import MODELS, calibration_covariance
from tests.reference import pool_r, tx60

CASES = pytest.mark.parametrize("name", MODELS)


def mixed_table(model, q, rng):
    """Poses and reflectors with full covariances, seen a little off the model."""
    m, n = len(q), model.chain.n_joints
    T = model.poses(q)
    offset = np.zeros((m, 3))
    kind = np.array(["pose", "point"])[(np.arange(m) % 3 == 2).astype(int)]
    offset[kind == "point"] = rng.normal(size=((kind == "point").sum(), 3)) * 0.05
    position = T[:, :3, 3] + (T[:, :3, :3] @ offset[..., None])[..., 0]
    device = isotropic_covariance(m, 2e-5, 2e-4)
    return Measurements(
        q=q,
        position=position + rng.normal(size=(m, 3)) * 1e-3,
        rotation=exp_so3(rng.normal(size=(m, 3)) * 5e-3) @ T[:, :3, :3],
        covariance=with_joint_noise(model, q, device, np.full(n, 1e-4)),
        kind=kind,
        offset=offset,
        pose_id=np.arange(m),
        repeat=np.zeros(m, dtype=int),
    )


@CASES
def test_moments_of_tool_points_equal_those_of_plain_propagation(name):
    rng = np.random.default_rng(7)
    model = MODELS[name](rng)
    q = rng.normal(size=(11, model.chain.n_joints))
    steps = rng.normal(size=(2000, model.n_numbers)) * 1e-3
    nominal = model.poses(q)[:, :3, 3]
    sums = chunk_sums(
        postures(model, q), np.arange(model.n_numbers), np.ascontiguousarray(steps.T), nominal
    )
    e = propagate(model, q, steps) - nominal
    assert np.abs(sums[:3] / 2000 - e.mean(axis=0).T).max() < 1e-12  # metres: the bar
    plain = np.stack([np.einsum("mn,mn->n", e[..., i], e[..., j]) for i, j in PAIRS])
    assert np.abs(sums[3:] - plain).max() < 1e-9 * np.abs(plain).max()  # the bar; 1e-14 in fact


def test_one_draw_of_the_moments_equals_the_moved_model():
    rng = np.random.default_rng(8)
    model = MODELS["gravity and harmonics"](rng)
    q = rng.normal(size=(5, model.chain.n_joints))
    step, nominal = rng.normal(size=model.n_numbers) * 1e-3, model.poses(q)[:, :3, 3]
    sums = chunk_sums(postures(model, q), np.arange(model.n_numbers), step[:, None], nominal)
    # rounding of the chain itself: metres, five joints
    assert pytest.approx(model.moved(step).poses(q)[:, :3, 3] - nominal, abs=1e-13) == sums[:3].T


def test_a_large_step_of_a_joint_term_goes_through_numpy(monkeypatch):
    rng = np.random.default_rng(9)
    model = MODELS["gravity and harmonics"](rng)
    q = rng.normal(size=(4, model.chain.n_joints))
    steps = rng.normal(size=(50, model.n_numbers)) * 0.2
    nominal = model.poses(q)[:, :3, 3]
    args = (postures(model, q), np.arange(model.n_numbers), np.ascontiguousarray(steps.T), nominal)
    expected = propagate(model, q, steps).sum(axis=0) - 50 * nominal
    assert pytest.approx(expected, abs=1e-10) == chunk_sums(*args)[:3].T
    monkeypatch.setattr(room, "LARGEST_TERM", 10.0)  # the series alone would be wrong
    assert np.abs(chunk_sums(*args)[:3].T - expected).max() > 1e-8


def test_moments_have_the_same_bits_for_any_number_of_threads():
    C, q = calibration_covariance(), pool_r(9)
    runs = [
        point_moments(tx60(), q, C, np.random.default_rng(3), draws=25_000, threads=threads)
        for threads in (1, 2, 5)
    ]
    for run in runs[1:]:
        for name in ("mean", "covariance", "shift", "controlled"):
            assert np.array_equal(getattr(run, name), getattr(runs[0], name))


def test_the_control_variate_needs_a_thousandth_of_the_draws():
    C, q = calibration_covariance(), pool_r(9)
    few = point_moments(tx60(), q, C, np.random.default_rng(3), draws=1000)
    linear = np.trace(few.linear, axis1=1, axis2=2)
    plain = np.trace(few.covariance, axis1=1, axis2=2) / linear - 1
    controlled = np.trace(few.controlled, axis1=1, axis2=2) / linear - 1
    # sd of a plain variance: sqrt(2/1000) / about sqrt(2) effective axes; the kinematics are
    # linear to 1e-4 of u here
    assert 0.01 < np.sqrt(np.mean(plain**2)) < 0.1
    assert np.abs(controlled).max() < 1e-3
    assert np.abs(few.shift).max() < 1e-2 * np.abs(few.mean).max()


def test_the_control_variate_equals_the_same_formula_draw_by_draw():
    C, q, draws = calibration_covariance(scale=300), pool_r(3), 400
    run = point_moments(tx60(), q, C, np.random.default_rng(4), draws=draws)
    moving = np.flatnonzero(np.diag(C))
    L = np.linalg.cholesky(C[np.ix_(moving, moving)])
    (stream,) = np.random.default_rng(4).spawn(1)
    steps = np.zeros((draws, 42))
    steps[:, moving] = stream.standard_normal((draws, len(moving))) @ L.T
    e = propagate(tx60(), q, steps) - tx60().poses(q)[:, :3, 3]
    line = np.einsum("nip,mp->mni", tx60().poses_and_jacobian(q)[1][:, :3], steps)
    for k in range(3):
        own = np.cov(e[:, k].T)
        assert run.covariance[k] == pytest.approx(own, rel=1e-9, abs=1e-12 * own.max())
        expected = run.linear[k] + own - np.cov(line[:, k].T)
        assert run.controlled[k] == pytest.approx(expected, rel=1e-6, abs=1e-9 * own.max())
    assert run.shift == pytest.approx((e - line).mean(axis=0), abs=1e-9 * np.abs(e).max())


@pytest.mark.parametrize("draws", [1, 0, -3])
def test_too_few_draws_are_refused(draws):
    with pytest.raises(InputError, match="draws"):
        point_moments(
            tx60(), pool_r(2), calibration_covariance(), np.random.default_rng(0), draws=draws
        )


def test_a_covariance_that_is_not_positive_is_refused():
    C = calibration_covariance()
    k = np.flatnonzero(np.diag(C))[:2]
    C[k[0], k[1]] = C[k[1], k[0]] = 2 * np.sqrt(C[k[0], k[0]] * C[k[1], k[1]])
    with pytest.raises(InputError, match="eigenvalue"):
        point_moments(tx60(), pool_r(2), C, np.random.default_rng(0), draws=100)


@CASES
def test_the_gradient_is_the_one_of_the_whitened_jacobian(name):
    """Each lane its own model and its own table: J'W r and r'W r through `stacked`."""
    rng = np.random.default_rng(21)
    model = MODELS[name](rng)
    q = rng.normal(size=(9, model.chain.n_joints))
    table = mixed_table(model, q, rng)
    start = freeze(
        model, table, parameters_of(model), prior_precision=np.eye(model.n_numbers) * 1e6
    )
    lanes = Lanes(model, start.parameters, start.measurements, 1)
    steps = rng.normal(size=(32, model.n_numbers)) * 1e-3
    lanes.move(np.ascontiguousarray(steps.T)[None])
    assert pytest.approx(steps, abs=1e-12) == lanes.x[0].T  # one move is the step itself
    seen = np.zeros((1, len(q), 12, 32))
    tables = []
    for k in range(32):
        other = mixed_table(model, q, rng)
        own = Measurements(
            **{n: getattr(table, n) for n in table.__slots__}
            | {"position": other.position, "rotation": other.rotation}
        )
        tables.append(own)
        seen[0, :, :3, k], seen[0, :, 3:, k] = own.position, own.rotation.reshape(-1, 9)
    slope, square = np.empty((1, model.n_numbers, 32)), np.empty((1, 32))
    replicates.gradient(
        lanes.links, lanes.base, lanes.tool, lanes.terms, seen, start.weight,
        start.measurements.offset, *lanes.plan, slope, square,
    )  # fmt: skip
    for k, own in enumerate(tables):
        stack = stacked(model.moved(steps[k]), own)
        expected = stack.A.T @ stack.r
        size = np.linalg.norm(stack.A, axis=0) * np.linalg.norm(stack.r)
        assert np.abs(slope[0, :, k] - expected).max() < 1e-9 * size.max()  # the bar
        assert (np.abs(slope[0, :, k] - expected) <= 1e-9 * size + 1e-12 * size.max()).all()
        assert square[0, k] == pytest.approx(stack.r @ stack.r, rel=1e-9)


def test_noisy_tables_are_true_poses_turned_by_the_exponential():
    rng = np.random.default_rng(5)
    T = tx60().poses(pool_r(4))
    normal = rng.standard_normal((2, 4, 6, 32))
    A = rng.normal(size=(4, 6, 6)) * 1e-3
    factor = np.linalg.cholesky(A @ np.swapaxes(A, 1, 2))
    seen = np.empty((2, 4, 12, 32))
    replicates.shots(
        normal, np.ascontiguousarray(T[:, :3, 3]), np.ascontiguousarray(T[:, :3, :3]), factor, seen
    )
    noise = np.einsum("jrc,bjck->bjrk", factor, normal)
    expected = exp_so3(np.moveaxis(noise[:, :, 3:], 2, -1)) @ T[:, None, :3, :3]
    got = np.moveaxis(seen[:, :, 3:], 2, -1).reshape(expected.shape)
    # turns of some mrad: the series ends at the eighth power
    assert got == pytest.approx(expected, abs=1e-15)
    assert seen[:, :, :3] == pytest.approx(T[None, :, :3, 3, None] + noise[:, :, :3], abs=1e-15)


def test_the_source_of_the_loops_runs_as_plain_python_with_the_same_bits():
    rng = np.random.default_rng(6)
    n, N, M = 2, 3, 2
    args = (
        rng.normal(size=(n, 8, M)), rng.normal(size=(3, M)), rng.normal(size=(12, M)),
        rng.normal(size=(1, M)) * 0.01, rng.normal(size=(n, N)), rng.normal(size=(n, N)),
        rng.normal(size=(n, N)), rng.normal(size=(1, N)), np.array([1]), np.array([True, False]),
        True, rng.normal(size=(3, N)),
    )  # fmt: skip
    compiled, plain = np.zeros((9, N)), np.zeros((9, N))
    points.point_sums(*args, compiled)
    points.point_sums.py_func(*args, plain)
    assert np.array_equal(compiled, plain)


def test_arrays_of_another_layout_or_type_are_refused_rather_than_compiled_for():
    with pytest.raises(TypeError, match="No matching definition"):
        replicates.shots(np.zeros((1, 1, 6, 32), dtype=np.float32), *(np.zeros((1, 3)),) * 4)


@pytest.mark.slow
def test_without_a_folder_to_write_the_loops_compile_uncached(tmp_path):
    """A copy of the house whose __pycache__ is a file: root may write anywhere else."""
    root = Path(__file__).parents[3]
    shutil.copytree(
        root / "calib", tmp_path / "calib", ignore=shutil.ignore_patterns("__pycache__")
    )
    (tmp_path / "calib" / "kernels" / "__pycache__").write_text("in the way")
    environment = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    code = "import calib.kernels.points as k; print(k.point_sums.stats.cache_path)"
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["None"]
