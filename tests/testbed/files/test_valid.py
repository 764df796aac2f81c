"""Every number of a measurement file is looked at before anything is computed."""

import numpy as np
import pytest

from calib.errors import InputError
from testbed.files.columns import bound_of, covariance_names, unit_of
from testbed.files.programs.correct import correct_program
from testbed.files.read import ReadOptions, read_session
from testbed.files.table import Columns, DataTable
from testbed.files.text import Sheet
from testbed.files.valid import valid_rows
from tests.testbed.files.made import ROBOT, N, columns, csv, made, with_spread

OPTIONAL = {
    "temperature_degC": 20.0,
    "payload_kg": 0.5,
    "time_s": 1.7e9 + np.arange(29),
    "repeat": 0,
    "reflector_x_mm": 10.0,
    **{f"q{j + 1}_read_deg": np.degrees(made().q[:, j]) for j in range(N)},
}
NO_NUMBERS = ("", "nan", "-inf", "warm")
BEYOND = ("1e300", "-1e308")
SOURCE = '[joints]\nsource = "commanded"\n'
CONFIG = SOURCE + '[frames]\neuler = "XYZ"\n'


def whole():
    """Full poses with every optional column."""
    out = with_spread(columns(made())) | OPTIONAL | {"reflector_y_mm": 0.0, "reflector_z_mm": 0.0}
    return {name: np.broadcast_to(value, 29) for name, value in out.items()}


def covariances():
    """The same with full covariances instead of uncertainties."""
    table = {name: values for name, values in whole().items() if not name.startswith("u")}
    entries = {name: np.full(29, 1e-10 * (name.split("_")[1] == name.split("_")[2]))
               for name in covariance_names()}  # fmt: skip
    return table | entries


def spoiled(table, name, cell, row=16):
    """Text of a table with another cell in a row; line 18 of the file by default."""
    cells = [f"{value:.15g}" for value in table[name]]
    cells[row] = cell
    return csv(table | {name: cells})


def read(folder, text, config=CONFIG, **options):
    (folder / "a.csv").write_text(text)
    (folder / "s.toml").write_text(config)
    return read_session(
        folder / "a.csv", ROBOT, config=folder / "s.toml", options=ReadOptions(**options)
    )


NUMBERS = [name for name in whole() if name != "pose_id"]


@pytest.mark.parametrize("name", NUMBERS)
def test_a_cell_that_is_no_number_is_named_whatever_its_column(name, tmp_path):
    for cell in NO_NUMBERS:
        with pytest.raises(InputError) as caught:
            read(tmp_path, spoiled(whole(), name, cell))
        error = caught.value
        assert (error.code, error.where, error.field) == ("M25", str(tmp_path / "a.csv"), name)
        assert f'1 of 29 rows has cells that are not numbers (line 18 {name} "{cell}"' in str(error)
        assert str(error).endswith("correct them or add --drop-invalid. [M25]")


@pytest.mark.parametrize("name", [*NUMBERS, *covariance_names()])
def test_a_number_beyond_sense_is_refused_with_the_largest_allowed(name, tmp_path):
    table = covariances() if name.startswith("cov") else whole()
    for cell in BEYOND:
        with pytest.raises(InputError) as caught:
            read(tmp_path, spoiled(table, name, cell))
        error = caught.value
        assert (error.code, error.where, error.field) == ("V9", str(tmp_path / "a.csv"), name)
        assert f'line 18 {name} "{cell}"' in str(error)
        assert bound_of(name).allowed(unit_of(name)) in str(error)


@pytest.mark.parametrize("cell", ["", "1e300"])
def test_rows_with_such_cells_are_left_out_on_request_and_named(cell, tmp_path):
    for name in ("temperature_degC", "payload_kg", "time_s", "repeat", "x_mm", "q3_deg", "ux_mm"):
        session = read(tmp_path, spoiled(whole(), name, cell), drop_invalid=True)
        table = session.measurements
        assert len(table) == 28
        assert [text for text in session.warnings if f'(line 18 {name} "{cell}")' in text]
        for values in (table.q, table.position, table.covariance, session.time):
            assert np.isfinite(values).all()
        assert np.isfinite(session.conditions.temperature).all()


def test_a_time_in_words_is_a_warning_still(tmp_path):
    session = read(tmp_path, csv(whole() | {"time": ["noon"] * 29, "time_s": np.arange(29.0)}))
    assert session.time is not None


@pytest.mark.parametrize("cell", BEYOND)
def test_a_target_beyond_sense_never_reaches_a_corrected_program(cell, tmp_path):
    targets = columns(made())
    joints = {name: values for name, values in targets.items() if name[0] == "q"}
    frames = {name: values for name, values in targets.items() if name[0] in "xyzr"}
    for table, name in ((joints, "q2_deg"), (frames | {"euler": ["XYZ"] * 29}, "x_mm")):
        program, out = tmp_path / "p.csv", tmp_path / "out.csv"
        program.write_text(spoiled(table, name, cell))
        with pytest.raises(InputError, match=rf"^p.csv: 1 of 29 rows .*line 18 {name}") as caught:
            correct_program(program, ROBOT, ROBOT.model, out)
        assert caught.value.code == "V9"
        assert "is at most" in str(caught.value)
        assert "--drop-invalid" not in str(caught.value)
        assert not out.exists()


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_a_table_without_names_is_refused_or_read_by_number(separator, tmp_path):
    lines = csv(whole(), separator=separator).split("\n")
    with pytest.raises(InputError, match="name the columns, or say header = false") as caught:
        read(tmp_path, "# measured by hand\n" + "\n".join(lines[1:]))
    assert caught.value.where == f"{tmp_path / 'a.csv'}:2"
    assert 'line 2 holds numbers ("1")' in str(caught.value)
    numbered = "\n".join(f'{name} = "{k + 1}"' for k, name in enumerate(whole()))
    config = CONFIG + f"[dialect]\nheader = false\n[frames.columns]\n{numbered}\n"
    session = read(tmp_path, "\n".join(lines[1:]), config)
    named = read(tmp_path, "\n".join(lines))
    np.testing.assert_array_equal(session.measurements.q, named.measurements.q)
    assert len(session.measurements) == 29
    assert session.place[0].endswith("a.csv:1")


def test_a_program_without_names_is_refused(tmp_path):
    joints = {name: values for name, values in columns(made()).items() if name[0] == "q"}
    program, out = tmp_path / "p.csv", tmp_path / "out.csv"
    program.write_text("\n".join(csv(joints).split("\n")[1:]))
    with pytest.raises(InputError, match=r"^p.csv:1: line 1 holds numbers"):
        correct_program(program, ROBOT, ROBOT.model, out)
    assert not out.exists()


@pytest.mark.parametrize(
    ("cells", "fix"),
    [
        (["12.5 mm"] * 8, "write numbers alone in these cells, and their unit in the column's"),
        ([""] * 7 + ["12.5"], "correct them or add --drop-invalid"),  # a log of few readings
        (["12.5"] * 7 + ["12.5 mm"], "correct them or add --drop-invalid"),
    ],
)
def test_rows_none_of_which_would_be_left_are_not_to_be_dropped(cells, fix):
    sheet = Sheet("a.csv", ("x_mm",), tuple((cell,) for cell in cells), (2,) * 8, "comma", "UTF-8")
    with pytest.raises(InputError, match="cells that are not numbers") as caught:
        valid_rows(DataTable(sheet, {"x_mm": "x_mm"}), Columns(("x_mm",)), drop=False)
    assert fix in str(caught.value)


@pytest.mark.parametrize("turned", [True, False], ids=["poses", "points"])
def test_rows_with_nothing_in_any_cell_of_the_reading_saw_nothing_and_are_named(tmp_path, turned):
    """Frames that a camera dropped were refused, with advice that `new session` could not take."""
    noise = "[uncertainty]\nposition_um = 20\nrotation_mdeg = 10\n"
    table, config = columns(made()), (CONFIG if turned else SOURCE) + noise
    seen = [name for name in table if name[:2] in ("x_", "y_", "z_", "rx", "ry", "rz")]
    if not turned:
        table = {name: values for name, values in table.items() if not name.startswith("r")}
    seen = [name for name in seen if name in table]
    blank = {3, 7, 20}

    def text(names):
        cells = {
            name: [
                "" if name in names and row in blank else f"{value:.15g}"
                for row, value in enumerate(np.broadcast_to(values, 29))
            ]
            for name, values in table.items()
        }
        return csv(cells)

    session = read(tmp_path, text(seen), config)
    assert len(session.measurements) == 26
    kept = np.delete(made().q, sorted(blank), axis=0)
    np.testing.assert_allclose(session.measurements.q, kept, atol=1e-12)
    told = "3 of 29 rows have nothing in the cells of the reading (line 5, line 9 and line 22)"
    assert any(told in warning for warning in session.warnings)
    with pytest.raises(InputError) as caught:  # a part of a reading is a fault of the file
        read(tmp_path, text(seen[1:]), config)
    assert caught.value.code == "M25"
    blank |= set(range(29))
    with pytest.raises(InputError) as caught:
        read(tmp_path, text(seen), config)
    assert caught.value.code == "M25"
