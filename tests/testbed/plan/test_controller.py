"""A plan for an arm whose controller counts joints its own way goes to the same postures."""

import csv
import io
import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from testbed.laboratory.joint_lists import read_joints
from testbed.plan.folder import programs
from testbed.plan.results import goal_csv, plan_csv, stops_of
from testbed.robots.coupled import ControllerTable
from tests.planned import ROBOT, quick_plan

STATED = {
    "geared": ("J3 = q3 - q2", "q5 = J5 + 1/50 J4", "q6 = -J6 + 0.5 J5"),
    "held": ("q4 = -q2 - q3",),
}


def planned(name):
    """The quick plan and its robot, as if a controller had counted all along."""
    kinds = ROBOT.model.chain.kinds
    controller = ControllerTable(joints=STATED[name]).controller(kinds)
    made = quick_plan()
    q = controller.holding(made.tour.q)
    made = replace(made, controller=controller, tour=replace(made.tour, q=q))
    return made, replace(ROBOT, controller=controller, limits=np.tile([-9.0, 9.0], (6, 1)))


@pytest.mark.parametrize("name", STATED)
def test_its_tables_come_back_as_the_postures_of_the_arm(tmp_path, name):
    made, robot = planned(name)
    (tmp_path / "plan.csv").write_text(plan_csv(made))
    again = read_joints(robot, tmp_path / "plan.csv")
    identified = [role == "identify" for role in made.tour.roles]
    # nine decimals of a degree, added three times at most
    assert_allclose(again, made.tour.q[identified], atol=3e-11)
    head = next(csv.reader(io.StringIO(goal_csv(made))))
    assert ("q4_deg" in head) == (name == "geared")


def test_its_programs_hold_what_the_controller_counts():
    made, robot = planned("geared")
    q = np.array([stop.q for stop in stops_of(made)])
    J = robot.controller.of_arm(q)
    text = programs(made)
    rapid = [re.findall(r"[-\d.]+", found) for found in
             re.findall(r"MoveAbsJ \[\[(.*?)\]", text["program.rapid.txt"])]  # fmt: skip
    assert_allclose(np.array(rapid, dtype=float), np.degrees(J), atol=1e-6)
    script = re.findall(r"movej\(\[(.*?)\], a=1\.4, v=([\d.]+)", text["program.urscript.txt"])
    assert_allclose([[float(x) for x in one.split(",")] for one, _ in script], J, atol=1e-9)
    assert "its controller (J3 = q3 - q2," in text["program.krl.txt"]
    # v is that of the controller's joint that turns farthest: no joint of the arm is too fast
    seconds = np.abs(np.diff(J, axis=0)).max(axis=1) / [float(v) for _, v in script[1:]]
    speed = np.abs(np.diff(q, axis=0)) / seconds[:, None]
    assert (speed / made.tour.speeds).max(axis=1) == pytest.approx(np.ones(len(speed)), abs=1e-4)
