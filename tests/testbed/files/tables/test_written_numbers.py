"""Numbers as programs and people write them: exponents of Fortran, thousands marks, quotes.

Truth: the files are written here from poses that are known.
"""

import numpy as np
import pytest

from calib.errors import InputError
from testbed.files.dialects.marks import Column, Marks, marks_of
from testbed.files.table import table_of
from testbed.files.text import read_sheet
from testbed.gates.text import read_text
from testbed.proposal.data import look_at
from testbed.proposal.session import propose_session
from tests.testbed.files.made import csv
from tests.testbed.proposal.test_dialects import read_as_meant
from tests.testbed.proposal.test_odd_files import DEG, MM, M, grouped_places, joints, places

COMMAS = {f"J{k + 1}": [f"{v:.12f}".replace(".", ",") for v in DEG[:, k]] for k in range(6)}
POINTS = {f"J{k + 1}": [f"{v:.12f}" for v in DEG[:, k]] for k in range(6)}
QUOTED = [f'"{v:.12f}"' for v in np.column_stack([DEG, MM]).ravel()]
NAMES = [*(f'"J{k}"' for k in range(1, 7)), '"X"', '"Y"', '"Z"']


def rows_of(mark, before=None):
    """Rows of numbers in quotes, or of plain ones behind names in quotes."""
    rows = np.array(QUOTED).reshape(M, 9)
    if before is None:
        return [mark.join(row) for row in rows]
    return [mark.join([f'"{k + 1}"', *(cell.strip('"') for cell in row)])
            for k, row in enumerate(rows)]  # fmt: skip


WRITTEN = {
    "exponents of Fortran": csv(joints("J{}") | places("{}"), form="{:.14E}").replace("E", "D"),
    "the same without names": "\n".join(
        " ".join(f"{v:.14e}".replace("e", "d") for v in row) for row in np.hstack([DEG, MM])
    ),
    "points between thousands": csv(COMMAS | grouped_places(".,"), separator=";"),
    "commas between thousands": csv(POINTS | grouped_places(",."), separator="\t"),
    "commas between thousands, in quotes": csv(
        POINTS | {axis: [f'"{cell}"' for cell in cells] for axis, cells in
                  grouped_places(",.").items()}
    ),
    "apostrophes between thousands": csv(POINTS | grouped_places("\u2019."), separator=";"),
    "narrow spaces between thousands": csv(COMMAS | grouped_places("\u202f,"), separator=";"),
    "apostrophes around numbers": csv(
        {name: [f"'{cell}'" for cell in cells] for name, cells in (POINTS | grouped_places(",."))
         .items()}, separator=";"
    ).replace("J1", "'J1'"),
    "quotes around cells between spaces": "\n".join([" ".join(NAMES), *rows_of(" ")]),
    "names of rows, as by R": "\n".join([" ".join(NAMES), *rows_of(" ", "names")]),
    "names of rows, as by R with commas": "\n".join([",".join(NAMES), *rows_of(",", "names")]),
}  # fmt: skip


@pytest.mark.parametrize("text", WRITTEN.values(), ids=WRITTEN)
def test_numbers_are_read_as_they_were_meant(text, tmp_path):
    read_as_meant(text, tmp_path)


def test_the_size_of_numbers_with_thousands_marks_tells_their_unit(tmp_path):
    """Without a robot millimeters were taken for meters."""
    (tmp_path / "m.csv").write_text(csv(COMMAS | grouped_places(".,"), separator=";"))
    found = propose_session(look_at([tmp_path / "m.csv"], tmp_path), None, tmp_path)
    assert found.document["points"]["columns"] == {f"{a.lower()}_mm": a for a in "XYZ"}


def found(*cells, unit="mm", **how):
    column = Column(f"x_{unit}", "X", cells)
    return marks_of("m.csv", range(2, 2 + len(cells)), [column], **how)


@pytest.mark.parametrize(
    ("cells", "marks"),
    [
        (("1.234,5", "0,25"), Marks(",", ".")),
        (("-1,234,567", "12.5"), Marks(".", ",")),
        (("1'234", "0.25"), Marks(".", "'")),
        (("1 234,5e-1", "1"), Marks(",", " ")),
        (("1,25", "2"), Marks(",")),
    ],
)
def test_marks_are_told_by_all_numbers_together(cells, marks):
    assert found(*cells) == marks


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        (("1.234.567", "2345.6"), r'm.csv:2: X is "1.234.567", which has thousands marks'),
        (("1.234,5", "1'234"), r'm.csv:3: X is "1\'234", which has thousands marks'),
        (("1.234,5", "0.25"), "have a decimal comma .* and a point"),
        (("1 234", "5"), "which has thousands marks"),  # or two numbers
        (("0.123,5", "5"), "which has thousands marks"),
        (("1,234", "2,345"), "may have a decimal comma or thousands marks"),
    ],
)
def test_marks_that_may_mean_two_things_are_refused(cells, message):
    with pytest.raises(InputError, match=message):
        found(*cells)


def test_beside_a_stated_mark_and_in_turns_nothing_is_a_thousands_mark(tmp_path):
    """A slip of the pen among them would be read a thousand times too large."""
    (tmp_path / "m.csv").write_text("x_mm;y_mm\n-1,700823;0,5\n-1.776;0,25\n-1.775,629;1\n")
    sheet = read_sheet(read_text(tmp_path / "m.csv", "m.csv"))
    table = table_of(sheet, {name: name for name in sheet.head}, decimal=",")
    seen = table.numbers(("x_mm", "y_mm"))
    np.testing.assert_array_equal(seen, [[-1.700823, 0.5], [np.nan, 0.25], [np.nan, 1.0]])
    assert found("57,931", "-1,5", unit="deg") == Marks(",")
    with pytest.raises(InputError, match="thousands marks"):
        found("1.057,931", unit="deg")
    with pytest.raises(InputError, match="thousands marks"):  # as in programs
        found("1,234.5", grouped=False)
