"""The folder of a calibration: whole or absent, read back bit for bit, its robot proven."""

import csv
import io
import json
from dataclasses import replace
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest

from calib.errors import InputError
from calib.identification.start.start import start_frames
from testbed.files.text import read_sheet
from testbed.gates.text import read_text
from testbed.identify.calibrate import Options
from testbed.identify.conditions import conditions_words
from testbed.identify.folder import load_calibration, play_calibration, rederive_calibration
from testbed.identify.handback.deliver import identified_name
from testbed.identify.handback.states import handed_robot, in_own_frames
from testbed.identify.results import split_csv
from testbed.robots.catalog import load_robot
from testbed.store import layout, npz
from testbed.store.codec import pack
from tests.calibrated import (
    real,
    real_session,
    robot,
    session_of,
    sound_session,
    table_of,
    true_model,
)
from tests.reference import DEG, pool_r

PROGRAM = (
    "name,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,temperature_degC\n"
    "a,10,20,30,40,50,60,20.5\nb,-5,40,60,0,20,9,30\n"
)
PROGRAMS = {
    "missing": ("", "does not exist"),
    "no targets": (PROGRAM.splitlines()[0], "has no targets"),
    "word": (PROGRAM.replace("20,", "x,"), "not numbers"),
    "no rotations": ("x_mm,y_mm,z_mm\n1,2,3\n", "positions without rotations"),
    "two joints": ("q1_deg,q2_deg\n1,2\n", "no column for 4 of the 6 joints"),
}
FILES = {
    *layout.DERIVED,
    layout.MANIFEST,
    layout.TRIALS,
    "robot",
    "robot_geometric",
    "dh_table.csv",
    "joint_map.csv",
    "split.csv",
    "jobs_corrected.csv",
    "jobs_statement.csv",
}


def make(root):
    """The folder of the wobbling robot, with a program."""
    program = root / "jobs.csv"
    program.write_text(PROGRAM)
    out = root / "out"
    play_calibration(robot(), real_session(), out, Options(seed=1), program=program)
    return out


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return make(tmp_path_factory.mktemp("calibration"))


def test_the_folder_holds_everything_and_nothing_else(out):
    assert {path.name for path in out.iterdir()} == FILES
    assert {path.name for path in out.parent.iterdir()} == {"jobs.csv", "out"}


def test_records_come_back_bit_for_bit(out):
    found, _ = load_calibration(out)
    one, two = pack(real()), pack(found)
    assert one.keys() == two.keys()
    for name, value in one.items():
        if isinstance(value, np.ndarray):
            assert value.dtype == two[name].dtype
            assert np.array_equal(value, two[name]), name
        else:
            assert value == two[name], name


def test_every_array_of_rows_is_held_to_their_number(out):
    """Sealed again with one row less: refused as the record is opened, or of no other's length."""
    file = out / layout.TRIALS / "calibration.npz"
    good, rows = file.read_bytes(), len(real().measurements)
    meta, arrays = npz.from_bytes(good)
    of_rows = [name for name, array in arrays.items() if array.shape[:1] == (rows,)]
    assert len(of_rows) > 20
    told = "the record calibration was written by another version"
    try:
        for name in of_rows:
            file.write_bytes(npz.to_bytes(meta, {**arrays, name: arrays[name][:-1]}))
            with pytest.raises(InputError, match=told):
                load_calibration(out)
    finally:
        file.write_bytes(good)


def test_derived_files_are_made_again_with_the_same_bytes(out):
    names = (layout.RESULT, layout.ARRAYS)  # the report is made again in its own test
    before = {name: (out / name).read_bytes() for name in names}
    for name in names:
        (out / name).unlink()
    rederive_calibration(out, names)
    for name in names:
        assert (out / name).read_bytes() == before[name], name


def test_the_result_says_what_the_record_says_with_units_in_its_keys(out):
    found = real()
    document = json.loads((out / layout.RESULT).read_bytes())
    assert document["notice"].startswith("MEASURED")
    assert document["kind"] == "calibration"
    held = document["models"]["extended"]["held_out"]
    assert held["mean_mm"] == pytest.approx(found.fit.test.position.mean * 1e3, rel=1e-15)
    assert held["mean_deg"] == pytest.approx(np.degrees(found.fit.test.rotation.mean), rel=1e-12)
    assert document["data"]["conditions"] == {
        "payload_kg": None,
        "temperature_degC": [20.0, 21.0],
        "tools": [],
        "stations": [],
        "date": None,
        "sentence": conditions_words(found),
    }
    assert document["delivered"]["program_conditions"] == ["as measured", "other temperature"]
    assert document["delivered"]["program"][1].startswith("target 2 is at 30 degC; the meas")
    numbers = {row["name"]: row for row in document["parameters"]}
    a2 = numbers["a2"]
    assert a2["new"] - a2["old"] == pytest.approx(a2["delta"], abs=1e-9)
    # d2 cannot be told from d3: each has half of what the weak prior leaves to their difference
    assert numbers["d2"]["U_k2"] == pytest.approx(2 * 0.6 / np.sqrt(2), rel=0.02)
    manifest = json.loads((out / layout.MANIFEST).read_bytes())
    assert (manifest["kind"], manifest["robot"]) == ("calibration", "staubli_tx60")


def test_the_identified_robot_is_the_identified_model(out):
    model = real().fit.identification.model
    found = load_robot(out / "robot")
    assert found.name == identified_name("staubli_tx60") == "staubli_tx60_identified"
    q = pool_r(50, seed=7)
    np.testing.assert_allclose(found.model.poses(q), model.poses(q), atol=1e-12)
    # without another fit of base or tool: they were found from nothing and are handed out
    truth = table_of(true_model(harmonics=0.02), q, noise=0.0)
    after = np.linalg.norm(truth.position - found.model.poses(q)[:, :3, 3], axis=1)
    before = start_frames(robot().model, truth).position_rms
    assert np.sqrt(np.mean(after**2)) < 0.3 * before


def test_who_reads_urdf_gets_the_geometric_fit_not_the_geometric_part_of_another(out):
    found = load_robot(out / "robot_geometric")
    geometric = handed_robot(real(), real().fits[0]).model
    # degrees in the file: back to the last bit or the one before
    np.testing.assert_allclose(found.model.chain.links, geometric.chain.links, rtol=1e-15)
    assert not found.model.joint_errors.terms
    assert "robot_geometric/ has the geometric model" in (out / layout.REPORT).read_text()


def test_link_numbers_alone_are_those_of_the_geometric_fit(out):
    """Multiplied out as formats/robot.md says it, they are the robot beside them."""
    table = csv.DictReader(io.StringIO((out / "robot_geometric" / "dh_table.csv").read_text()))
    rows = {row["number"]: row for row in table}
    found = load_robot(out / "robot_geometric").model.chain
    names = [f"{name}{k}" for k in range(1, 7) for name in ("theta", "d", "a", "alpha", "beta")]
    scale = np.tile([DEG, 1e-3, 1e-3, DEG, DEG], 6)
    links = np.reshape([float(rows[name]["new"]) for name in names], (6, 5)) * scale.reshape(6, 5)
    # nine digits are written
    np.testing.assert_allclose(links, found.links, atol=1e-9)
    place = [float(rows[f"base.{axis}"]["new"]) for axis in "xyz"]
    np.testing.assert_allclose(place, 1e3 * found.T_world_base[:3, 3], atol=1e-5)
    nominal = robot().model.chain.links / scale.reshape(6, 5)
    old = np.reshape([float(rows[name]["old"]) for name in names], (6, 5))
    np.testing.assert_allclose(old, nominal, atol=1e-6)
    # other numbers than those of the chosen model, which has joint terms
    chosen = csv.DictReader(io.StringIO((out / "dh_table.csv").read_text()))
    assert any(row["new"] != rows[row["number"]]["new"] for row in chosen if row["number"] in rows)
    assert not any("harmonic" in name or "joint_map" in name for name in rows)


def test_the_split_table_has_every_row_with_its_errors(out):
    found = real()
    rows = list(csv.DictReader(io.StringIO((out / "split.csv").read_text())))
    assert len(rows) == 90
    assert [row["split"] == "test" for row in rows] == found.split.is_test.tolist()
    errors = np.array([float(row["error_after_mm"]) for row in rows])
    # written to a nanometer
    np.testing.assert_allclose(errors, found.fit.misses.position * 1e3, atol=5.1e-7)


def test_pose_names_that_a_spreadsheet_would_run_come_back_from_the_split_table(tmp_path):
    names = ("=cmd|x", "-a", "@b", "'=c", "+d", "'e", "-1.5")
    told = replace(real(), pose_names=(*names, *real().pose_names[len(names) :]))
    path = tmp_path / "split.csv"
    path.write_text(split_csv(told), encoding="utf-8")
    written = [line.split(",")[0] for line in path.read_text(encoding="utf-8").splitlines()]
    assert written[1:8] == ["'=cmd|x", "-a", "'@b", "''=c", "+d", "'e", "-1.5"]
    sheet = read_sheet(read_text(path, path.name))
    assert {row[0] for row in sheet.rows} == set(told.pose_names)


def test_the_corrected_program_sends_the_identified_robot_where_it_was_meant(out):
    rows = list(csv.DictReader(io.StringIO((out / "jobs_corrected.csv").read_text())))
    assert [row["status"] for row in rows] == ["reached", "reached"]
    sent = np.radians([[float(row[f"q{k}_deg"]) for k in range(1, 7)] for row in rows])
    meant = np.radians([[10, 20, 30, 40, 50, 60], [-5, 40, 60, 0, 20, 9]])
    # in the base and with the tool that the program was written for
    own, model = robot().model.chain, in_own_frames(real())
    assert np.array_equal(model.chain.T_world_base, own.T_world_base)
    assert np.array_equal(model.chain.T_flange_tool, own.T_flange_tool)
    gone = model.poses(sent)
    # the file keeps its decimals
    np.testing.assert_allclose(gone, robot().model.poses(meant), atol=1e-6)


def test_nothing_is_written_when_nothing_was_understood(tmp_path):
    session = session_of(table_of(true_model(), pool_r(4)))
    with pytest.raises(InputError):
        play_calibration(robot(), session, tmp_path / "out")
    bad = tmp_path / "bad.csv"
    bad.write_text("a,b\n1,2\n")
    with pytest.raises(InputError):
        play_calibration(robot(), sound_session(), tmp_path / "out", program=bad)
    assert {path.name for path in tmp_path.iterdir()} == {"bad.csv"}


def test_other_people_s_folders_are_left_alone_and_old_runs_renamed(out, tmp_path):
    theirs = tmp_path / "mine"
    theirs.mkdir()
    (theirs / "notes.txt").write_text("keep")
    for overwrite, told in ((False, "exists already"), (True, "is not a run folder")):
        with pytest.raises(InputError, match=told):
            play_calibration(robot(), real_session(), theirs, overwrite=overwrite)
    assert (theirs / "notes.txt").read_text() == "keep"


@pytest.mark.parametrize("name", ["calibration.npz", "delivered.npz"])
def test_a_damaged_record_is_told_by_name(out, tmp_path, name):
    copy = tmp_path / "copy"
    (copy / layout.TRIALS).mkdir(parents=True)
    for part in (
        layout.MANIFEST,
        f"{layout.TRIALS}/calibration.npz",
        f"{layout.TRIALS}/delivered.npz",
    ):
        (copy / part).write_bytes((out / part).read_bytes())
    data = bytearray((copy / layout.TRIALS / name).read_bytes())
    with ZipFile(copy / layout.TRIALS / name) as parts:
        largest = max(parts.infolist(), key=lambda part: part.file_size)
    # in its numbers: the padding between parts, some 200 bytes, says nothing
    data[largest.header_offset + 200 + largest.file_size // 2] ^= 1
    (copy / layout.TRIALS / name).write_bytes(bytes(data))
    with pytest.raises(InputError) as caught:
        load_calibration(copy)
    assert f"the record {Path(name).stem} is damaged" in str(caught.value)


@pytest.mark.parametrize(("text", "says"), PROGRAMS.values(), ids=PROGRAMS)
def test_a_program_is_refused_before_anything_is_computed(text, says, tmp_path):
    program = tmp_path / "jobs.csv"
    if text:
        program.write_text(text)
    before = list(tmp_path.iterdir())
    with pytest.raises(InputError, match=says) as caught:
        play_calibration(robot(), None, tmp_path / "new" / "out", program=program)
    assert caught.value.where.startswith("jobs.csv")
    assert list(tmp_path.iterdir()) == before
