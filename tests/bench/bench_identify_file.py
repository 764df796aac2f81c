"""From a file of 2,773 full poses to report, recording and robot: run with ``--benchmark-only``."""

import resource
from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.frames import step_transform
from calib.geometry.joint_errors import JointErrors, harmonic_terms
from calib.geometry.model import RobotModel
from testbed.files.read import read_session
from testbed.identify.folder import play_calibration
from testbed.robots.catalog import load_robot
from testbed.robots.placements import quaternion_wxyz

POSES = 2773
LIMIT = 15.0
"""Seconds on two cores, one BLAS thread."""


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """A CSV in the project's own layout: a UR10 with wobbling joints, some meters away."""
    robot, rng = load_robot("universal_ur10"), np.random.default_rng(0)
    chain, angle = robot.model.chain, np.radians(0.05)
    sd = np.array([angle, 5e-4, 5e-4, angle, angle])
    terms = harmonic_terms(6)
    true = RobotModel(
        replace(
            chain,
            links=chain.links + sd * rng.standard_normal(chain.links.shape),
            T_world_base=step_transform(np.array([3.0, -0.6, -0.5, 0.1, 0.05, 1.9])),
            T_flange_tool=step_transform(np.array([0.01, 0.02, 0.1, 0.3, -0.2, 1.0])),
        ),
        JointErrors(terms, np.radians(0.01) * rng.standard_normal(len(terms))),
    )
    q = rng.uniform(-2.5, 2.5, (POSES, 6))
    T = true.poses(q)
    position = 1e3 * (T[:, :3, 3] + rng.normal(0, 20e-6, (POSES, 3)))
    rows = np.column_stack([np.degrees(q), position, quaternion_wxyz(T[:, :3, :3])])
    head = [f"q{k}_deg" for k in range(1, 7)] + ["x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"]
    folder = tmp_path_factory.mktemp("identify")
    lines = [",".join(["pose_id", *head])]
    lines += [",".join([f"P{k}", *map(repr, row)]) for k, row in enumerate(rows.tolist())]
    (folder / "poses.csv").write_text("\n".join(lines) + "\n")
    (folder / "session.toml").write_text(
        'name = "bench"\nrobot = "universal_ur10"\n[joints]\nfile = "poses.csv"\n'
        '[frames]\nfile = "poses.csv"\n[uncertainty]\nposition_um = 20.0\nrotation_mdeg = 10.0\n'
    )
    return folder / "session.toml"


def test_a_file_of_2773_full_poses_to_the_report(benchmark, file):
    robot, rounds = load_robot("universal_ur10"), []

    def whole():
        out = file.parent / f"out{len(rounds)}"
        rounds.append(play_calibration(robot, read_session(file, robot), out)[0])

    benchmark.pedantic(whole, rounds=2, iterations=1)
    found = rounds[-1]
    benchmark.extra_info["peak_gb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    assert len(found.measurements) == POSES
    assert found.fit.test.position.mean < 60e-6 < found.before_test.position.mean
    assert benchmark.stats.stats.min < LIMIT
