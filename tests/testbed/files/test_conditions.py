"""What rows and targets say of payload, tool and temperature: read as it was written."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.model import RobotModel
from calib.identification.ladders import ladders_of
from calib.identification.levels import with_errors
from calib.uncertainty.statement.conditions import NOT_STATED, Conditions
from testbed.files.conditions import SetUp, first_stated, joined
from testbed.files.programs.correct import correct_program
from testbed.files.read import ReadOptions, read_session
from testbed.identify.session import with_test
from tests.testbed.files.made import ROBOT, N, columns, csv, made, with_spread

M = 29
PAYLOAD = np.linspace(0, 7, M)
WARMTH = np.linspace(20.0, 23.5, M)
TOOLS = ["probe"] * 20 + ["gripper"] * 9


def rows(**more):
    """Full poses with further columns."""
    return with_spread(columns(made())) | {"euler": ["XYZ"] * M} | more


def read(folder, table, toml="", name="a", **dialect):
    (folder / f"{name}.csv").write_text(csv(table, **dialect))
    (folder / f"{name}.toml").write_text(f"{toml}\n[frames]\n")
    return read_session(folder / f"{name}.csv", ROBOT, config=folder / f"{name}.toml")


@pytest.mark.parametrize(("separator", "decimal"), [(",", "."), (";", ",")])
def test_columns_come_back_row_by_row(tmp_path, separator, decimal):
    table = rows(payload_kg=PAYLOAD, tool=TOOLS, temperature_degC=WARMTH)
    session = read(tmp_path, table, separator=separator, decimal=decimal)
    # fifteen digits are written
    np.testing.assert_allclose(session.conditions.payload, PAYLOAD, atol=1e-13)
    np.testing.assert_allclose(session.conditions.temperature, WARMTH, atol=1e-13)
    assert session.conditions.tool == tuple(TOOLS)
    assert not session.warnings
    some = session.rows(np.arange(M) >= 20)
    assert some.conditions.tool == ("gripper",) * 9
    assert some.conditions.payload.tolist() == session.conditions.payload[20:].tolist()


def test_columns_of_another_name_are_mapped(tmp_path):
    toml = '[frames.columns]\npayload_kg = "Last"\ntool = "Werkzeug"'
    (tmp_path / "s.toml").write_text(toml)
    (tmp_path / "a.csv").write_text(csv(rows(Last=PAYLOAD, Werkzeug=TOOLS)))
    session = read_session(tmp_path / "a.csv", ROBOT, config=tmp_path / "s.toml")
    assert session.conditions.stated == ("payload", "tool")
    assert session.conditions.tool == tuple(TOOLS)


def test_one_statement_for_a_whole_session(tmp_path):
    toml = (
        '[conditions]\npayload_kg = 2.5\ntool = "probe"\ntemperature_degC = -4.0\n'
        "date = 2026-11-22\npayload_tolerance_kg = 0\ntemperature_tolerance_k = 0.5\n"
        '[use]\npayload_kg = 5.0\ntool = "gripper"\n'
    )
    session = read(tmp_path, rows(), toml)
    assert session.conditions.payload.tolist() == [2.5] * M
    assert session.conditions.tool == ("probe",) * M
    assert session.conditions.temperature.tolist() == [-4.0] * M
    kept = session.set_up
    assert kept.date == "2026-11-22"  # a day of TOML, or the same as text
    assert read(tmp_path, rows(), '[conditions]\ndate = "2026-11-22"').set_up.date == kept.date
    assert (kept.tolerance.payload, kept.tolerance.temperature) == (0.0, 0.5)
    assert kept.use.payload.tolist() == [5.0]
    assert kept.use.tool == ("gripper",)
    assert kept.use.temperature is None


def test_who_says_nothing_has_the_usual_tolerances(tmp_path):
    session = read(tmp_path, rows(tool=[""] * M))  # a column without any name is no column
    assert session.conditions.stated == ()
    assert (session.set_up.tolerance.payload, session.set_up.tolerance.temperature) == (0.5, 2.0)
    assert session.set_up.use.stated == ()
    assert session.set_up.date == ""


@pytest.mark.parametrize("day", ["2026-13-01", "20261122", "2026-W47-7", "22.11.2026", ""])
def test_a_date_is_a_day_that_everybody_reads_the_same_way(tmp_path, day):
    with pytest.raises(InputError, match="should be an ISO day"):
        read(tmp_path, rows(), f'[conditions]\ndate = "{day}"')


def test_rows_left_out_take_their_conditions_with_them(tmp_path):
    cells = [f"{x:g}" for x in PAYLOAD]
    (tmp_path / "a.csv").write_text(csv(rows(payload_kg=[*cells[:4], "?", *cells[5:]])))
    session = read_session(tmp_path / "a.csv", ROBOT, options=ReadOptions(drop_invalid=True))
    np.testing.assert_allclose(session.conditions.payload, np.delete(PAYLOAD, 4))


def test_joints_may_say_it_for_readings_in_another_file(tmp_path):
    table = rows(payload_kg=PAYLOAD)
    joints = {k: v for k, v in table.items() if k[0] in "pq"}
    seen = {k: np.asarray(v)[::-1] for k, v in table.items() if k[0] != "q" and k != "payload_kg"}
    (tmp_path / "j.csv").write_text(csv(joints))
    (tmp_path / "f.csv").write_text(csv(seen))
    (tmp_path / "session.toml").write_text(
        '[joints]\nfile = "j.csv"\n[frames]\nfile = "f.csv"\neuler = "XYZ"\n'
    )
    session = read_session(tmp_path, ROBOT)
    np.testing.assert_allclose(session.conditions.payload, PAYLOAD[::-1], atol=1e-13)


def test_held_out_files_bring_their_own(tmp_path):
    own = read(tmp_path, rows(), "[conditions]\npayload_kg = 1.0\ndate = 2026-11-22")
    other = read(tmp_path, rows(payload_kg=PAYLOAD), "[conditions]\ndate = 2026-11-23", "b")
    both = with_test(own, other)
    np.testing.assert_allclose(both.conditions.payload, [1.0] * M + PAYLOAD.tolist())
    assert both.set_up.date == "2026-11-22 and 2026-11-23"
    silent = read(tmp_path, rows(), name="c")
    for one, two in ((own, silent), (silent, own)):
        with pytest.raises(InputError) as caught:
            with_test(one, two)
        assert caught.value.where == str(tmp_path / "c.csv")
        assert "states no payload_kg, and" in str(caught.value)
    assert with_test(silent, read(tmp_path, rows(), name="d")).conditions.stated == ()


def test_files_joined_keep_the_order_and_none_is_a_wildcard():
    one, two = Conditions(np.zeros(2), ("a", "b")), Conditions(np.ones(1), ("c",))
    found = joined([("x", one), ("y", two)])
    assert found.payload.tolist() == [0.0, 0.0, 1.0]
    assert found.tool == ("a", "b", "c")
    assert found.temperature is None
    assert joined([]).stated == ()
    mixed = first_stated(Conditions(tool=("mine",)), Conditions(np.ones(1), ("theirs",)))
    assert mixed.tool == ("mine",)
    assert mixed.payload.tolist() == [1.0]


def corrected(folder, more, measured, set_up=None):
    """A program of three targets corrected for a robot as its maker describes it."""
    targets = {f"q{j + 1}_deg": np.degrees(made().q[:3, j]) for j in range(N)}
    (folder / "p.csv").write_text(csv(targets | more))
    out = folder / "out.csv"
    out.unlink(missing_ok=True)
    found = correct_program(
        folder / "p.csv", ROBOT, ROBOT.model, out, measured=measured, set_up=set_up
    )
    lines = out.read_text().splitlines()
    assert lines[0].endswith(",conditions")
    assert tuple(line.rpartition(",")[2] for line in lines[1:]) == found.conditions
    return found


def test_targets_of_a_program_under_other_conditions_are_named_and_corrected_still(tmp_path):
    measured = Conditions(np.zeros(9), ("probe",) * 9, np.linspace(20, 22, 9))
    more = {"payload_kg": [0, 5, 0.4], "tool": ["probe", "probe", "gripper"]}
    found = corrected(tmp_path, more, measured)
    assert found.conditions == ("as measured", "other payload", "other tool")
    assert found.corrected.all()
    assert [said.partition(";")[0] for said in found.sentences[1:3]] == [
        "target 2 carries 5 kg",
        "target 3 has the tool gripper",
    ]
    assert "the targets do not state their temperature" in found.sentences[3]


def bent():
    """The robot as its maker describes it, on springs."""
    gravity, _ = ladders_of(ROBOT.model, limits=ROBOT.limits)
    springs = next(level.errors for level in gravity.levels if level.errors.springs is not None)
    model = with_errors(ROBOT.model, springs)
    numbers = np.full(len(model.joint_errors.coefficients), 1e-3)
    return RobotModel(model.chain, replace(model.joint_errors, coefficients=numbers))


def test_a_load_is_not_put_on_a_model_whose_own_load_nobody_stated(tmp_path):
    """Its moments hold what was carried: stated of targets alone, it was on them twice."""
    sent, found = {}, {}
    for name, measured in (("unsaid", Conditions()), ("said", Conditions(np.full(9, 5.0)))):
        for load in ({}, {"payload_kg": [5, 5, 5]}):
            targets = {f"q{j + 1}_deg": np.degrees(made().q[:3, j]) for j in range(N)}
            (tmp_path / "p.csv").write_text(csv(targets | load))
            out = tmp_path / f"{name}{len(load)}.csv"
            done = correct_program(tmp_path / "p.csv", ROBOT, bent(), out, measured=measured)
            sent[name, len(load)], found[name, len(load)] = done.q, done
    np.testing.assert_array_equal(sent["unsaid", 0], sent["unsaid", 1])
    assert np.abs(sent["said", 0] - sent["said", 1]).max() > 1e-5
    assert found["unsaid", 1].departed.all()
    assert found["unsaid", 1].conditions == ("payload of the measurements not stated",) * 3
    told = " | ".join(found["unsaid", 1].sentences)
    assert "bent by its own weight and what it carried in the measurements" in told
    assert "corrected for what the arm carried in the measurements, whatever it was" in told
    assert "not for the 5 kg that they state" in told
    assert "write payload_kg under [conditions]" in told
    assert not found["unsaid", 0].departed.any()
    assert not found["said", 1].departed.any()


def test_a_load_hangs_where_it_did_in_the_measurements(tmp_path):
    """A center that one side states is treated as a payload that one side states."""
    hung = np.array([0.0, 0.0, 300.0])
    stated = {"payload_kg": [5, 5, 5]}
    center = stated | {f"payload_{a}_mm": [x] * 3 for a, x in zip("xyz", hung, strict=True)}
    load = np.full(9, 5.0)
    measured = {
        "unsaid": Conditions(load),
        "said": Conditions(load, center=np.tile(hung / 1e3, (9, 1))),
    }
    found = {}
    for name, rows in measured.items():
        for more in (stated, center):
            targets = {f"q{j + 1}_deg": np.degrees(made().q[:3, j]) for j in range(N)}
            (tmp_path / "p.csv").write_text(csv(targets | more))
            out = tmp_path / f"{name}{len(more)}.csv"
            found[name, len(more)] = correct_program(
                tmp_path / "p.csv", ROBOT, bent(), out, measured=rows
            )
    # where only the measurements say it, the targets' load hangs there as well
    np.testing.assert_array_equal(found["said", 1].q, found["said", 4].q)
    assert np.abs(found["said", 1].q - found["unsaid", 1].q).max() > 1e-5
    told = " | ".join(found["said", 1].sentences)
    assert "bent by its own weight and a payload of 5 kg at 0, 0, 300 mm" in told
    assert "the targets do not state their payload center" in told
    assert not found["said", 1].departed.any()
    # where only the targets say it, they are corrected for where it hung, and have no region
    np.testing.assert_array_equal(found["unsaid", 4].q, found["unsaid", 1].q)
    assert found["unsaid", 4].departed.all()
    told = " | ".join(found["unsaid", 4].sentences)
    assert "corrected for a payload that hangs where it did in the measurements" in told
    assert "write payload_center_mm under [conditions]" in told


@pytest.mark.parametrize(
    ("column", "values"),
    [
        ("payload_kg", [0, 5, 5]),
        ("tool", ["probe", "probe", "gripper"]),
        ("temperature_degC", [20, 20, 21]),
    ],
)
def test_no_target_has_a_region_under_a_condition_that_the_measurements_do_not_state(
    column, values, tmp_path
):
    """The model does not bend: whether it was that load, tool or warmth is unknown all the same."""
    kind, others = column.partition("_")[0], {"payload_kg": [0.0] * 3, "tool": ["probe"] * 3}
    measured = Conditions(np.zeros(9), ("probe",) * 9, np.full(9, 20.0))
    for silent in (Conditions(), replace(measured, **{kind: None})):
        more = {name: cells for name, cells in others.items() if silent.stated} | {column: values}
        found = corrected(tmp_path, more, silent)
        assert found.departed.all()
        assert found.conditions == (f"{kind} of the measurements not stated",) * 3
        told = " | ".join(found.sentences)
        assert f"the targets state their {kind} ({kind} " in told
        assert ("whatever it was" in told) == (kind == "payload")
        assert f"to get a region there, write {column} under [conditions]" in told
    said = corrected(tmp_path, {column: values}, measured)
    assert not said.departed[0]
    assert "[conditions]" not in " | ".join(said.sentences)


def test_what_the_session_says_of_use_stands_in_for_columns_that_are_missing(tmp_path):
    measured = Conditions(np.zeros(9), ("probe",) * 9)
    set_up = SetUp(use=Conditions(np.full(1, 5.0), ("probe",)))
    assert corrected(tmp_path, {}, measured, set_up).conditions == ("other payload",) * 3
    own = corrected(tmp_path, {"payload_kg": [0, 0, 3]}, measured, set_up)
    assert own.conditions == ("as measured", "as measured", "other payload")
    assert corrected(tmp_path, {}, measured).conditions == (NOT_STATED,) * 3
    assert corrected(tmp_path, {}, None).conditions == (NOT_STATED,) * 3


@pytest.mark.parametrize(
    ("named", "warned"),
    [
        (ROBOT.name, False),
        ("../models/staubli_tx60/robot.toml", False),
        ("models/staubli_tx60", False),
        ("staubli_tx60.urdf", False),
        ("kuka_iiwa7", True),
        ("../models/kuka_iiwa7/kuka_iiwa7.urdf", True),
    ],
)
def test_a_session_may_name_its_robot_by_the_path_of_its_file(named, warned, tmp_path):
    session = read(tmp_path, rows(), f'robot = "{named}"')
    assert ("names the robot" in " | ".join(session.warnings)) == warned
