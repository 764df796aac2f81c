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
