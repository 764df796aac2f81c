"""Files as an engineer with a rented tracker has them: odd ones are read, wrong ones are named."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbed.files.read import read_session
from testbed.robots.catalog import load_robot
from tests.command import call
from tests.testbed.files.made import csv, made
from tests.testbed.proposal.test_session import proposed

UR10 = load_robot("universal_ur10")
M = 40
DATA = made(5, M, robot=UR10)
DEG, MM = np.degrees(DATA.q), 1e3 * DATA.T[:, :3, 3]
X, Y, Z, W = Rotation.from_matrix(DATA.T[:, :3, :3]).as_quat().T


def joints(form, values=DEG):
    return {form.format(j + 1): values[:, j] for j in range(6)}


def places(form, values=MM, axes="XYZ"):
    return {form.format(axis): values[:, k] for k, axis in enumerate(axes)}


def with_units(text, mark, units):
    """A table with its units in the line below the names."""
    head, _, rows = text.partition("\n")
    return "\n".join([head, mark.join(units), rows])


PLAIN = joints("J{}") | places("{}")


def grouped(value, marks=".,"):
    return f"{value:,.9f}".translate(str.maketrans(",.", marks))


def grouped_places(marks):
    return {axis: [grouped(v, marks) for v in MM[:, k]] for k, axis in enumerate("XYZ")}


GERMAN = {"separator": ";", "decimal": ","}
COMMENTS = "# Export of a tracker\n# units: mm, deg\n"
ODD = {
    "semicolons and decimal commas": csv(joints("J{}") | places("{} [mm]"), **GERMAN),
    "meters and radians": csv(joints("q{}", DATA.q) | places("{}", MM / 1e3, "xyz")),
    "heads in another order": csv(
        places("{} (mm)") | {"Comment": ["ok"] * M, "Temp": np.full(M, 21.5)}
        | joints("Axis {} [deg]")
    ),
    "German heads": csv(
        {"Nr": np.arange(M)} | joints("Achse{} [°]") | places("{}_Ist [mm]")
        | places("{}_Soll [mm]", MM + 0.5) | {"Bemerkung": ["-"] * M}, **GERMAN
    ),
    "coordinates of one word": csv(joints("Theta{}") | places("P{}", axes="xyz")),
    "coordinates of a tool": csv(joints("Joint_{}") | places("TCP{}", axes="xyz")),
    "quaternions, scalar first": csv(
        joints("J{}_deg") | places("{}_mm") | {"qw": W, "qx": X, "qy": Y, "qz": Z}
    ),
    "quaternions, scalar last": csv(
        joints("J{}_deg") | places("{}_mm") | {"qx": X, "qy": Y, "qz": Z, "qw": W}
    ),
    "a mark of the encoding": "\ufeff" + csv(PLAIN, eol="\r\n", **GERMAN),
    "the largest errors and tolerances beside": csv(
        PLAIN | places("MPE {}", np.full((M, 3), 0.04)) | places("Tol {}", np.full((M, 3), 0.5))
    ),
    "comments above": COMMENTS + csv(PLAIN),
    "comments of a controller, also between rows": "; exported\n" + csv(
        {"Nr": [f"{k}" if k != 7 else "; beam broken\n7" for k in range(M)]} | PLAIN
    ),
    "a line of units below the names": with_units(
        csv(PLAIN, **GERMAN), ";", ["°"] * 6 + ["mm"] * 3
    ),
    "units in brackets below the names": with_units(
        csv({"Nr": np.arange(M)} | joints("A{}", DATA.q) | places("{}", MM / 1e3)),
        ",", [""] + ["[rad]"] * 6 + ["(m)"] * 3,
    ),
    "entries of transforms": csv(
        joints("joint{}", DATA.q)
        | {f"T{i + 1}{j + 1}": (MM[:, i] if j == 3 else DATA.T[:, i, j])
           for i in range(3) for j in range(4)}
    ),
    "a first column without a name, as pandas writes its index": csv(
        {"": np.arange(M)} | joints("J{}_deg") | places("{}_mm")
    ),
    "a merged cell above each group, and a unit at the end": (
        "Nr;Joints;;;;;;Tool;;[mm]\n"
        + csv({"Nr": np.arange(M)} | joints("A{}") | places("{}"), **GERMAN)
    ),
    "a title, merged cells, names and a line of units": (
        "Calibration 2026\n;Joints;;;;;;Tool\n"
        + with_units(csv({"Nr": np.arange(M)} | joints("A{}") | places("{}"), **GERMAN), ";",
                     ["", *["deg"] * 6, *["mm"] * 3])
    ),
    "minus as in print": csv(PLAIN, **GERMAN).replace("-", "\u2212"),
    "a first cell that could not be computed": csv(
        {"Nr": ["#N/A", *(f"P{k}" for k in range(1, M))]} | PLAIN
    ),
    "a log of a UR controller": csv(
        {"timestamp": 0.1 * np.arange(M)}
        | {f"actual_q_{k}": DATA.q[:, k] for k in range(6)}
        | {f"actual_qd_{k}": np.zeros(M) for k in range(6)} | places("{}")
    ),
    "joints from 0 beside a quaternion, its scalar first": csv(
        {f"J{k} [deg]": DEG[:, k] for k in range(6)} | places("{}_mm")
        | {"q0": W, "q1": X, "q2": Y, "q3": Z}
    ),
    "our names counted from 0": csv({f"q{k}_deg": DEG[:, k] for k in range(6)} | places("{}_mm")),
    "an array that a script assigns": "data = np.array(["
    + ",\n ".join(map(repr, np.hstack([DEG, MM]).tolist())) + "])\n",
    "cells that are lists, of the rotation as well": csv({
        "joints": ['"' + repr(row.tolist()) + '"' for row in DEG],
        "position": ['"' + repr(row.tolist()) + '"' for row in MM],
        "R": ['"' + repr(T[:3, :3].ravel().tolist()) + '"' for T in DATA.T],
    }),
    "messages of ROS": csv(
        {"stamp": 1.7e9 + np.arange(M)} | joints("joint_{}", DATA.q)
        | places("pose.position.{}", MM / 1e3, "xyz")
        | {f"pose.orientation.{axis}": v for axis, v in zip("xyzw", (X, Y, Z, W), strict=True)}
    ),
}  # fmt: skip


@pytest.mark.parametrize("text", ODD.values(), ids=ODD)
def test_an_odd_file_is_proposed_as_it_was_meant(text, tmp_path):
    (tmp_path / "m.csv").write_bytes(text.encode())
    said, _ = proposed(tmp_path, [tmp_path / "m.csv"], "--robot", UR10.name)
    assert "to fix" not in said
    table = read_session(tmp_path / "session.toml", UR10).measurements
    # fifteen digits are written
    np.testing.assert_allclose(table.q, DATA.q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(table.position, DATA.T[:, :3, 3], rtol=0, atol=1e-12)


ARMS = 1e-3 * np.array([[60, 0, 0], [0, 60, 0], [0, 0, 60]])
SEEN = DATA.T[:, None, :3, 3] + np.einsum("mij,kj->mki", DATA.T[:, :3, :3], ARMS)
"""(m, 3, 3) of three reflectors on the tool [m]."""
WIDE = {
    "numbers behind the axes": ("{axis}{k}", ("1", "2", "3"), 1e3),
    "names before the axes": ("SMR{k} {axis} [mm]", ("SMR1", "SMR2", "SMR3"), 1e3),
    "meters by their size": ("P{k}_{axis}", ("P1", "P2", "P3"), 1.0),
}


@pytest.mark.parametrize(("form", "names", "lengths"), WIDE.values(), ids=WIDE)
def test_several_targets_in_a_row_are_points_of_one_pose(form, names, lengths, tmp_path):
    table = joints("J{}") | {
        form.format(axis=axis, k=k + 1): lengths * SEEN[:, k, i]
        for k in range(3) for i, axis in enumerate("xyz")
    }  # fmt: skip
    for name in [form.format(axis=axis, k=2) for axis in "xyz"]:  # one that was not seen
        cells = list(map("{:.15g}".format, table[name]))
        table[name] = [cells[0], "", *cells[2:]]
    (tmp_path / "m.csv").write_text(csv(table))
    said, _ = proposed(tmp_path, [tmp_path / "m.csv"], "--robot", UR10.name)
    assert "to fix" not in said
    assert "unused" not in said
    read = read_session(tmp_path / "session.toml", UR10)
    assert read.name == "m"  # as the file is called
    there = np.delete(np.arange(3 * M), 4)
    assert read.reflector_names == names
    assert len(read.pose_names) == M
    table = read.measurements
    np.testing.assert_array_equal(table.reflector, there % 3)
    # fifteen digits are written
    np.testing.assert_allclose(table.q, DATA.q[there // 3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(table.position, SEEN.reshape(-1, 3)[there], rtol=0, atol=1e-12)


WRONG = {
    "centimeters that nothing states": (
        joints("J{}") | places("{}", MM / 10), "if the positions are in cm, not mm",
    ),
    "a mirrored frame": (PLAIN | {"X": -MM[:, 0]}, "if one of x, y, z has the other sign"),
    "thousands marks in one row alone": (
        PLAIN | {"X": [grouped(MM[0, 0]), *map("{:.4f}".format, MM[1:, 0])]},
        "which has thousands marks",
    ),
    "a joint that is missing": (
        {name: column for name, column in PLAIN.items() if name != "J4"}, "and none for q4",
    ),
    "two joints swapped": (
        PLAIN | {"J2": DEG[:, 2], "J3": DEG[:, 1]}, "if the columns q2 and q3 are swapped",
    ),
    "shifted rows": (PLAIN | places("{}", np.roll(MM, 1, axis=0)), "if row k+1 belongs to pose k"),
    "poses of a controller": (
        joints("actual_q_{}") | {f"actual_TCP_pose_{k}": MM[:, k] for k in range(3)},
        "actual_TCP_pose_0 ... are poses that the controller computed: give what was measured",
    ),
    "counts of encoders": (
        joints("J{}", np.round(1000 * DEG)) | places("{}"), "are counts of encoders, and only the",
    ),
    "targets alone": (joints("J{}") | places("{}_Soll"), "are targets or differences"),
    "a unit that another line contradicts": (
        {name: ["[rad]" if name[0] == "q" else "mm", *column] for name, column in
         (joints("q{}_deg") | places("{}")).items()},
        "is called q1_deg, and the line below the names says rad; correct the one that is wrong",
    ),
}  # fmt: skip


def test_names_and_order_that_agree_are_one_reading(tmp_path):
    names = {"name": [f"p{k}" for k in range(M)]}
    (tmp_path / "joints.csv").write_text(csv(names | joints("J{}")))
    points = [f"Group::p{k}, {x:.6f}, {y:.6f}, {z:.6f}" for k, (x, y, z) in enumerate(MM)]
    (tmp_path / "points.txt").write_text("\n".join(["// from the tracker", *points]))
    files = [tmp_path / "joints.csv", tmp_path / "points.txt"]
    said, _ = proposed(tmp_path, files, "--robot", UR10.name)
    assert "too close to tell them apart" not in said
    assert "the k-th reading belongs" not in said
    session = read_session(tmp_path / "session.toml", UR10)
    assert session.name == tmp_path.name  # as their folder is called
    read = session.measurements
    # six decimals of a millimeter are printed
    np.testing.assert_allclose(read.position, DATA.T[:, :3, 3], rtol=0, atol=1e-9)


def test_all_files_are_named_where_none_has_a_reading(tmp_path):
    (tmp_path / "joints.csv").write_text(csv(joints("J{}")))
    (tmp_path / "log.csv").write_text("state,volts\nok,1\nok,2\n")
    files = [tmp_path / "joints.csv", tmp_path / "log.csv"]
    done = call("new", "session", *files, "--robot", UR10.name, "--out", tmp_path / "session.toml")
    assert done.exit_code == 2
    said = " ".join(done.stderr.split())
    assert "joints.csv, log.csv: none has a column known as a reading" in said


def test_lists_behind_names_are_refused_by_their_line(tmp_path):
    rows = [f"{k} here={{{', '.join(map(str, DEG[k]))}}} {MM[k, 0]} 1 2" for k in range(M)]
    (tmp_path / "log.txt").write_text("\n".join(rows))
    done = call("new", "session", tmp_path / "log.txt", "--robot", UR10.name, "--out",
                tmp_path / "session.toml")  # fmt: skip
    assert done.exit_code == 2
    assert 'log.txt:1: has lists behind names ("here={ ...")' in " ".join(done.stderr.split())


def test_a_table_on_its_side_is_named(tmp_path):
    np.savetxt(tmp_path / "m.csv", np.column_stack([DEG, MM]).T, delimiter=",")
    done = call("new", "session", tmp_path / "m.csv", "--robot", UR10.name, "--out",
                tmp_path / "session.toml")  # fmt: skip
    assert done.exit_code == 2
    assert "turn rows into columns" in " ".join(done.stderr.split())


@pytest.mark.parametrize(("table", "why"), WRONG.values(), ids=WRONG)
def test_a_wrong_file_is_refused_by_name(table, why, tmp_path):
    mark = ";" if "thousands" in why else ","
    (tmp_path / "m.csv").write_text(csv(table, separator=mark), encoding="utf-8")
    done = call("new", "session", tmp_path / "m.csv", "--robot", UR10.name, "--out",
                tmp_path / "session.toml")  # fmt: skip
    assert done.exit_code == 2
    assert why in " ".join(done.stderr.split())
    assert not (tmp_path / "session.toml").exists()


def test_a_sheet_of_words_beside_the_tables_of_a_workbook_is_left_aside(tmp_path):
    """A cover sheet refused the whole workbook, without its name."""
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.title = "Cover"
    for words in (("Project", "Cell 7"), ("Customer", "Acme", "Berlin"), ("Date", "2026-03-02")):
        book.active.append(words)
    book.create_sheet("Plan").append(["Name", "X", "Y", "Z"])  # nothing was filled in
    sheet = book.create_sheet("Data")
    sheet.append([*(f"J{k}" for k in range(1, 7)), *"XYZ"])
    for row in np.hstack([np.degrees(DATA.q), 1e3 * DATA.T[:, :3, 3]]):
        sheet.append(list(map(float, row)))
    book.save(tmp_path / "a.xlsx")
    said, _ = proposed(tmp_path, [tmp_path / "a.xlsx"], "--robot", UR10.name)
    assert "a.xlsx sheet Cover" in said
    assert "a.xlsx sheet Plan" in said
    table = read_session(tmp_path / "session.toml", UR10).measurements
    np.testing.assert_allclose(table.position, DATA.T[:, :3, 3], rtol=0, atol=1e-12)
    assert call("check", tmp_path / "a.xlsx", "--robot", UR10.name).exit_code == 0
    del book["Data"]
    book.save(tmp_path / "b.xlsx")
    done = call("new", "session", tmp_path / "b.xlsx", "--out", tmp_path / "o.toml")
    assert "has no rows below them" in done.stderr
