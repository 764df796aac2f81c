"""Nests on the floor among the readings of a file become [drift], and no readings of the robot."""

import numpy as np
import pytest

from testbed.files.read import read_session
from tests.command import call
from tests.testbed.proposal.test_odd_files import DATA, DEG, MM, UR10, M
from tests.testbed.proposal.test_session import proposed

NESTS = {"N1": (1000, 200, 50), "N2": (-300, 1500, 80), "N3": (400, -900, 600)}


def rows(robot, nest, names):
    """Lines of a table in which all nests are shot twice, by what robot and nests write."""
    lines = [robot.format(k=k, q=",".join(map(repr, DEG[k].tolist())),
                          p=",".join(map(repr, MM[k].tolist()))) for k in range(M)]  # fmt: skip
    shots = [[nest.format(n=name, p=f"{x + shot},{y},{z}") for name, (x, y, z) in NESTS.items()]
             for shot in (0.0, 1e-3)]  # fmt: skip
    return "\n".join([names, *shots[0], *lines, *shots[1], ""])


JOINTS = "Name,J1,J2,J3,J4,J5,J6\n" + "".join(
    f"P{k},{','.join(map(repr, row.tolist()))}\n" for k, row in enumerate(DEG)
)
FILES = {
    "beside joints": {
        "m.csv": rows("SMR,{q},{p}", "{n},,,,,,,{p}", "Target,J1,J2,J3,J4,J5,J6,X,Y,Z")
    },
    "without a pose": {
        "m.csv": rows("P{k},SMR,{p}", ",{n},{p}", "Pose,Target,X,Y,Z"), "joints.csv": JOINTS
    },
    "by name": {
        "m.csv": rows("P{k},SMR,{p}", "{n},{n},{p}", "Name,Target,X,Y,Z"), "joints.csv": JOINTS
    },
}  # fmt: skip


@pytest.mark.parametrize("files", FILES.values(), ids=FILES)
def test_targets_without_joints_that_come_again_are_nests(files, tmp_path):
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    said, _ = proposed(tmp_path, [tmp_path / name for name in files], "--robot", UR10.name)
    assert "drift: no joints belong to N1, N2, N3: taken as nests on the floor" in said
    assert "to fix" not in said
    session = read_session(tmp_path / "session.toml", UR10)
    # all nests moved by a micrometer, which is taken off
    np.testing.assert_allclose(session.measurements.position, DATA.T[:, :3, 3], rtol=0, atol=1e-6)
    assert session.drift is not None
    assert session.drift.nests == ("N1", "N2", "N3")


def test_names_that_come_again_in_both_files_are_visits_of_poses(tmp_path):
    rows = [*range(M), 3, 0]
    seen = [f"P{k},{','.join(map(repr, (MM[k] + 1e-3 * j).tolist()))}" for j, k in enumerate(rows)]
    lines = JOINTS.splitlines()
    (tmp_path / "m.csv").write_text("\n".join(["Point,X,Y,Z", *seen, ""]))
    (tmp_path / "joints.csv").write_text("\n".join([*lines, lines[4], lines[1], ""]))
    proposed(tmp_path, [tmp_path / "m.csv", tmp_path / "joints.csv"], "--robot", UR10.name)
    table = read_session(tmp_path / "session.toml", UR10).measurements
    np.testing.assert_allclose(table.q, DATA.q[rows], rtol=0, atol=2e-12)
    assert table.repeat.tolist() == [0] * M + [1, 1]


def test_names_without_joints_are_named_where_no_column_tells_nests(tmp_path):
    (tmp_path / "m.csv").write_text(rows("P{k},{p}", "{n},{p}", "Name,X,Y,Z"))
    (tmp_path / "joints.csv").write_text(JOINTS)
    files = [tmp_path / "m.csv", tmp_path / "joints.csv"]
    done = call("new", "session", *files, "--out", tmp_path / "s.toml", "--robot", UR10.name)
    assert "joints.csv has no joints for poses N1, N2, N3; correct" in " ".join(done.stderr.split())
