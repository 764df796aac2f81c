"""What results show of themselves: one line, a page in a notebook, tables for pandas and Arrow."""

import sys
from html.parser import HTMLParser
from inspect import getmembers, isclass

import numpy as np
import pytest

import calib
import truebed
from calib.errors import InputError
from calib.shown import ROWS, ResultTable, Shown, concatenated, decimals
from testbed.robots.catalog import load_robot


@pytest.fixture(scope="module")
def calibrated(campaign):
    train, _ = campaign.trials[1].measurements.split(held_out=9, seed=0)
    return calib.calibrate(campaign.setting.nominal, train)


class Opened(HTMLParser):
    """Tags that are not closed, and the text."""

    def __init__(self, html):
        super().__init__()
        self.open, self.text = [], []
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def results(campaign, calibrated):
    trial = campaign.trials[0]
    _, test = campaign.trials[1].measurements.split(held_out=9, seed=0)
    judged = calibrated.judge(test)
    yield from (campaign, trial, trial.estimates[0], trial.estimates[0].comparison)
    yield from (trial.selection, trial.observability, trial.measurements, campaign.setting)
    yield from (calibrated, calibrated.identification, judged, judged.held_out, judged.belief)
    yield load_robot("staubli_tx60")


def test_a_result_prints_as_one_line_and_shows_well_formed_html(campaign, calibrated):
    for result in results(campaign, calibrated):
        line = repr(result)
        assert "\n" not in line
        assert len(line) < 400, line
        page = Opened(result._repr_html_())
        assert not page.open
        assert line in "".join(page.text)


def test_every_result_at_the_doors_of_calib_shows_itself():
    found = {
        kind
        for room in (calib, calib.design, calib.uncertainty)
        for name in dir(room)
        if isclass(kind := getattr(room, name)) and hasattr(kind, "__dataclass_fields__")
    }
    assert len(found) > 10
    inputs = {"Circumstances", "RowNoise"}  # handed in, never handed out
    assert {kind.__name__ for kind in found if not issubclass(kind, Shown)} <= inputs


def test_a_name_in_a_table_runs_nothing_in_a_notebook():
    table = ResultTable({"<b>name": ["<script>alert(1)</script>"]})
    assert "<script>" not in table._repr_html_()
    assert "<b>name" not in table._repr_html_()


def test_columns_are_of_one_length_and_single_values_fill_theirs():
    table = ResultTable({"trial": "a", "pose": [3, 4], "mm": 0.5})
    assert table.rows == 2
    assert list(table["trial"]) == ["a", "a"]
    assert concatenated([table, table])["pose"].tolist() == [3, 4, 3, 4]
    with pytest.raises(ValueError, match="shape"):
        ResultTable({"a": [1, 2], "b": [1, 2, 3]})


def test_numbers_have_the_digits_of_their_uncertainty():
    table = ResultTable({"value": [290.01234], "U": [0.0123]}, precision="U")
    assert ">290.012<" in table._repr_html_()
    assert [decimals(u) for u in (0.0123, 1.0, 9.99, 10.0, np.nan)] == [3, 1, 1, 0, 6]


def test_a_long_table_is_cut_in_a_notebook_only():
    table = ResultTable({"row": np.arange(ROWS + 5)})
    assert table._repr_html_().count("<tr>") == ROWS + 1
    assert "5 more rows" in table._repr_html_()


def test_the_table_of_numbers_says_what_the_summary_does(calibrated):
    table = calibrated.tables()["numbers"]
    for name, value, U, unit in zip(*table.values(), strict=True):
        (line,) = (line for line in calibrated.summary().splitlines() if line.split()[:1] == [name])
        _, shown, stated, of = line.split()
        assert of == unit
        assert float(shown) == pytest.approx(value, abs=U / 10)
        assert float(stated) == pytest.approx(U, rel=0.06)  # two digits
    fit = calibrated.identification
    k = fit.names.index("a2")  # a link's number is listed as it is estimated
    assert table["U"][k] == pytest.approx(2e3 * fit.standard_uncertainty[k], rel=1e-9)
    assert table["value"][k] == pytest.approx(1e3 * fit.model.chain.links[1, 2], rel=1e-12)


def test_residuals_and_errors_are_those_of_the_model(campaign, calibrated):
    seen, model = calibrated.measured, calibrated.model
    rest = np.column_stack([calibrated.tables()["residuals"][k] for k in ("x_m", "y_m", "z_m")])
    off = seen.position - model.poses(seen.q)[:, :3, 3]
    np.testing.assert_allclose(rest, off, rtol=0, atol=1e-12)
    estimate = campaign.trials[0].estimates[0]
    errors = campaign.tables()["errors"]
    assert errors["after_mm"][: len(estimate.inside)].mean() == pytest.approx(
        1e3 * estimate.comparison.accuracy_after.mean
    )


def test_frames_hold_the_table_where_their_packages_are(calibrated):
    pandas = pytest.importorskip("pandas")
    table = calibrated.tables()["numbers"]
    frame = calibrated.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert list(frame.columns) == list(table)
    np.testing.assert_array_equal(frame["value"], table["value"])
    residuals = calibrated.to_pandas("residuals")
    residuals["x_m"] *= 2  # a frame is the user's own


def test_arrow_holds_the_same(campaign):
    pytest.importorskip("pyarrow")
    arrow = campaign.to_arrow("errors")
    np.testing.assert_array_equal(arrow["after_mm"], campaign.tables()["errors"]["after_mm"])
    assert str(arrow.schema.field("inside").type) == "bool"


@pytest.mark.parametrize(("package", "name"), [("pandas", "to_pandas"), ("pyarrow", "to_arrow")])
def test_a_missing_package_is_one_sentence(calibrated, monkeypatch, package, name):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(InputError, match=rf"needs the package {package}.*truebed\[frames\]"):
        getattr(calibrated, name)()


def test_a_table_that_is_not_there_names_those_that_are(calibrated):
    with pytest.raises(InputError, match=r"table is nubers; expected one of numbers, residuals"):
        calibrated.to_pandas("nubers")
    with pytest.raises(InputError, match="Chain has no table"):
        calibrated.model.chain.to_arrow()


def test_load_says_what_a_test_after_iso_9283_is(tmp_path):
    rng = np.random.default_rng(1)
    lines = ["pose_id,cycle,x_mm,y_mm,z_mm,command_x_mm,command_y_mm,command_z_mm"]
    for cycle in range(1, 31):
        for pose in range(1, 6):
            x, y, z = 100 * pose + 0.02 * rng.normal(size=3)
            lines.append(f"{pose},{cycle},{x},{y},{z},{100 * pose},{100 * pose},{100 * pose}")
    (tmp_path / "cycles.csv").write_text("\n".join(lines) + "\n")
    result = truebed.iso9283(tmp_path / "cycles.csv", tmp_path / "iso")
    tested = truebed.load(tmp_path / "iso")
    assert "the folder of a test after ISO 9283" in repr(tested)
    written, figures = tested.tables()["iso9283"], result.tables()["figures"]
    np.testing.assert_allclose(written["value"], figures["value"], rtol=1e-5)  # six digits
    assert list(written["figure"]) == list(figures["figure"])
    assert "RP" in repr(result)
    with pytest.raises(InputError, match="is not a run folder"):
        truebed.load(tmp_path)


def test_members_of_shown_are_no_fields():
    """They would be stored with every record."""
    assert not getattr(Shown, "__dict__", {}).get("__dataclass_fields__")
    assert Shown.__slots__ == ()
    assert {name for name, _ in getmembers(Shown) if not name.startswith("_")} == {
        "tables",
        "to_arrow",
        "to_pandas",
    }
