"""Points at the flange of a URDF are stated at its tip, in which no chain has to end."""

from types import SimpleNamespace

import numpy as np
import pytest

from calib.geometry.frames import inverse
from calib.uncertainty.statement.conditions import Conditions
from testbed.files.programs.mounted import known_tips
from testbed.files.read import read_session
from testbed.files.rows.targets import of_targets
from testbed.robots.catalog import load_robot
from testbed.robots.file_frames import stated_at_flange
from testbed.run.export import conditions_in
from tests.testbed.files.test_program import ROBOT, written
from tests.testbed.files.test_program_frames import CLOCKWISE, JOINTS, PLACE, TURNS, poses_of
from tests.testbed.robots.described_cases import HALF
from tests.testbed.robots.robot_cases import yourdfpy_poses

BENT = CLOCKWISE.replace(
    f'<origin xyz="0 0 0" rpy="0 {HALF} 0"/>', '<origin xyz="0.18 -0.02 0.04" rpy="0.5 1.1 -0.3"/>'
)
CENTER = np.array([0.02, -0.03, 0.15])
SESSION = """format = 1
uncertainty = { position_um = 20, rotation_mdeg = 5 }
conditions = { payload_kg = 3, payload_center_mm = [20, -30, 150] }
tool_in_use = { name = "gripper", point_mm = [20, -30, 150] }
"""


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """With a tip that points aside."""
    assert BENT != CLOCKWISE
    path = tmp_path_factory.mktemp("arm") / "bent.urdf"
    path.write_text(BENT, encoding="utf-8")
    return load_robot(path)


def in_flange(arm, point):
    """What the chain calls a point of the tip, by another reader of the file."""
    q = np.array([[0.3, -0.8, 0.4, 1.0, -0.6, 0.2]])
    T = yourdfpy_poses(arm.own_text.path, q, "tool0_link")[0]
    chain = arm.model.chain
    flange = arm.model.poses(q)[0] @ inverse(chain.T_flange_tool)
    return (inverse(flange) @ T @ [*point, 1.0])[:3]


def test_a_session_states_payloads_and_tools_at_the_tip(arm, tmp_path):
    q = np.random.default_rng(2).uniform(-1.0, 1.0, (20, 6))
    rows = np.hstack([np.degrees(q), poses_of(arm.model.poses(q))])
    written(tmp_path / "rows.csv", [*JOINTS, *PLACE, *TURNS], rows.tolist())
    (tmp_path / "session.toml").write_text(SESSION, encoding="utf-8")
    session = read_session(tmp_path / "rows.csv", arm, config=tmp_path / "session.toml")
    there = session.measurements.conditions.center
    # what another reader says, to rounding
    np.testing.assert_allclose(there, np.tile(in_flange(arm, CENTER), (20, 1)), atol=1e-12)
    np.testing.assert_allclose(session.conditions.center[0], CENTER, atol=1e-15)  # as it is said
    tool = session.in_use
    np.testing.assert_allclose(
        tool.in_chain(np.array(tool.point)), in_flange(arm, CENTER), atol=1e-12
    )
    # a Cartesian target is of the tip itself, and so of a tool that ends there
    assert known_tips(tool, arm, cartesian=True) == ()
    text = SESSION.replace("point_mm = [20, -30, 150]", "point_mm = [0, 0, 0]")
    (tmp_path / "session.toml").write_text(text, encoding="utf-8")
    tip = read_session(tmp_path / "rows.csv", arm, config=tmp_path / "session.toml").in_use
    assert known_tips(tip, arm, cartesian=True) == ("gripper",)


def test_targets_state_payloads_at_the_tip(arm):
    q = np.zeros((2, 6))
    stated = Conditions(np.array([3.0, 0.0]), None, None, np.tile(CENTER, (2, 1)))
    at, _ = of_targets(arm, arm.model, stated, q)
    np.testing.assert_allclose(at.center, np.tile(in_flange(arm, CENTER), (2, 1)), atol=1e-12)
    # without a center it hangs in the tip; of nothing there is none
    at, _ = of_targets(arm, arm.model, Conditions(stated.payload), q)
    np.testing.assert_allclose(at.center, np.tile(in_flange(arm, np.zeros(3)), (2, 1)), atol=1e-12)
    at, _ = of_targets(arm, arm.model, Conditions(np.zeros(2)), q)
    assert at.center is None
    own = Conditions(stated.payload, None, None, stated.center)
    at, _ = of_targets(ROBOT, ROBOT.model, own, q)
    np.testing.assert_array_equal(at.center, stated.center)


def test_what_a_campaign_hung_on_its_arm_is_exported_at_the_tip(arm):
    there = in_flange(arm, CENTER)
    np.testing.assert_allclose(stated_at_flange(arm, there), CENTER, atol=1e-12)
    assert stated_at_flange(ROBOT, there) is there
    # and so it is written
    truth = SimpleNamespace(springs=SimpleNamespace(payload_center=there), thermal=None)
    bench = SimpleNamespace(
        robot=arm, truth=SimpleNamespace(unmodelled=truth),
        scenario=SimpleNamespace(truth=SimpleNamespace(payload_kg=3.0)),
    )  # fmt: skip
    table = SimpleNamespace(conditions=SimpleNamespace(payload=None))
    found = conditions_in(bench, table, np.zeros(2))
    np.testing.assert_allclose(found.center, np.tile(CENTER, (2, 1)), atol=1e-12)
