"""Joint zeros that a table has in another posture: named by quarter turns, never taken."""

import re

import numpy as np
import pytest

from calib.errors import InputError
from testbed.files.alternatives import Interpretation
from testbed.files.frames_fit import Misfit
from testbed.files.probe import probe
from testbed.files.read import read_session
from testbed.files.tried.interpretations import Probe, Tried
from testbed.files.tried.quarter_turns import QUARTER, quarter_turns
from testbed.proposal.data import look_at
from testbed.proposal.session import propose_session
from testbed.robots.catalog import load_robot
from tests.testbed.files.made import ROBOT, columns, csv, made

M = 25


def table(turns, *, poses, within=True):
    """Columns of a table with its joint zeros elsewhere, by quarter turns; within the limits."""
    data = made(seed=2, m=400)
    q = data.q - QUARTER * np.array(turns)
    inside = ((q > ROBOT.limits[:, 0]) & (q < ROBOT.limits[:, 1])).all(axis=1) | (not within)
    rows = np.flatnonzero(inside)[:M]
    found = {key: values[rows] for key, values in columns(data).items()}
    found |= {f"q{k + 1}_deg": np.degrees(q[rows, k]) for k in range(6)}
    return found if poses else {k: v for k, v in found.items() if k[0] != "r"}


def read(folder, found):
    (folder / "d.csv").write_text(csv(found))
    (folder / "session.toml").write_text(
        f'[joints]\nfile = "d.csv"\n[{"frames" if "rx_deg" in found else "points"}]\n'
        'file = "d.csv"\n' + 'euler = "XYZ"\n' * ("rx_deg" in found) + "[uncertainty]\n"
        "position_um = 20\n" + "rotation_mdeg = 10\n" * ("rx_deg" in found)
    )
    return read_session(folder, ROBOT)


@pytest.mark.parametrize("name", ["staubli_tx60", "kuka_iiwa7", "universal_ur10"])
@pytest.mark.parametrize("poses", [False, True])
def test_any_turns_of_the_inner_joints_are_found(name, poses):
    arm, rng = load_robot(name), np.random.default_rng(7)
    data = made(seed=4, m=M, robot=arm)
    turns = rng.integers(0, 4, arm.model.chain.n_joints)
    turns[[0, -1]] = 1  # the base takes the first one up, and the tool the last
    rows = Interpretation(
        data.q - QUARTER * turns, data.T[:, :3, 3], data.T[:, :3, :3] if poses else None
    )
    _, read_so = quarter_turns(arm.model, rows)
    away = (read_so.q - data.q)[:, 1:-1] / (4 * QUARTER)
    np.testing.assert_allclose(away, np.round(away), atol=1e-12)


def test_nothing_is_found_where_nothing_is_turned_or_nothing_fits():
    data = made(seed=2, m=M)
    rows = Interpretation(data.q, data.T[:, :3, 3], None)
    assert quarter_turns(ROBOT.model, rows) is None
    mixed = Interpretation(data.q[::-1] + QUARTER, data.T[:, :3, 3], None)
    assert quarter_turns(ROBOT.model, mixed) is None
    # of few poses one of 256 combinations fits by chance
    turned = data.q + QUARTER * np.eye(6)[1]
    few = Interpretation(turned[:11], data.T[:11, :3, 3], None)
    assert quarter_turns(ROBOT.model, few) is None


def test_identify_names_the_joints_and_what_to_add(tmp_path):
    """It ended with "and by 85 mm or more however the file is interpreted"."""
    session = read(tmp_path, table([0, 1, -1, 0, 0, 0], poses=True))
    with pytest.raises(InputError) as caught:
        probe(ROBOT, session).raise_if_wrong()
    said = str(caught.value)
    assert (
        "if the zeros of its joints are turned: joint 2 by +90 deg and joint 3 by -90 deg" in said
    )
    assert "add +90 deg to q2 and -90 deg to q3 in the table" in said
    assert "to theta_deg of those joints in its robot.toml" in said
    # the same table with that done
    mended = table([0, 1, -1, 0, 0, 0], poses=True)
    mended["q2_deg"], mended["q3_deg"] = mended["q2_deg"] + 90, mended["q3_deg"] - 90
    probe(ROBOT, read(tmp_path, mended)).raise_if_wrong()


def test_joints_beyond_their_limits_are_explained_by_the_readings(tmp_path):
    """It said "correct these cells"."""
    with pytest.raises(InputError, match=r"joint 2 by \+90 deg; add \+90 deg to q2") as caught:
        read(tmp_path, table([0, 1, 0, 0, 0, 0], poses=False, within=False))
    assert caught.value.code == "M20"
    # of readings that no turn explains it still does
    other = table([0, 1, 0, 0, 0, 0], poses=False, within=False)
    other["x_mm"] = other["x_mm"][::-1]
    with pytest.raises(InputError, match="joint values lie outside the limits"):
        read(tmp_path, other)


def test_joints_in_another_order_are_told_where_their_limits_refuse_them(tmp_path):
    """It said "correct these cells, or check the robot"."""
    swapped = table([0, 0, 0, 0, 0, 0], poses=False)
    q = np.stack([swapped["q3_deg"], swapped["q4_deg"]])
    q[1, : M // 2] = 200.0  # joint 3 turns by 142.5 deg, joint 4 by 270
    swapped["q4_deg"], swapped["q3_deg"] = q
    arm = np.radians(np.stack([swapped[f"q{k}_deg"] for k in (1, 2, 4, 3, 5, 6)], axis=1))
    seen = 1e3 * made(seed=2, m=M).truth.poses(arm)[:, :3, 3]
    swapped |= dict(zip(("x_mm", "y_mm", "z_mm"), seen.T, strict=True))
    with pytest.raises(InputError, match="if the columns q3 and q4 are swapped; name") as caught:
        read(tmp_path, swapped)
    assert caught.value.code == "M20"


def test_the_zero_of_a_first_joint_is_taken_up_by_the_base(tmp_path):
    """Its values lie beyond the limits, and all fits: "correct these cells" was wrong."""
    turned = table([2, 0, 0, 0, 0, 0], poses=False, within=False)
    with pytest.raises(InputError) as caught:
        read(tmp_path, turned)
    said = str(caught.value)
    assert re.search(r"q1 often lies outside the limits of staubli_tx60, and base and tool", said)
    assert said.endswith("add +180 deg to q1 in the table. [M20]")
    turned["q1_deg"] = turned["q1_deg"] + 180
    probe(ROBOT, read(tmp_path, turned)).raise_if_wrong()


def test_full_turns_are_no_other_zero(tmp_path):
    """Of a table from 0 to 360 deg it said to add -180 deg, which turned the arm half round."""
    counted = table([0] * 6, poses=False)
    counted["q1_deg"] = counted["q1_deg"] % 360
    with pytest.raises(
        InputError, match="it counts full turns, as from 0 to 360 deg, or"
    ) as caught:
        read(tmp_path, counted)
    said = str(caught.value)
    assert "if it counts full turns, take 360 deg off the values of q1 above the limits" in said
    # between the ends no base or tool takes up a zero: full turns alone explain it
    inner = table([0] * 6, poses=False)
    for joint in ("q2_deg", "q3_deg"):
        inner[joint] = inner[joint] % 360
    with pytest.raises(InputError) as caught:
        read(tmp_path, inner)
    assert str(caught.value).endswith(
        "take 360 deg off the values of q2 and q3 above the limits, and add it below. [M20]"
    )


@pytest.mark.parametrize("within", [False, True])
def test_a_session_is_not_proposed_with_other_zeros_in_silence(within, tmp_path):
    (tmp_path / "d.csv").write_text(csv(table([0, 1, 0, 0, 0, 0], poses=False, within=within)))
    with pytest.raises(InputError, match=r"add \+90 deg to q2 in the table"):
        propose_session(look_at([tmp_path / "d.csv"], tmp_path), ROBOT, tmp_path)


def test_absurd_interpretations_are_not_told_by_their_size():
    """313 m is the size of no error."""
    alternative = quarter_turns_of_one()
    absurd = Probe("d.csv", "arm", Misfit(84.0, 0.0), (Tried(alternative, Misfit(313.0, 0.0)),) * 3)
    assert absurd.sentence.endswith("; none of 3 other interpretations comes near the robot")
    with pytest.raises(InputError, match="none of 3 other interpretations comes near it"):
        absurd.raise_if_wrong()
    nothing = Probe("d.csv", "arm", Misfit(np.inf, 0.0), absurd.tried)
    with pytest.raises(InputError, match="no base and tool bring the readings near the robot, and"):
        nothing.raise_if_wrong()


def quarter_turns_of_one():
    """An alternative."""
    data = made(seed=2, m=M)
    rows = Interpretation(data.q - [0, QUARTER, 0, 0, 0, 0], data.T[:, :3, 3], data.T[:, :3, :3])
    return quarter_turns(ROBOT.model, rows)[0]


def test_joints_in_gon_and_in_revolutions_are_named_with_their_unit(tmp_path):
    """Of the former it was said to correct the cells beyond the limits, of the latter nothing."""
    numbers = table([0] * 6, poses=False)
    for factor, said in ((400 / 360, "in gon, not deg"), (1 / 360, "in revolutions, not deg")):
        other = {name: column * (factor if name[0] == "q" else 1) for name, column in
                 numbers.items()}  # fmt: skip
        with pytest.raises(InputError, match=f"if the joints are {said}; name the columns q1_"):
            probe(ROBOT, read(tmp_path, other)).raise_if_wrong()


def test_no_links_are_fitted_to_joints_beyond_their_limits(tmp_path, monkeypatch):
    """Sixteen rows of nine numbers that are no joints took a minute: two seconds for each fit of
    links, four of them for each of eight interpretations."""
    fitted = []
    monkeypatch.setattr("testbed.files.probe.links_fit", lambda *args, **_: fitted.append(args))
    numbers = np.random.default_rng(1).uniform(0, 1000, (16, 9))
    robot = load_robot("universal_ur10")  # full turns bring any angle within its limits
    names = [*(f"q{j + 1}_deg" for j in range(6)), "x_mm", "y_mm", "z_mm"]
    (tmp_path / "m.csv").write_text(csv(dict(zip(names, numbers.T, strict=True))))
    with pytest.raises(InputError, match="% of the joint values lie outside the limits"):
        propose_session(look_at([tmp_path / "m.csv"], tmp_path), robot, tmp_path)
    assert fitted == []
