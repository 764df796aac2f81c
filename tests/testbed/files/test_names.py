"""Targets whose names were exchanged from some row on are named with that row."""

import numpy as np
import pytest

from calib.errors import InputError
from testbed.files.probe import probe
from testbed.files.read import read_session
from tests.testbed.files.made import ROBOT, csv, made

PLACES = np.array([[0.1, 0.0, 0.05], [-0.03, 0.09, 0.02], [0.0, -0.06, 0.11]])


def table(names, *, m=30, begin=None, apart=1.0):
    """Rows of each pose in turn; from pose `begin` on the first two names are exchanged."""
    data = made(m=m)
    seen = apart * PLACES[: len(names)]
    rows = np.repeat(np.arange(m), len(names))
    called = np.tile(names, (m, 1))
    if begin is not None:
        called[begin:, :2] = called[begin:, 1::-1]
    points = np.einsum("mij,kj->mki", data.T[:, :3, :3], seen) + data.T[:, None, :3, 3]
    points = points.reshape(-1, 3)
    out = {"pose_id": rows + 1} | {f"q{j + 1}_deg": np.degrees(data.q[rows, j]) for j in range(6)}
    out |= {"target": called.ravel()}
    return out | {f"{a}_mm": 1e3 * points[:, k] for k, a in enumerate("xyz")}


def at_poses(poses, *, m=34, apart=0.65, seed=0):
    """Rows of three targets, of which the first two are exchanged at some poses; links are off."""
    rows = table(("A", "B", "C"), m=m, apart=apart)
    for k in poses:
        rows["target"][3 * k : 3 * k + 2] = ["B", "A"]
    rng = np.random.default_rng(seed)
    for axis in "xyz":
        rows[f"{axis}_mm"] = rows[f"{axis}_mm"] + rng.normal(size=3 * m)
    return rows


def read(folder, rows):
    (folder / "a.csv").write_text(csv(rows))
    free = "\n".join(f'{name} = "free"' for name in sorted(set(rows["target"])))
    (folder / "session.toml").write_text(
        '[joints]\nfile = "a.csv"\n[points]\nfile = "a.csv"\n[points.reflectors_mm]\n'
        f"{free}\n[uncertainty]\nposition_um = 10\n"
    )
    return read_session(folder / "session.toml", ROBOT)


@pytest.mark.parametrize("begin", [8, 15, 20])
@pytest.mark.parametrize("names", [("A", "B"), ("A", "B", "C")], ids="".join)
@pytest.mark.parametrize("apart", [0.2, 1.0], ids=["28 mm", "140 mm"])
def test_names_exchanged_from_a_row_on_are_named_with_that_row(tmp_path, begin, names, apart):
    session = read(tmp_path, table(names, begin=begin, apart=apart))
    with pytest.raises(InputError, match="exchanged") as caught:
        probe(ROBOT, session).raise_if_wrong()
    assert caught.value.code == "M32"
    line = 2 + begin * len(names)  # below the head
    assert f'"A" and "B" are exchanged from line {line} on' in str(caught.value).replace(
        '"B" and "A"', '"A" and "B"'
    )


@pytest.mark.parametrize("names", [("A", "B"), ("A", "B", "C")], ids="".join)
def test_names_that_stay_are_not_doubted(tmp_path, names):
    found = probe(ROBOT, read(tmp_path, table(names)))
    found.raise_if_wrong()
    assert found.wrong is None


@pytest.mark.parametrize("row", [0, -1], ids=["first", "last"])
def test_a_name_of_a_single_row_at_either_end_of_a_file_is_read(tmp_path, row):
    """Beside the joints of a neighbor on one side there is no row of it at all."""
    rows = table(("A", "B"))
    rows["target"][row] = "C"
    found = probe(ROBOT, read(tmp_path, rows))
    assert found.wrong is None


@pytest.mark.parametrize(("seed", "count"), [(0, 4), (4, 5), (37, 4), (49, 5), (59, 6)])
def test_two_names_exchanged_at_a_few_poses_leave_out_both_rows_of_each(tmp_path, seed, count):
    """They bent base and tool of one or both targets until all its rows passed for sound."""
    poses = np.sort(np.random.default_rng(seed).choice(34, count, replace=False))
    session = read(tmp_path, at_poses(poses, seed=seed))
    lines = sorted(3 * k + line for k in poses.tolist() for line in (2, 3))
    assert [int(text.split(":")[1]) for text in session.masked] == lines
    assert all("fits the target of line" in text for text in session.masked)


def test_names_exchanged_at_a_third_of_the_poses_are_named_with_their_lines(tmp_path):
    """Too many to leave out; they were said to be exchanged from the first of these lines on."""
    poses = np.sort(np.random.default_rng(1).choice(34, 11, replace=False)).tolist()
    with pytest.raises(InputError, match="exchanged") as caught:
        probe(ROBOT, read(tmp_path, at_poses(poses))).raise_if_wrong()
    lines = ", ".join(str(2 + 3 * k) for k in poses[:4])
    assert f"exchanged at 11 poses (lines {lines} and 7 more)" in str(caught.value)
