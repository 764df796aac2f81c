"""What columns say beside joints and readings: order, payload, drives, temperature, gears."""

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.operating import approaches
from testbed.files.read import read_session
from testbed.identify.session import with_test
from tests.testbed.files.made import ROBOT, csv
from tests.testbed.files.test_conditions import M, read, rows

LOADS = np.linspace(-40, 40, 6 * M).reshape(M, 6)
DRIVES = {f"torque{j + 1}_Nm": LOADS[:, j] for j in range(6)}


def test_what_rows_say_reaches_the_table(tmp_path):
    warm, heavy = np.linspace(20, 30, M), np.repeat([0.0, 5.0], [20, 9])
    table = rows(
        temperature_degC=warm, payload_kg=heavy, payload_x_mm=np.full(M, 20.0),
        payload_y_mm=np.zeros(M), payload_z_m=np.full(M, 0.05), **DRIVES,
    )  # fmt: skip
    session = read(tmp_path, table, '[identification]\norder = "as measured"\n')
    said = session.measurements.conditions
    np.testing.assert_allclose(said.temperature, warm, atol=1e-13)
    np.testing.assert_allclose(said.payload, heavy, atol=1e-13)
    np.testing.assert_allclose(said.center, np.tile([0.02, 0, 0.05], (M, 1)), atol=1e-15)
    np.testing.assert_allclose(said.torque, LOADS, atol=1e-12)
    assert np.array_equal(said.approach, approaches(session.measurements.q))
    assert session.rows_say.drive == "torque"
    assert session.rows_say.unsaid == ()
    assert not session.warnings
    assert not any("not used" in note for note in session.notes)
    some = session.rows(np.arange(M) >= 20)
    assert some.measurements.conditions.payload.tolist() == [5.0] * 9


def test_files_that_say_nothing_leave_the_table_as_it_was(tmp_path):
    session = read(tmp_path, rows())
    assert session.measurements.conditions.stated == ()
    assert dict(session.rows_say.unsaid) == {
        "approach": "the order of the poses is not known",
        "torque": "the file has no such columns",
    }


def test_times_and_a_column_state_the_order_and_a_lost_row_breaks_it(tmp_path):
    back = np.arange(M)[::-1]
    q = read(tmp_path, rows()).measurements.q
    for name, more in (("b", {"order": back}), ("c", {"time_s": 10.0 * back})):
        found = read(tmp_path, rows(**more), name=name).measurements.conditions.approach
        assert np.array_equal(found, approaches(q, back)), name
    table = rows()
    for column in ("x_mm", "y_mm", "z_mm"):
        table[column][7] = 0.0  # a missed shot
    lost = read(tmp_path, table, '[identification]\norder = "as measured"\n', name="d")
    found, whole = lost.measurements.conditions.approach, approaches(q)
    assert len(found) == M - 1
    assert not found[7].any()  # nobody knows where it came from
    assert np.array_equal(np.delete(found, 7, 0), np.delete(whole, [7, 8], 0))
    silent = read(tmp_path, rows(time_s=10.0 * back), '[identification]\norder = "unknown"\n')
    assert silent.measurements.conditions.approach is None


def test_a_column_states_the_order_of_shuffled_rows_whatever_their_times_say(tmp_path):
    place = np.random.default_rng(4).permutation(M)
    session = read(tmp_path, rows(order=10 * place + 3, time_s=np.arange(M)))
    assert session.in_time.tolist() == place.tolist()
    assert session.numbered
    assert session.rows(place < 9).in_time.tolist() == place[place < 9].tolist()
    timed = read(tmp_path, rows(time_s=10.0 * place), name="timed")
    assert timed.in_time.tolist() == place.tolist()
    assert not timed.numbered


def test_an_order_that_is_none_is_said_and_not_used(tmp_path):
    session = read(tmp_path, rows(order=[*range(20), *range(9)]))
    assert session.in_time.tolist() == list(range(M))
    assert session.measurements.conditions.approach is None
    why = dict(session.rows_say.unsaid)["approach"]
    assert why.startswith("the column order of ")
    assert why.endswith("is not an order: lines 2 and 22 both have 0, at other joints")
    assert why in session.notes


def test_one_value_of_a_whole_file_fills_all_rows(tmp_path):
    toml = "[conditions]\npayload_kg = 2\npayload_center_mm = [0, 10, 60]\ntemperature_degC = 21\n"
    said = read(tmp_path, rows(), toml).measurements.conditions
    assert said.payload.tolist() == [2.0] * M
    assert said.center.tolist() == [[0.0, 0.01, 0.06]] * M
    assert said.temperature.tolist() == [21.0] * M
    plain = read(tmp_path, rows(), "[conditions]\npayload_kg = 2\n", name="b")
    assert plain.measurements.conditions.center is None
    assert any("center of the payload is taken at the flange" in note for note in plain.notes)


def test_gears_are_orders_of_joints(tmp_path):
    toml = "[gear]\nratio = { joint1 = 121, joint3 = 100.5 }\norders = { joint3 = [80, 201] }\n"
    session = read(tmp_path, rows(), toml)
    assert session.gear == ((121.0, 242.0), (), (100.5, 201.0, 80.0), (), (), ())


def test_currents_are_told_from_torques(tmp_path):
    amperes = {f"current{j + 1}_mA": LOADS[:, j] for j in range(6)}
    session = read(tmp_path, rows(**amperes))
    assert session.rows_say.drive == "current"
    np.testing.assert_allclose(session.measurements.conditions.torque, LOADS / 1e3, atol=1e-12)


def test_held_out_rows_that_say_less_are_taken_at_the_mean(tmp_path):
    one = read(tmp_path, rows(**DRIVES))
    two = read(tmp_path, rows(), name="b")
    joined = with_test(one, two)
    both = joined.measurements.conditions
    assert [text for text in joined.warnings if "drives" in text] == [
        "the held-out rows have no torques of the drives, unlike the others: the mean of these is "
        "used"
    ]
    np.testing.assert_allclose(both.torque[M:], np.tile(LOADS.mean(axis=0), (M, 1)), atol=1e-12)


@pytest.mark.parametrize(
    ("more", "toml", "message"),
    [
        ({"payload_x_mm": np.zeros(M)}, "", "none for payload_y, payload_z"),
        ({f"payload_{a}_mm": np.zeros(M) for a in "xyz"}, "", "none for payload_kg"),
        ({"payload_kg": np.full(M, 2500.0)}, "", "implausible numbers"),
        ({"payload_kg": np.full(M, 80.0)}, "", "payload_kg is 80, and the moving parts of"),
        ({"torque2_Nm": np.zeros(M)}, "", "none for torque1"),
        ({"torque1_Nm": np.zeros(M)}, "", "has the torque of 1 joint"),
        ({"torque1_Nm": np.zeros(M), "current1_A": np.zeros(M)}, "", "torques and currents"),
        ({"torque1_Nm": np.zeros(M), "torque1_Nmm": np.zeros(M)}, "", "are both present"),
        ({}, "[gear]\nratio = { joint1 = 0 }\n", r"gear.*joint1.*greater than 0|joint1"),
        ({}, "[gear]\nratio = { joint9 = 100 }\n", r"\[gear\] ratio names joint9"),
        ({}, "[conditions]\npayload_center_mm = [0, 0, 50]\n", "payload_center_mm needs"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_sentence(tmp_path, more, toml, message):
    with pytest.raises(InputError, match=message):
        read(tmp_path, rows(**more), toml)


def test_columns_of_another_name_are_mapped_and_a_likely_one_is_named(tmp_path):
    toml = "[frames.columns]\n" + "".join(f'torque{j}_Nm = "M{j}"\n' for j in range(1, 7))
    (tmp_path / "s.toml").write_text(toml)
    table = rows(**{f"M{j + 1}": LOADS[:, j] for j in range(6)})
    (tmp_path / "a.csv").write_text(csv(table))
    session = read_session(tmp_path / "a.csv", ROBOT, config=tmp_path / "s.toml")
    np.testing.assert_allclose(session.measurements.conditions.torque, LOADS, atol=1e-12)
    named = read(tmp_path, rows(torqe1_Nm=np.zeros(M)), name="b")
    assert any('did you mean "torque1_Nm"?' in text for text in named.warnings)
