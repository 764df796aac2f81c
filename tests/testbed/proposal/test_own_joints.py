"""Joints under names of any kind: those of the robot's file, or anything and a number.

Truth: the files are written here from poses that are known.
"""

import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.frames import log_so3, target_points
from testbed.files.probe import probe
from testbed.files.read import read_session
from testbed.files.rows.widened import of_rows
from testbed.files.text import Sheet
from testbed.proposal.data import look_at
from testbed.proposal.naming.own_joints import counted_joints, with_joints
from testbed.robots.catalog import load_robot
from tests.command import call
from tests.hangs import no_hang
from tests.testbed.files.made import csv, made
from tests.testbed.files.test_program import scara
from tests.testbed.proposal.test_dialects import read_as_meant
from tests.testbed.proposal.test_odd_files import DATA, DEG, MM, UR10, M, joints, places
from tests.testbed.proposal.test_session import proposed

ROS = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint",
       "wrist_2_joint", "wrist_3_joint")  # fmt: skip
STILL = np.zeros((M, 6))


def of_ros(form, values):
    return {form.format(name): values[:, k] for k, name in enumerate(ROS)}


def cells_of(written):
    """Joints and places in two cells of each row, as pandas writes a column of arrays."""
    rows = [
        f'{k},"{written(q)}","{written(p)}"' for k, (q, p) in enumerate(zip(DEG, MM, strict=True))
    ]
    return "\n".join([",joints,position", *rows, ""])


NAMED = {
    "letters and a number": csv(joints("Th{}") | places("{}")),
    "between words": csv(joints("arm_{}_joint", DATA.q) | places("{}")),
    "Korean": csv(joints("관절{}") | places("{}")),
    "Japanese, the number in the middle": csv(joints("第{}軸") | places("{}")),
    "below the line": csv({f"θ{'₁₂₃₄₅₆'[k]}": DEG[:, k] for k in range(6)} | places("{}")),
    "numbers alone below a group": (
        ",Axis,,,,,,Point,,\nNo.,1,2,3,4,5,6,X,Y,Z\n"
        + csv({"No.": np.arange(M)} | joints("{}") | places("{}")).partition("\n")[2]
    ),
    "numbers alone": csv(joints("{}") | places("{}-real", axes="xyz")),
    "rates and loads of the same joints beside them": csv(
        {f"position.{k}": DATA.q[:, k] for k in range(6)}
        | {f"velocity.{k}": STILL[:, k] for k in range(6)}
        | {f"effort.{k}": STILL[:, k] for k in range(6)} | places("{}", MM / 1e3)
    ),
    "paths with names of Universal Robots": csv(
        of_ros("/joint_states/{}/position", DATA.q) | of_ros("/joint_states/{}/velocity", STILL)
        | places("/tracker/point/{}", MM / 1e3, "xyz")
    ),
    "lists in cells": "joints;position\n" + "\n".join(
        f"{list(map(float, q))};{tuple(map(float, p))}" for q, p in zip(DEG, MM, strict=True)
    ),
    "arrays in cells, as numpy prints them": cells_of(
        lambda row: str(np.array2string(row, precision=16, max_line_width=60))
    ),
    "arrays in cells, as Python does": cells_of(
        lambda row: np.array_repr(row, precision=16, max_line_width=60)
    ),
    "tensors in cells": cells_of(lambda row: f"tensor({row.tolist()}, dtype=torch.float64)"),
    "lists of numbers of numpy": cells_of(
        lambda row: f"[{', '.join(f'np.float64({v!r})' for v in row.tolist())}]"
    ),
    "one target": csv(joints("J{}") | places("{}1", axes="xyz")),
    "Chinese words beside letters": csv(joints("关节角{}") | places("实测{}")),
    "bars between cells": csv(joints("J{}") | places("{}"), separator="|"),
    "an axis and its unit as words": csv(joints("J{}") | places("pos_{}_m", MM / 1e3, "xyz")),
}  # fmt: skip


@pytest.mark.parametrize("text", NAMED.values(), ids=NAMED)
def test_joints_of_any_name_are_proposed_as_they_were_meant(text, tmp_path):
    read_as_meant(text, tmp_path)


def test_which_columns_are_taken_as_joints_is_said(tmp_path):
    (tmp_path / "m.csv").write_text(csv(joints("Th{}") | joints("Tz{}") | places("{}")))
    said, _ = proposed(tmp_path, [tmp_path / "m.csv"], "--robot", UR10.name)
    assert "joints: columns Th1 to Th6 are taken as those of the joints" in said
    assert "Tz1 to Tz6 are not used" in said


def test_ten_joints_have_two_digits(tmp_path):
    table = {f"j{k}_deg": DEG[:, k % 6] for k in range(1, 11)}
    (tmp_path / "m.csv").write_text(csv(table | places("{}")))
    (look,) = look_at([tmp_path / "m.csv"], tmp_path)
    taken, *_ = with_joints(look, range(1, 11), ())
    assert taken.has(*(f"q{k}" for k in range(1, 11)))
    assert {one.plain: one.theirs for one in taken.meanings}["q10"] == "j10_deg"


def test_joints_of_more_than_the_arm_are_counted_and_not_said_to_be_none(tmp_path):
    """Of a humanoid that logs all of its joints in one cell, with a marker on either hand."""
    rng = np.random.default_rng(6)
    cells = zip(rng.normal(size=(M, 19)).tolist(), MM.tolist(), strict=True)
    rows = [f'"{q}","{p}"' for q, p in cells]
    (tmp_path / "m.csv").write_text("\n".join(["joints,marker", *rows, ""]))
    said, _ = proposed(tmp_path, [tmp_path / "m.csv"], "--robot", "staubli_tx60")
    said = " ".join(said.split())
    assert "has 19 joints, joints[0] to joints[18], and staubli_tx60 6: nothing could be" in said
    assert 'its own joints under columns, as in q1_rad = "joints[0]"' in said
    assert "there are no joints" not in said


@pytest.mark.parametrize("called", ["joint {}", "q[{}]", "force {}"])
def test_only_what_is_called_a_joint_is_counted_as_one(called, tmp_path):
    names = [called.format(k) for k in range(1, 9)]
    (tmp_path / "m.csv").write_text(csv(dict.fromkeys(names, DEG[:, 0]) | places("{}")))
    (look,) = look_at([tmp_path / "m.csv"], tmp_path)
    assert counted_joints(look) == ([] if called == "force {}" else names)


def test_names_that_makers_and_the_file_of_the_robot_share_are_no_second_group(tmp_path):
    (tmp_path / "m.csv").write_text(csv(of_ros("{}_deg", DEG) | places("{}")))
    (look,) = look_at([tmp_path / "m.csv"], tmp_path)
    taken, *_ = with_joints(look, range(1, 7), [name.replace("_", " ") for name in ROS])
    (note,) = (note for note in taken.notes if note.startswith("joints"))
    assert "shoulder_pan_joint_deg to wrist_3_joint_deg are taken" in note
    assert "not used" not in note


RECORDS = {
    "an object for each": [
        {"joints": list(map(float, q)), "pose": {"position": dict(zip("xyz", p, strict=True))}}
        for q, p in zip(DEG, MM.tolist(), strict=True)
    ],
    "in an object": {"robot": "ur10", "samples": [
        {"q": q, "xyz": p} for q, p in zip(DATA.q.tolist(), (MM / 1e3).tolist(), strict=True)]},
    "readings in each object": {"poses": [
        {"id": k, "joints": q, "shots": [{"x": p[0], "y": p[1], "z": p[2]}]}
        for k, (q, p) in enumerate(zip(DEG.tolist(), MM.tolist(), strict=True))]},
    "a list for each column": {"q": DATA.q.tolist(), "tvec": (MM / 1e3).tolist()},
    "by names of poses": {f"P{k}": {"joints": q, "measured": p} for k, (q, p) in
                          enumerate(zip(DEG.tolist(), MM.tolist(), strict=True))},
    "poses of Universal Robots": [
        {"actual_q": q, "pose": [*p, *turn]} for q, p, turn in
        zip(DATA.q.tolist(), (MM / 1e3).tolist(), log_so3(DATA.T[:, :3, :3]).tolist(), strict=True)
    ],
    "transforms by columns": [
        {"q": q, "T": T.T.ravel().tolist()} for q, T in zip(DATA.q.tolist(), DATA.T, strict=True)
    ],
    "a controller's poses beside a tracker's points": [
        {"actual_q": q, "actual_TCP_pose": [*T[:3, 3], *log_so3(T[:3, :3])], "tracker": p}
        for q, T, p in zip(DATA.q.tolist(), UR10.model.poses(DATA.q), MM.tolist(), strict=True)
    ],
}  # fmt: skip


TEXTS = {name: json.dumps(records) for name, records in RECORDS.items()} | {
    "an object a line": "\n".join(map(json.dumps, RECORDS["an object for each"]))
}


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
def test_records_of_json_are_read(text, tmp_path):
    file = tmp_path / "m.json"
    file.write_text(text)
    said, _ = proposed(tmp_path, [file], "--robot", UR10.name)
    assert "to fix" not in said
    table = read_session(tmp_path / "session.toml", UR10).measurements
    np.testing.assert_allclose(table.q, DATA.q, rtol=0, atol=2e-12)
    np.testing.assert_allclose(table.position, DATA.T[:, :3, 3], rtol=0, atol=2e-12)
    turned = table.rotation[table.is_pose]
    np.testing.assert_allclose(turned, DATA.T[table.is_pose, :3, :3], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("place", "by_rows"),
    [((5, 6, 7, 0, 0, 0), False), ((0, 0, 0, 5, 6, 7), True), ((0,) * 6, True)],
)
def test_transforms_are_read_by_columns_where_that_alone_makes_them_some(place, by_rows):
    """Rotations without a place are transforms both ways: by rows, as most are written."""
    T = np.eye(4)
    T[:3, :3] = np.arange(1, 10).reshape(3, 3)
    T[3, :3], T[:3, 3] = place[:3], place[3:]
    cells = tuple((json.dumps(row),) for row in [T.ravel().tolist()] * 2)
    sheet = Sheet("m.json", ("T",), cells, (1, 2), ";", "utf-8")
    assert of_rows(sheet).head[1] == ("T12" if by_rows else "T21")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"a": 1, "b": [1, 2]', "is no JSON: Expecting ',' delimiter"),
        ("[" * 5000, "is no JSON"),
        ('{"a": 1}', "holds no records that make a table; one object for each measurement"),
        ("[]", "holds no records"),
        ('[{"q": {"a": 1, "b": 2, "a": 3}}]', 'two values called "a" in one object; name each'),
        ("1e999999", "holds no records"),
    ],
)
def test_what_is_no_table_of_json_is_refused(text, message, tmp_path):
    (tmp_path / "m.json").write_text(text)
    done = call("new", "session", tmp_path / "m.json", "--out", tmp_path / "session.toml")
    assert done.exit_code == 2
    assert message in " ".join(done.stderr.split())


BARE = {
    "brackets of a console": lambda q, p: "\n".join(
        f"[{' ' * (k > 0)}[{' '.join(map(repr, row))}]" for k, row in
        enumerate(np.column_stack([q, p]).tolist())) + "]",
    "lists side by side": lambda q, p: "\n".join(
        f"{a} {b}" for a, b in zip(q.tolist(), p.tolist(), strict=True)),
    "a minus that touches": lambda q, p: "\n".join(
        "".join(f"{v:17.12f}" for v in row) for row in np.column_stack([q, p / 1e3])),
    "more behind the place": lambda q, p: "\n".join(
        " ".join(map(repr, [*b, *a, 0.0, 0.0, 0.0])) for a, b in
        zip(q.tolist(), p.tolist(), strict=True)),
}  # fmt: skip


@pytest.mark.parametrize("form", BARE.values(), ids=BARE)
def test_numbers_without_names_as_programs_print_them(form, tmp_path):
    (tmp_path / "m.txt").write_text(form(DEG, MM))
    proposed(tmp_path, [tmp_path / "m.txt"], "--robot", UR10.name)
    table = read_session(tmp_path / "session.toml", UR10).measurements
    np.testing.assert_allclose(table.q, DATA.q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(table.position, DATA.T[:, :3, 3], rtol=0, atol=1e-12)


def test_a_tracker_file_with_more_behind_each_place_is_read_beside_its_joints(tmp_path):
    """Uncertainties, angles, words: what they are is not known, and nothing is taken from them."""
    rng = np.random.default_rng(0)
    rows = [f"{x!r},{y!r},{z!r},0.03,0.011,0.013,0.025,88.2,{a:.6f},{b:.6f},0,Red ring,24.6,True"
            for (x, y, z), (a, b) in zip(MM.tolist(), rng.random((M, 2)), strict=True)]  # fmt: skip
    (tmp_path / "points.csv").write_text("\n".join(rows))
    np.savetxt(tmp_path / "theta.csv", DEG, delimiter=",", fmt="%.15g")
    files = [tmp_path / "points.csv", tmp_path / "theta.csv"]
    proposed(tmp_path, files, "--robot", UR10.name)
    table = read_session(tmp_path / "session.toml", UR10).measurements
    np.testing.assert_allclose(table.q, DATA.q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(table.position, DATA.T[:, :3, 3], rtol=0, atol=1e-12)


def test_a_report_with_a_row_for_each_coordinate_is_read(tmp_path):
    rows = [f"P{k + 1},{axis},{MM[k, j] + 0.1!r},{MM[k, j]!r},0.05,-0.1,Pass"
            for k in range(M) for j, axis in enumerate("XYZ")]  # fmt: skip
    text = "\n".join(["Name,Control,Nom,Meas,Tol,Dev,Test", *rows])
    (tmp_path / "report.csv").write_text(text.replace("np.float64(", "").replace(")", ""))
    named = {"Name": [f"P{k + 1}" for k in range(M)]} | joints("J{}")
    (tmp_path / "joints.csv").write_text(csv(named))
    files = [tmp_path / "report.csv", tmp_path / "joints.csv"]
    proposed(tmp_path, files, "--robot", UR10.name)
    table = read_session(tmp_path / "session.toml", UR10).measurements
    np.testing.assert_allclose(table.q, DATA.q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(table.position, DATA.T[:, :3, 3], rtol=0, atol=1e-12)


SLIDING = {
    "mm and deg": (np.array([180 / np.pi, 180 / np.pi, 1e3, 180 / np.pi]), 1e3, "J{}"),
    "m and rad": (np.ones(4), 1.0, "joint_{}"),
    "mm and rad": (np.array([1, 1, 1e3, 1]), 1e3, "axis_{}"),
}


@pytest.mark.parametrize("named", [True, False], ids=["named", "unnamed"])
@pytest.mark.parametrize(("factors", "long", "form"), SLIDING.values(), ids=SLIDING)
def test_a_joint_that_slides_has_a_length(factors, long, form, named, tmp_path):
    robot = scara(tmp_path)
    data = made(5, M, robot=robot)
    q, p = data.q * factors, data.T[:, :3, 3] * long
    table = {form.format(k + 1): q[:, k] for k in range(4)} | places("{}", p)
    text = csv(table, separator=" ")
    (tmp_path / "m.txt").write_text(text if named else text.partition("\n")[2])
    said, _ = proposed(tmp_path, [tmp_path / "m.txt"], "--robot", tmp_path / "robot.toml")
    assert "where it slides" in said
    read = read_session(tmp_path / "session.toml", robot).measurements
    np.testing.assert_allclose(read.q, data.q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(read.position, data.T[:, :3, 3], rtol=0, atol=1e-12)


URDF = """<robot name="lift"><link name="base"/>{}</robot>"""
LINK = """<link name="{child}"/><joint name="{name}" type="{kind}"><parent link="{parent}"/>
<child link="{child}"/><origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>"""
ARM = (("lift_joint", "prismatic", "0 0 0.8", "0 0 0"), ("pan", "revolute", "0.1 0 0", "0 0 0.3"),
       ("tilt", "revolute", "0.1 0.02 0", "1.57 0 0"), ("elbow", "revolute", "0.3 0 0", "0 0 0.2"),
       ("turn", "revolute", "0.3 0 0.05", "0 1.57 0"))  # fmt: skip


def test_columns_called_as_the_joints_of_a_urdf_are_these(tmp_path):
    """In any order, with the same words around them; the lift slides."""
    parents = ["base", *(name + "_link" for name, *_ in ARM)]
    links = [LINK.format(name=name, kind=kind, xyz=xyz, rpy=rpy, parent=parents[k],
                         child=parents[k + 1])
             for k, (name, kind, xyz, rpy) in enumerate(ARM)]  # fmt: skip
    (tmp_path / "lift.urdf").write_text(URDF.format("".join(links)))
    robot = load_robot(tmp_path / "lift.urdf")
    data = made(3, M, robot=replace(robot, free_sets={}))
    order = [3, 0, 4, 2, 1]
    table = {f"arm/{ARM[k][0]}/position": data.q[:, k] for k in order}
    table |= {f"arm/{ARM[k][0]}/effort": 0 * data.q[:, k] for k in order}
    table |= places("{}", data.T[:, :3, 3], "xyz")
    (tmp_path / "m.csv").write_text(csv(table))
    proposed(tmp_path, [tmp_path / "m.csv"], "--robot", tmp_path / "lift.urdf")
    read = read_session(tmp_path / "session.toml", robot).measurements
    np.testing.assert_allclose(read.q, data.q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(read.position, data.T[:, :3, 3], rtol=0, atol=1e-12)


def test_readings_that_hardly_move_are_explained_by_no_robot(tmp_path):
    """Meters taken as millimeters lie within 20 mm of anything."""
    wrong = DATA.q[::-1]
    (tmp_path / "m.csv").write_text(csv(joints("q{}", wrong) | places("{}", MM / 1e3)))
    said, _ = proposed(tmp_path, [tmp_path / "m.csv"], "--robot", UR10.name)
    assert "none of" in said
    assert "fits a nominal" in said


def test_a_target_that_repeats_another_is_left_aside(tmp_path):
    """As where a marker was exported twice; three others are on the tool."""
    arms = 60 * np.eye(3)
    seen = [MM + DATA.T[:, :3, :3] @ arm for arm in arms]
    table = joints("J{}")
    for k, one in enumerate([*seen, seen[2]], 1):
        table |= places(f"{{}}{k}", one, "xyz")
    (tmp_path / "m.csv").write_text(csv(table))
    said, _ = proposed(tmp_path, [tmp_path / "m.csv"], "--robot", UR10.name)
    assert "4 repeats the numbers of 3, and is not used" in said
    assert "to fix" not in said
    assert len(read_session(tmp_path / "session.toml", UR10).measurements) == 3 * M


def test_one_coordinate_in_inches_is_named(tmp_path):
    table = joints("J{}") | {"X": MM[:, 0], "Y": MM[:, 1] / 25.4, "Z": MM[:, 2]}
    (tmp_path / "m.csv").write_text(csv(table))
    done = call("new", "session", tmp_path / "m.csv", "--robot", UR10.name, "--out",
                tmp_path / "session.toml")  # fmt: skip
    assert done.exit_code == 2
    message = " ".join(done.stderr.split())
    assert "if y alone is in inches, not mm; write all three coordinates in one unit" in message


def test_axes_copied_from_a_display_of_kuka_are_read(tmp_path):
    lines = ["{" + ", ".join(f"A{k + 1} {v:.12f}" for k, v in enumerate(q)) + "}" for q in DEG]
    (tmp_path / "axes.txt").write_text("\n".join(lines))
    (tmp_path / "points.csv").write_text(csv(places("{}")))
    files = [tmp_path / "axes.txt", tmp_path / "points.csv"]
    proposed(tmp_path, files, "--robot", UR10.name)
    table = read_session(tmp_path / "session.toml", UR10).measurements
    np.testing.assert_allclose(table.q, DATA.q, rtol=0, atol=1e-12)


def test_an_arm_that_is_built_less_well_is_that_arm(tmp_path):
    """Its links are off by degrees: 20 mm and more, where a wrong reading leaves a tenth of a
    meter."""
    rng = np.random.default_rng(2)
    sd = np.where(UR10.model.is_length, 0.0, np.radians(3.0))
    truth = UR10.model.moved(sd * rng.standard_normal(UR10.model.n_numbers))
    seen = 1e3 * truth.poses(DATA.q)[:, :3, 3]
    (tmp_path / "m.csv").write_text(csv(joints("J{}") | places("{}", seen)))
    said, _ = proposed(tmp_path, [tmp_path / "m.csv"], "--robot", UR10.name)
    found = probe(UR10, read_session(tmp_path / "session.toml", UR10))
    assert found.stated is not None
    assert 0.020 < found.stated.score < found.far < 0.060
    found.raise_if_wrong()
    assert "none of" not in said
    assert "to fix" not in said


def test_among_several_families_of_columns_the_fit_finds_the_joints(tmp_path):
    """Forces in front of the joints, and words of the joints beside what is called J1 ... J6."""
    noise = np.random.default_rng(0).normal(0, 10, (M, 6))
    forces = {f"force_{k + 1}": noise[:, k] for k in range(6)}
    states = of_ros("{}_status", noise)
    for k, table in enumerate((forces | joints("Th{}"), joints("J{}") | states)):
        (tmp_path / f"{k}").mkdir()
        (tmp_path / f"{k}/m.csv").write_text(csv(table | places("{}")))
        said, _ = proposed(tmp_path / f"{k}", [tmp_path / f"{k}/m.csv"], "--robot", UR10.name)
        assert "none of" not in said
        read = read_session(tmp_path / f"{k}/session.toml", UR10).measurements
        np.testing.assert_allclose(read.q, DATA.q, rtol=0, atol=2e-12)


def test_of_the_tables_in_a_document_that_with_most_numbers_is_meant(tmp_path):
    events = [{"t": k, "said": "moving"} for k in range(3 * M)]
    (tmp_path / "m.json").write_text(json.dumps({"log": events} | RECORDS["in an object"]))
    proposed(tmp_path, [tmp_path / "m.json"], "--robot", UR10.name)
    read = read_session(tmp_path / "session.toml", UR10).measurements
    np.testing.assert_allclose(read.q, DATA.q, rtol=0, atol=2e-12)


HALVES = RECORDS["an object for each"][: M // 2], RECORDS["an object for each"][M // 2 :]


@pytest.mark.parametrize(
    "document",
    [
        {"train": HALVES[0], "test": HALVES[1]},
        {"of": {"version": 1}, "train": {"samples": HALVES[0]}, "test": {"samples": HALVES[1]}},
    ],
    ids=["side by side", "in objects"],
)
def test_of_two_tables_alike_none_is_left_out_without_a_word(document, tmp_path):
    (tmp_path / "m.json").write_text(json.dumps(document))
    done = call("new", "session", tmp_path / "m.json", "--out", tmp_path / "session.toml")
    assert done.exit_code == 2
    assert "holds several tables with the same names" in " ".join(done.stderr.split())


LONG = 20_000
ENDLESS = {
    "a cell of brackets": "a,b\n" + "[" * LONG + "]" * LONG + "c,1\n",
    "a word": "a" * 3 * LONG + "\n1 2 3\n",
    "spaces between brackets": "[1 2 3]" + " " * 3 * LONG + "4\n",
    "a number in a name": f"J{'1' * LONG},x,y,z\n1,2,3,4\n",
    "a line that is a mark of Unicode": ",9\n\u2028\n",
    "many numbers in a name": f"{'J1' * LONG},x,y,z\n1,2,3,4\n",
}


@pytest.mark.parametrize("text", ENDLESS.values(), ids=ENDLESS)
def test_long_cells_and_names_take_no_time(text, tmp_path):
    """By expressions that try each start again they took minutes, or all memory."""
    (tmp_path / "m.csv").write_text(text)
    with no_hang():
        done = call("new", "session", tmp_path / "m.csv", "--robot", UR10.name, "--out",
                    tmp_path / "session.toml")  # fmt: skip
    assert done.exit_code in (0, 2)


def message(order, prefix=""):
    """Names, positions and rates of a message of ROS, a gripper among them."""
    own = [f"{prefix}{name}" for name in ROS] + ["finger_joint"]
    q = np.column_stack([DATA.q, np.linspace(0.0, 0.8, M)])
    return [own[k] for k in order], q[:, order], 0.1 * np.cos(q[:, order])


def as_csv(names, q, rates):
    table = {f"field.name{k}": [name] * M for k, name in enumerate(names)}
    table |= {f"field.position{k}": q[:, k] for k in range(len(names))}
    table |= {f"field.velocity{k}": rates[:, k] for k in range(len(names))}
    return csv(table | places("{}"))


def as_json(names, q, rates):
    rows = [
        {"joint_state": {"name": names, "position": list(map(float, a)),
                         "velocity": list(map(float, b))},
         "point": dict(zip("xyz", map(float, p), strict=True))}
        for a, b, p in zip(q, rates, MM, strict=True)
    ]  # fmt: skip
    return json.dumps(rows)


@pytest.mark.parametrize("form", [as_csv, as_json])
@pytest.mark.parametrize("order", [(2, 1, 0, 3, 4, 5), (6, 1, 2, 0, 5, 3, 4)])
@pytest.mark.parametrize("prefix", ["", "left_"])
def test_joints_of_a_message_are_those_that_it_names(form, order, prefix, tmp_path):
    """Drivers sort them by their letters: two were to be swapped, and of three none fitted."""
    file = tmp_path / ("m.json" if form is as_json else "m.csv")
    file.write_text(form(*message(list(order), prefix)))
    said, _ = proposed(tmp_path, [file], "--robot", UR10.name)
    assert "are taken as those of the joints, by the names of joints beside them" in said
    table = read_session(tmp_path / "session.toml", UR10).measurements
    np.testing.assert_allclose(table.q, DATA.q, rtol=0, atol=1e-14)


def test_names_of_other_joints_leave_the_order_of_the_columns(tmp_path):
    _, q, rates = message([0, 1, 2, 3, 4, 5])
    (tmp_path / "m.csv").write_text(as_csv([f"axis_of_{k}" for k in "abcdef"], q, rates))
    proposed(tmp_path, [tmp_path / "m.csv"], "--robot", UR10.name)
    table = read_session(tmp_path / "session.toml", UR10).measurements
    np.testing.assert_allclose(table.q, DATA.q, rtol=0, atol=1e-14)


def seen_markers(noise):
    """Joints and two markers [m], 60 mm apart, of poses that a TX60 takes."""
    rng, data = np.random.default_rng(4), made(6, 40)
    offsets = np.array([[-0.1, -0.03, 0.1], [-0.1, 0.03, 0.05]])
    seen = np.stack([target_points(data.T, offset) for offset in offsets], axis=1)
    return data.q, seen + noise * rng.standard_normal(seen.shape)


@pytest.mark.parametrize("name", ["markers", "measured_positions"])
def test_two_markers_in_one_cell_are_two_targets(name, tmp_path):
    """As pandas writes a column of arrays (2, 3): no column was known as a reading."""
    q, seen = seen_markers(2e-5)
    rows = [f'{k},"{a}","{b}"' for k, (a, b) in enumerate(zip(q, seen, strict=True))]
    (tmp_path / "m.csv").write_text("\n".join([f",joints,{name}", *rows, ""]))
    said, _ = proposed(tmp_path, [tmp_path / "m.csv"], "--robot", "staubli_tx60")
    assert "to fix" not in said
    table = read_session(tmp_path / "session.toml", load_robot("staubli_tx60")).measurements
    assert len(table) == 80
    for k in range(2):
        rows = table.reflector == k
        np.testing.assert_allclose(table.position[rows], seen[:, k], atol=1e-8)


def test_a_rotation_in_one_cell_is_no_three_markers():
    cells = tuple((str(np.eye(3)),) for _ in range(2))
    head = of_rows(Sheet("m.csv", ("R",), cells, (1, 2), ";", "utf-8")).head
    assert head == tuple(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))


@pytest.mark.parametrize(("noise", "assumed"), [(3e-4, (200, 400)), (1e-5, (30, 30))])
def test_noise_is_assumed_by_how_far_two_markers_lie_apart(noise, assumed, tmp_path):
    """With 30 um where markers scatter by 300, R95 of an iiwa was 12.7 mm: what they scatter
    against each other counted as turns of the tool, at the end of a long arm."""
    q, seen = seen_markers(noise)
    records = [
        {"joints": a.tolist(), "a": dict(zip("xyz", b[0].tolist(), strict=True)),
         "b": dict(zip("xyz", b[1].tolist(), strict=True))} for a, b in zip(q, seen, strict=True)
    ]  # fmt: skip
    (tmp_path / "m.json").write_text(json.dumps(records))
    said, text = proposed(tmp_path, [tmp_path / "m.json"], "--robot", "staubli_tx60")
    stated = tomllib.loads(text)["uncertainty"]
    assert assumed[0] <= stated["position_um"] <= assumed[1]
    assert stated["assumed"] is True
    assert ("by which the targets scatter against each other" in said) == (noise > 3e-5)


def test_groups_of_lists_are_several_tables(tmp_path):
    """The groups were taken for poses, of which no column was known as a reading."""
    rows = RECORDS["an object for each"]
    groups = {name: {"spaces": {"0": {"a": rows[:8], "b": rows[8:]}}} for name in ("1.9", "3.2")}
    (tmp_path / "m.json").write_text(json.dumps({"names": ["q"], "heights": groups}))
    done = call("new", "session", tmp_path / "m.json", "--out", tmp_path / "session.toml")
    assert done.exit_code == 2
    said = " ".join(done.stderr.split())
    assert "several tables with the same names: 1.9 a, 1.9 b, 3.2 a and 3.2 b" in said
    assert "join those of one session to one list" in said
