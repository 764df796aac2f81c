"""Lines below a table: sums and sentences are told and not read, and what was cut is refused.

Truth: tables that are written here, with and without such lines.
"""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from testbed.files.dialects.spatial_lines import sa_lines
from testbed.files.read import read_session
from testbed.files.rows.below import table_ends
from testbed.files.rows.widened import sheet_in
from testbed.files.text import read_sheet
from testbed.gates.text import read_text
from tests.testbed.files.made import ROBOT, columns, csv, made, with_spread
from tests.testbed.proposal.test_session import proposed

M = 12
DATA = made(m=M)
OWN = {name: column for name, column in columns(DATA, ids=False).items() if name[0] in "qxyz"}
TABLE = with_spread({"pose_id": [f"P{k + 1}" for k in range(M)]} | OWN, turn=False)
TEXT = csv(TABLE)
WIDTH = len(TABLE)
BELOW = {
    "how many there are": ("Total points: 12", 1),
    "a mean of some columns": ("Mean" + "," * 7 + "1.5,2.5,3.5,0.1,0.1,0.1", 1),
    "a mean without a number": ("Mean" + "," * (WIDTH - 1), 1),
    "several sums": ("Mittelwert,,,,,,,1.5,2.5\nStd. Dev.,,,,,,,0.5,0.5", 2),
    "who exported it": ("\nExported by Tracker X\nOperator,Meier", 2),
    "a comma in a sentence": ("End of export, 12 points", 1),
    "one word": ("EOF", 1),
    "one word in brackets": ("[End]", 1),
    "words and their values": ("Operator:,Meier\nTemperature:,20.5\nFit error,0.012", 3),
    "a rule": ("------\nTotal: 12", 2),
}


def read(folder, text):
    (folder / "a.csv").write_text(text)
    return read_session(folder / "a.csv", ROBOT)


@pytest.mark.parametrize(("below", "count"), BELOW.values(), ids=BELOW)
def test_lines_below_a_table_are_told_and_not_read(below, count, tmp_path):
    session = read(tmp_path, f"{TEXT}{below}\n")
    np.testing.assert_allclose(session.measurements.q, DATA.q, rtol=0, atol=1e-14)
    np.testing.assert_allclose(session.measurements.position, DATA.T[:, :3, 3], atol=1e-14)
    (said,) = session.warnings
    lines = "1 line below the table is" if count == 1 else f"{count} lines below the table are"
    assert f"a.csv: {lines} not read: line 1" in said
    assert below.split()[0][:8].strip(",") in said


CUT = {
    "cut behind the joints": TABLE["pose_id"][-1] + ",1.5,2.5,3.5",
    "cut behind its name": "P12",
    "a lost shot in words": ",".join(["P12", *["lost"] * (WIDTH - 1)]),
    "without a name": ",".join(["n/a"] * WIDTH),
    "a name with a space": "Point 12,1.5,2.5",
    "numbers alone": "1.5,2.5,3.5",
    "sums under no name": "Statistics\n1.5,2.5",
}


@pytest.mark.parametrize("last", CUT.values(), ids=CUT)
def test_a_row_that_is_cut_is_no_line_below_the_table(last, tmp_path):
    with pytest.raises(InputError, match=r"a\.csv:1[34]: has|1 of 12 rows has cells that are not"):
        read(tmp_path, TEXT.rsplit("P12", 1)[0] + last + "\n")
    with pytest.raises(InputError, match=r"M35|M25"):  # above others they stay what they are, too
        read(tmp_path, TEXT.replace("P11", f"{last}\nP11"))


def test_a_sentence_that_is_named_as_the_rows_are_is_a_row():
    rows = [["Point 1", "1.5", "2.5"], ["Point 2", "1.5", "3.5"], ["Point 3"]]
    assert table_ends(rows) == 3
    assert table_ends([*rows[:2], ["Operator 3"]]) == 2
    assert table_ends([["left", "1.5", "2.5"], ["right", "1.5", "3.5"], ["low", "1.5"]]) == 3
    assert table_ends([["left", "1.5", "2.5"], ["right", "1.5", "3.5"], ["Air:", "1.5"]]) == 2
    assert table_ends([["only", "words"], ["no", "numbers: here"]]) == 2


def test_a_table_is_made_once_and_that_of_a_part_of_its_lines_anew(tmp_path):
    """Joints and readings stand in one table, and hundreds of interpretations are tried on it."""
    (tmp_path / "a.csv").write_text(TEXT)
    text = read_text(tmp_path / "a.csv", "a.csv")
    whole = sheet_in(text)
    assert len(whole.rows) == M
    assert sheet_in(text) is whole
    assert len(sheet_in(replace(text, lines=text.lines[:5])).rows) == 4
    assert len(sheet_in(text, header=False).rows) == M + 1
    assert sheet_in(text) is whole


def test_programs_have_no_lines_below(tmp_path):
    (tmp_path / "a.csv").write_text("q1_deg,q2_deg\n1.5,2.5\nTotal: 1\n")
    with pytest.raises(InputError, match=r"a\.csv:3: has 1 cell"):
        read_sheet(read_text(tmp_path / "a.csv", "a.csv"))


@pytest.mark.parametrize("mark", [", ", "; ", "\t", " "])
def test_rows_without_a_head_may_have_lines_below(mark, tmp_path):
    lines = [mark.join([f"P{k}", "1.25", "2.50", f"{k}.75"]) for k in range(4)]
    (tmp_path / "a.txt").write_text("\n".join([*lines, "Total points: 4"]))
    found = sa_lines(read_text(tmp_path / "a.txt", "a.txt"))
    assert found.lines == (1, 2, 3, 4)
    assert found.below == ((5, "Total points: 4"),)


def test_what_stands_below_is_told_where_a_session_is_proposed(tmp_path):
    joints = {name: TABLE[name] for name in TABLE if name[0] in "pq"}
    (tmp_path / "j.csv").write_text(csv(joints) + "Count" + "," * 5 + "12\n")
    points = [f"{name}, " + ", ".join(f"{1e3 * v:.9f}" for v in place)
              for name, place in zip(TABLE["pose_id"], DATA.T[:, :3, 3], strict=True)]  # fmt: skip
    (tmp_path / "t.txt").write_text("\n".join([*points, "Exported by Tracker X"]))
    said, _ = proposed(tmp_path, [tmp_path / "j.csv", tmp_path / "t.txt"], "--robot", ROBOT.name)
    assert "to fix" not in said
    for file, line in (("j.csv", 14), ("t.txt", 13)):
        assert f"{file}: 1 line below the table is not read: line {line}" in said
    table = read_session(tmp_path / "session.toml", ROBOT).measurements
    np.testing.assert_allclose(table.position, DATA.T[:, :3, 3], atol=1e-12)
