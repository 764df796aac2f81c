"""Types of the packages as a user's type checker sees them: what runs is no error there."""

import os
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.fresh import python

ROOT = Path(__file__).parents[1]
SCRIPT = """
import numpy as np

import calib
from calib import design, uncertainty

links = [[0, 0.4, 0.1, -1.57, 0], [0, 0, 0.5, 0, 0], [0, 0, 0.4, 0, 0]]
beside = calib.Fixtures(anchors=[[2, 0, 0]])
arm = calib.RobotModel(calib.Chain(links, ["revolute"] * 3), fixtures=beside)
rng = np.random.default_rng(0)
q = rng.uniform(-2, 2, (60, 3))
xyz = arm.poses(q)[:, :3, 3] + rng.normal(scale=2e-5, size=(60, 3))
train, test = calib.points(q.tolist(), xyz, sd=2e-5).split(held_out=20)
belief = calib.Prior([0.0, 0.0], [1e-3, 1e-3], ["d1", "a2"])
result: calib.CalibratedRobot = calib.calibrate(arm, train, prior=belief, loss="huber")
judged = result.judge(test)
if judged.point is not None:
    radius: float = judged.point.radius_mean
problem = design.Problem.of_poses(arm, q, poses=12, criterion="V", goals=[[0.1, 0.2, 0.3]])
places = design.exchange(problem, rng, restarts=1).indices.tolist()
u = uncertainty.expanded(1e-3), uncertainty.expanded(result.identification.standard_uncertainty)
held = uncertainty.inside([0, 0, 0], np.eye(3).tolist()), uncertainty.ellipsoid([[1, 0], [0, 1]])
fixed = calib.compensate(result.start.model, result.model, [[0.1, 0.2, 0.3]])
"""


@pytest.mark.slow  # the first run reads the types of numpy
@pytest.mark.skipif(find_spec("mypy") is None, reason="mypy is not installed")
def test_a_strict_type_checker_passes_what_runs(tmp_path):
    script = tmp_path / "own.py"
    script.write_text(SCRIPT, "utf-8")
    path = os.pathsep.join([str(ROOT), str(ROOT / "testbed" / "front")])
    for command in (
        ("-W", "error", script),
        ("-m", "mypy", "--strict", "--cache-dir", ROOT / ".mypy_cache", script),
    ):
        done = python(*command, cwd=tmp_path, check=False, MYPYPATH=path)
        assert done.returncode == 0, done.stdout + done.stderr
