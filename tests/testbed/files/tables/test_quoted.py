"""Cells over several lines, as spreadsheets write names with a line break in them."""

from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

from testbed.files.dialects.quoted import with_quoted_lines
from testbed.files.read import read_session
from testbed.gates.text import FileText, SourceFile
from tests.hangs import no_hang
from tests.testbed.files.made import ROBOT, made
from tests.testbed.proposal.test_session import proposed

DATA = made()
ROWS = np.hstack([np.degrees(DATA.q), 1e3 * DATA.T[:, :3, 3]])
NAMES = [f'"Axis {k}\n[deg]"' for k in range(1, 7)] + [f'"{a}\nmeasured\n[mm]"' for a in "XYZ"]


@pytest.mark.parametrize("mark", [",", ";", "\t"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_names_with_line_breaks_are_those_of_their_columns(mark, end, tmp_path):
    """They left "no column known as a reading"."""
    lines = [mark.join(NAMES), *(mark.join(f"{v:.11f}" for v in row) for row in ROWS)]
    (tmp_path / "a.csv").write_bytes("\n".join(lines).replace("\n", end).encode())
    said, _ = proposed(tmp_path, [tmp_path / "a.csv"], "--robot", ROBOT.name)
    assert "Not used" not in said
    session = read_session(tmp_path / "session.toml", ROBOT)
    np.testing.assert_allclose(session.measurements.q, DATA.q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(session.measurements.position, DATA.T[:, :3, 3], rtol=0, atol=1e-13)
    # rows keep the lines that an editor shows
    assert session.place[0].endswith(f":{2 + sum(name.count(chr(10)) for name in NAMES)}")


def text_of(*lines):
    source = SourceFile(Path("a.csv"), sha256(b"").hexdigest())
    return FileText("a.csv", lines, "UTF-8", source)


@pytest.mark.parametrize(
    "lines",
    [
        ('J1,J2,X "raw', '1,2,"3', "4,5,6", '7,8,9"'),  # would swallow a row
        ('X,Y,note', '1,2,"open', "words", "more words"),  # never ends
        ('X,Y,pipe', '1,2,5"', '3,4,6"'),  # inches
        ("X,Y", "1,2"),
    ],
)  # fmt: skip
def test_quotes_that_are_no_such_cells_stay_as_they_are(lines):
    text = text_of(*lines)
    assert with_quoted_lines(text) is text


def test_cells_that_follow_each_other_over_lines_make_one_row():
    text = text_of("a,b", '1,"x', ' y","z', "", 'w"', "2,3")
    assert with_quoted_lines(text).lines == ("a,b", '1,"x  y","z   w"', "", "", "", "2,3")


def test_a_long_file_of_open_quotes_ends_in_time():
    lines = ['1,"a'] * 100_000
    with no_hang(20):
        assert with_quoted_lines(text_of(*lines)).lines == tuple(lines)
    lines = ['1,"a', 'b"'] * 50_000
    with no_hang(20):
        assert with_quoted_lines(text_of(*lines)).lines[:2] == ('1,"a b"', "")
