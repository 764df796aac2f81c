"""Programs corrected: the right numbers in the right cells, everything else as it was."""

import csv
import os
import re

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.frames import exp_so3, log_so3
from calib.geometry.inverse import inverse_kinematics
from calib.geometry.joint_errors import JointErrors, gravity_terms
from calib.geometry.model import RobotModel
from testbed.files.programs.correct import correct_program
from testbed.files.programs.read import ADDED, in_other_units, read_program
from testbed.files.programs.said import outcome_words
from testbed.files.rotations import EULER, in_form, rotations
from testbed.files.text import read_sheet
from testbed.gates.text import read_text
from testbed.identify.handback.deliver import corrected_name
from testbed.robots.catalog import load_robot

ROBOT = load_robot("staubli_tx60")
Q = np.radians([[10, 20, 70, 15, 40, -30], [-40, 35, 60, 5, 70, 20], [25, -10, 95, -30, 35, 80.0]])


@pytest.fixture(scope="module")
def real():
    """The robot as identified, sag included."""
    rng = np.random.default_rng(1)
    nominal = ROBOT.model
    chain = nominal.chain.moved(rng.normal(size=nominal.chain.n_numbers) * 2e-4)
    return RobotModel(chain, JointErrors(gravity_terms(6), [3e-4, 1e-4, 2e-4]))


def written(path, head, rows, mark=",", comments=()):
    lines = [*comments, mark.join(head), *(mark.join(map(str, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def cells(path, mark=","):
    lines = [
        line for line in path.read_text(encoding="utf-8").splitlines() if line and line[0] != "#"
    ]
    return list(csv.DictReader(lines, delimiter=mark))


def test_joint_targets_bring_the_real_robot_where_the_program_meant(tmp_path, real):
    head = ["name", *(f"q{k}_deg" for k in range(1, 7)), "speed"]
    rows = [[f"P{k}", *q, 250] for k, q in enumerate(np.degrees(Q))]
    path = written(tmp_path / "p.csv", head, rows, comments=["# my program", ""])
    found = correct_program(path, ROBOT, real, tmp_path / "out.csv")
    assert found.corrected.all()
    lines = (tmp_path / "out.csv").read_text().splitlines()
    assert lines[:2] == ["# my program", ""]  # comments stay
    out = cells(tmp_path / "out.csv")
    assert list(out[0]) == [*head, *ADDED]
    assert [row["name"] for row in out] == ["P0", "P1", "P2"]
    assert {row["speed"] for row in out} == {"250"}
    q = np.radians([[float(row[f"q{k}_deg"]) for k in range(1, 7)] for row in out])
    want = ROBOT.model.poses(Q)
    assert np.abs(real.poses(q) - want).max() < 1e-9
    np.testing.assert_allclose(q, found.q, atol=1e-15)
    missed = np.linalg.norm((real.poses(Q) - want)[:, :3, 3], axis=1)
    # written with six digits
    assert [float(row["before_mm"]) for row in out] == pytest.approx(1e3 * missed, rel=1e-5)
    assert "3 of 3 targets corrected" in found.sentences[0]
    # searches end at rounding, which is no figure to print
    assert found.left.max() < 1e-9
    assert found.sentences[0].endswith(" mm on average as written")


@pytest.mark.parametrize(("n", "whose"), [(1, "it"), (2, "both"), (3, "all 3")])
def test_one_target_or_two_are_not_counted_again(n, whose):
    said = outcome_words(np.ones(n, dtype=bool), np.full(n, 5e-4), np.zeros(n), ["a", "b", "c"][:n])
    assert f"the tool misses {whose} by 0.500 mm" in said


def test_errors_are_those_of_the_targets_that_were_corrected(tmp_path, real):
    """One that no posture reaches made the mean 162 mm before and 161 mm after."""
    T = ROBOT.model.poses(Q)
    turn = in_form("quaternion", np.zeros((3, 4)), T[:, :3, :3])
    head = ["name", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz", *(f"q{k}_deg" for k in (1, 2))]
    head += [f"q{k}_deg" for k in range(3, 7)]
    rows = [
        [f"P{k}", *row] for k, row in enumerate(np.hstack([1e3 * T[:, :3, 3], turn, np.degrees(Q)]))
    ]
    alone = correct_program(
        written(tmp_path / "a.csv", head, rows), ROBOT, real, tmp_path / "b.csv"
    )
    rows.insert(1, ["far", 3000.0, *rows[0][2:]])
    path = written(tmp_path / "p.csv", head, rows)
    found = correct_program(path, ROBOT, real, tmp_path / "out.csv")
    assert found.status == ("reached", "out of reach", "reached", "reached")
    assert found.before[1] > 1.0
    said = '3 of 4 targets corrected; 1 left as written (target 2 "far"): by the identified model, '
    assert found.sentences[0].startswith(f"{said}the tool misses the 3 corrected by ")
    # searches end at rounding: before is what it is without the fourth
    figures = found.sentences[0].partition(" 3 corrected by ")[2]
    assert figures == alone.sentences[0].partition(" all 3 by ")[2]
    none = written(tmp_path / "n.csv", head, rows[1:2])
    (first, *_) = correct_program(none, ROBOT, real, tmp_path / "none.csv").sentences
    assert first == '0 of 1 target corrected; 1 left as written (target 1 "far")'
    many = written(tmp_path / "m.csv", head, rows[1:2] * 12)
    (first, *_) = correct_program(many, ROBOT, real, tmp_path / "many.csv").sentences
    assert first.startswith("0 of 12 targets corrected; 12 left as written (targets 1 ")
    assert first.endswith('10 "far" and 2 more)')


def test_columns_that_nothing_is_taken_from_are_named(tmp_path, real):
    joints = [f"q{k}_deg" for k in range(1, 7)]

    def told(head, *more):
        rows = [[*q, *more] for q in np.degrees(Q).tolist()]
        out = tmp_path / "out.csv"
        out.unlink(missing_ok=True)
        said = correct_program(written(tmp_path / "p.csv", head, rows), ROBOT, real, out).sentences
        lines = (tmp_path / "out.csv").read_text().splitlines()
        assert all(line.split(",")[6 : 6 + len(more)] == [*map(str, more)] for line in lines[1:])
        return [one for one in said if one.startswith("not used")]

    start = "not used, and left as they are: the program's column"
    assert told([*joints, "q7_deg"], 5) == [f"{start} q7_deg"]
    assert told([*joints, "speed", "zone", "approach"], 5, 1, "+") == [
        f"{start}s speed, zone and approach"
    ]
    (hinted,) = told([*joints, "paylod_kg"], 5)
    assert hinted.endswith(' paylod_kg; did you mean "payload_kg"?')
    # of two names the first one is read; rotations without positions are no targets
    assert told([*joints, "name", "pose_id", "rx_deg"], "a", "b", 0) == [
        f"{start}s name and rx_deg"
    ]
    read = [
        "payload_kg",
        "payload_x_mm",
        "payload_y_mm",
        "payload_z_mm",
        "tool",
        "temperature_degC",
    ]
    assert not told([*joints, *read, "target"], 1, 2, 3, 4, "probe", 20, "T1")
    # no position without x, and no reason to refuse the joints when they are written already
    assert told([*joints, "z_m"], 1) == [f"{start} z_m"]
    # but places that lack their x would stand beside corrected joints as they were
    with pytest.raises(InputError, match=r'a column y_mm but none for x; did you mean "x_mm"\?'):
        told([*joints, "xx_mm", "y_mm", "z_mm"], 1, 2, 3)
    many = [f"c{k}" for k in range(13)]
    assert told([*joints, *many], *range(13))[0].endswith(" c8, c9 and 3 more")
    assert not told([f"A{k}" for k in range(1, 7)])


def test_targets_in_another_unit_than_their_columns_say_are_said_to_be(tmp_path, real):
    """Radians called degrees and meters called millimeters: each target alone seems a bad one."""
    joints, place = [f"q{k}_deg" for k in range(1, 7)], ["x_mm", "y_mm", "z_mm", "rvx_deg"]
    place += ["rvy_deg", "rvz_deg"]
    T = ROBOT.model.poses(Q)
    turn = np.degrees(log_so3(T[:, :3, :3]))
    cases = {
        "in radians": (joints, Q, np.degrees(Q)),
        "in meters": (place, *(np.hstack([f * T[:, :3, 3], turn]) for f in (1, 1e3))),
    }
    for said, (head, wrong, right) in cases.items():
        for k, (rows, told) in enumerate(((wrong, True), (right, False), (wrong[:2], False))):
            path = written(tmp_path / f"{said}{k}.csv", head, rows.tolist())
            found = in_other_units(read_program(path, ROBOT)[1], ROBOT)
            assert any(said in one for one in found) == told
    path = written(tmp_path / "whole.csv", joints, Q.tolist())
    sentences = correct_program(path, ROBOT, real, tmp_path / "out.csv").sentences
    assert any("in radians" in one for one in sentences)


FORMS = {
    "quaternion": ["qw", "qx", "qy", "qz"],
    "matrix": [f"r{i}{j}" for i in "123" for j in "123"],
    "rotation_vector": ["rvx_deg", "rvy_deg", "rvz_deg"],
    "XYZ": ["rx_deg", "ry_deg", "rz_deg"],
    "zyx": ["rx_rad", "ry_rad", "rz_rad"],
    "YZX": ["rx_deg", "ry_deg", "rz_deg"],
    "ZYZ": ["e1_deg", "e2_deg", "e3_deg"],
}


@pytest.mark.parametrize("form", FORMS)
def test_cartesian_targets_go_through_the_nominal_controller_to_the_right_place(
    form, tmp_path, real
):
    T = ROBOT.model.poses(Q)
    turn = in_form(form, np.zeros((3, len(FORMS[form]))), T[:, :3, :3])
    # the columns are x, y, z; the numbers follow the letters
    letters = form.upper() if FORMS[form][0].startswith("rx") else "XYZ"
    count = len(FORMS[form])
    turn = turn[:, [letters.index(axis) for axis in "XYZ"]] if count == 3 else turn
    factor = 180 / np.pi if "_deg" in FORMS[form][0] else 1.0
    head = ["x_mm", "y_mm", "z_mm", *FORMS[form], *(f"q{k}_deg" for k in range(1, 7))]
    rows = np.hstack([1e3 * T[:, :3, 3], factor * turn, np.degrees(Q) + 0.5])
    stated = [form] if form in EULER else []
    lines = [[*row, *stated] for row in rows.tolist()]
    path = written(tmp_path / "p.csv", [*head, *(["euler"] if stated else [])], lines)
    found = correct_program(path, ROBOT, real, tmp_path / "out.csv")
    assert found.corrected.all()
    out = cells(tmp_path / "out.csv")
    new = np.array([[float(row[name]) for name in head] for row in out])
    numbers = new[:, 3 : 3 + len(FORMS[form])] / factor
    R = rotations(
        form, numbers[:, ["XYZ".index(axis) for axis in letters]] if count == 3 else numbers
    )
    told = np.tile(np.eye(4), (3, 1, 1))
    told[:, :3, :3], told[:, :3, 3] = R, new[:, :3] / 1e3
    # nothing jumps: the numbers stay near what they were
    assert np.abs(new - rows).max() < 1.0
    taken = inverse_kinematics(ROBOT.model, told, Q, ROBOT.limits).q  # the controller
    assert np.abs(real.poses(taken)[:, :3] - T[:, :3]).max() < 1e-9
    # joint columns only say in which configuration; they are no targets here
    np.testing.assert_array_equal(new[:, -6:], rows[:, -6:])


def test_without_joints_the_configuration_is_assumed_and_said(tmp_path, real):
    near = Q[:1] + np.radians(2) * np.arange(3)[:, None]
    T = ROBOT.model.poses(near)
    turn = in_form("quaternion", np.zeros((3, 4)), T[:, :3, :3])
    head = ["x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"]
    path = written(tmp_path / "p.csv", head, np.hstack([T[:, :3, 3], turn]).tolist())
    found = correct_program(path, ROBOT, real, tmp_path / "out.csv")
    assert found.corrected.all()
    assert np.abs(np.diff(found.q, axis=0)).max() < np.radians(4)  # one configuration
    assert "configuration" in found.sentences[-1]


def test_what_cannot_be_corrected_stays_as_it_was_and_is_listed(tmp_path, real):
    q = Q.copy()
    q[1, 4] = 0.002  # axes 4 and 6 nearly in line
    q[2, 0] = ROBOT.limits[0, 1]  # its correction may lie beyond
    head = [f"q{k}_rad" for k in range(1, 7)]
    path = written(tmp_path / "p.csv", head, [[repr(v) for v in row] for row in q.tolist()])
    found = correct_program(path, ROBOT, real, tmp_path / "out.csv")
    out = cells(tmp_path / "out.csv")
    assert len(out) == 3
    assert found.status[0] == "reached"
    assert found.status[1] == "singular"
    assert out[1]["q5_rad"] == "0.002"
    assert [row["status"] for row in out] == list(found.status)
    for k, ok in enumerate(found.corrected):
        if not ok:
            assert found.left[k] == pytest.approx(found.before[k], rel=1e-9)
            assert [float(out[k][name]) for name in head] == q[k].tolist()
    assert any("left as written" in sentence for sentence in found.sentences)


def test_a_target_outside_the_joint_limits_stays_and_is_said_to_be_there(tmp_path, real):
    head = [f"q{k}_deg" for k in range(1, 7)]
    rows = [*np.degrees(Q).tolist() * 10, [250, 20, 70, 15, 40, -30]]
    path = written(tmp_path / "p.csv", head, rows)
    found = correct_program(path, ROBOT, real, tmp_path / "out.csv")
    assert found.status == ("reached",) * 30 + ("limits",)
    last = cells(tmp_path / "out.csv")[-1]
    assert (last["q1_deg"], last["status"]) == ("250", "limits")
    assert any("is outside the joint limits" in said for said in found.sentences)
    assert not any("singular" in said for said in found.sentences)
    warned = next(said for said in found.sentences if said.startswith("p.csv: 1 joint value lies"))
    assert warned.endswith('in line 32: q1_deg = "250"; its limits are -180 to 180 deg')


def test_joints_that_contradict_their_pose_leave_the_target_as_written(tmp_path, real):
    T = ROBOT.model.poses(Q)
    turn = in_form("quaternion", np.zeros((3, 4)), T[:, :3, :3])
    head = ["x_m", "y_m", "z_m", "qw", "qx", "qy", "qz", *(f"q{k}_deg" for k in range(1, 7))]
    beside = np.degrees(Q)
    beside[1:] = beside[[2, 1]]
    rows = np.hstack([T[:, :3, 3], turn, beside]).tolist()
    path = written(tmp_path / "p.csv", head, [rows[0], rows[1], rows[2]], comments=["# joints"])
    found = correct_program(path, ROBOT, real, tmp_path / "out.csv")
    assert found.status == ("reached", "other joints", "other joints")
    out = cells(tmp_path / "out.csv")
    assert [float(out[1][name]) for name in head] == rows[1]
    np.testing.assert_array_equal(found.left[1:], found.before[1:])
    said = next(text for text in found.sentences if "do not belong to their poses" in text)
    assert said.startswith("2 of 3 targets are left as written")
    assert "the first in line 4: " in said


@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_a_quoted_number_sign_is_no_comment_in_the_corrected_program_either(mark, tmp_path, real):
    head = ['"#name"', *(f"q{k}_deg" for k in range(1, 7))]
    rows = [[f'" #{k}"', *q] for k, q in enumerate(np.degrees(Q))]
    path = written(tmp_path / "p.csv", head, rows, mark)
    assert correct_program(path, ROBOT, real, tmp_path / "out.csv").corrected.all()
    sheet = read_sheet(read_text(tmp_path / "out.csv", "out.csv"))
    assert sheet.head == ("#name", *head[1:], *ADDED)
    assert [row[0] for row in sheet.rows] == ["#0", "#1", "#2"]


def test_a_decimal_comma_and_a_semicolon_stay(tmp_path, real):
    head = [f"q{k}_deg" for k in range(1, 7)]
    rows = [[str(v).replace(".", ",") for v in row] for row in np.degrees(Q).tolist()]
    path = written(tmp_path / "p.csv", head, rows, mark=";")
    found = correct_program(path, ROBOT, real, tmp_path / "out.csv")
    out = cells(tmp_path / "out.csv", ";")
    q = np.radians([[float(row[name].replace(",", ".")) for name in head] for row in out])
    np.testing.assert_allclose(q, found.q, atol=1e-15)


def test_columns_of_measurements_say_nothing_in_a_program(tmp_path, real):
    joints = {f"q{k + 1}_deg": column for k, column in enumerate(np.degrees(Q).T.tolist())}
    plain = written(tmp_path / "p.csv", list(joints), zip(*joints.values(), strict=True))
    wild = {"order": ["", 1, "x"], "repeat": [0.5, "", 2], "split": ["a", "", "test"]}
    wild |= {"time": ["soon", 5, ""], "time_s": ["", "", "x"], "approach": ["", "up", ""]}
    table = {"order": wild.pop("order"), **joints, **wild}
    path = written(tmp_path / "w.csv", list(table), zip(*table.values(), strict=True))
    found = correct_program(path, ROBOT, real, tmp_path / "w_out.csv")
    same = correct_program(plain, ROBOT, real, tmp_path / "p_out.csv")
    np.testing.assert_array_equal(found.q, same.q)
    *others, unused = found.sentences
    assert tuple(others) == same.sentences
    assert unused.endswith(" order, repeat, split, time, time_s and approach")
    out = cells(tmp_path / "w_out.csv")
    assert [[row[name] for row in out] for name in wild] == [
        [str(cell) for cell in column] for column in wild.values()
    ]


def test_a_comma_before_three_digits_of_a_degree_is_the_decimal_mark(tmp_path, real):
    head = [f"q{k}_deg" for k in range(1, 7)]
    rows = np.round(np.degrees(Q)) + 0.125
    commas = [[f"{v:.3f}".replace(".", ",") for v in row] for row in rows]
    assert all(not cell.lstrip("-").startswith("0") for row in commas for cell in row)
    plain = correct_program(written(tmp_path / "p.csv", head, rows.tolist()), ROBOT, real,
                            tmp_path / "out.csv")  # fmt: skip
    path = written(tmp_path / "c.csv", head, commas, mark=";")
    np.testing.assert_array_equal(
        correct_program(path, ROBOT, real, tmp_path / "c_out.csv").q, plain.q
    )
    names = written(tmp_path / "n.csv", [f"A{k}" for k in range(1, 7)], commas, mark=";")
    np.testing.assert_array_equal(
        correct_program(names, ROBOT, real, tmp_path / "n_out.csv").q, plain.q
    )


def test_a_program_that_may_have_thousands_marks_says_what_helps_and_that_does(tmp_path, real):
    head = ["work_object", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"]
    rows = [["table, v1.2", x, "1,234", 500, 1, 0, 0, 0] for x in ("1,234", "-1,234")]
    path = written(tmp_path / "p.csv", head, rows, mark=";")
    with pytest.raises(InputError, match="thousands marks; write one of them with") as caught:
        read_program(path, ROBOT)
    assert "session.toml" not in str(caught.value)
    path.write_text(path.read_text().replace("-1,234", "-1,2340"))
    _, table = read_program(path, ROBOT)
    assert table.numbers(["x_mm"])[:, 0].tolist() == [1.234, -1.234]


def test_a_line_of_units_stays_below_the_names(tmp_path, real):
    head = [f"q{k}_rad" for k in range(1, 7)]
    plain = correct_program(written(tmp_path / "p.csv", head, Q.tolist()), ROBOT, real,
                            tmp_path / "out.csv")  # fmt: skip
    units = written(tmp_path / "u.csv", head, [["rad"] * 6, *Q.tolist()])
    found = correct_program(units, ROBOT, real, tmp_path / "units.csv")
    np.testing.assert_array_equal(found.q, plain.q)
    names, below, *rows = (tmp_path / "units.csv").read_text().splitlines()
    assert [names, *rows] == (tmp_path / "out.csv").read_text().splitlines()
    assert below.split(",") == ["rad"] * 6 + [""] * (names.count(",") - 5)


ENDS = {"lines": b"\n", "carriage returns": b"\r\n", "old": b"\r", "mixed": b""}


@pytest.mark.parametrize("ends", ENDS)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "cp1252"])
def test_a_corrected_program_differs_in_the_corrected_numbers_and_the_columns_behind(
    ends, encoding, tmp_path, real
):
    word = {"cp1252": "Prüf – Größe", "latin-1": "Prüfgröße"}.get(encoding, "Prüf – 位置")
    head = ["", *(f"q{k}_deg" for k in range(1, 7)), "side", "note"]
    q = [[f"{v:.1f}".replace(".", ",") for v in row] for row in np.degrees(Q)]
    lines = [
        f'# {word}; "as taught"',
        "; ".join(head),
        "",
        *("; ".join([f'"P;{k}"', *row, "-x", f'  "{word}"  ']) for k, row in enumerate(q)),
        "# the end",
        "",
    ]
    marks = [ENDS[ends] or (b"\r\n", b"\n")[k % 2] for k in range(len(lines) - 1)]
    coded = [line.encode("utf-8" if "utf" in encoding else encoding) for line in lines]
    bom = b"\xef\xbb\xbf" if encoding == "utf-8-sig" else b""
    path = tmp_path / "p.csv"
    path.write_bytes(bom + b"".join(map(b"".join, zip(coded, [*marks, b""], strict=True))))
    found = correct_program(path, ROBOT, real, tmp_path / "out.csv")
    assert found.corrected.all()
    # the second way: the original's bytes with the result's numbers put in, and the columns cut off
    told = (tmp_path / "out.csv").read_bytes()
    degrees = found.q / (np.pi / 180)  # not np.degrees, which may round its last bit otherwise
    numbers = [[repr(v).replace(".", ",") for v in row] for row in degrees.tolist()]
    for k, row in enumerate(q):
        new = "; ".join(numbers[k]).encode()
        assert told.count(new) == 1
        told = told.replace(new, "; ".join(row).encode())
        coded[3 + k] = coded[3 + k].rstrip()
    for k in (1, 3, 4, 5):
        cut = re.compile(re.escape(coded[k]) + rb"(;[^;\r\n]*){%d}" % len(ADDED))
        told, count = cut.subn(lambda _, k=k: coded[k], told)
        assert count == 1
    assert told == bom + b"".join(map(b"".join, zip(coded, [*marks, b""], strict=True)))


def test_numbers_that_a_correction_leaves_keep_their_digits(tmp_path):
    turned = ROBOT.model.chain.moved(np.zeros(ROBOT.model.chain.n_numbers))
    head = [f"q{k}_deg" for k in range(1, 7)]
    rows = [["10.50", "2E1", "+70", "015.000", " 40 ", "-30."]]
    path = written(tmp_path / "p.csv", head, rows)
    found = correct_program(path, ROBOT, RobotModel(turned), tmp_path / "out.csv")
    assert found.corrected.all()
    assert (tmp_path / "out.csv").read_text().splitlines()[1].startswith(",".join(rows[0]).strip())


@pytest.mark.parametrize("form", ["quaternion", "matrix", "rotation_vector", *EULER])
def test_numbers_of_a_rotation_mean_that_rotation_and_stay_where_they_were(form):
    rng = np.random.default_rng(7)
    count = {"quaternion": 4, "matrix": 9}.get(form, 3)
    old = rng.normal(size=(40, count)) * 2.0
    if count > 3:
        old = in_form(form, old, exp_so3(rng.normal(size=(40, 3)) * 2.0))
    R = rotations(form, old)
    moved = R @ exp_so3(rng.normal(size=(40, 3)) * 1e-9)
    new = in_form(form, old, moved)
    assert np.abs(log_so3(np.swapaxes(rotations(form, new), 1, 2) @ moved)).max() < 1e-12
    # 1e-9 rad, times what a sequence near its lock makes of it; a vector of whole turns may unwind
    near = np.abs(new - old).max(axis=1) < 1e-6
    if form == "rotation_vector":
        near |= np.linalg.norm(old, axis=1) > 2 * np.pi
    assert near.all()


@pytest.mark.parametrize(
    ("head", "row", "said"),
    [
        (["q1_deg", "q2_deg"], [1, 2], "no column for 4 of the 6 joints"),
        (["x_mm", "y_mm", "z_mm"], [1, 2, 3], "positions without rotations"),
        (
            ["x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg"],
            [1] * 6,
            "no euler, which says how .* add a column euler, with",
        ),
        ([*(f"q{k}_deg" for k in range(1, 7)), "status"], [1] * 7, "already"),
        ([f"q{k}_rad" for k in range(1, 7)], [40.0] * 6, "outside the limits"),
        ([f"q{k}_deg" for k in range(1, 7)], [1, 2, 3, 4, 5, "x"], "not numbers"),
        ([*(f"q{k}_deg" for k in range(1, 6)), "q6"], [1] * 6, "q6; name the columns so, with"),
        ([f"A{k}" for k in range(1, 7)], [1] * 6, "may be degrees or radians: rename them as q1_d"),
        ([f"A{k}" for k in range(1, 6)], [40] * 5, "joints are q1_deg ... q6_deg .* rename its"),
        (list("XYZABC"), [400] * 6, "found: X, Y, Z, A, B, C; rename its columns like this"),
    ],
)
def test_a_program_that_is_not_understood_is_refused_and_nothing_written(
    head, row, said, tmp_path, real
):
    path = written(tmp_path / "p.csv", head, [row])
    with pytest.raises(InputError, match=said):
        correct_program(path, ROBOT, real, tmp_path / "out.csv")
    assert not (tmp_path / "out.csv").exists()


@pytest.mark.parametrize("sentence", ["in_other_units", "renamed_words", "target_names"])
def test_what_is_said_of_a_program_is_made_before_it_is_written(
    sentence, monkeypatch, tmp_path, real
):
    def fails(*_):
        raise InputError("no number", code="M35")

    monkeypatch.setattr(f"testbed.files.programs.correct.{sentence}", fails)
    path = written(tmp_path / "p.csv", [f"q{k}_deg" for k in range(1, 7)], np.degrees(Q))
    with pytest.raises(InputError, match="no number"):
        correct_program(path, ROBOT, real, tmp_path / "out.csv")
    assert not (tmp_path / "out.csv").exists()


@pytest.mark.parametrize(
    ("head", "unit", "mark"),
    [
        ([f"A{k}" for k in range(1, 7)], "deg", ","),
        ([f"J{k} [deg]" for k in range(6, 0, -1)], "deg", ";"),
        ([f"joint_{k}_rad" for k in range(1, 7)], "rad", ","),
    ],
)
def test_joints_under_the_names_of_other_controllers_are_taken_by_their_numbers(
    head, unit, mark, tmp_path, real
):
    joint = [int("".join(filter(str.isdigit, name))) - 1 for name in head]
    numbers = np.degrees(Q) if unit == "deg" else Q
    ours = written(tmp_path / "a.csv", [f"q{k}_{unit}" for k in range(1, 7)], numbers.tolist())
    theirs = written(tmp_path / "b.csv", head, numbers[:, joint].tolist(), mark)
    plain = correct_program(ours, ROBOT, real, tmp_path / "a_out.csv")
    found = correct_program(theirs, ROBOT, real, tmp_path / "b_out.csv")
    np.testing.assert_array_equal(found.q, plain.q)
    assert list(cells(tmp_path / "b_out.csv", mark)[0])[:6] == head
    first, last = (next(n for n in head if str(k) in n) for k in (1, 6))
    said = f"columns {first} to {last} are taken as the joints 1 to 6 of {ROBOT.name}, in {unit}"
    assert found.sentences[1].endswith(said)
    assert not any("taken as" in text for text in plain.sentences)


def test_no_file_is_overwritten(tmp_path, real):
    head = [f"q{k}_rad" for k in range(1, 7)]
    path = written(tmp_path / "p.csv", head, Q.tolist())
    before = path.read_bytes()
    with pytest.raises(InputError, match="is the program itself"):
        correct_program(path, ROBOT, real, path)
    correct_program(path, ROBOT, real, tmp_path / "out.csv")
    with pytest.raises(InputError, match="exists"):
        correct_program(path, ROBOT, real, tmp_path / "out.csv")
    assert path.read_bytes() == before


@pytest.mark.parametrize("stem", ["p", "x" * 228, "x" * 251, "é" * 125, "x" * 230 + "\udcff"])
def test_a_program_of_the_longest_name_is_corrected_under_one_that_a_file_can_have(
    stem, tmp_path, real
):
    path = written(tmp_path / f"{stem}.csv", [f"q{k}_rad" for k in range(1, 7)], Q.tolist())
    name = corrected_name(path)
    assert correct_program(path, ROBOT, real, tmp_path / name).corrected.all()
    assert len(cells(tmp_path / name)) == len(Q)
    kept = name.removesuffix("_corrected.csv")
    assert stem.startswith(kept)
    assert kept == stem or 198 < len(os.fsencode(kept)) <= 200  # letters stay whole


SCARA = """
format = 1
name = "scara"
"""
LINKS = [("revolute", 400, 325, 0), ("revolute", 0, 275, 180), ("prismatic", 0, 0, 0),
         ("revolute", 50, 0, 0)]  # fmt: skip


def scara(folder):
    """An arm of four joints, as its maker draws it."""
    text = SCARA
    for kind, d, a, alpha in LINKS:
        unit = "mm" if kind == "prismatic" else "deg"
        text += f"""
[[joints]]
kind = "{kind}"
theta_deg = 0
d_mm = {d}
a_mm = {a}
alpha_deg = {alpha}
lower_{unit} = -200
upper_{unit} = 200
"""
    (folder / "robot.toml").write_text(text, encoding="utf-8")
    return load_robot(folder / "robot.toml")


@pytest.mark.parametrize("poses", [False, True], ids=["joints", "poses"])
def test_a_program_of_an_arm_of_four_joints_is_corrected_and_says_what_stays_turned(
    tmp_path, poses
):
    robot = scara(tmp_path)
    chain = robot.model.chain
    numbers = np.random.default_rng(2).normal(size=chain.n_numbers)
    real = RobotModel(chain.moved(numbers * 3e-4))
    q = np.array([[0.3, 0.8, 0.05, 0.4], [-0.6, 1.2, 0.1, -1.0], [1.1, -0.9, 0.02, 2.0]])
    want = robot.model.poses(q)
    if poses:  # rounded as people write them, the tool straight down
        head = ["x_mm", "y_mm", "z_mm", "euler", "rx_deg", "ry_deg", "rz_deg"]
        head += ["q1_deg", "q2_deg", "q3_mm", "q4_deg"]
        rows = []
        for T, one in zip(want, q, strict=True):
            yaw = np.degrees(np.arctan2(T[1, 0], T[0, 0]))
            joints = np.degrees(one) * [1, 1, 0, 1] + [0, 0, 1e3 * one[2], 0]
            place = (1e3 * T[:3, 3]).round(4)
            rows.append([*place, "ZYX", 180, 0, round(yaw, 4), *joints.round(3)])
    else:
        head = ["q1_deg", "q2_deg", "q3_mm", "q4_deg"]
        rows = np.where([1, 1, 0, 1], np.degrees(q), 1e3 * q)
    path = written(tmp_path / "p.csv", head, rows)
    found = correct_program(path, robot, real, tmp_path / "out.csv")
    assert found.corrected.all()
    assert found.before.min() > 1e-4
    assert found.left.max() < 1e-9
    there = real.poses(found.q)
    # what is written is rounded to 0.1 um
    np.testing.assert_allclose(there[:, :3, 3], want[:, :3, 3], atol=1e-7 if poses else 1e-9)
    tilt = np.degrees(np.linalg.norm(np.cross(there[:, :3, 2], want[:, :3, 2]), axis=1)).max()
    said = [one for one in found.sentences if "cannot orient its tool freely" in one]
    assert len(said) == 1
    assert f"up to {tilt:.2g} deg of the rotation remains" in said[0]
