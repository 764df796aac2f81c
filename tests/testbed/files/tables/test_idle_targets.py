"""Columns of texts that nothing is taken from: they are told like any other column."""

import pytest

from testbed.files.read import read_session
from tests.testbed.files.made import ROBOT, columns, csv, made

M = 30
WHOLE = columns(made(seed=2, m=M)) | {"pose_id": [f"P{k}" for k in range(M)]}
JOINTS = {k: v for k, v in WHOLE.items() if k == "pose_id" or k.startswith("q")}
SEEN = {k: v for k, v in WHOLE.items() if k not in JOINTS or k == "pose_id"}
TARGETS = {"target": ["T-Mac"] * 20 + ["T-Probe"] * 10}


def read(folder, joints, seen=None, *, more=""):
    """A session of full poses; of one file without `seen`."""
    (folder / "j.csv").write_text(csv(joints))
    if seen is not None:
        (folder / "f.csv").write_text(csv(seen))
    file = "j.csv" if seen is None else "f.csv"
    (folder / "session.toml").write_text(
        f'[joints]\nfile = "j.csv"\n[frames]\nfile = "{file}"\neuler = "XYZ"\n{more}'
        "[uncertainty]\nposition_um = 20\nrotation_mdeg = 10\n"
    )
    return read_session(folder, ROBOT)


@pytest.mark.parametrize(
    ("joints", "seen", "file"),
    [
        (JOINTS | TARGETS, SEEN, "j.csv"),
        (JOINTS, SEEN | TARGETS, "f.csv"),
        (WHOLE | TARGETS, None, "j.csv"),
    ],
)
def test_targets_of_full_poses_are_not_used_and_several_are_warned_of(joints, seen, file, tmp_path):
    session = read(tmp_path, joints, seen)
    assert f"{file}: not used: target" in session.notes
    assert [one for one in session.unread if "target" in one.columns]
    (said,) = (text for text in session.warnings if "target" in text)
    assert said == (
        f"{file}: the column target names 2 targets (T-Mac and T-Probe), and [frames] takes all "
        "poses as those of one target; if several were mounted, give each a [[session]] of its own"
    )


def test_one_target_or_a_name_for_each_place_is_no_warning(tmp_path):
    for names in (["T-Mac"] * M, [f"goal {k}" for k in range(M)]):
        session = read(tmp_path, JOINTS | {"target": names}, SEEN)
        assert "j.csv: not used: target" in session.notes
        assert not session.warnings
    assert not read(tmp_path, JOINTS | {"target": [""] * M}, SEEN).unread


def test_a_station_or_an_anchor_beside_the_joints_is_told(tmp_path):
    beside = {"station": ["S1"] * M, "anchor": ["A"] * M, "split": ["test", "identify"] * (M // 2)}
    session = read(tmp_path, JOINTS | beside, SEEN)
    assert "j.csv: not used: anchor, station" in session.notes or (
        "j.csv: not used: station, anchor" in session.notes
    )
    assert session.split_stated
