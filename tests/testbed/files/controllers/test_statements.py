"""What all languages share: several statements on a line, no statement at all, and long lines."""

from typing import get_args

import pytest

from calib.errors import InputError
from testbed.files.dialects.controllers.read import READERS, Language, joints_in, language_of
from testbed.gates.text import read_text
from tests.hangs import no_hang

LANGUAGES = get_args(Language)
BEGUN = (
    "", "1", "P[1]{ GP1: J1", "DECL E6AXIS a={", "E6AXIS a", "PTP ", "movej(", "a=[", "p1=posj(",
    "#p1", "JMOVE #p", "POINT #p", "C00001=", "MOVJ", "<Data ", "jointtarget p", "MoveAbsJ [",
    "MoveAbsJ p", "p1",
)  # fmt: skip
"""Beginnings of lines, after which something is wanted."""


def text_of(folder, content):
    (folder / "a.txt").write_text(content)
    return read_text(folder / "a.txt", "a.txt")


def test_every_language_has_its_reader():
    assert set(READERS) == set(LANGUAGES)


@pytest.mark.parametrize(
    ("language", "line"),
    [
        ("doosan", "movej(posj(0, 0, 0, 0, 0, 0)); movej(posj(1, 2, 3, 4, 5, 6), v=30)"),
        ("doosan", "a = posj(0, 0, 0, 0, 0, 0); movej(a); b = posj(1, 2, 3, 4, 5, 6); movej(b)"),
        ("urscript", "movej([0, 0, 0, 0, 0, 0]); movej([1, 2, 3, 4, 5, 6]) # ; movej([0, 0])"),
        ("rapid", "MoveAbsJ [[0,0,0,0,0,0],[9E9]],v,z,t; MoveAbsJ [[1,2,3,4,5,6],[9E9]],v,z,t;"),
    ],
)  # fmt: skip
def test_every_statement_of_a_line_is_read(language, line, tmp_path):
    found = joints_in(text_of(tmp_path, line), language).sheet
    assert [row[-6:] for row in found.rows] == [("0",) * 6, tuple("123456")]
    assert found.lines == (1, 1)


ELSEWHERE = {
    "urscript": ["home = p[1, 2, 3, 0, 0, 0]", "movej([0, 0, 0, 0, 0, 0])", "movej(home)",
                 "movel(home)", "movej([1, 2, 3, 4, 5, 6])"],
    "doosan": ["home = posx(1, 2, 3, 0, 0, 0)", "movej(posj(0, 0, 0, 0, 0, 0))", "movel(home)",
               "movej(home)", "movej(posj(1, 2, 3, 4, 5, 6))"],
    "fanuc": ["/PROG A", "/MN", "1:J P[1] 20% FINE ;", "2:C P[3]", ":  P[4] 9mm/sec FINE ;",
              "3:L P[3] 9mm/sec FINE ;", "4:J P[2] 20% FINE ;", "/POS",
              "P[1]{ GP1: J1=0 deg, J2=0 deg, J3=0 deg, J4=0 deg, J5=0 deg, J6=0 deg };",
              "P[2]{ GP1: J1=1 deg, J2=2 deg, J3=3 deg, J4=4 deg, J5=5 deg, J6=6 deg };",
              "P[3]{ GP1: X = 1 mm, Y = 2 mm };", "P[4]{ GP1: X = 1 mm, Y = 2 mm };"],
}  # fmt: skip


@pytest.mark.parametrize("language", ELSEWHERE)
def test_moves_to_positions_of_the_tool_are_counted_and_left(language, tmp_path):
    """By name, and on an arc, which is one move with two positions."""
    text = text_of(tmp_path, "\n".join(ELSEWHERE[language]))
    assert language_of(text) == language
    found = joints_in(text, language)
    assert [row[-6:] for row in found.sheet.rows] == [("0",) * 6, tuple("123456")]
    assert "2 Cartesian positions are not used" in " ".join(found.note)


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("content", ["! # // ; '\n", "; \n,\n", "x\n"])
def test_a_program_without_a_statement_has_no_joint_target(language, content, tmp_path):
    with pytest.raises(InputError, match="has no joint target"):
        joints_in(text_of(tmp_path, content), language)


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_line_of_spaces_is_read_in_time(language, tmp_path):
    """Where two parts of a pattern both take the spaces, one such line takes minutes."""
    texts = [text_of(tmp_path, f"{begun}{' ' * 60_000}{end}") for begun in BEGUN for end in "x="]
    with no_hang():
        for text in texts:
            language_of(text)
            with pytest.raises(InputError):
                joints_in(text, language)
