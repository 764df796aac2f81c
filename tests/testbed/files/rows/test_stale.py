"""Readings that an instrument did not take anew are no measurements; good ones may be alike."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.frames import exp_so3, step_transform
from calib.geometry.inverse import inverse_kinematics
from calib.geometry.model import RobotModel
from testbed.files.read import read_session
from tests.testbed.files.made import ROBOT, Made, columns, csv, made

LENGTHS = ("x_mm", "y_mm", "z_mm")
ANGLES = ("rx_deg", "ry_deg", "rz_deg")
STALE = "digit for digit the readings of other rows"
AXIS = np.array([0, 0, 0.1, 0, 0, 0])
"""A target on the axis of the last joint [m, rad]."""


def seen(q, *, noise=10e-6, truth=None, seed=0):
    """What a tracker sees of a robot at joints q (m, 6)."""
    truth = made().truth if truth is None else truth
    T = truth.poses(q)
    T[:, :3, 3] += noise * np.random.default_rng(seed).standard_normal((len(q), 3))
    return Made(q, T, truth)


def table_of(data, decimals, *, kind="points"):
    table = columns(data)
    if kind == "frames":
        table["euler"] = ["XYZ"] * len(data.q)
    else:
        table = {name: column for name, column in table.items() if name not in ANGLES}
    return table | {
        name: np.round(table[name], decimals) for name in (*LENGTHS, *ANGLES) if name in table
    }


def read(folder, table, *, kind="points", um=10.0):
    (folder / "a.csv").write_text(csv(table))
    turned = "rotation_mdeg = 6\n" if kind == "frames" else ""
    toml = f'[{kind}]\nfile = "a.csv"\n[uncertainty]\nposition_um = {um}\n{turned}'
    (folder / "session.toml").write_text(toml)
    return read_session(folder, ROBOT)


def again(table, rows, *, before=1):
    """The table with readings of rows that are those of the rows before."""
    table = {name: list(column) for name, column in table.items()}
    for name in (*LENGTHS, *(name for name in ANGLES if name in table)):
        for row in rows:
            table[name][row] = table[name][row - before]
    return table


def left_out(session):
    """Lines that one sentence says are stale; its end."""
    said = [text for text in session.masked if STALE in text]
    if not said:
        return "", ""
    (said,) = said
    return said.partition("lines ")[2].partition(")")[0], said.partition("joints lead ")[2]


@pytest.mark.parametrize(("kind", "decimals"), [("points", 4), ("points", 2), ("frames", 2)])
def test_readings_that_a_tracker_repeats_while_the_arm_moves_are_left_out(kind, decimals, tmp_path):
    """A quarter of the rows, of which those that no fit brings near were left out before."""
    rows = np.arange(1, 60, 4)
    table = again(table_of(seen(made(0, 60).q), decimals, kind=kind), rows)
    session = read(tmp_path, table, kind=kind)
    assert len(session.measurements) == 45
    lines, end = left_out(session)
    assert lines == "3, 7, 11, 15, 19, 23, 27, 31, 35, 39 and 5 more"
    assert end.endswith(
        "mm away: an instrument that stays on its last value measured nothing there"
    )
    assert not any("the digits of earlier" in text for text in session.warnings)
    kept = np.delete(np.arange(60), rows)
    np.testing.assert_allclose(session.measurements.q, made(0, 60).q[kept], atol=1e-12)


def test_a_short_way_is_enough_where_digits_are_fine(tmp_path):
    q = made(0, 60).q.copy()
    rows = np.arange(1, 60, 10)
    q[rows] = q[rows - 1] + 0.0015  # about a millimeter
    session = read(tmp_path, again(table_of(seen(q), 4), rows))
    assert len(session.measurements) == 54
    assert left_out(session)[0] == "3, 13, 23, 33, 43, 53"


def test_the_row_stays_whose_joints_fit_wherever_it_stands(tmp_path):
    """Rows that were sorted by something else than time."""
    q = made(0, 40).q
    table = again(table_of(seen(q), 4), [20])
    flipped = {name: list(column)[::-1] for name, column in table.items()}
    session = read(tmp_path, flipped)
    assert left_out(session)[0] == ""
    assert len(session.measurements) == 39
    np.testing.assert_allclose(session.measurements.q, np.delete(q, 20, axis=0)[::-1], atol=1e-12)


def test_time_tells_which_reading_is_the_first_where_both_joints_fit(tmp_path):
    q = made(0, 40).q.copy()
    q[20] = q[19] + 0.0015
    table = again(table_of(seen(q), 4), [20]) | {"time_s": np.arange(40.0)}
    flipped = {name: list(column)[::-1] for name, column in table.items()}
    session = read(tmp_path, flipped)
    np.testing.assert_allclose(session.measurements.q, np.delete(q, 20, axis=0)[::-1], atol=1e-12)


def test_a_reading_of_one_reflector_under_the_name_of_another_is_left_out(tmp_path):
    q = made(0, 30).q
    one = table_of(seen(q), 4)
    moved = made().truth.poses(q)
    moved[:, :3, 3] += moved[:, :3, :3] @ [0.04, 0.0, 0.01]
    two = table_of(Made(q, moved, made().truth), 4)
    table = {name: np.ravel([one[name], two[name]], order="F") for name in one}
    table = again(table | {"target": ["A", "B"] * 30}, [7])
    session = read(tmp_path, table)
    assert len(session.measurements) == 59
    assert any("line 9" in text and STALE in text for text in session.masked)


def held_on_axis():
    """The robot as it is described, with a target on the axis of its last joint."""
    return RobotModel(replace(ROBOT.model.chain, T_flange_tool=step_transform(AXIS)))


def on_one_point():
    """Joints (m, 6) that turn this target about itself."""
    q = np.array([[0.3, 0.5, 1.2, 0.4, 0.8, 0.2]])
    T = np.repeat(held_on_axis().poses(q), 40, axis=0)
    turns = np.random.default_rng(1).normal(0, 0.3, (40, 3))
    T[:, :3, :3] = exp_so3(turns) @ T[:, :3, :3]
    found = inverse_kinematics(held_on_axis(), T, np.repeat(q, 40, axis=0), ROBOT.limits)
    return found.q[found.reached]


@pytest.mark.parametrize("others", [0, 20])
def test_a_point_about_which_the_tool_turns_is_seen_at_one_place(others, tmp_path):
    q = on_one_point()
    assert len(q) >= 30
    both = np.vstack([q, made(0, 40).q[:others]])
    session = read(tmp_path, table_of(seen(both, truth=held_on_axis()), 1), um=60)
    assert any("the digits of earlier" in text for text in session.warnings)
    assert len(session.measurements) == len(both)


def touched():
    """Joints (m, 6) that bring a tip to 12 points from above, and turn it about each; the points.

    What comes first at each tells nothing of how long the tip is.
    """
    rng, truth = np.random.default_rng(0), made(0).truth
    q0 = np.array([0.3, 0.5, 1.2, 0.4, 0.8, 0.2])
    T = np.repeat(truth.poses(q0[None]), 72, axis=0)
    T[:, :3, 3] += np.repeat(rng.uniform(-0.1, 0.1, (12, 3)), 6, axis=0)
    tilts = rng.normal(0, 0.3, (72, 3))
    tilts[::6] = 0
    T[:, :3, :3] = exp_so3(tilts) @ T[:, :3, :3]
    found = inverse_kinematics(truth, T, np.repeat(q0[None], 72, axis=0), ROBOT.limits)
    return found.q[found.reached], T[found.reached]


@pytest.mark.parametrize("stated", ["right", "signs", "swapped", "tenths"])
def test_points_about_which_a_tip_is_turned_that_came_from_above_stay(stated, tmp_path):
    """As cones of known places are touched; of joints in other columns, of wrong signs or of few
    digits as well."""
    q, T = touched()
    assert len(q) >= 60
    table = table_of(Made(q, T, made(0).truth), 7)
    if stated == "signs":
        table |= {name: -table[name] for name in ("q3_deg", "q5_deg")}
    elif stated == "swapped":
        table |= {"q4_deg": table["q6_deg"], "q6_deg": table["q4_deg"]}
    elif stated == "tenths":
        table |= {f"q{joint}_deg": np.round(table[f"q{joint}_deg"], 1) for joint in range(1, 7)}
    session = read(tmp_path, table, um=50)
    assert left_out(session)[0] == ""
    assert any("the digits of earlier" in text for text in session.warnings)


def test_a_target_on_the_axis_of_the_last_joint_stays_while_that_turns(tmp_path):
    """Seen without noise, to all digits."""
    q = made(0, 40).q.copy()
    q[20:, :5] = q[20, :5]
    session = read(tmp_path, table_of(seen(q, noise=0, truth=held_on_axis()), 7))
    assert any("the digits of earlier" in text for text in session.warnings)
    assert len(session.measurements) == 40


def test_coarse_digits_of_a_short_way_are_no_stale_readings(tmp_path):
    """Steps of a thousandth of a degree, where a tenth of a millimeter is written."""
    q = made(0, 60).q.copy()
    q[20:] = q[20] + 2e-5 * np.arange(40)[:, None] * np.eye(6)[0]
    session = read(tmp_path, table_of(seen(q), 1), um=60)
    assert any("the digits of earlier" in text for text in session.warnings)
    assert len(session.measurements) == 60


def test_joints_of_few_digits_are_no_stale_readings(tmp_path):
    """Read back to a tenth of a degree, where the arm stood at one place."""
    q = np.repeat(made(0, 20).q, 3, axis=0)
    table = table_of(seen(q, noise=2e-6), 1)
    rng = np.random.default_rng(0)
    for joint in range(1, 7):
        name = f"q{joint}_deg"
        table[name] = np.round(table[name] + rng.uniform(-0.05, 0.05, 60), 1)
    table["pose_id"] = np.arange(1, 61)
    session = read(tmp_path, table, um=60)
    assert any("the digits of earlier" in text for text in session.warnings)
    assert len(session.measurements) == 60
