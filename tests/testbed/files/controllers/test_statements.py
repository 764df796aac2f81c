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
