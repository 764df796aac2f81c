"""Columns at the end that no name stands over: as motion capture writes them, and as damage does.

Truth: tables that are written here.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib.errors import InputError
from testbed.files.read import read_session
from testbed.files.text import read_sheet
from testbed.gates.text import read_text
from tests.testbed.files.made import ROBOT, csv, made
from tests.testbed.proposal.test_session import proposed

M = 20
DATA = made(m=M)


def sheet(folder, text):
    (folder / "a.csv").write_text(text)
    return read_sheet(read_text(folder / "a.csv", "a.csv"), below=True)


def motive(*beside):
    """A rigid body by an optical system, and further columns named in the line above."""
    count = 7 + len(beside)
    turns = Rotation.from_matrix(DATA.T[:, :3, :3]).as_quat()
    head = [
        ["Format Version", "1.23", "Take Name", "Take 1", "Rotation Type", "Quaternion"],
        [], ["", "Type", *["Rigid Body"] * count], ["", "Name", *["tool"] * count],
        ["", "", *["Rotation"] * 4, *["Position"] * 3, *beside],
        ["Frame", "Time (Seconds)", *"XYZWXYZ", *[""] * len(beside)],
    ]  # fmt: skip
    rows = [
        [str(k), f"{k / 120:.6f}", *map(repr, [*turns[k].tolist(), *DATA.T[k, :3, 3].tolist()]),
         *["0.000211"] * len(beside)] for k in range(M)
    ]  # fmt: skip
    return "\n".join(map(",".join, [*head, *rows]))


@pytest.mark.parametrize(
    "beside", [(), ("Mean Marker Error",), ("Mean Marker Error", "Marker Quality")]
)
def test_names_that_stand_above_are_taken_for_columns_without_one(beside, tmp_path):
    found = sheet(tmp_path, motive(*beside))
    assert found.head[2:9] == (
        *(f"Rotation {axis}" for axis in "XYZW"), *(f"Position {axis}" for axis in "XYZ")
    )  # fmt: skip
    assert found.head[9:] == beside
    assert len(found.rows) == M


def test_motion_capture_with_errors_of_its_markers_is_proposed(tmp_path):
    joints = {f"J{j + 1}": np.degrees(DATA.q[:, j]) for j in range(6)}
    (tmp_path / "j.csv").write_text(csv(joints))
    (tmp_path / "take.csv").write_text(motive("Mean Marker Error"))
    files = [tmp_path / "j.csv", tmp_path / "take.csv"]
    said, _ = proposed(tmp_path, files, "--robot", ROBOT.name)
    assert "to fix" not in said
    assert "Mean Marker Error" in said  # which is not used
    table = read_session(tmp_path / "session.toml", ROBOT).measurements
    np.testing.assert_allclose(table.position, DATA.T[:, :3, 3], rtol=0, atol=1e-14)
    np.testing.assert_allclose(table.rotation, DATA.T[:, :3, :3], rtol=0, atol=1e-13)


def test_a_column_without_a_name_and_a_title_is_called_by_its_place(tmp_path):
    assert sheet(tmp_path, "a,b,\n1,2,0.5\n3,4,0.7\n").head == ("a", "b", "column 3")
    assert sheet(tmp_path, "a,b,,\n1,2,,\n3,4,,\n").head == ("a", "b")


def test_rows_without_a_cell_are_no_wider_than_the_names(tmp_path):
    with pytest.raises(InputError, match="holds numbers"):
        sheet(tmp_path, '5\n""\n')
    assert sheet(tmp_path, 'a,b,\n1,2\n"",\n').head == ("a", "b")


DAMAGED = {
    "commas before decimals": "pose,x,y,z,,,\np,1,5,2,7,3,1\nq,1,5,2,7,3,1\n",
    "a longer row": "a,b,\n1,2,0.5\n3,4,\n5,6,0.7,8\n",
    "no cell in the first line": "a,b\n1,2,0.5\n3,4,0.7\n",
    "hardly any name": "a,,\n1,0.2,0.5\n3,0.4,0.7\n",
    "one row that is longer": "a,b,\n1,2,\n3,4,\n5,6,0.7\n",
}


@pytest.mark.parametrize("text", DAMAGED.values(), ids=DAMAGED)
def test_cells_that_no_column_explains_are_refused(text, tmp_path):
    with pytest.raises(InputError, match=r"cells; the first line names \d columns?"):
        sheet(tmp_path, text)
