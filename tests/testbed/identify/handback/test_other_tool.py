"""The tip of another tool, where one reflector near the last axis was measured: a foreign UR5.

The reflector lies on axis 6 or beside it, the tip 100 or 150 mm off the flange. What the readings
never saw of the last links must be in the stated radius.
"""

from dataclasses import replace

import numpy as np
import pytest

from testbed.files.read import read_session
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.handback.states import MEASURED, PRIOR, handed_numbers
from testbed.robots.catalog import load_robot
from testbed.robots.tolerances import usual_tolerances
from tests.truth.foreign import UR5, ForeignArm, candidates, true_arm
from tests.truth.foreign_cells import UR5_LINKS
from tests.truth.foreign_tracker import ForeignTracker

pytestmark = pytest.mark.truth
OFF_AXIS = (0.0, 0.01, 0.04, 0.08)
TIPS = (0.1, 0.15)
"""Along the flange's axis, and half as far beside it [m]."""
BESIDE = 0.05
AHEAD = 0.035
"""Where the reflector sits before the flange [m]."""
HOME = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""Axes of the flange at joint zero, in those of the base: Rx(90 deg)."""
TRAIN, HELD_OUT, TARGETS = 50, 20, 60


def write_ur5(folder):
    """robot.toml of the maker's table."""
    lines = ["format = 1", 'name = "ur5"']
    for theta, d, a, alpha, _ in UR5_LINKS.tolist():
        lines += [
            "[[joints]]", 'kind = "revolute"', f"theta_deg = {theta}", f"d_mm = {1e3 * d!r}",
            f"a_mm = {1e3 * a!r}", f"alpha_deg = {float(np.degrees(alpha))!r}",
            "lower_deg = -360", "upper_deg = 360",
        ]  # fmt: skip
    (folder / "robot.toml").write_text("\n".join(lines) + "\n")
    return folder / "robot.toml"


def campaign(folder, off_axis, robot, tip):
    """session.toml of one robot's campaign, the arm, its tracker and joints where it is used."""
    rng = np.random.default_rng([robot, int(1e4 * off_axis), 11])
    arm = true_arm(rng, body=UR5, tool=HOME @ np.array([off_axis, 0.0, AHEAD]))
    tracker = ForeignTracker()
    q = candidates(rng, TRAIN + HELD_OUT, UR5)
    p, _ = tracker.read(arm, q, rng)
    along, across, _ = tracker.stated(arm.poses(q)[0])
    u = np.sqrt((along**2 + 2 * across**2) / 3)
    lines = ["pose_id,split,x_mm,y_mm,z_mm,ux_mm,uy_mm,uz_mm," + ",".join(
        f"q{k}_deg" for k in range(1, 7))]  # fmt: skip
    for k in range(len(q)):
        cells = [*(1e3 * p[k]), *[1e3 * u[k]] * 3, *np.degrees(q[k])]
        word = "identify" if k < TRAIN else "test"
        lines.append(f"{k},{word}," + ",".join(repr(float(cell)) for cell in cells))
    (folder / "points.csv").write_text("\n".join(lines) + "\n")
    x, y, z = (1e3 * each for each in tip)
    (folder / "session.toml").write_text(
        'robot = "ur5"\n[joints]\nfile = "points.csv"\n[points]\nfile = "points.csv"\n'
        '[identification]\nmodel = "geometric"\n'
        f'[tool_in_use]\nname = "gripper"\npoint_mm = [{x!r}, {y!r}, {z!r}]\n'
    )
    return arm, tracker, candidates(rng, TARGETS, UR5)


def missed(folder, off_axis, robot, tip):
    """Stated R95 of the tip and how far from it the true one lies (m,), with the calibration."""
    arm, tracker, q = campaign(folder, off_axis, robot, tip)
    ur5 = load_robot(write_ur5(folder))
    found = calibrate(ur5, read_session(folder, ur5), Options())
    stated = found.handback.in_use
    # on the flange as it is: what is mounted on it is as stated
    wrong = arm.wrong.copy()
    wrong[7] = 0.0
    true = ForeignArm(UR5, wrong=wrong, tool=HOME @ np.array(tip)).poses(q)[0]
    true = (true - tracker.frame[:3, 3]) @ tracker.frame[:3, :3]
    chain = found.fit.identification.model.chain
    flange = replace(chain, T_flange_tool=np.eye(4))
    T = replace(found.fit.identification.model, chain=flange).poses(q)
    predicted = T[:, :3, 3] + T[:, :3, :3] @ np.array(tip)
    return stated.radius_mean, np.linalg.norm(true - predicted, axis=1), found


@pytest.mark.study
@pytest.mark.parametrize("off_axis", OFF_AXIS)
@pytest.mark.parametrize("ahead", TIPS)
def test_the_tip_of_another_tool_lies_within_its_radius_on_95_robots_of_100(
    off_axis, ahead, tmp_path
):
    inside = np.zeros(40)
    for robot in range(len(inside)):
        radius, away, found = missed(tmp_path, off_axis, robot, (BESIDE, 0.0, ahead))
        inside[robot] = (away <= radius).mean()
        assert found.converged
        moved = found.fit.identification.model.chain.links - UR5_LINKS
        # the true axes are turned about points half a meter off: 5.5 tolerances of theta2 at most
        assert np.abs(moved / usual_tolerances(6)).max() < 8
    assert inside.mean() >= 0.95
    assert (inside >= 0.95).mean() >= 0.95


def test_the_tip_of_another_tool_lies_within_its_radius(tmp_path):
    """A few robots: the worst case, on the axis, and the best."""
    for off_axis in (0.0, 0.08):
        radius, away, found = missed(tmp_path, off_axis, 1, (BESIDE, 0.0, 0.15))
        assert found.converged
        assert (away <= radius).mean() >= 0.95
        at = found.handback.in_use
        # the reflector itself is known to tens of micrometres, the tip by what the flange may be
        assert at.measured_at_poses.max() < 1e-4
        assert 0.5e-3 < radius < 5e-3
        held = {one.row.name: one.held_by for one in handed_numbers(found)}
        assert all(held[name].startswith(MEASURED) for name in ("a2", "theta2", "alpha1"))
        assert held["d6"] == held["theta6"] == PRIOR
        if not off_axis:  # known by what is believed of its neighbors alone
            assert held["theta5"] == held["d5"] == held["alpha5"] == PRIOR
