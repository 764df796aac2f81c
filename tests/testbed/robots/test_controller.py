"""Joints of a controller: statements that can be solved, their inverse, and those that cannot."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import truebed
from calib.errors import InputError
from calib.geometry.jacobian import joint_columns
from testbed.robots.catalog import load_robot
from testbed.robots.controller import AS_THE_ARM
from testbed.robots.coupled import ControllerTable
from testbed.robots.write.toml import robot_toml
from testbed.scenario.hashes import robot_hash
from tests.testbed.robots.described_cases import urdf
from tests.testbed.robots.robot_cases import TX60, joint_vectors
from tests.testbed.robots.test_minimal import robot_file

TURNING = ("revolute",) * 6
SCARA = ("revolute", "revolute", "prismatic", "revolute")
FANUC, PALLETIZER = ("q3 = J3 + J2",), ("q3 = J3 - J2", "q4 = -q2 - q3")


def stated(*statements, kinds=TURNING, **limits):
    return ControllerTable(joints=statements, **limits).controller(kinds)


def test_statements_mean_what_they_say():
    J = np.array([[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]])
    both = stated("J3 = q3 - q2", "q5 = J5 + 1/50 J4", "q6 = -J6 + 0.5*J5 - .25 q4")
    q = [0.1, 0.2, 0.3 + 0.2, 0.4, 0.5 + 0.4 / 50, -0.6 + 0.5 * 0.5 - 0.25 * 0.4]
    assert_allclose(both.to_arm(J)[0], q, rtol=1e-15)
    # either side of one statement is the same statement
    assert_array_equal(both.to_arm(J)[:, 2], stated(*FANUC).to_arm(J)[:, 2])
    # a held joint has no motor: the forearm stays level whatever the others do
    held = stated(*PALLETIZER)
    q = held.read(J[:, [0, 1, 2, 4, 5]], 6)
    assert_allclose(q[0], [0.1, 0.2, 0.3 - 0.2, -0.3, 0.5, 0.6], rtol=1e-15)
    assert_array_equal(held.written(q), J[:, [0, 1, 2, 4, 5]])
    slide = stated("q3 = J3 + 0.05 mm/deg J4", kinds=SCARA)
    assert_allclose(slide.to_arm(np.radians([0, 0, 0, 90.0]))[2], 0.05e-3 * 90, rtol=1e-14)


@pytest.mark.parametrize("seed", range(20))
def test_the_inverse_of_random_statements_brings_joints_back(seed):
    rng, order = np.random.default_rng(seed), np.random.default_rng(seed).permutation(6)
    texts = []
    for k, i in enumerate(order[1:], start=1):
        side, other = rng.permutation(["q", "J"])
        before = rng.choice(order[:k], size=rng.integers(0, k + 1), replace=False)
        terms = "".join(
            f" {rng.choice(['+', '-'])} {rng.uniform(0.01, 2):.3g} {rng.choice(['q', 'J'])}{j + 1}"
            for j in before
        )
        texts.append(f"{side}{i + 1} = {rng.uniform(0.5, 2):.3g} {other}{i + 1}{terms}")
    found = stated(*texts)
    J = rng.uniform(-3, 3, (7, 6))
    size = np.abs(found.inverse) @ np.abs(found.matrix) @ np.full(6, 3.0)
    # as many roundings as there are terms
    assert (np.abs(found.of_arm(found.to_arm(J)) - J) <= 40 * 2.3e-16 * size).all()
    # another way to the matrix: every statement holds at every joint vector
    q = found.to_arm(J)
    for text in texts:
        left, _, right = text.partition(" = ")
        names = {f"q{k + 1}": q[:, k] for k in range(6)} | {f"J{k + 1}": J[:, k] for k in range(6)}
        value = eval(right.replace(" q", " * q").replace(" J", " * J"), {}, names)
        assert_allclose(value, names[left], atol=1e-13 * size.max())


@pytest.mark.parametrize(
    ("statements", "told"),
    [
        (["q3"], "no statement on a joint"),
        (["q3 = "], "says nothing of q3"),
        (["q7 = J7"], "names joint 7; there are q1 to q6"),
        (["q3 = J3 + 10"], "constants belong to theta_deg"),
        (["q3 = q3 + J3"], "q3 on both sides"),
        (["q3 = J3 + J2 + J2"], "names J2 twice"),
        (["q3 = J3 + 0 J2"], "has 0 at J2; allowed"),
        (["q3 = 0 J3"], "has 0 at J3; allowed"),
        (["J3 = q2"], "does not name q3"),
        (["q3 = J3", "J3 = q3 - q2"], "joint 3 is stated twice"),
        (["q2 = J2 + J3", "q3 = J3 + J2"], "stated by each other, in a circle"),
        (["q3 = J2", "q4 = J4 + J3"], "leaves the controller none"),
        (["q4 = -q2 - q3", "q5 = J4"], "or write J5 here if it is the one that turns q5"),
        (["q3 = J3 + 2 mm/deg J2"], "takes no unit"),
        (["q4 = 1e-6 J4 + 1e6 q5"], "multiply joints by more"),
    ],
)
def test_what_cannot_be_solved_is_refused(statements, told):
    with pytest.raises(ValueError, match=told):
        stated(*statements)


def test_a_slide_is_moved_by_a_turn_only_with_a_unit():
    with pytest.raises(ValueError, match=r'needs the unit mm/deg.*as in "0.05 mm/deg J4"'):
        stated("q3 = J3 + 0.05 J4", kinds=SCARA)
    with pytest.raises(ValueError, match=r"limits_mm names J2: it is for joints that are stated"):
        stated("q3 = J3", kinds=SCARA, limits_mm={"J2": (0.0, 1.0)})


@pytest.mark.parametrize(
    ("limits", "told"),
    [
        ({"limits_deg": {"J3": (0.0, 1.0)}}, "limits_deg names J3, which is prismatic"),
        ({"limits_mm": {"J3": (5.0, 1.0)}}, "limits_mm: J3 goes from 5 to 1"),
    ],
)
def test_limits_that_no_joint_has_are_refused(limits, told):
    with pytest.raises(ValueError, match=told):
        stated("q3 = J3", kinds=SCARA, **limits)


def test_a_robot_file_keeps_its_statements_and_says_what_is_wrong_with_them(tmp_path):
    limits = {"J3": (-140.0, 210.5)}
    own = replace(TX60, controller=stated(*FANUC, "J5 = q5 - 1/50 q4", limits_deg=limits))
    links = [(0, 100, 0)] * 6
    plain = robot_file(tmp_path, *links).read_text()
    text = robot_toml(own).partition("[[parts]]")[0]
    (tmp_path / "robot.toml").write_text(text)
    again = load_robot(tmp_path)
    assert again.controller.statements == own.controller.statements
    for name in ("matrix", "inverse", "limits"):
        assert_array_equal(getattr(again.controller, name), getattr(own.controller, name))
    # another robot for records, and the same one where nothing is stated
    assert robot_hash(replace(own, visuals=())) != robot_hash(replace(TX60, visuals=()))
    assert TX60.controller.plain
    assert TX60.controller is AS_THE_ARM
    (tmp_path / "robot.toml").write_text(plain + '[controller]\njoints = ["q3 = J3 + J9"]\n')
    with pytest.raises(InputError, match=r"\[controller\] .*names joint 9") as caught:
        load_robot(tmp_path)
    assert caught.value.code == "S37"


def test_limits_are_those_of_the_arm_and_of_the_controller():
    found = stated(*PALLETIZER, limits_deg={"J3": (-10.0, 20.0)})
    q = found.holding(joint_vectors(200))
    J3, inside = np.degrees(q[:, 2] + q[:, 1]), found.allows(q)
    assert_array_equal(inside, (J3 >= -10) & (J3 <= 20))
    off = q.copy()
    off[:, 3] += 1e-3
    assert not found.allows(off).any()
    assert AS_THE_ARM.allows(q).all()


def scatter(root):
    """Root mean squares (m,) of tool points that scatter by roots (m, 3, n)."""
    return np.sqrt((root**2).sum(axis=(1, 2)))


@pytest.mark.parametrize(
    ("statements", "ratio", "single"),
    [
        (("q5 = J5 + J4", "q6 = J6 - J5"), (0.998, 1.002), 0.12),
        (("q3 = J3 - J2",), (0.72, 0.78), 0.45),
        (("q3 = J3 + J2",), (1.17, 1.23), 0.31),
    ],
    ids=["wrist", "driven from the base", "to one side"],
)
def test_what_motors_scatter_beside_what_is_stated_of_joints_is_as_the_guide_says(
    statements, ratio, single
):
    tool = np.eye(4)
    tool[:3, 3] = 0.05, 0.03, 0.15
    chain, sd = replace(TX60.model.chain, T_flange_tool=tool), TX60.repeatability
    q = joint_vectors(2000)
    J = replace(TX60.model, chain=chain).poses_and_jacobian(q)[1][:, :3, joint_columns(chain)]
    C = stated(*statements).matrix
    real, said = scatter(J @ C * sd), scatter(J * np.sqrt(C**2 @ sd**2))
    low, high = ratio
    assert low < np.sqrt((real**2).mean() / (said**2).mean()) < high
    assert np.abs(real / said - 1).max() < single
    # |c| s^2 more at both joints covers all that they scatter, in every direction
    more = sum(np.abs(C[i, j]) * sd[j] ** 2 * (np.eye(6)[i] + np.eye(6)[j])
               for i, j in np.argwhere(C - np.diag(np.diag(C))))  # fmt: skip
    left = np.diag(C**2 @ sd**2 + more) - (C * sd) @ (C * sd).T
    if len(statements) == 1:
        assert np.linalg.eigvalsh(left).min() > -1e-12 * sd.max() ** 2


def test_a_urdf_gets_its_statement_as_a_robot_toml_of_the_same_robot(tmp_path):
    joint = ("turn", "revolute", "0 0 0.1", "0 0 0", "0 0 1", (-1, 1))
    other = ("fold", "revolute", "0.2 0 0", "0 0 0", "0 1 0", (-1, 1))
    (tmp_path / "arm.urdf").write_text(urdf("arm", [joint, other]))
    arm = load_robot(tmp_path / "arm.urdf")
    truebed.write_robot(arm, arm.model, tmp_path / "own")
    file = tmp_path / "own" / "robot.toml"
    file.write_text(file.read_text() + '\n[controller]\njoints = ["q2 = J2 - J1"]\n')
    found = load_robot(file)
    assert (found.name, found.title) == (arm.name, arm.title)
    assert "identified" not in file.read_text()
    q = joint_vectors(5, robot=arm)
    assert_allclose(found.model.poses(q), arm.model.poses(q), atol=1e-12)
    assert_allclose(found.controller.to_arm(np.array([0.3, 0.1])), [0.3, -0.2], rtol=1e-15)
