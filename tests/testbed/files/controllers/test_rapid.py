"""RAPID programs as joints: the moves in their order, or what is declared."""

import numpy as np
import pytest

from calib.errors import InputError
from testbed.files.dialects.controllers.rapid import is_rapid, read_rapid
from testbed.files.read import read_session
from testbed.gates.text import read_text
from tests.hangs import no_hang
from tests.testbed.files.made import ROBOT, columns, csv, made, with_spread

NONE = "[9E9,9E9,9E9,9E9,9E9,9E9]"


def sheet(folder, *lines):
    (folder / "a.mod").write_text("\n".join(lines))
    text = read_text(folder / "a.mod", "a.mod")
    assert is_rapid(text)
    return read_rapid(text).sheet


def test_declared_targets_are_rows_with_their_names(tmp_path):
    found = sheet(
        tmp_path,
        "MODULE A",
        f"  CONST jointtarget p1 := [[1,2,3,4,5,6],{NONE}];",
        f"  PERS JointTarget p2:=[ [ 1.5 , -2, 3,4,5,6] , {NONE} ]; ! p3 := [[1,1,1,1,1,1],{NONE}]",
        "  CONST robtarget r1 := [[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];",
        "ENDMODULE",
    )
    assert found.head == ("pose_id", *(f"q{k}_deg" for k in range(1, 7)))
    assert found.rows == (
        ("p1", "1", "2", "3", "4", "5", "6"),
        ("p2", "1.5", "-2", "3", "4", "5", "6"),
    )
    assert found.lines == (2, 3)


def test_moves_count_in_their_order_and_external_axes_are_named(tmp_path):
    found = sheet(
        tmp_path,
        "CONST jointtarget p1 := [[1,2,3,4,5,6],[7,9E9,9E9,9E9,9E9,9E9]];",
        "MoveAbsJ P1\\NoEOffs, v100, fine, tool0;",
        "MoveAbsJ [[6,5,4,3,2,1],[8,9E9,9E9,9E9,9E9,9E9]]\\NoEOffs, v100, fine, tool0;",
        "MoveAbsJ p1, v100, fine, tool0;",
    )
    assert found.head == (*(f"q{k}_deg" for k in range(1, 7)), "eax_a")
    assert [row[0] for row in found.rows] == ["1", "6", "1"]
    assert [row[-1] for row in found.rows] == ["7", "8", "7"]
    assert found.lines == (2, 3, 4)


def test_an_external_axis_keeps_its_letter_where_those_before_it_do_not_exist(tmp_path):
    found = sheet(tmp_path, *(f"MoveAbsJ [[1,2,3],[9E9,{x},9E9]],v,z,t;" for x in (7, 8)))
    assert found.head == ("q1_deg", "q2_deg", "q3_deg", "eax_b")


def test_every_statement_of_a_line_is_read_and_one_may_go_over_lines(tmp_path):
    found = sheet(
        tmp_path,
        f'TPWrite "a;b ! c"; CONST jointtarget p1:=[[1,2,3,4,5,6],{NONE}]; '
        f"CONST jointtarget p2:=[[2,2,3,4,5,6],{NONE}]; ! p1:=[[9,9,9,9,9,9],{NONE}];",
        "PROC main()",
        f"  MoveAbsJ p1,v1,fine,t; MoveAbsJ [[3,2,3,4,5,6],{NONE}],v1,fine,t; MoveAbsJ p2,v1,z5,t;",
        "  MoveAbsJ",
        "  ! the last one",
        f"    [[4,2,3,4,5,6],{NONE}], v1,fine,t;",
        "ENDPROC",
    )
    assert [row[0] for row in found.rows] == ["1", "3", "2", "4"]
    assert found.lines == (3, 3, 3, 4)


def test_a_semicolon_alone_in_its_line_ends_a_statement(tmp_path):
    """As a table such a line would be an empty row; dropped, it made one statement of two."""
    lines = [
        "CONST jointtarget p1",
        f"  := [[1,2,3,4,5,6],{NONE}]",
        ";",
        f"CONST jointtarget p2 := [[2,2,3,4,5,6],{NONE}]",
        "  ;  ",
        "MoveAbsJ p1,v1,fine,t",
        "",
        "; ! here",
        "MoveAbsJ p2,v1,fine,t",
        ";",
        "MoveAbsJ [[3",
        ",",
        f"2,3,4,5,6],{NONE}],v1,fine,t;",
    ]
    found = sheet(tmp_path, *lines)
    assert [row[0] for row in found.rows] == ["1", "2", "3"]
    assert found.lines == (6, 9, 11)
    assert sheet(tmp_path, *lines[:5]).lines == (1, 4)
    moved = [
        f"VAR jointtarget p1 := [[1,2],{NONE}]",
        ";",
        "MoveAbsJ p1,v1,z,t",
        ";",
        "p1 := a",
        ";",
    ]
    with pytest.raises(InputError, match=r"a\.mod:5: p1 is assigned another value here"):
        sheet(tmp_path, *moved)


def test_arrays_are_rows_in_their_order_and_moves_take_what_they_name(tmp_path):
    array = [
        "CONST jointtarget P{3}",
        f"  := [ [[1,2,3,4,5,6],{NONE}], [[2,2,3,4,5,6],{NONE}],",
        f"  [[3,2,3,4,5,6],{NONE}] ];",
        "VAR num speed;",
        "VAR jointtarget now;",
    ]
    found = sheet(tmp_path, *array, "speed := 5; now := CJointT();")
    assert [row[:2] for row in found.rows] == [("P{1}", "1"), ("P{2}", "2"), ("P{3}", "3")]
    assert found.lines == (1, 1, 1)
    found = sheet(tmp_path, *array, "MoveAbsJ p{3},v1,z,t;", "MoveAbsJ \\Conc, p{ 1 }, v1,z,t;")
    assert [row[:2] for row in found.rows] == [("P{3}", "3"), ("P{1}", "1")]
    assert found.lines == (6, 7)


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        (["MoveAbsJ home, v100, fine, tool0;"], 'a.mod:1: moves to "home", which is no'),
        (["VAR jointtarget p1;"], "a.mod: has no joint target"),
        (["CONST jointtarget p1 := "], "a.mod:1: p1 is not given by numbers"),
        ([f"CONST jointtarget p{k} := [[{row}],{NONE}];" for k, row in enumerate(("1,2", "1"))],
         "a.mod: has targets of different robots"),
        ([f"CONST jointtarget p1 := [[1,2],{NONE}];", "MoveAbsJ p1,v1,z,t", "MoveAbsJ p1,v1,z,t;"],
         "a.mod:2: has two targets in one statement"),
        ([f"VAR jointtarget p1 := [[1,2],{NONE}];", "MoveAbsJ p1,v1,z,t;", "PROC a()",
          f"  P1 := [[3,4],{NONE}];", "ENDPROC"], "a.mod:4: p1 is assigned another value here"),
        ([f"VAR jointtarget p1 := [[1,2],{NONE}];", "p1 := CJointT();"],
         "a.mod:2: p1 is assigned another value here"),
        ([f"VAR jointtarget p1 := [[1,2],{NONE}];", "MoveAbsJ p1,v1,z,t;", "p1.robax.rax_1 := 5;"],
         "a.mod:3: p1 is assigned another value here"),
        ([f"CONST jointtarget p1 := [[1,2],{NONE}];", "CONST jointtarget p2 := p1;"],
         "a.mod:2: p2 is not given by numbers; write each position as"),
        ([f"VAR jointtarget p{{2}} := [[[1,2],{NONE}],[[3,4],{NONE}]];", "MoveAbsJ p{2},v1,z,t;",
          f"p{{1}} := [[3,4],{NONE}];"], "a.mod:3: p is assigned another value here"),
        ([f"CONST jointtarget p{{2}} := [[[1,2],{NONE}],[[3,4],{NONE}]];",
          "FOR i FROM 1 TO 2 DO", "MoveAbsJ p{i},v1,z,t;", "ENDFOR"],
         "a.mod:3: moves to p{i}, whose index is known only while the program runs"),
        ([f"CONST jointtarget p{{3}} := [[[1,2],{NONE}],[[3,4],{NONE}]];"],
         "a.mod:1: p{3} has 2 targets; an array has one dimension"),
        ([f"CONST jointtarget p{{2,1}} := [[[[1,2],{NONE}]],[[[3,4],{NONE}]]];"],
         "a.mod:1: p{2,1} has 2 targets"),
        (["VAR jointtarget p1;", "MoveAbsJ p1,v1,z,t;"], 'a.mod:2: moves to "p1", which is no'),
        (["MODULE A", f"CONST jointtarget p1 := [[1,2],{NONE}] [[1,2],{NONE}];"],
         "a.mod:2: has two targets in one statement"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_one_sentence(tmp_path, lines, told):
    with pytest.raises(InputError) as caught:
        sheet(tmp_path, *lines)
    assert str(caught.value).startswith(told)


@pytest.mark.parametrize(
    "word", ["9", "a{", "{", "a.", "a .b", "jointtarget a{", "MoveAbsJ a{ ", "a ", "a :", "p1{1}."]
)
def test_a_long_line_of_anything_takes_no_time(tmp_path, word):
    lines = [word * (60_000 // len(word))] * 10  # where one takes its square, minutes
    with no_hang(), pytest.raises(InputError):  # a statement of its own, and part of a move
        sheet(tmp_path, f"CONST jointtarget p1 := [[1,2],{NONE}];", *lines, "a;", *lines,
              "MoveAbsJ p2,v,z,t;")  # fmt: skip


def test_a_session_takes_its_joints_from_a_program(tmp_path):
    data = made()
    rows = np.degrees(data.q)
    lines = [f"CONST jointtarget p{k} := [[{','.join(f'{v:.12f}' for v in row)}],[5,9E9]];"
             for k, row in enumerate(rows)]  # fmt: skip
    seen = {"pose_id": [f"p{k}" for k in range(29)]} | with_spread(
        {k: v for k, v in columns(data).items() if k[0] in "xyzr"}
    )
    (tmp_path / "a.mod").write_text("\n".join(lines))
    (tmp_path / "a.csv").write_text(csv(seen))
    (tmp_path / "session.toml").write_text(
        '[joints]\nfile = "a.mod"\nformat = "rapid"\n[frames]\nfile = "a.csv"\neuler = "XYZ"\n'
    )
    session = read_session(tmp_path, ROBOT)
    # twelve decimals of a degree
    np.testing.assert_allclose(session.measurements.q, data.q, rtol=0, atol=1e-14)
    assert "a.mod: not used: eax_a" in session.notes
