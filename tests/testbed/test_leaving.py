"""What leaves the program: nothing steers a terminal, runs in a spreadsheet or breaks a line."""

import csv
import io

import pytest

from calib.errors import one_line, refuse, visible
from testbed.files.programs.correct import correct_program
from testbed.files.read import read_session
from testbed.files.text import read_sheet
from testbed.gates.text import read_text
from testbed.laboratory.joint_lists import read_joints
from testbed.report.page import Page, Points, Section, Table, Text, render
from testbed.report.text import csv_text, guarded, table, unguarded
from testbed.robots.catalog import load_robot
from testbed.robots.write.toml import robot_toml
from tests.testbed.files import made

ROBOT = load_robot("staubli_tx60")
SEPARATORS = "\n\x0b\x0c\r\x1c\x1d\x1e\x85\u2028\u2029"
"""Every character at which Python's `splitlines` breaks a line."""
STEERING = [
    *map(chr, range(9)), *map(chr, range(11, 32)), *map(chr, range(127, 160)),
    *"\u2028\u2029\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069", "\udc9b",
]  # fmt: skip
HARMLESS = "aZ09 äß√−µ\u202f'\"=<>|{}[]()~\\/日本語 עברית 😀"
RUN = [
    "=cmd|x", "=1+1", "@SUM(A1)", "+A1", "-A1", "-1+cmd|' /C calc'!A0", "-2-3", "+-1", "-e5", "--1",
    "\t=1", "\rx", " =1", "- 1", "'=1", "''@x", "-x+1", "=", "@", "-1,5;", "-.", "-5 %", "+x(1)",
    "-x|y", "-x!A1", "+'a'!x", "-[b]x", " -x", "-x y", "'-x", "''+z", "-XFD1048576", "--x",
]  # fmt: skip
PLAIN = [
    "", "a", "P1", "1", "-1.5", "+1.5", "-1,5", "-1.5e-3", "-.5", "+1E+09", "-1.", "-", "+", "a=b",
    "'a", "'", "''", "1-2", "(=1)", "x@y", "'1", "-x", "+Z", "-inf", "-high", "+straße", "-_",
]  # fmt: skip


def test_what_steers_a_terminal_is_written_out():
    assert visible("\x1b[2J \x9b \u202e") == r"\x1b[2J \x9b \u202e"
    for one in STEERING:
        shown = visible(f"a{one}b")
        assert len(shown) in (6, 8)
        assert shown[1:-1].encode().decode("unicode_escape") == one
        assert one_line(f"a{one}b") == shown
        assert one not in str(refuse("x", code="S37", message=f"a{one}b", where=f"c{one}.toml"))


def test_everything_else_stays():
    assert visible(HARMLESS + "\n\t") == HARMLESS + "\n\t"
    assert one_line(HARMLESS + "\n\t") == HARMLESS + r"\x0a\x09"


@pytest.mark.parametrize("one", SEPARATORS)
def test_an_error_is_one_line_and_shows_what_breaks_it(one):
    error = refuse("x", code="S37", message=f'the key "a{one}b" is unknown', where=f"my{one}.toml")
    assert len(str(error).splitlines()) == 1
    assert error.where == f"my{one}.toml"  # for programs, as it was


def test_a_table_shows_no_steering_and_has_one_line_a_row():
    text = table("what", ("robot", "title"), [[f"a{one}b", "c"] for one in [*STEERING, "\n"]])
    assert len(text.splitlines()) == 4 + len(STEERING) + 1
    assert text == visible(text)
    assert r"a\x1bb" in text
    assert r"a\u202eb" in text


@pytest.mark.parametrize("cell", RUN)
def test_a_spreadsheet_shows_what_it_would_run(cell):
    assert guarded(cell) == f"'{cell}"
    assert unguarded(guarded(cell)) == cell


@pytest.mark.parametrize("cell", PLAIN)
def test_numbers_and_words_stay_as_they_are(cell):
    assert guarded(cell) == cell
    assert unguarded(cell) == cell


def test_a_csv_holds_nothing_that_runs_and_comes_back():
    cells = [one for one in RUN if one.strip() == one and "\r" not in one]
    text = csv_text(["=head", "value"], [[cell, "-1.5"] for cell in cells])
    head, *rows = csv.reader(io.StringIO(text))
    assert head == ["'=head", "value"]
    assert rows == [[f"'{cell}", "-1.5"] for cell in cells]
    assert [[unguarded(cell) for cell in row] for row in rows] == [[one, "-1.5"] for one in cells]
    text = csv_text(["a"], [[f"x{one}y"] for one in STEERING])
    assert text == visible(text)
    assert len(text.splitlines()) == 1 + len(STEERING)


def test_pose_names_behind_an_apostrophe_are_read_as_they_were(tmp_path):
    names = ("=cmd|x", "-a", "@b", "'=c", "+d", "'e", "P5", "'-f", "-P5", "''+g")
    data = made.made()
    wanted = (*names, *(f"p{k}" for k in range(len(names), len(data.q))))
    ids = {"pose_id": list(map(guarded, wanted)), "euler": ["XYZ"] * len(data.q)}
    text = made.csv(made.with_spread(made.columns(data)) | ids)
    (tmp_path / "poses.csv").write_text(text, encoding="utf-8")
    session = read_session(tmp_path / "poses.csv", ROBOT)
    assert session.pose_names == wanted


@pytest.mark.parametrize("mark", [",", ";", "\t", " "])
def test_a_corrected_program_runs_nothing_and_breaks_no_line(mark, tmp_path):
    joints = [f"q{k}_deg" for k in range(1, 7)]
    q = ["-10.5", "20", "70", "15", "40", "-30"]
    wild = "\x0b\u2029" if mark != " " else ""  # both separate words
    lines = [
        "# mine: a\u2028b\x85c\x1b[31m",
        mark.join(["=name", "note", *joints]),
        mark.join(["=cmd|x", f"-hi+{wild}gh", *q]),
        mark.join(["'=cmd|y", "'@z", *q]),
    ]
    path = tmp_path / "p.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    correct_program(path, ROBOT, ROBOT.model, tmp_path / "out.csv")
    text = (tmp_path / "out.csv").read_text(encoding="utf-8")
    assert text == visible(text)
    told = text.splitlines()
    assert len(told) == 4
    assert told[0] == r"# mine: a\u2028b\x85c\x1b[31m"
    rows = [line.split(mark) for line in told[1:]]
    assert [row[0] for row in rows] == ["'=name", "'=cmd|x", "'=cmd|y"]
    assert [row[1] for row in rows] == ["note", f"'-hi+{visible(wild)}gh", "'@z"]
    assert all(float(cell) < 0 for row in rows[1:] for cell in (row[2], row[7]))
    again = read_sheet(read_text(tmp_path / "out.csv", "out.csv"))
    assert again.head[0] == "=name"
    assert [row[0] for row in again.rows] == ["=cmd|x", "=cmd|y"]


def test_joint_lists_take_their_columns_behind_an_apostrophe(tmp_path):
    path = tmp_path / "joints.csv"
    rows = [["=P1", *"123456"], ["=P2", *"234567"]]
    path.write_text(csv_text(["=id", *(f"q{k}_deg" for k in range(1, 7))], rows), encoding="utf-8")
    assert read_joints(ROBOT, path).shape == (2, 6)


@pytest.mark.parametrize("one", [*SEPARATORS, "\x1b", "\x7f", "\u202e"])
def test_comments_of_a_robot_file_hold_no_line_separator(one):
    bare = robot_toml(ROBOT)
    lines = robot_toml(ROBOT, comment=f"arm{one}b").splitlines()
    assert lines[-len(bare.splitlines()) :] == bare.splitlines()
    comments = lines[: -len(bare.splitlines())]
    assert comments == (["# arm", "# b"] if one == "\n" else [f"# {visible(f'arm{one}b')}"])


def test_the_page_shows_what_it_cannot_print():
    wild = "".join(["a", *(one for one in STEERING if one != "\udc9b"), "b"])
    head = Table(wild, (wild, "u"), ((wild, "1"),), "ll")
    section = Section("s", wild, (Text(wild), Points((wild,))))
    text = render(Page(wild, wild, wild, True, wild, wild, (wild,), head, wild, (section,)))
    assert text == visible(text)
    assert text.count(r"a\x00\x01") == 17  # every place that takes a text; a table says its name
