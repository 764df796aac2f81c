"""Rows far off that follow each other: named as one, with what explains all of them."""

import re

import numpy as np
import pytest

from testbed.files.read import read_session
from tests.testbed.files.made import ROBOT, Made, made, poses_csv

ROWS = np.arange(20, 27)


def left_out(tmp_path, change):
    """Notes on a file of 40 rows, seven of which one after the other are changed."""
    data = made(6, 40)
    T = data.T.copy()
    T[ROWS] = change(T[ROWS], data)
    file = tmp_path / "a.csv"
    file.write_text(poses_csv(Made(data.q, T, data.truth)))
    session = read_session(file, ROBOT)
    assert len(session.measurements) == 33
    (note,) = (text.rpartition("/")[2] for text in session.masked)
    assert note.startswith("a.csv:22: left out: 7 rows one after the other, up to line 28: ")
    return note


def on_tool(T, data):
    """Another target, 70 mm away."""
    T[:, :3, 3] += T[:, :3, :3] @ [0.06, -0.02, 0.03]
    return T


def pushed(T, data):
    """The instrument."""
    T[:, :3, 3] += [0.06, -0.02, 0.03]
    return T


def metres(T, data):
    """Positions a thousandth as large."""
    T[:, :3, 3] /= 1e3
    return T


def inches(T, data):
    """Positions in inches."""
    T[:, :3, 3] /= 25.4
    return T


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (on_tool, "all of them by the same 70 mm on the tool (another tool or reflector"),
        (pushed, "all of them by the same 70 mm before the instrument"),
        (metres, "fit 1000 times as large (m among mm?)"),
        (inches, "fit 25.4 times as large (inches among mm?)"),
    ],
)
def test_what_explains_all_rows_of_a_run_is_said_once(tmp_path, change, said):
    """A nominal arm: 70.0 mm to a few parts in a hundred, shown with three digits."""
    note = left_out(tmp_path, change)
    if "same" in said:
        size = note.partition("by the same ")[2].split()[0]
        assert float(size) == pytest.approx(70.0, rel=0.02)
        said = said.replace("70 mm", f"{size} mm")
    assert said in note


def test_rows_that_share_nothing_are_named_as_a_run_all_the_same(tmp_path):
    ways = np.random.default_rng(0).normal(size=(7, 3))
    ways *= (np.linspace(0.3, 0.5, 7) / np.linalg.norm(ways, axis=1))[:, None]

    def anywhere(T, data):
        T[:, :3, 3] += ways
        return T

    assert re.search(r": 300 to (499|500) mm off$", left_out(tmp_path, anywhere))
