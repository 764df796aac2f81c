"""Where the root of a URDF was found, in which corrected programs hold."""

from dataclasses import replace
from functools import cache

import numpy as np

from calib.geometry.frames import log_so3, step_transform
from calib.geometry.model import RobotModel
from testbed.identify.applies.region import workspace_table
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.handback.deliver import deliver
from testbed.identify.handback.delivered import Delivered
from testbed.identify.handback.root import root_found
from testbed.identify.to_do.program import program_step
from testbed.robots.catalog import load_robot
from tests.calibrated import BASE, TOOL, session_of, table_of
from tests.testbed.files.test_program_frames import CLOCKWISE

ROOT = "the root link of clockwise.urdf"
N = 60


@cache
def found(path):
    """A clockwise arm without errors, before a tracker that stands somewhere, and calibrated."""
    arm = load_robot(path)
    chain = arm.model.chain
    seen = replace(
        chain,
        T_world_base=step_transform(BASE) @ chain.T_world_base,
        T_flange_tool=chain.T_flange_tool @ step_transform(TOOL),
    )
    q = np.random.default_rng(3).uniform(-1.5, 1.5, (N, 6))
    return arm, calibrate(arm, session_of(table_of(RobotModel(seen), q)), Options(seed=1))


def test_the_root_of_a_file_is_said_in_the_frame_of_the_measurements(tmp_path):
    """Its chain begins on the first axis, which points down, in a frame that nobody knows."""
    path = tmp_path / "clockwise.urdf"
    path.write_text(CLOCKWISE, encoding="utf-8")
    arm, calibration = found(path)
    T = root_found(calibration)
    # the links have a prior of 0.6 mm and 0.1 deg, and take up far less of noise of 10 um
    assert np.abs((T - step_transform(BASE))[:3, 3]).max() < 1e-4
    assert np.abs(log_so3(T[:3, :3].T @ step_transform(BASE)[:3, :3])).max() < 1e-4
    told = deliver(calibration, arm, tmp_path / "out")
    assert told.root == ROOT
    said = next(one for one in told.robot if one.startswith(f"{ROOT} was found at ("))
    place = [float(x) for x in said.partition("(")[2].partition(")")[0].split(", ")]
    np.testing.assert_allclose(place, 1e3 * T[:3, 3], atol=1e-4)
    step = program_step(calibration, replace(told, program=("1 of 1 corrected",)))
    assert step.startswith(f"Corrected targets hold in {ROOT}: measure work frames in it")
    assert f"{ROOT[1:]} was found at (" in step
    # measured in the frame of the robot, it stands in it
    own = deliver(replace(calibration, own_frames=True), arm, tmp_path / "own")
    assert not any("was found at" in one for one in own.robot)


def test_the_workspace_is_that_of_the_root(tmp_path):
    path = tmp_path / "clockwise.urdf"
    path.write_text(CLOCKWISE, encoding="utf-8")
    arm, calibration = found(path)
    place = arm.model.poses(calibration.measurements.q)[calibration.is_used][:, :3, 3]
    table = workspace_table(calibration, ROOT)
    assert ROOT in table.caption
    for k, row in enumerate(table.rows[:3]):
        low, high = (float(cell.replace("−", "-")) for cell in row[1:3])
        assert abs(low - 1e3 * place[:, k].min()) <= 0.5 + 1e-9  # written in whole mm
        assert abs(high - 1e3 * place[:, k].max()) <= 0.5 + 1e-9
    assert "in the base frame" in workspace_table(calibration, Delivered((), (), 0).root).caption
