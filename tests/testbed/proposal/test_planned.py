"""A plan.csv beside what was measured: its joints and roles count, what it foretells never does."""

import numpy as np
import pytest

from calib.errors import InputError
from testbed.files.read import read_session
from testbed.files.rows import planned
from testbed.plan import results
from tests.command import call
from tests.testbed.files.made import ROBOT, csv
from tests.testbed.proposal.test_session import M, data, points

Q = np.degrees(data().q)
ROLES = ["test" if k % 3 == 0 else "identify" for k in range(M)]
NAMES = [f"{role[0].upper()}{k}" for k, role in enumerate(ROLES)]


def plan_csv(**more):
    """As `truebed plan` writes one: a start before, and a pose that is passed among the others.

    What it foretells fits the nominal robot perfectly, two targets of it.
    """
    T = ROBOT.model.poses(data().q)
    table = {"pose_id": NAMES, "role": ROLES, "order": [str(k) for k in range(M)]}
    table |= {f"q{k + 1}_deg": Q[:, k] for k in range(6)}
    for target, arm in (("tool", np.zeros(3)), ("probe", np.array([0.06, 0.0, 0.0]))):
        place = 1e3 * (T[:, :3, 3] + T[:, :3, :3] @ arm)
        far = np.linalg.norm(place, axis=1)
        angles = np.arctan2(place[:, 1], place[:, 0]), np.arcsin(place[:, 2] / far)
        values = (*place.T, *np.degrees(angles), far)
        table |= {f"{target}_{name}": v for name, v in zip(planned.READING, values, strict=True)}
    table |= {"move": ["free"] * M, "approach_s": np.ones(M)} | more
    head, *rows = csv(table).splitlines()
    empty = "," * (head.count(",") - 8)
    joints = "0,0,0,0,0,0"
    return "\n".join(
        [
            head,
            f"start,start,,{joints}{empty}",
            *rows[:9],
            f"P9via1,via,9,{joints}{empty}",
            *rows[9:],
        ]
    )


def test_a_plan_is_written_as_it_is_read():
    assert planned.READING == results.READING
    roles = results.Stop.__annotations__["role"]
    assert set(roles.__args__) == {*planned.STOPS, *planned.PASSED}


@pytest.mark.parametrize("robot", [(), ("--robot", ROBOT.name)])
def test_beside_a_plan_the_readings_count_and_never_what_it_foretells(robot, tmp_path):
    (tmp_path / "plan.csv").write_text(plan_csv())
    seen = {"pose_id": NAMES[::-1]} | {
        f"{axis}_mm": points()[::-1, k] for k, axis in enumerate("xyz")
    }
    (tmp_path / "seen.csv").write_text(csv(seen))
    files = (tmp_path / "plan.csv", tmp_path / "seen.csv")
    done = call("new", "session", *files, "--out", tmp_path / "session.toml", *robot)
    assert done.exit_code == 0, done.stderr
    session = read_session(tmp_path / "session.toml", ROBOT)
    table = session.measurements
    assert len(table) == M
    np.testing.assert_allclose(table.q, data().q[::-1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(table.position, points()[::-1] / 1e3, rtol=0, atol=1e-12)
    assert session.is_test.tolist() == [role == "test" for role in ROLES[::-1]]
    assert not session.warnings
    note = next(text for text in session.notes if text.startswith("plan.csv: not used"))
    assert "tool_x_mm" in note
    assert "probe_range_mm" in note


def test_readings_beside_the_joints_of_a_plan_count_by_row(tmp_path):
    seen = {f"{axis}_mm": points()[:, k] for k, axis in enumerate("xyz")}
    (tmp_path / "a.csv").write_text(plan_csv(**seen, ux_mm=["0.01"] * M, uy_mm=["0.01"] * M,
                                             uz_mm=["0.01"] * M))  # fmt: skip
    session = read_session(tmp_path / "a.csv", ROBOT)
    np.testing.assert_allclose(session.measurements.position, points() / 1e3, rtol=0, atol=1e-12)
    assert session.is_test.sum() == ROLES.count("test")
    assert not session.warnings


def test_a_plan_alone_has_no_readings(tmp_path):
    (tmp_path / "plan.csv").write_text(plan_csv())
    done = call("new", "session", tmp_path / "plan.csv", "--out", tmp_path / "session.toml")
    assert done.exit_code == 2
    assert "what a plan foretells: give what was measured beside it" in done.stderr
    with pytest.raises(InputError, match="what a plan foretells"):
        read_session(tmp_path / "plan.csv", ROBOT)
