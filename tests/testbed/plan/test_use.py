"""What a plan says of the conditions that the robot will be used under."""

import csv as tables
import io
import json
from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.uncertainty.statement.conditions import Conditions
from testbed.files.read import ReadOptions, read_session
from testbed.laboratory.joint_lists import read_conditions
from testbed.plan.results import plan_csv, plan_numbers, stops_of
from testbed.plan.words import reasons, use_words
from testbed.scenario.hashes import hashed_document
from testbed.scenario.read import changed
from tests.planned import ROBOT, quick_plan
from tests.testbed.files.made import csv

USE = {"payload_kg": 5.0, "tool": "gripper", "temperature_degC": -3.5}
HEAD = ",".join(f"q{k}_deg" for k in range(1, 7))


def used(**use):
    """The small plan, for a robot that will be used so."""
    made = quick_plan()
    return replace(made, scenario=changed(made.scenario, {"plan.use": use}))


def test_the_table_has_a_column_for_each_condition_that_is_stated():
    for use in (USE, {"tool": "gripper"}, {}):
        made = used(**use)
        rows = list(tables.DictReader(io.StringIO(plan_csv(made))))
        assert len(rows) == len(stops_of(made))
        for row in rows:
            assert {key: row[key] for key in use} == {k: str(v) for k, v in use.items()}
            assert not {*USE} - {*use} & {*row}
        assert json.loads(json.dumps(plan_numbers(made, ROBOT)["use"])) == use


def test_who_measures_is_told_to_do_it_as_the_robot_will_be_used():
    assert use_words(quick_plan()) == ()
    assert use_words(used()) == ()
    said = (
        "Measure with a payload of 5 kg and the tool gripper at -3.5 degC, as the robot will be "
        "used: no statement will hold under other conditions than those of the measurements"
    )
    assert use_words(used(**USE)) == (said,)
    assert f"{said}." in reasons(used(**USE))
    assert "Measure with the tool gripper, as" in use_words(used(tool="gripper"))[0]
    assert "Measure at 24 degC, as" in use_words(used(temperature_degC=24.0))[0]


def test_poses_measured_already_under_other_conditions_are_warned_of():
    under = Conditions(np.zeros(3), ("probe",) * 3)
    made = replace(used(**USE), measured_under=under)
    assert use_words(made)[:-1] == (
        "Warning: the goal carries 5 kg; the poses measured already had a payload of 0 kg; they "
        "count here as if nothing differed",
        "Warning: the goal has the tool gripper; the poses measured already had the tool probe; "
        "they count here as if nothing differed",
    )
    same = replace(used(**USE), measured_under=Conditions(np.full(3, 5.2), ("gripper",) * 3))
    assert len(use_words(same)) == 1


def test_a_plan_says_what_its_table_reads_back(tmp_path):
    made = used(**USE)
    (tmp_path / "plan.csv").write_text(plan_csv(made))
    under = read_conditions(tmp_path / "plan.csv")
    count = len(made.places)
    assert under.payload.tolist() == [5.0] * count
    assert under.tool == ("gripper",) * count
    assert under.temperature.tolist() == [-3.5] * count
    (tmp_path / "plain.csv").write_text(plan_csv(quick_plan()))
    assert read_conditions(tmp_path / "plain.csv").stated == ()


def test_a_session_finds_the_conditions_in_the_plan_that_was_measured(tmp_path):
    made = used(**USE)
    (tmp_path / "plan.csv").write_text(plan_csv(made))
    stops = [stop for stop in stops_of(made) if stop.measured]
    T = ROBOT.model.poses(np.array([stop.q for stop in stops]))
    seen = {"pose_id": [stop.name for stop in stops]}
    seen |= {f"{axis}_mm": 1e3 * T[:, k, 3] for k, axis in enumerate("xyz")}
    seen |= {f"r{i + 1}{j + 1}": T[:, i, j] for i in range(3) for j in range(3)}
    (tmp_path / "seen.csv").write_text(csv(seen))
    (tmp_path / "session.toml").write_text(
        '[joints]\nfile = "plan.csv"\n[frames]\nfile = "seen.csv"\n'
        "[uncertainty]\nposition_um = 20\nrotation_mdeg = 10\n"
    )
    session = read_session(tmp_path, ROBOT, options=ReadOptions(drop_invalid=True))
    assert session.conditions.payload.tolist() == [5.0] * len(stops)
    assert session.conditions.tool == ("gripper",) * len(stops)
    assert session.conditions.temperature.tolist() == [-3.5] * len(stops)


@pytest.mark.parametrize(
    ("column", "cell", "said"),
    [
        (
            "payload_kg",
            "",
            'payload_kg is ""; it must be a number; correct or remove that row. [M25]',
        ),
        ("payload_kg", "-1", "payload_kg is -1; a payload is 0 kg or more; correct it. [M25]"),
        ("payload_kg", "1e4", "payload_kg is 10000; a payload is at most 1000 kg; correct it. [V9]")
        ,
        ("temperature_degC", "nan", 'temperature_degC is "nan"; it must be a number; correct or '
         "remove that row. [M25]"),
        ("temperature_degC", "-2e3", "temperature_degC is -2000; a temperature (in degC, not in "
         "kelvin) is at most 150 degC; correct it. [V9]"),
        ("tool", "", "tool is empty; fill the cell. [M25]"),
    ],
)  # fmt: skip
def test_a_cell_that_makes_no_sense_is_named(tmp_path, column, cell, said):
    file = tmp_path / "measured.csv"
    good = "probe" if column == "tool" else "1"
    file.write_text(f"{HEAD},{column}\n1,2,3,4,5,6,{good}\n6,5,4,3,2,1,{cell}\n")
    with pytest.raises(InputError) as caught:
        read_conditions(file)
    assert str(caught.value) == f"{file}:3: {said}"


def test_a_plan_of_an_earlier_version_stays_the_same_plan():
    made = quick_plan()
    assert "use" not in hashed_document(made.scenario)["plan"]
    assert hashed_document(used(**USE).scenario)["plan"]["use"] == USE
