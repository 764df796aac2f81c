"""Names of points that are of a pose and a reflector at once."""

import numpy as np
import pytest

from tests.command import call
from tests.testbed.files.made import ROBOT, csv, made
from tests.testbed.proposal.test_session import proposed, refused

M = 20
DATA = made(m=M)
TIPS = np.array([[0.06, 0.0, 0.08], [-0.04, 0.05, 0.08], [-0.03, -0.05, 0.11]])


def files(folder, *, apart, joints=1, mark="_"):
    """Joints of each pose, once or beside each reflector, and the points of three reflectors."""
    q = np.repeat(DATA.q, joints, axis=0)
    poses = [f"P{k + 1}" for k in range(M) for _ in range(joints)]
    table = {"pose_id": poses} if joints == 1 else {}
    table |= {f"J{j + 1} [deg]": np.degrees(q[:, j]) for j in range(6)}
    (folder / "joints.csv").write_text(csv(table))
    seen = np.einsum("mij,kj->mki", DATA.T[:, :3, :3], TIPS) + DATA.T[:, None, :3, 3]
    names = [(f"P{k + 1}", f"SMR{n + 1}") for k in range(M) for n in range(3)]
    own = {"Name": [mark.join(one) for one in names]}
    if apart:
        own = {"Pose": [one for one, _ in names], "Target": [two for _, two in names]}
    own |= {f"{a} (mm)": 1e3 * seen[..., k].ravel() for k, a in enumerate("XYZ")}
    (folder / "seen.csv").write_text(csv(own))
    return folder / "joints.csv", folder / "seen.csv"


@pytest.mark.parametrize("robot", [["--robot", ROBOT.name], []])
@pytest.mark.parametrize("mark", ["_", "-", "."])
def test_a_pose_and_a_reflector_in_one_name_are_told_how_to_part(mark, robot, tmp_path):
    """Without a robot a session was written that nothing could read."""
    said = refused(tmp_path, *files(tmp_path, apart=False, mark=mark), *robot)
    assert f'"P1{mark}SMR1": 20 poses, 3 targets each' in said
    assert "part them into pose_id (P1) and target (SMR1)" in said
    # with that done
    (tmp_path / "session.toml").unlink(missing_ok=True)
    _, written = proposed(tmp_path, files(tmp_path, apart=True), "--robot", ROBOT.name)
    assert 'target = "Target"' in written


def test_such_names_are_left_where_each_reading_has_its_joints(tmp_path):
    done = call("new", "session", *files(tmp_path, apart=False, joints=3), "--robot", ROBOT.name,
                "--out", tmp_path / "session.toml")  # fmt: skip
    assert "in one, as" not in done.stderr
