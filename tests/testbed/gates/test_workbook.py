"""Workbooks: a sheet reads as its text would; what is packed, locked or runs is refused."""

import sys
import zipfile
from datetime import datetime, timedelta

import numpy as np
import pytest

from calib.errors import InputError
from testbed.files.read import ReadOptions, read_session
from testbed.gates.workbook import read_workbook
from tests.hangs import no_hang
from tests.testbed.files.made import ROBOT, columns, csv, made, with_spread

openpyxl = pytest.importorskip("openpyxl")


def table():
    return with_spread(columns(made())) | {"euler": ["XYZ"] * 29}


def book(path, *sheets):
    """A workbook of (name, table) sheets."""
    out = openpyxl.Workbook()
    out.remove(out.active)
    for name, content in sheets:
        sheet = out.create_sheet(name)
        sheet.append(list(content))
        for row in zip(*content.values(), strict=True):
            sheet.append([v if isinstance(v, str) else float(v) for v in row])
    out.save(path)
    return path


def changed(path, change, method=zipfile.ZIP_DEFLATED):
    """The same with other parts."""
    with zipfile.ZipFile(path) as old:
        parts = change({name: old.read(name) for name in old.namelist()})
    with zipfile.ZipFile(path, "w", method) as new:
        for name, data in parts.items():
            new.writestr(name, data)
    return path


def test_a_sheet_reads_as_its_text_does(tmp_path):
    file = book(tmp_path / "a.xlsx", ("Tabelle1", table()))
    (tmp_path / "a.csv").write_text(csv(table(), form="{:.17g}"))
    one, two = (read_session(tmp_path / name, ROBOT) for name in ("a.xlsx", "a.csv"))
    # openpyxl writes 16 digits
    np.testing.assert_allclose(one.measurements.position, two.measurements.position, rtol=2e-15)
    assert np.array_equal(one.measurements.covariance, two.measurements.covariance)
    assert one.place[0] == f"{file}:2"
    assert "xlsx sheet Tabelle1, values only, tab between cells" in one.notes[0]


def test_moments_are_read_and_cells_without_anything_are_empty(tmp_path):
    """As spreadsheets keep them, whatever they show."""
    begun = datetime(2026, 3, 1, 23, 59, 50)  # noqa: DTZ001 - a workbook knows no zones
    moments = [begun + timedelta(seconds=k) for k in range(29)]
    book(tmp_path / "a.xlsx", ("Tabelle1", table()))
    whole = openpyxl.load_workbook(tmp_path / "a.xlsx")
    for row, (time, note) in enumerate([("time", "note"), *((one, None) for one in moments)], 1):
        whole.active.cell(row, 30, time)
        whole.active.cell(row, 31, note)
    whole.save(tmp_path / "a.xlsx")
    session = read_session(tmp_path / "a.xlsx", ROBOT)
    # a workbook counts days since 1900: rounded to milliseconds by what reads it
    np.testing.assert_allclose(session.time, np.arange(29.0), rtol=0, atol=2e-3)
    assert not session.warnings


def test_one_of_several_sheets_is_named(tmp_path):
    joints = {k: v for k, v in table().items() if k[0] in "pq"}
    seen = {k: v for k, v in table().items() if k[0] != "q"}
    book(tmp_path / "a.xlsx", ("Joints", joints), ("Frames", seen))
    with pytest.raises(InputError, match=r"has the sheets Joints, Frames; name one: sheet = "):
        read_session(tmp_path / "a.xlsx", ROBOT)
    (tmp_path / "session.toml").write_text(
        '[joints]\nfile = "a.xlsx"\nsheet = "Joints"\n[frames]\nfile = "a.xlsx"\nsheet = "Frames"\n'
    )
    session = read_session(tmp_path, ROBOT)
    assert len(session.measurements) == 29
    assert len(session.files) == 2
    (tmp_path / "session.toml").write_text('[frames]\nfile = "a.xlsx"\nsheet = "Frame"\n')
    with pytest.raises(InputError, match=r'no sheet "Frame"; .*; did you mean "Frames"'):
        read_session(tmp_path, ROBOT)


def refused(path, **how):
    how = {"sheet": None, "max_mb": 100.0} | how
    with no_hang(), pytest.raises(InputError) as caught:  # to read all of it would take minutes
        read_workbook(path, path.name, **how)
    return str(caught.value)


def test_formulas_are_values_and_without_one_refused(tmp_path):
    file = tmp_path / "a.xlsx"
    out = openpyxl.Workbook()
    for row in (["a", "b"], [1, "=1+1"]):
        out.active.append(row)
    out.save(file)
    assert refused(file) == (
        "a.xlsx: cell B2 has a formula without a value; formulas are read by the values saved with "
        "them; open the workbook, let it compute and save it. [M35]"
    )

    def computed(parts):
        name = "xl/worksheets/sheet1.xml"
        return parts | {name: parts[name].replace(b"<v></v>", b"<v>2</v>").replace(b"<v />",
                        b"<v>2</v>").replace(b"<v/>", b"<v>2</v>")}  # fmt: skip

    changed(file, computed)
    assert read_workbook(file, "a", sheet=None, max_mb=1.0).lines == ("a\tb", "1\t2")


HOSTILE = {
    "macros": (lambda p: p | {"xl/vbaProject.bin": b"MZ"}, "with macros, or a binary one"),
    "entities": (
        lambda p: p | {"xl/styles.xml": b'<!DOCTYPE a [<!ENTITY b "c">]><styleSheet/>'},
        "part xl/styles.xml has a document type; DOCTYPE is not allowed",
    ),
    "entities in UTF-16": (
        lambda p: p | {"xl/styles.xml": '<?xml version="1.0" encoding="utf-16"?><!DOCTYPE a '
                       '[<!ENTITY b SYSTEM "file:///etc/passwd">]><a>&b;</a>'.encode("utf-16")},
        "part xl/styles.xml has a document type",
    ),
    "another encoding": (
        lambda p: p | {"xl/styles.xml": '<?xml version="1.0" encoding="cp037"?><!DOCTYPE a>'.encode(
                       "cp037")},
        "part xl/styles.xml is no XML in UTF-8",
    ),
    "a bomb": (lambda p: p | {"xl/media/a.bin": b"\0" * 50_000_000}, "unpacks 1"),
    "too large": (lambda p: p | {"xl/media/a.bin": b"\0" * 101_000_000}, "unpacks to 101 MB"),
    "many parts": (
        lambda p: p | {f"xl/media/{k}.bin": b"" for k in range(1001)}, "parts, or two of one name",
    ),
    "no sheet": (
        lambda p: {k: v for k, v in p.items() if "sheet1" not in k}, "has no sheet with cells",
    ),
    "half a sheet": (
        lambda p: p | {"xl/worksheets/sheet1.xml": p["xl/worksheets/sheet1.xml"][:-40]},
        "is no sound workbook",
    ),
    "deep": (
        lambda p: p | {"xl/worksheets/sheet1.xml": b"<a>" * 100_000}, "is no sound workbook",
    ),
    "a row of all columns": (
        lambda p: p | {"xl/worksheets/sheet1.xml": p["xl/worksheets/sheet1.xml"].replace(
            b'r="T1"', b'r="XFD1"')}, "has 16384 columns", ),
    "a row far away": (
        lambda p: p | {"xl/worksheets/sheet1.xml": p["xl/worksheets/sheet1.xml"].replace(
            b'<row r="2"', b'<row r="900000000"')}, "has more than 1000000 rows", ),
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_workbook_is_one_sentence(tmp_path, name):
    change, told = HOSTILE[name]
    file = changed(book(tmp_path / "a.xlsx", ("A", table())), change)
    said = refused(file)
    assert told in said, said
    assert said.startswith("a.xlsx: ")
    assert "\n" not in said


def test_a_damaged_workbook_never_escapes(tmp_path):
    """Every 97th byte another one: read, or refused in our words."""
    whole = book(tmp_path / "a.xlsx", ("A", {"a": [1.0], "b": ["x"]})).read_bytes()
    file = tmp_path / "b.xlsx"
    for k in range(0, len(whole), 97):
        file.write_bytes(whole[:k] + bytes([whole[k] ^ 0x55]) + whole[k + 1 :])
        try:
            read_workbook(file, "b.xlsx", sheet=None, max_mb=1.0)
        except InputError as error:
            assert error.where == "b.xlsx"  # noqa: PT017  # both ends are right


def test_what_looks_like_a_workbook_and_is_none_stays_refused_as_text(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.xlsx", "w") as file:
        file.writestr("a.txt", "1")
    with pytest.raises(InputError, match="is an archive or a workbook"):
        read_session(tmp_path / "a.xlsx", ROBOT)
    (tmp_path / "a.csv").write_text(csv(table()))
    (tmp_path / "s.toml").write_text('[frames]\nsheet = "A"\n')
    with pytest.raises(InputError, match=r'has no sheet "A": it is not a workbook'):
        read_session(tmp_path / "a.csv", ROBOT, config=tmp_path / "s.toml")


def test_without_openpyxl_one_sentence_says_what_to_install(tmp_path, monkeypatch):
    file = book(tmp_path / "a.xlsx", ("A", {"a": [1.0]}))
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    assert refused(file) == (
        "a.xlsx: is a workbook, and openpyxl is not installed; pip install 'truebed[xlsx]', or "
        "save the sheet as CSV. [M35]"
    )


def test_a_large_file_is_refused_unread(tmp_path):
    file = book(tmp_path / "a.xlsx", ("A", {"a": np.arange(20_000)}))
    assert "[M36]" in refused(file, max_mb=0.01)
    with pytest.raises(InputError, match="M36"):
        read_session(file, ROBOT, options=ReadOptions(max_mb=0.3))
