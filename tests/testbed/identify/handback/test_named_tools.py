"""Targets that name their tools, where another tool than the measured one is stated to be used."""

import csv
import io
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import testbed.identify.handback.deliver as deliver_module
from calib.uncertainty.statement.conditions import Conditions
from testbed.files.conditions import SetUp
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.handback.deliver import deliver
from testbed.report.text import csv_text
from testbed.scenario.tool_in_use import ToolInUse
from tests.calibrated import robot, session_of, table_of, true_model
from tests.reference import pool_r

GRIPPER = ToolInUse("gripper", (0.0, 0.0, 0.15), (0.0, 0.0, 0.0), 0.0)
M = 80


@cache
def with_gripper():
    """Measured with a probe, to be used with a gripper."""
    return calibrate(
        robot(),
        session_of(
            table_of(true_model(), pool_r(M)),
            in_use=GRIPPER,
            conditions=Conditions(tool=("probe",) * M),
        ),
        Options(seed=1),
    )


@pytest.fixture(autouse=True)
def _no_files_of_the_robot(monkeypatch):
    """They have their own tests."""
    monkeypatch.setattr(deliver_module, "write_robot_folder", lambda *_, **__: ())


def with_use(found, **use):
    """The same calibration for targets that are used so."""
    return replace(found, set_up=SetUp(use=Conditions(**use)))


def unstated(found):
    """The same where nobody says what was mounted while it was measured."""
    return replace(found, conditions=Conditions())


def delivered(found, folder, arm=None, **more):
    """What comes with a program of three joint targets, and the table beside it."""
    q = np.degrees(with_gripper().stated_q[:3])
    columns = {f"q{k + 1}_deg": [f"{x:.6f}" for x in q[:, k]] for k in range(6)} | more
    folder.mkdir()
    program = folder / "jobs.csv"
    program.write_text(csv_text(tuple(columns), zip(*columns.values(), strict=True)))
    made = deliver(found, arm or robot(), folder, program=program)
    table = list(csv.DictReader(io.StringIO((folder / "jobs_statement.csv").read_text())))
    return made, [float(row["R95_mean_um"] or "nan") for row in table], " | ".join(made.program)


@pytest.mark.parametrize("data", [with_gripper, lambda: unstated(with_gripper())])
def test_the_tool_in_use_has_its_region_whatever_was_measured(data, tmp_path):
    """Its tip is stated in the flange's frame: that is what the region is of."""
    _, tip, _ = delivered(data(), tmp_path / "unsaid")
    made, stated, said = delivered(with_use(data(), tool=("gripper",)), tmp_path / "said")
    np.testing.assert_allclose(stated, tip, rtol=1e-12)
    assert np.isfinite(stated).all()
    assert not made.targets.departed.any()
    assert set(made.program_conditions) == {"tool with a stated point"}
    assert "R95 at targets is for the tip of gripper, as [tool_in_use] states it" in said
    assert "as long as the arm carries the same load as in the measurements" in said
    assert "nothing can be stated" not in said


def test_a_target_with_the_measured_tool_keeps_the_region_of_that(tmp_path):
    found = with_gripper()
    _, tip, _ = delivered(found, tmp_path / "tip")
    alone = replace(found, handback=replace(found.handback, in_use=None))
    _, own, _ = delivered(with_use(alone, tool=("probe",)), tmp_path / "own")
    tools = ["probe", "gripper", "welder"]
    made, mixed, said = delivered(found, tmp_path / "mixed", tool=tools)
    # the gripper reaches further beyond the flange than the tool of the file
    assert own[0] < 0.99 * tip[0]
    np.testing.assert_allclose(mixed, [own[0], tip[1], np.nan], rtol=1e-12)
    assert made.program_conditions == ("as measured", "tool with a stated point", "other tool")
    assert "at target 1, where the tool measured is named, for the tool of the robot" in said
    assert (
        "for a region at target 3: if the tool welder is the one under [tool_in_use], write name = "
        '"welder" there in place of "gripper"'
    ) in said


def test_without_a_tool_in_use_it_is_said_what_to_write(tmp_path):
    alone = replace(with_gripper(), handback=replace(with_gripper().handback, in_use=None))
    for k, found in enumerate((alone, unstated(alone))):
        made, _, said = delivered(with_use(found, tool=("gripper",)), tmp_path / str(k))
        assert made.targets.departed.all()
        assert (
            "for a region at targets 1, 2 and 3, state under [tool_in_use] of session.toml name = "
            '"gripper" and point_mm = [x, y, z], where the tip of that tool is in the frame of the '
            "flange"
        ) in said


def test_poses_of_the_file_s_tool_are_not_those_of_another_tip(tmp_path):
    """A Cartesian target says where the tool of the robot's file goes."""
    T = robot().model.poses(with_gripper().stated_q[:3])
    place = {f"{axis}_mm": [f"{1e3 * x:.6f}" for x in T[:, k, 3]] for k, axis in enumerate("xyz")}
    turn = {
        f"r{i + 1}{j + 1}": [f"{x:.12f}" for x in T[:, i, j]] for i in range(3) for j in range(3)
    }
    used = with_use(with_gripper(), tool=("gripper",))
    made, _, said = delivered(used, tmp_path / "apart", **place, **turn)
    assert made.targets.departed.all()
    assert "give the joints of the targets alone, or make that tip the tool of the robot's" in said
    # the same tip in the robot's file: its poses are those of the gripper
    own = robot()
    there = own.model.chain.T_flange_tool.copy()
    there[:3, 3] = GRIPPER.point
    chain = replace(own.model.chain, T_flange_tool=there)
    arm = replace(own, model=replace(own.model, chain=chain))
    T = arm.model.poses(with_gripper().stated_q[:3])
    place = {f"{axis}_mm": [f"{1e3 * x:.6f}" for x in T[:, k, 3]] for k, axis in enumerate("xyz")}
    made, _, _ = delivered(used, tmp_path / "same", arm, **place, **turn)
    assert not made.targets.departed.any()
