"""Names in a comment right above the numbers are those of the columns; other comments are none."""

import numpy as np
import pytest

from testbed.files.dialects.commented_names import with_commented_names
from testbed.files.read import read_session
from testbed.files.text import read_sheet
from testbed.gates.text import read_text
from tests.testbed.files.made import ROBOT, columns, made

DATA = made(2, 12)
OWN = columns(DATA, form="none", ids=False)
ROWS = np.column_stack(list(OWN.values()))


def text(folder, head, *, mark=",", rows=ROWS):
    np.savetxt(folder / "a.csv", rows, delimiter=mark, header="\n".join(head), comments="# ")
    return read_text(folder / "a.csv", "a.csv")


@pytest.mark.parametrize("mark", [",", "\t", " "])
def test_a_table_as_numpy_writes_it_is_read(mark, tmp_path):
    text(tmp_path, ["shots of Monday", mark.join(OWN)], mark=mark)
    (tmp_path / "s.toml").write_text("[points]\n[uncertainty]\nposition_um = 20\n")
    read = read_session(tmp_path / "a.csv", ROBOT, config=tmp_path / "s.toml").measurements
    # numpy writes 19 digits
    np.testing.assert_allclose(read.position, DATA.T[:, :3, 3], rtol=0, atol=1e-15)
    np.testing.assert_allclose(read.q, DATA.q, rtol=0, atol=1e-15)


def test_a_line_of_units_below_the_names_is_one(tmp_path):
    head = ["J1 J2 J3 J4 J5 J6 X Y Z", "deg deg deg deg deg deg mm mm mm"]
    sheet = read_sheet(text(tmp_path, head, mark=" "))
    assert sheet.head == tuple(head[0].split())
    assert sheet.units == tuple(head[1].split())
    assert len(sheet.rows) == len(DATA.q)
    assert sheet.lines[0] == 3


@pytest.mark.parametrize(
    "head",
    [["tracker", "export"], ["one two three four five six seven eight nine"], ["X Y Z"],
     [" ".join(OWN), "a last word"], ["1 2 3 4 5 6 7 8 9"]],
)  # fmt: skip
def test_comments_that_name_no_columns_stay_comments(head, tmp_path):
    plain = text(tmp_path, head, mark=" ")
    assert with_commented_names(plain) is plain


def test_where_a_session_says_that_no_line_names_columns_none_does(tmp_path):
    sheet = read_sheet(text(tmp_path, [",".join(OWN)]), header=False)
    assert sheet.head == tuple(map(str, range(1, 10)))
    assert len(sheet.rows) == len(DATA.q)
