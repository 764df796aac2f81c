"""What no table may be, whoever reads it: too large, another program's, a cell without end."""

import io
import math
import os
import pickle

import numpy as np
import pytest

from calib.errors import InputError
from testbed.files.programs.correct import correct_program
from testbed.files.read import ReadOptions, read_session
from testbed.gates.text import MAX_LINE, read_text, split
from testbed.laboratory.joint_lists import read_joints
from testbed.robots.catalog import load_robot

ROBOT = load_robot("staubli_tx60")
HEAD = "pose_id,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm,note\n"
ROWS = "".join(f"p{k},{k},2,3,4,5,6,700,{k},300,\n" for k in range(1, 30))
READERS = {
    "measurements": lambda path: read_session(path, ROBOT),
    "program": lambda path: correct_program(path, ROBOT, ROBOT.model, path.parent / "new.csv"),
    "joint list": lambda path: read_joints(ROBOT, path),
}


@pytest.fixture(params=READERS)
def told(request, tmp_path):
    """The sentence with which one reader refuses a file; nothing is written."""
    path = tmp_path / "a.csv"

    def call(content=None):
        if content is not None:
            path.write_bytes(content if isinstance(content, bytes) else content.encode())
        with pytest.raises(InputError) as caught:
            READERS[request.param](path)
        assert [*tmp_path.iterdir()] == [path]
        return str(caught.value).removeprefix(f"{tmp_path}/")

    return call


@pytest.mark.parametrize(
    ("cell", "column"),
    [("p1", 1), ("2", 3), ("300", 10), ('"' + "x" * 140_000 + '"', 11)],
    ids=["a name", "a joint", "a coordinate", "a quoted note"],
)
def test_a_cell_of_more_characters_than_a_line_may_have_is_named_by_line_and_column(
    told, cell, column
):
    cells = ["p1", "1", "2", "3", "4", "5", "6", "700", "1", "300", ""]
    cells[column - 1] = cell if len(cell) > 10 else cell * 140_000
    line = ",".join(cells)
    assert told(f"{HEAD}{ROWS}{line}\n{ROWS}") == (
        f"a.csv:31: has {len(line)} bytes, and too many in column {column}; expected at most 65536 "
        "bytes a line; save one measurement a line, a number or a name in each column. [M36]"
    )


@pytest.mark.parametrize(
    "note", ['"open', '"a","b', 'x","y', '"a""', '""",', '"a" "'], ids=lambda text: text
)
def test_a_quote_that_is_open_at_the_end_of_its_line_takes_in_no_other(told, note):
    row = f"p1,1,2,3,4,5,6,700,1,300,{note}"
    wanted = "a quote is not closed in its line; close or remove it. [M35]"
    assert told(f"{HEAD}{ROWS}{row}\n{ROWS * 400}") == f"a.csv:31: {wanted}"
    assert told(f"{HEAD}{ROWS}{row}") == f"a.csv:31: {wanted}"


def test_quotes_that_are_closed_hold_what_they_hold():
    lines = [(1, 'a,"b,c"'), (4, '"d ""e""", f')]
    assert split(lines, "comma", "x") == [["a", "b,c"], ['d "e"', "f"]]


PROGRAMS = {
    "a KRL program (KUKA)": ["&ACCESS RVP", "DEF cal( )", "PTP {A1 10,A2 -90,A3 90,A4 0}", "END"],
    "a TP program (FANUC)": ["/PROG  CAL", "/MN", "   1:J P[1] 100% FINE ;", "/POS", "P[1]{", "};"],
    "an INFORM job (Yaskawa)": ["/JOB", "//NAME CAL", "//POS", "///NPOS 1,0,0,0,0,0", "C0=1,2,3"],
    "a URScript program (Universal Robots)": ["def cal():", "  movej([0.1,-1.5,1,0,0.5,0])", "end"],
    "a VAL3 program (Stäubli)": ["begin", "  jPose[0]={1, 2, 3, 4, 5, 6}", "  movej(jPose[0],t,m)"],
}


@pytest.mark.parametrize("name", PROGRAMS)
def test_programs_of_controllers_are_called_by_their_names(told, name):
    said = told("\n".join(PROGRAMS[name]))
    assert said.startswith(f"a.csv: is {name}, and a table is wanted here; write its joint targets")


def test_a_program_of_rapid_is_no_table_of_targets(tmp_path):
    path = tmp_path / "a.mod"
    path.write_text("CONST jointtarget p1 := [[1,2,3,4,5,6],[9E9,9E9,9E9,9E9,9E9,9E9]];\n")
    with pytest.raises(InputError, match="is a RAPID program; targets are corrected in tables"):
        READERS["program"](path)


@pytest.mark.parametrize("error", ["#N/A", "#NV", "#DIV/0!", "#REF!", "#NAME?", '"#WERT!"'])
def test_a_row_that_begins_with_what_could_not_be_computed_is_no_comment(tmp_path, error):
    path = tmp_path / "a.csv"
    path.write_text(f"{HEAD}{error},1,2,3,4,5,6,700,1,300,\n# {error}, is no number\n#a,b\n{ROWS}")
    assert [line for line, _ in read_text(path, "a.csv").content("#")][:3] == [1, 2, 5]


def packed(save, **arrays):
    buffer = io.BytesIO()
    save(buffer, **arrays)
    return buffer.getvalue()


class Trap:
    """Ends the process if anyone unpickles it."""

    def __reduce__(self):
        return os._exit, (99,)


FOREIGN = {
    **{f"pickle {k}": (pickle.dumps(Trap(), k), "a Python pickle", "S39") for k in (2, 3, 4, 5)},
    "npz": (packed(np.savez, a=np.ones(3)), "an archive or a workbook (zip, npz, xlsx)", "M36"),
    "npy of objects": (
        packed(lambda to: np.save(to, np.array([Trap()], dtype=object))), "a NumPy array", "S39",
    ),
    "mat": (b"MATLAB 5.0 MAT-file, written by hand", "a MATLAB file", "S39"),
    "gzip": (b"\x1f\x8b\x08\0", "a gzip archive", "M36"),
}  # fmt: skip


@pytest.mark.parametrize("name", FOREIGN)
def test_the_file_of_another_program_is_neither_unpacked_nor_unpickled(told, name):
    content, what, code = FOREIGN[name]
    assert told(content) == (
        f"a.csv: is {what}; measurements are read from text only, and nothing is unpacked; save "
        f"the table as CSV. [{code}]"
    )


def test_a_sparse_file_of_gigabytes_is_refused_unread(told, tmp_path):
    with (tmp_path / "a.csv").open("wb") as file:
        file.truncate(5 * 10**9)  # takes no room
    assert told().startswith("a.csv: is 5e+03 MB; expected at most 1")


def test_a_pipe_is_not_waited_for(told, tmp_path):
    os.mkfifo(tmp_path / "a.csv")
    assert told() == "a.csv: is not a file; check the path. [M35]"


@pytest.mark.parametrize("size", [math.nan, 0.0, -1.0, math.inf, 1e300])
def test_a_largest_size_that_no_file_has_is_refused_by_its_option(size):
    with pytest.raises(InputError, match=r"^--max-mb is .*; it must be above 0 and at most 1") as e:
        ReadOptions(max_mb=size)
    assert e.value.code == "C41"


def test_a_line_as_long_as_it_may_be_is_read():
    assert split([(1, "x" * MAX_LINE + ',"y"')], "comma", "x")[0][1] == "y"
