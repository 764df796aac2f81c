"""The compiled loops against plain numpy: noisy tables and gradients."""

import os
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from calib.geometry.frames import exp_so3
from calib.geometry.parameters import parameters_of
from calib.kernels import compiled, loops, plain
from calib.measurement.noise import with_joint_noise
from calib.measurement.observations import Measurements
from calib.measurement.residual import linearize
from calib.measurement.tables import covariances_of_sd, poses
from calib.uncertainty.batch import Batch
from calib.uncertainty.bootstrap import bootstrap
from calib.uncertainty.refit import freeze
from tests.calib.uncertainty.test_monte_carlo import MODELS
from tests.fresh import printed
from tests.reference import WEN24, pool_r, tx60

CASES = pytest.mark.parametrize("name", MODELS)
NUMBA = pytest.mark.skipif(not loops.NUMBA, reason="numba is not installed: nothing is compiled")
ROOMS = pytest.mark.parametrize(
    "room",
    [pytest.param("replicates", id="compiled", marks=NUMBA), pytest.param("plain", id="plain")],
    indirect=True,
)


@pytest.fixture
def room(request):
    """A module of loops, imported by the tests that call it: importing compiles, for long."""
    return import_module(f"calib.kernels.{request.param}")


def compiled_poses():
    """The compiled loop of noisy tables, imported as above."""
    return import_module("calib.kernels.noisy_poses").noisy_poses


def mixed_table(model, q, rng):
    """Poses and reflectors with full covariances, seen a little off the model."""
    m, n = len(q), model.chain.n_joints
    T = model.poses(q)
    offset = np.zeros((m, 3))
    kind = np.array(["pose", "point"])[(np.arange(m) % 3 == 2).astype(int)]
    offset[kind == "point"] = rng.normal(size=((kind == "point").sum(), 3)) * 0.05
    position = T[:, :3, 3] + (T[:, :3, :3] @ offset[..., None])[..., 0]
    device = covariances_of_sd((2e-5, 2e-4), 6, m)
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


@ROOMS
@CASES
def test_the_gradient_is_the_one_of_the_whitened_jacobian(name, room):
    """Each lane its own model and its own table: J'W r and r'W r through `linearize`."""
    rng = np.random.default_rng(21)
    model = MODELS[name](rng)
    q = rng.normal(size=(9, model.chain.n_joints))
    table = mixed_table(model, q, rng)
    start = freeze(
        model, table, parameters_of(model), prior_precision=np.eye(model.n_numbers) * 1e6
    )
    batch = Batch(model, start.parameters, start.measurements, 1)
    steps = rng.normal(size=(32, model.n_numbers)) * 1e-3
    batch.move(np.ascontiguousarray(steps.T)[None])
    assert pytest.approx(steps, abs=1e-12) == batch.x[0].T  # one move is the step itself
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
    room.gradient(
        batch.links, batch.base, batch.tool, batch.terms, seen, start.weight,
        start.measurements.offset, *batch.configurations, slope, square,
    )  # fmt: skip
    for k, own in enumerate(tables):
        stack = linearize(model.moved(steps[k]), own)
        expected = stack.A.T @ stack.r
        size = np.linalg.norm(stack.A, axis=0) * np.linalg.norm(stack.r)
        assert np.abs(slope[0, :, k] - expected).max() < 1e-9 * size.max()  # the bar
        assert (np.abs(slope[0, :, k] - expected) <= 1e-9 * size + 1e-12 * size.max()).all()
        assert square[0, k] == pytest.approx(stack.r @ stack.r, rel=1e-9)


@pytest.mark.parametrize("which", ["compiled", "plain"])
def test_noisy_tables_are_true_poses_turned_by_the_exponential(which):
    made = compiled_poses() if which == "compiled" else plain.noisy_poses
    rng = np.random.default_rng(5)
    T = tx60().poses(pool_r(4))
    normal = rng.standard_normal((2, 4, 6, 32))
    A = rng.normal(size=(4, 6, 6)) * 1e-3
    factor = np.linalg.cholesky(A @ np.swapaxes(A, 1, 2))
    seen = np.empty((2, 4, 12, 32))
    made(
        normal, np.ascontiguousarray(T[:, :3, 3]), np.ascontiguousarray(T[:, :3, :3]), factor, seen
    )
    noise = np.einsum("jrc,bjck->bjrk", factor, normal)
    expected = exp_so3(np.moveaxis(noise[:, :, 3:], 2, -1)) @ T[:, None, :3, :3]
    got = np.moveaxis(seen[:, :, 3:], 2, -1).reshape(expected.shape)
    # turns of some mrad: the series ends at the eighth power
    assert got == pytest.approx(expected, abs=1e-15)
    assert seen[:, :, :3] == pytest.approx(T[None, :, :3, 3, None] + noise[:, :, :3], abs=1e-15)


@NUMBA
def test_the_source_of_the_loops_runs_as_plain_python_with_the_same_bits():
    rng = np.random.default_rng(6)
    args = (
        rng.standard_normal((1, 2, 6, 32)), rng.normal(size=(2, 3)), rng.normal(size=(2, 3, 3)),
        rng.normal(size=(2, 6, 6)) * 1e-3,
    )  # fmt: skip
    by_machine, by_python = np.zeros((1, 2, 12, 32)), np.zeros((1, 2, 12, 32))
    noisy_poses = compiled_poses()
    noisy_poses(*args, by_machine)
    noisy_poses.py_func(*args, by_python)
    assert np.array_equal(by_machine, by_python)


@NUMBA
def test_arrays_of_another_layout_or_type_are_refused_rather_than_compiled_for():
    with pytest.raises(TypeError, match="No matching definition"):
        compiled_poses()(np.zeros((1, 1, 6, 32), dtype=np.float32), *(np.zeros((1, 3)),) * 4)


@NUMBA
@pytest.mark.slow
@pytest.mark.parametrize("home_is_open", [True, False], ids=["home", "nowhere"])
def test_without_its_own_folder_code_is_kept_in_the_user_cache_or_not_at_all(
    tmp_path, home_is_open
):
    """A copy of the house whose __pycache__ is a file: root may write anywhere else."""
    root, home = Path(__file__).parents[3], tmp_path / "home"
    shutil.copytree(
        root / "calib", tmp_path / "calib", ignore=shutil.ignore_patterns("__pycache__")
    )
    (tmp_path / "calib" / "kernels" / "__pycache__").write_text("in the way")
    home.mkdir() if home_is_open else home.write_text("in the way")
    environment = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    environment |= {"HOME": str(home), "XDG_CACHE_HOME": str(home / "cache")}
    code = "import calib.kernels.noisy_poses as k; print(k.noisy_poses.stats.cache_path)"
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    where = done.stdout.strip()
    assert where.startswith(str(home)) if home_is_open else where == "None"


@NUMBA
def test_few_replicates_and_few_robots_load_no_compiler():
    code = (
        "import sys; from calib.kernels.loops import *; from calib.kernels import loops, plain;"
        "few = loops_for(loops.MANY - 1), spring_loop_for(loops.MANY_SPRUNG - 1);"
        "print(few[0].gradient is plain.gradient, few[1], 'numba' in sys.modules);"
        "many = loops_for(loops.MANY), spring_loop_for(loops.MANY_SPRUNG);"
        "print(many[0].gradient is plain.gradient, many[1] is None, 'numba' in sys.modules)"
    )
    assert printed(code) == ["True", "None", "False", "False", "False", "True"]


def test_a_compiler_that_cannot_be_imported_is_none(monkeypatch):
    """As one made for another numpy: else the interpreter would play each of many replicates."""
    monkeypatch.setattr(compiled, "njit", None)
    assert loops.loops_for(loops.MANY).gradient is plain.gradient
    assert loops.spring_loop_for(loops.MANY_SPRUNG) is None


@NUMBA
def test_both_kinds_of_loops_find_the_same_replicates(monkeypatch):
    """The draws are the same, so are the answers, but for the order of sums."""
    model, q = tx60(), pool_r(20)
    plan = poses(q, model.poses(q), sd=(2e-5, 2e-4))
    free = parameters_of(model, WEN24)

    def made(many, steps=2):
        monkeypatch.setattr(loops, "MANY", many)
        return bootstrap(model, plan, free, np.random.default_rng(3), replicates=200, steps=steps)

    plain_ones, compiled_ones = made(1000), made(0)
    sd = np.sqrt(np.diag(plain_ones.covariance))
    # metres over micrometres in double precision; 2e-11 were seen
    assert np.abs((plain_ones.estimates - compiled_ones.estimates) / sd).max() < 1e-9
    assert plain_ones.chi_square == pytest.approx(compiled_ones.chi_square, rel=1e-9)
    # the first step knows the noise to first order; 3e-7 were seen
    assert np.abs((plain_ones.estimates - made(0, 8).estimates) / sd).max() < 1e-6
