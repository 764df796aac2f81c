"""UTF-16, as Windows programs and spreadsheets export it: read and written back as it was.

Truth: the same text in UTF-8.
"""

import codecs

import numpy as np
import pytest

from calib.errors import InputError
from testbed.files.programs.rewrite import rewritten
from testbed.files.read import read_session
from testbed.files.text import read_sheet
from testbed.gates.text import read_text
from tests.testbed.files.made import ROBOT, csv, made, poses_csv
from tests.testbed.proposal.test_session import proposed

DATA = made(m=12)
CODED = {
    "low byte first": (codecs.BOM_UTF16_LE, "utf-16-le"),
    "high byte first": (codecs.BOM_UTF16_BE, "utf-16-be"),
}


@pytest.mark.parametrize(("mark", "codec"), CODED.values(), ids=CODED)
def test_a_table_is_read_as_in_utf_8(mark, codec, tmp_path):
    text = poses_csv(DATA, separator="\t", decimal=",", eol="\r\n") + "Größe – 位置: 12\r\n"
    (tmp_path / "a.txt").write_bytes(mark + text.encode(codec))
    (tmp_path / "b.txt").write_bytes(text.encode())
    one, other = (read_session(tmp_path / f"{k}.txt", ROBOT) for k in "ab")
    np.testing.assert_array_equal(one.measurements.q, other.measurements.q)
    np.testing.assert_array_equal(one.measurements.position, other.measurements.position)
    np.testing.assert_allclose(one.measurements.q, DATA.q, atol=1e-13)
    assert "UTF-16" in one.notes[0]
    assert "Größe – 位置: 12" in one.warnings[0]
    found = [read_text(tmp_path / f"{k}.txt", "it") for k in "ab"]
    assert found[0].lines == found[1].lines
    assert found[0].ends == found[1].ends
    assert found[0].source.sha256 != found[1].source.sha256  # of the bytes as they are


@pytest.mark.parametrize(("mark", "codec"), CODED.values(), ids=CODED)
def test_a_program_comes_back_in_its_encoding(mark, codec, tmp_path):
    text = "# Größe – 位置\r\nq1_deg,note\r\n1.5,a\r\n"
    (tmp_path / "a.csv").write_bytes(mark + text.encode(codec))
    read = read_text(tmp_path / "a.csv", "a.csv")
    new, taken = {"q1_deg": np.array([2.5])}, {"q1_deg": np.array([True])}
    told = rewritten(read, read_sheet(read), new, taken, {}, comma=False)
    assert told == mark + text.replace("1.5", "2.5").encode(codec)


def test_a_spreadsheet_exported_as_unicode_text_is_proposed(tmp_path):
    table = {f"J{j + 1}": np.degrees(DATA.q[:, j]) for j in range(6)}
    table |= {axis: 1e3 * DATA.T[:, k, 3] for k, axis in enumerate("XYZ")}
    text = csv(table, separator="\t", eol="\r\n")
    (tmp_path / "a.txt").write_bytes(text.encode("utf-16"))
    said, _ = proposed(tmp_path, [tmp_path / "a.txt"], "--robot", ROBOT.name)
    assert "to fix" not in said
    found = read_session(tmp_path / "session.toml", ROBOT).measurements
    np.testing.assert_allclose(found.position, DATA.T[:, :3, 3], atol=1e-12)


TEXT = "q1_deg,x_mm\n1,2\n"
REFUSED = {
    "no mark": (TEXT.encode("utf-16-le"), "is UTF-16 text without the mark .*; save it as UTF-8"),
    "no mark, high byte first": (TEXT.encode("utf-16-be"), "is UTF-16 text without the mark"),
    "broken off": (
        TEXT.encode("utf-16")[:-1],
        "begins as UTF-16 text, and byte 32 is part of no letter",
    ),
    "half a letter": (TEXT.encode("utf-16") + b"\x00\xd8\x31\x00", "as UTF-16 text, and byte 34"),
    "four bytes a letter": (TEXT.encode("utf-32"), "is not text|is UTF-16 text without"),
    "a page": ("<?xml ?>".encode("utf-16"), "is a page of HTML or XML"),
    "a zero": ("1,2\0".encode("utf-16"), "is not text: byte 3 is zero"),
    "nothing": (codecs.BOM_UTF16_LE, "is empty"),
    "zeros": (b"q1_deg,x_mm\n1,2\n\0\0", "is not text: byte 16 is zero"),
}


@pytest.mark.parametrize(("data", "why"), REFUSED.values(), ids=REFUSED)
def test_what_is_no_text_is_refused(data, why, tmp_path):
    (tmp_path / "a.txt").write_bytes(data)
    with pytest.raises(InputError, match=why):
        read_text(tmp_path / "a.txt", "a.txt")
