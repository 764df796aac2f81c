"""Exports in the words and shapes of several programs and languages: all are read as they mean it.

Truth: the files are written here from poses that are known.
"""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbed.files.dialects.pose_names import counted_alike, stay_apart
from testbed.files.dialects.records import read_records
from testbed.files.read import ReadOptions, read_session
from testbed.proposal.data import look_at
from testbed.proposal.missing import with_rows
from testbed.proposal.names import meanings
from testbed.proposal.rows.nominal_files import without_nominal
from testbed.proposal.rows.sorted_names import sorted_by_letters
from testbed.proposal.words import QUATERNION
from tests.command import call
from tests.testbed.files.made import csv
from tests.testbed.proposal.test_odd_files import (
    DATA,
    DEG,
    GERMAN,
    MM,
    UR10,
    M,
    W,
    X,
    Y,
    Z,
    joints,
    places,
)
from tests.testbed.proposal.test_session import proposed

SOLL = np.round(MM, 1) + 0.5
NAMES = [f"P{k + 1}" for k in range(M)]
VECTOR = Rotation.from_matrix(DATA.T[:, :3, :3]).as_rotvec().T


def over(groups, table, **how):
    """A table with the names of its groups in the line above, each over its first column."""
    above = [name for name, count in groups for name in (name, *[""] * (count - 1))]
    mark = how.get("separator", ",")
    return "\n".join([mark.join(above), csv(table, **how)])


def doubled(text, *names):
    """The same with names that come again: only lists may hold them."""
    for name in names:
        text = text.replace(f"{name}*", name)
    return text


TWICE = joints("J{}") | places("{}*", SOLL) | places("{}")
MOTIVE = (
    "Format Version,1.23,Take Name,Take 1,Capture Frame Rate,120,Rotation Type,Quaternion,Length "
    "Units,Meters,Coordinate Space,Global\n\n,,"
    + ",".join(["Rigid Body"] * 7) + ",,,,,,\n,," + ",".join(["tool"] * 7) + ",,,,,,\n,,"
    + ",".join("1234567") + ",,,,,,\n,," + ",".join(["Rotation"] * 4 + ["Position"] * 3)
    + ",,,,,,\nFrame,Time (Seconds),X,Y,Z,W,X,Y,Z,J1,J2,J3,J4,J5,J6\n"
    + csv({"Frame": np.arange(M), "t": np.arange(M) / 120, "a": X, "b": Y, "c": Z, "d": W}
          | places("{}", MM / 1e3) | joints("J{}")).partition("\n")[2]
)  # fmt: skip
DIALECTS = {
    "French, where it was measured": csv(
        {"Nom": NAMES} | places("{} théorique", SOLL) | places("{} mesuré") | joints("Axe {}"),
        **GERMAN,
    ),
    "Italian": csv(places("{} nominale", SOLL) | places("{} misurato") | joints("Asse {}")),
    "Spanish": csv(places("{} teórico", SOLL) | places("{} medido") | joints("Eje {}")),
    "Chinese": csv(
        {"名称": NAMES} | places("名义 {}", SOLL) | places("测量 {}") | joints("关节{}")
    ),
    "German joints": csv(joints("Gelenk {}") | places("{}")),
    "Greek letters": csv(joints("θ{}") | places("{}")),
    "joints by what they are": csv(joints("Joint angle {}") | places("{}")),
    "positions of joints": csv(joints("joint_{}_position", DATA.q) | places("{}")),
    "joints in brackets": csv({f"q[{k}]": DATA.q[:, k] for k in range(6)} | places("{}")),
    "paths of messages": csv(
        {f"/joint_states/joint_{k + 1}/position": DATA.q[:, k] for k in range(6)}
        | {f"/vicon/pose/position/{a}": MM[:, k] / 1e3 for k, a in enumerate("xyz")}
    ),
    "joints of Yaskawa": csv({a: DEG[:, k] for k, a in enumerate("SLURBT")} | places("{}")),
    "joints of a teach pendant": csv(
        dict(zip(("Base", "Shoulder", "Elbow", *(f"Wrist {k}" for k in "123")), DEG.T, strict=True))
        | places("{}")
    ),
    "centimeters": csv(joints("J{}") | places("{} (cm)", MM / 10)),
    "feet below the names": csv(joints("J{}") | places("{}", MM / 304.8)).replace(
        "Z\n", "Z\ndeg,deg,deg,deg,deg,deg,ft,ft,ft\n", 1
    ),
    "grad that are deg": csv(joints("J{} [grad]") | places("{}")),
    "grad that are gon": csv(joints("J{} (grad)", DEG / 0.9) | places("{}")),
    "gon": csv(joints("J{} [gon]", DEG / 0.9) | places("{} [mm]")),
    "units behind a comma": csv(joints('"J{}, deg"') | places('"{}, mm"')),
    "entries of transforms counted from 0": csv(
        {"number": np.arange(M)} | joints("theta_{}", DATA.q)
        | {f"m_{i}{j}": (MM[:, i] if j == 3 else DATA.T[:, i, j]) if i < 3 else np.full(M, j == 3)
           for i in range(4) for j in range(4)}
    ),
    "entries of transforms apart": csv(
        joints("J{}")
        | {f"T_{i + 1}_{j + 1}": (MM[:, i] if j == 3 else DATA.T[:, i, j])
           for i in range(3) for j in range(4)}
    ),
    "entries of rotations counted from 0": csv(
        joints("J{}") | places("p{}", axes="xyz")
        | {f"r{i}{j}": DATA.T[:, i, j] for i in range(3) for j in range(3)}
    ),
    "joints of ABB, and averages among their shots": csv(
        joints("rax_{}") | places("{} shot 1", MM + 0.1) | places("{} shot 2", MM - 0.1)
        | places("{} avg")
    ),
    "averages with their extremes": csv(
        joints("J{}") | places("{} mean") | places("{} std", 0 * MM + 0.01)
        | places("{} min", MM - 0.02) | places("{} max", MM + 0.02)
    ),
    "what was wished in brackets": csv(joints("J{}") | places("{} (nominal)", SOLL) | places("{}")),
    "a quaternion that counts from 1 beside the joints": csv(
        joints("J{}") | places("{}") | {"q1": W, "q2": X, "q3": Y, "q4": Z}
    ),
    "shifts and turns of one body": csv(
        joints("J{}") | places("T{}") | dict(zip(("RX", "RY", "RZ"), VECTOR, strict=True))
    ),
    "groups whose names come again": doubled(
        over([("Joints", 6), ("Nominal", 3), ("Measured", 3)], TWICE), "X", "Y", "Z"
    ),
    "motion capture, a long line of settings above": MOTIVE,
    "comments with slashes above names": "// tracker\n// mm\n" + csv(joints("J{}") | places("{}")),
}  # fmt: skip


def read_as_meant(text, tmp_path):
    """The readings of one file by the session that is proposed for it: those of `DATA`."""
    (tmp_path / "m.csv").write_text(text, encoding="utf-8")
    said, _ = proposed(tmp_path, [tmp_path / "m.csv"], "--robot", UR10.name)
    assert "to fix" not in said
    table = read_session(tmp_path / "session.toml", UR10).measurements
    # fifteen digits are written, of gon as well
    np.testing.assert_allclose(table.q, DATA.q, rtol=0, atol=2e-12)
    np.testing.assert_allclose(table.position, DATA.T[:, :3, 3], rtol=0, atol=2e-12)
    return table


@pytest.mark.parametrize("text", DIALECTS.values(), ids=DIALECTS)
def test_a_dialect_is_proposed_as_it_was_meant(text, tmp_path):
    table = read_as_meant(text, tmp_path)
    if table.is_pose.any():
        # fifteen digits of each of three or four numbers
        np.testing.assert_allclose(table.rotation, DATA.T[:, :3, :3], rtol=0, atol=1e-11)


@pytest.mark.parametrize(
    ("form", "first", "order"),
    [("quat{}", 1, "w x y z"), ("q_{}", 1, "x y z w"), ("quaternion[{}]", 0, "x y z w")],
)
def test_four_numbers_that_are_counted_are_a_quaternion_in_the_order_that_fits(
    form, first, order, tmp_path
):
    """The rotations were left aside, or joints were missing: q_1 to q_4 were taken for some."""
    own = {"w": W, "x": X, "y": Y, "z": Z}
    turn = {form.format(first + k): own[letter] for k, letter in enumerate(order.split())}
    (tmp_path / "m.csv").write_text(csv(joints("joint{}") | places("{}") | turn))
    said, _ = proposed(tmp_path, [tmp_path / "m.csv"], "--robot", UR10.name)
    assert f"no name states the order of the quaternions; assumed: {order}" in " ".join(
        said.split()
    )
    table = read_session(tmp_path / "session.toml", UR10).measurements
    # fifteen digits of four numbers
    np.testing.assert_allclose(table.rotation, DATA.T[:, :3, :3], rtol=0, atol=1e-11)


JOINTED = {"Target": NAMES} | joints("J{}")
SHUFFLED = np.random.default_rng(1).permutation(M)
POINTS = {
    "a table of Spatial Analyzer with names of its columns": csv(
        {"Collection": ["A"] * M, "Group": ["Main"] * M, "Target": [NAMES[k] for k in SHUFFLED]}
        | places("{} (mm)", MM[SHUFFLED])
    ),
    "points of Spatial Analyzer with semicolons and decimal commas": (
        "// AXES = CARTESIAN: X, Y, Z (mm)\n"
        + "\n".join(
            f"A; Main; {NAMES[k]}; " + "; ".join(f"{v:.9f}".replace(".", ",") for v in MM[k]) + ";"
            for k in SHUFFLED
        )
    ),
}  # fmt: skip


@pytest.mark.parametrize("text", POINTS.values(), ids=POINTS)
def test_names_of_points_in_two_files_are_those_of_poses(text, tmp_path):
    (tmp_path / "points.txt").write_text(text, encoding="utf-8")
    (tmp_path / "joints.csv").write_text(csv(JOINTED if "Target" in text else
                                             {"name": NAMES} | joints("J{}")))  # fmt: skip
    files = [tmp_path / "points.txt", tmp_path / "joints.csv"]
    said, _ = proposed(tmp_path, files, "--robot", UR10.name)
    assert "to fix" not in said
    table = read_session(tmp_path / "session.toml", UR10).measurements
    assert len(np.unique(table.reflector)) == 1
    np.testing.assert_allclose(table.q, DATA.q[SHUFFLED], rtol=0, atol=1e-12)
    # nine decimals of a millimeter are written
    np.testing.assert_allclose(table.position, DATA.T[SHUFFLED, :3, 3], rtol=0, atol=1e-12)


@pytest.mark.parametrize(("apart", "names"), [(0.01, ()), (60.0, ("Run1", "Run2"))])
def test_groups_that_have_the_same_points_again_are_repeats_or_reflectors(apart, names, tmp_path):
    """They were taken as poses: "no joints for poses Run1, Run2"."""
    seen = [MM, MM + apart * DATA.T[:, :3, 0]]
    rows = [f"A::Run{g}::{name}, {x:.9f}, {y:.9f}, {z:.9f}" for g, points in enumerate(seen, 1)
            for name, (x, y, z) in zip(NAMES, points, strict=True)]  # fmt: skip
    head = "// AXES = CARTESIAN: X, Y, Z (mm)"
    (tmp_path / "points.txt").write_text("\n".join([head, *rows]))
    (tmp_path / "joints.csv").write_text(csv({"name": NAMES} | joints("J{}")))
    files = [tmp_path / "points.txt", tmp_path / "joints.csv"]
    said, _ = proposed(tmp_path, files, "--robot", UR10.name)
    assert "to fix" not in said
    session = read_session(tmp_path / "session.toml", UR10)
    assert session.reflector_names == names
    np.testing.assert_allclose(session.measurements.q, np.tile(DATA.q, (2, 1)), rtol=0, atol=1e-12)
    # nine decimals of a millimeter are written
    np.testing.assert_allclose(session.measurements.position, np.vstack(seen) / 1e3, rtol=0,
                               atol=1e-12)  # fmt: skip


WRITTEN = {
    "zeros before": ("P{:03d}", "P{}"),
    "small letters and a space": ("p {}", "P{}"),
    "whole numbers of a table program": ("{}.0", "{}"),
    "a number alone, and behind a word": ("Pose {}", "{}"),
}


@pytest.mark.parametrize(("seen", "sent"), WRITTEN.values(), ids=WRITTEN)
def test_names_of_poses_that_two_programs_write_in_their_ways_are_one(seen, sent, tmp_path):
    """In another order, and some were not seen."""
    rows = SHUFFLED[: M - 3]
    table = {"id": [seen.format(k + 1) for k in rows]} | places("{}", MM[rows])
    (tmp_path / "points.csv").write_text(csv(table))
    (tmp_path / "joints.csv").write_text(
        csv({"id": [sent.format(k + 1) for k in range(M)]} | joints("J{}"))
    )
    files = [tmp_path / "points.csv", tmp_path / "joints.csv"]
    proposed(tmp_path, files, "--robot", UR10.name)
    options = ReadOptions(drop_invalid=True)
    read = read_session(tmp_path / "session.toml", UR10, options=options).measurements
    np.testing.assert_allclose(read.q, DATA.q[rows], rtol=0, atol=1e-12)
    np.testing.assert_allclose(read.position, DATA.T[rows, :3, 3], rtol=0, atol=1e-12)


def test_points_sorted_by_the_letters_of_their_names_are_named(tmp_path):
    """Of P1, P10, P11 beside joints without names it was said that this is another robot."""
    rows = sorted(range(M), key=NAMES.__getitem__)
    points = {"Point": [NAMES[k] for k in rows]} | places("{}", MM[rows])
    (tmp_path / "p.csv").write_text(csv(points))
    (tmp_path / "q.csv").write_text(csv(joints("J{}")))
    files = look_at([tmp_path / "p.csv", tmp_path / "q.csv"], tmp_path)
    said = sorted_by_letters(files)
    assert said.startswith("p.csv is sorted by the letters of its names (P1, P10, P11 ...)")
    told, _ = proposed(tmp_path, [tmp_path / "p.csv", tmp_path / "q.csv"], "--robot", UR10.name)
    assert "is it the robot that was measured?" in told
    assert said in told
    (tmp_path / "n.csv").write_text(csv({"Point": NAMES} | joints("J{}")))
    named = look_at([tmp_path / "n.csv"], tmp_path)
    assert sorted_by_letters((files[0], *named)) == ""
    assert sorted_by_letters((files[1], *named)) == ""


@pytest.mark.parametrize(("planned", "shot"), [(M, M), (M, M - 3), (M - 3, M)])
def test_a_file_of_targets_beside_what_was_measured_is_no_station(planned, shot, tmp_path):
    """Rounded places passed for those of a second station, 0.7 mm off, without a word."""
    for name, values, count in (("nominal", SOLL, planned), ("measured", MM, shot)):
        table = {"Name": NAMES[:count]} | places("{}", values[:count])
        (tmp_path / f"{name}.csv").write_text(csv(table))
    (tmp_path / "joints.csv").write_text(csv({"Name": NAMES} | joints("J{}")))
    files = [tmp_path / f"{name}.csv" for name in ("nominal", "measured", "joints")]
    said, _ = proposed(tmp_path, files, "--robot", UR10.name)
    assert "nominal.csv: called so, it is taken as where the robot was sent" in said
    assert "stations" not in said
    options = ReadOptions(drop_invalid=True)  # joints without readings
    table = read_session(tmp_path / "session.toml", UR10, options=options).measurements
    np.testing.assert_allclose(table.position, DATA.T[:shot, :3, 3], rtol=0, atol=1e-12)


def test_names_that_one_file_tells_apart_stay_apart():
    assert stay_apart(["P1", "P01", "P2"]) is False
    assert stay_apart(["P1", "P2", "P1_2", "P12"]) is True


def test_columns_without_names_in_an_order_that_is_not_tried_are_to_be_named(tmp_path):
    away = MM + np.array([0.0, 60.0, 0.0])
    np.savetxt(tmp_path / "m.txt", np.column_stack([MM, away, MM, np.zeros((M, 6)), DEG]))
    done = call("new", "session", tmp_path / "m.txt", "--robot", UR10.name, "--out",
                tmp_path / "session.toml")  # fmt: skip
    assert done.exit_code == 2
    message = " ".join(done.stderr.split())
    assert "no line names its 21 columns" in message
    assert "name the columns in a first line" in message


def test_what_is_not_known_is_named_where_there_are_no_joints(tmp_path):
    table = {f"Motor {'abcdef'[k]}": DEG[:, k] for k in range(6)} | places("{}")
    (tmp_path / "m.csv").write_text(csv(table))
    said, _ = proposed(tmp_path, [tmp_path / "m.csv"], "--robot", UR10.name)
    assert "there are no joints: nothing could be tried; not known are Motor a, Motor b" in said


def test_a_shift_beside_a_place_is_no_place():
    head = ["X", "Y", "Z", "RX", "RY", "RZ", "TX", "TY", "TZ"]
    assert "TX" not in {one.theirs for one in meanings(head)}
    assert {one.stem for one in meanings(["TX", "TY", "TZ"])} == set()


def test_four_joints_of_an_arm_are_no_quaternion():
    own = {one.theirs: one.stem for one in meanings(["q1", "q2", "q3", "q4", "X", "Y", "Z"])}
    assert own["q1"] == "q1"


@pytest.mark.parametrize(
    ("own", "other", "aside"),
    [
        ("nominal_points", "measured", True),
        ("nominal_load", "full_load", False),  # two loads
        ("target_a", "smr_b", False),  # two targets of a tracker
    ],
)
def test_only_what_a_name_plainly_calls_nominal_is_left_aside(own, other, aside, tmp_path):
    for name, values in ((own, SOLL), (other, MM)):
        (tmp_path / f"{name}.csv").write_text(csv({"Name": NAMES} | places("{}", values)))
    looks = look_at([tmp_path / f"{name}.csv" for name in (own, other)], tmp_path)
    left, said = without_nominal(with_rows(looks))
    assert (len(left), len(said)) == ((1, 1) if aside else (2, 0))


def test_names_of_poses_meet_by_their_numbers_only_where_one_file_has_no_words():
    numbers = [f"{k}" for k in range(1, 7)]
    assert counted_alike(numbers, [f"Pose{k}" for k in (6, 2, 1, 3)]) is not None
    assert counted_alike([f"A{k}" for k in numbers], [f"B{k}" for k in numbers]) is None
    assert counted_alike(numbers, ["R1", "R2"]) is None  # groups of a program, not poses
    assert counted_alike(numbers, [f"P{k}" for k in (1, 2, 9)]) is None


@pytest.mark.parametrize(
    ("record", "rows"),
    [
        ({"xyz": [1.0, 2.0, 3.0], "tags": [{"id": 7, "x": 1.0, "y": 2.0, "z": 3.0}] * 2}, 1),
        ({"J1": 1.0, "events": [{"id": 1}, {"id": 2}]}, 1),
        ({"J1": 1.0, "shots": [{"x": k, "y": 2.0, "z": 3.0} for k in (1.0, 1.1)]}, 2),
    ],
)
def test_a_list_of_readings_is_one_where_no_place_stands_beside_it(record, rows, tmp_path):
    (tmp_path / "m.json").write_text(json.dumps([record] * 3))
    text = read_records(tmp_path / "m.json", "m.json", max_mb=1.0)
    assert len(text.lines) == 1 + 3 * rows


def test_four_counted_joints_beside_four_others_are_no_quaternion():
    four = ["q_1", "q_2", "q_3", "q_4"]
    for count, turned in ((4, False), (6, True)):
        found = meanings([*four, *(f"J{k}" for k in range(1, count + 1))])
        assert any(one.plain in QUATERNION for one in found) is turned
