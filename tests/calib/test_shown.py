"""Results in one line and as tables: what a console and a notebook show of each kind of them."""

from dataclasses import fields, is_dataclass

import numpy as np
import pytest

import calib
from calib.design import Problem, best_next, exchange, pose_budget, pose_count
from calib.design.relaxation import relaxation
from calib.geometry.inverse import inverse_kinematics
from calib.geometry.many import ManyModels
from calib.identification.ladders import ladders_of
from calib.identification.many.tables import ManyTables
from calib.identification.model_choice import choose
from calib.identification.outliers.search import search_outliers
from calib.measurement.residual import linearize
from calib.shown import Shown, length_unit, length_words
from calib.uncertainty.adaptive import adaptive
from calib.uncertainty.bootstrap import bootstrap
from calib.uncertainty.budget import RowNoise, budget
from calib.uncertainty.monte_carlo import distance_spread, point_spread
from calib.uncertainty.refit import freeze
from calib.uncertainty.statement.conformity import conformity
from calib.uncertainty.type_a import best_budget
from calib.uncertainty.type_b import common_inputs
from calib.uncertainty.validation import first_order, validate
from tests.calib.design.design_cases import small_criterion, small_goals, small_pool
from tests.calib.kinds import joints, true_robot
from tests.calib.test_calibration import poses_of
from tests.reference import TX60_LIMITS, tx60

PLAIN = {"ratio", "bias", "gain", "figure", "reached", "possible", "mean", "sd", "p_value", "risk",
         "residual", *(f"q{k}" for k in range(1, 7))}  # fmt: skip
"""Columns without a unit of their own: shares, standard deviations, indices, joints [rad, m]."""
UNITS = ("_m", "_rad", "_um", "_mm", "_deg", "_s")


def squares(inputs):
    return inputs[:, :2] ** 2


@pytest.fixture(scope="module")
def results():
    """One of each kind, by its name: of a calibration, designs, budgets and simulations."""
    rng = np.random.default_rng(1)
    true = true_robot("tx60", rng)
    train, test = poses_of(true, joints("tx60", rng, 60), rng).split(held_out=20, seed=3)
    found = calib.calibrate(tx60(), train)
    model, fit, numbers = found.model, found.identification, len(found.model.names)
    problem = Problem.of_blocks(small_pool(0, 30, 3), 8, small_criterion("V"))
    given = Problem.of_blocks(small_pool(0, 30, 3), 8, small_criterion("V"), given=[0, 1, 2, 3])
    offset = np.tile(np.eye(6)[:, :1], (len(train), 1, 1))
    noise, common = RowNoise("noise", train.covariance), common_inputs(("offset",), offset, [1e-10])
    parts = budget(freeze(model, train, fit.parameters), (noise,), common=common)
    linear = first_order(squares, [1.0, 2.0, 3.0], 1e-4 * np.eye(3))
    drawn = adaptive(
        lambda n, own: squares([1.0, 2.0, 3.0] + 1e-2 * own.normal(size=(n, 3))), rng, digits=1
    )
    made = (
        found,
        calib.judge(fit, test, train=train, rng=rng, replicates=100),
        calib.compensate(found.start.model, model, test.q),
        choose(found.start.model, train, rng=rng),
        search_outliers(found.start.model, fit, train),
        relaxation(problem), exchange(problem, rng), pose_budget(problem, 0.9, rng),
        pose_count(problem, rng, sets=5), best_next(given),
        parts, parts.at_tool(model, test.q), common,
        bootstrap(model, train, fit.parameters, rng, replicates=100),
        best_budget(rng.normal(size=(5, 4)), 0.1),
        linear, drawn, validate(linear.value, linear.covariance, drawn, digits=1),
        distance_spread(model, test.q, np.full(numbers, 1e-5), rng, draws=100),
        point_spread(model, test.q, 1e-10 * np.eye(numbers), rng, draws=100),
        conformity(np.zeros((3, 3)), np.tile(1e-12 * np.eye(3), (3, 1, 1)), 1e-5),
        inverse_kinematics(model, model.poses(test.q), test.q, TX60_LIMITS),
        calib.SinglePoses.of(model), ManyModels.of(model, 3), ManyTables.of([train]),
        linearize(model, train), tuple(ladders_of(model)), small_goals(0),
    )  # fmt: skip
    kinds: dict[str, Shown] = {}
    open_, seen = list(made), set()
    while open_:
        one = open_.pop(0)
        if id(one) in seen:
            continue
        seen.add(id(one))
        if isinstance(one, Shown):
            kinds.setdefault(type(one).__name__, one)
        if is_dataclass(one):
            open_ += [getattr(one, field.name) for field in fields(one)]
        elif isinstance(one, tuple):
            open_ += one
    return kinds


def test_every_result_is_one_line_of_words_and_numbers(results):
    assert len(results) > 40  # else what leads to them was lost
    for name, one in results.items():
        line = repr(one)
        assert line.startswith(f"{name}("), line
        assert line.endswith(")"), line
        assert "\n" not in line
        for inside in ("array(", "object at", "nan", "None", "dtype"):
            assert inside not in line, line


def test_every_table_has_whole_columns_whose_units_are_known(results):
    tables = [(f"{name}.{key}", table) for name, one in results.items()
              for key, table in one.tables().items()]  # fmt: skip
    assert len(tables) > 20
    for name, table in tables:
        assert repr(table).startswith(f"ResultTable({table.rows} rows of ")
        for column, values in table.items():
            assert len(values) == table.rows > 0, name
            if values.dtype.kind == "f":
                known = column.endswith(UNITS) or column in PLAIN or "unit" in table
                assert known, f"{name}: {column}"
                # a level that was not offered has no gain
                assert np.isfinite(values).all() or column == "gain", f"{name}: {column}"


def test_tables_say_what_the_results_say(results):
    """Independent sources add by their squares; the rest of a target is its distance."""
    whole, tool = results["Budget"], results["ToolBudget"]
    table = whole.tables()["numbers"]
    parts = np.square([table[name] for name in whole.names]).sum(axis=0)
    np.testing.assert_allclose(np.sqrt(parts), table["combined"], rtol=1e-12)
    of_length = np.array([(name[0] in "ad" and not name.startswith("alpha")) or name.endswith(
        (".x", ".y", ".z")) for name in table["name"].tolist()])  # fmt: skip
    np.testing.assert_array_equal(table["unit"] == "m", of_length)
    u = tool.tables()["sources"]["u_m"]
    assert np.square(u).sum() == pytest.approx(np.square(tool.combined).mean(), rel=1e-12)
    corrected = results["Correction"]
    targets = corrected.tables()["targets"]
    np.testing.assert_array_equal(targets["left_m"], corrected.position_error)
    np.testing.assert_array_equal(
        np.column_stack([targets[f"q{k}"] for k in range(1, 7)]), corrected.q
    )
    ranking = results["Ranking"].tables()["poses"]
    assert (np.diff(ranking["gain"]) <= 0).all()
    curve = results["PoseBudget"].tables()["curve"]
    assert (curve["possible"] <= curve["reached"] * (1 + 1e-9)).all()  # a bound, to rounding


@pytest.mark.parametrize(
    ("length", "said"),
    [(0.0, "0 um"), (3.14e-6, "3.1 um"), (999.4e-6, "999 um"), (999.6e-6, "1.00 mm"),
     (1e-3, "1.00 mm"), (4.3074e-3, "4.31 mm"), (0.0127, "12.7 mm"), (1.2345, "1234 mm")],
)  # fmt: skip
def test_a_length_is_said_in_millimeters_from_where_three_digits_reach_one(length, said):
    assert length_words(length) == said
    # whatever the digits of its micrometers, no thousand of them is written
    for form in (".1f", ".3g", "#.3g", ".0f"):
        number, unit = length_words(length, um=form).split()
        assert "e" not in number
        assert unit == said.split()[1]
        assert unit == "mm" or float(number) < 1000


def test_lengths_that_are_read_side_by_side_have_the_unit_of_the_largest():
    assert length_words(26.4e-6, 4.3e-3) == "0.0264 mm"
    assert length_words(3e-9, 4.3e-3) == "0.003 um"  # it was "3.00e-06 mm"
    assert length_unit([26.4e-6, -4.3e-3]) == (1e3, "mm")
    assert length_unit([]) == length_unit([26.4e-6, np.inf, np.nan]) == (1e6, "um")
