"""Rows that no line names: transforms in each order, and names of poses before the numbers.

Truth: the files are written here from poses that are known.
"""

import numpy as np
import pytest

from testbed.files.read import ReadOptions, read_session
from testbed.proposal.data import look_at
from testbed.proposal.rows.markers import markers_in
from tests.command import call
from tests.testbed.files.made import made
from tests.testbed.proposal.test_odd_files import UR10
from tests.testbed.proposal.test_session import proposed

M = 16
"""Poses: hundreds of interpretations of each file are tried."""
DATA = made(5, M, robot=UR10)
DEG, MM = np.degrees(DATA.q), 1e3 * DATA.T[:, :3, 3]
MILLIMETERS = np.where(np.arange(4) == 3, np.array([[1e3], [1e3], [1e3], [1.0]]), 1.0) * DATA.T
ROWS = MILLIMETERS.reshape(M, 16)
COLUMNS = MILLIMETERS.transpose(0, 2, 1)
TURNED = DATA.T[:, :3, :3].transpose(0, 2, 1).reshape(M, 9)
INVERSE = np.linalg.inv(DATA.T).reshape(M, 16)
NAMES = np.array([f"P{k + 1}" for k in range(M)])


def text(*blocks, mark=" "):
    """Lines of names and of numbers with eleven decimals."""
    lines = ([cell for block in row for cell in (
        [f"{v:.11f}" for v in block] if isinstance(block, np.ndarray) else [block]
    )] for row in zip(*blocks, strict=True))  # fmt: skip
    return "\n".join(map(mark.join, lines))


FILES = {
    "joints, then 4 x 4": [text(DEG, ROWS)],
    "4 x 4, then joints": [text(ROWS, DEG, mark=",")],
    "joints, then 3 x 4 in meters": [text(DATA.q, DATA.T.reshape(M, 16)[:, :12], mark="\t")],
    "4 x 4 by columns": [text(DEG, COLUMNS.reshape(M, 16), mark=";")],
    "3 x 4 by columns": [text(DEG, COLUMNS[:, :, :3].reshape(M, 12))],
    "a number, a place, a rotation by columns": [text(np.arange(M)[:, None], DEG, MM, TURNED)],
    "the tracker in the tool": [text(DEG, INVERSE)],
    "in two files": [text(DEG), text(ROWS)],
    "a name, joints, a place": [text(NAMES, DEG, MM, mark=",")],
    "a name and joints; a name and a place": [text(NAMES, DEG), text(NAMES[::-1], MM[::-1])],
    "a name and joints; a name and 3 x 4": [text(NAMES, DEG), text(NAMES[::-1], ROWS[::-1, :12])],
}


@pytest.mark.parametrize("texts", FILES.values(), ids=FILES)
def test_rows_without_names_are_proposed_as_they_were_meant(texts, tmp_path):
    files = [tmp_path / f"{name}.txt" for name in "ab"[: len(texts)]]
    for file, one in zip(files, texts, strict=True):
        file.write_text(one)
    said, _ = proposed(tmp_path, files, "--robot", UR10.name)
    assert "to fix" not in said
    table = read_session(tmp_path / "session.toml", UR10).measurements
    at = [int(np.abs(DATA.q - q).max(axis=1).argmin()) for q in table.q]
    assert sorted(at) == list(range(M))
    # eleven decimals of a degree, of a millimeter and, in an inverse, of a rotation of 3 m
    np.testing.assert_allclose(table.q, DATA.q[at], rtol=0, atol=1e-11)
    np.testing.assert_allclose(table.position, DATA.T[at, :3, 3], rtol=0, atol=1e-10)
    if table.is_pose.any():
        assert "taken as" in said
        np.testing.assert_allclose(table.rotation, DATA.T[at, :3, :3], rtol=0, atol=1e-10)


SQUARES = [text(one) for one in MILLIMETERS]


@pytest.mark.parametrize(
    "printed",
    [
        "\n".join(SQUARES),
        "\n\n".join(one.replace(" ", ", ") for one in SQUARES),
        "\n".join(f"DataSet_2\n{one}\n" for one in SQUARES),
        "\n".join(f"pose {k + 1}\n{one}" for k, one in enumerate(SQUARES)),
        "\n".join("[[" + one.replace("\n", "]\n [") + "]]" for one in SQUARES),
    ],
    ids=["alone", "with commas", "below a title", "below a name", "as a console prints them"],
)
def test_transforms_over_four_lines_are_a_row_each(printed, tmp_path):
    (tmp_path / "a.txt").write_text(printed)
    (look,) = look_at([tmp_path / "a.txt"], tmp_path)
    named = int("pose" in printed)
    assert (look.rows, look.width, look.names) == (M, 16, named)
    assert [look.column(str(k + 1 + named)) for k in range(16)] == [
        tuple(f"{v:.11f}" for v in column) for column in ROWS.T
    ]


def test_transforms_over_four_lines_below_a_title_are_proposed(tmp_path):
    files = [tmp_path / "a.txt", tmp_path / "b.txt"]
    files[0].write_text(text(DEG))
    files[1].write_text("\n".join(f"DataSet_2\n{one}\n" for one in SQUARES))
    said, _ = proposed(tmp_path, files, "--robot", UR10.name)
    assert "to fix" not in said
    table = read_session(tmp_path / "session.toml", UR10).measurements
    np.testing.assert_allclose(table.q, DATA.q, rtol=0, atol=1e-11)
    np.testing.assert_allclose(table.position, DATA.T[:, :3, 3], rtol=0, atol=1e-10)
    np.testing.assert_allclose(table.rotation, DATA.T[:, :3, :3], rtol=0, atol=1e-10)


def matrix(name, rows, mark=" ", ends=";", last="];"):
    return f"{name} = [\n" + text(rows, mark=mark).replace("\n", f"{ends}\n") + last


@pytest.mark.parametrize(
    ("printed", "line"),
    [
        ("% measured\nclear; clc\n" + matrix("Q", DEG) + "\n" + matrix("P", MM), 3),
        (f"Q =\n\n{text(DEG)}\n\nP =\n\n{text(MM)}\n", 1),
    ],
    ids=["a script", "a console"],
)
def test_matrices_behind_names_are_to_be_files_of_their_own(printed, line, tmp_path):
    (tmp_path / "a.m").write_text(printed)
    done = call("new", "session", tmp_path / "a.m", "--out", tmp_path / "session.toml")
    assert done.exit_code == 2
    assert f"a.m:{line}: begins a matrix behind a name (Q =)" in " ".join(done.stderr.split())


def test_lines_of_keys_above_a_table_begin_no_matrix(tmp_path):
    above = "Operator =\nTemperature = (20.5)\nUnits = [mm]\nJ1,J2,J3,J4,J5,J6,X,Y,Z\n"
    (tmp_path / "a.csv").write_text(above + text(DEG, MM, mark=","))
    said, _ = proposed(tmp_path, [tmp_path / "a.csv"], "--robot", UR10.name)
    assert "to fix" not in said


def test_squares_that_are_no_transforms_stay_as_they_are(tmp_path):
    """Four numbers in each row: an angle and a place, of which one in four is 0 0 0 1."""
    rows = np.arange(32.0).reshape(8, 4)
    rows[3] = 0, 0, 0, 1
    (tmp_path / "a.txt").write_text(text(rows))
    (look,) = look_at([tmp_path / "a.txt"], tmp_path)
    assert (look.rows, look.width) == (8, 4)


def test_tabs_and_spaces_in_one_line_are_both_white_space(tmp_path):
    joints = [line.replace(" ", "\t", 5 - k % 3) for k, line in enumerate(text(DEG).split("\n"))]
    files = [tmp_path / "a.txt", tmp_path / "b.txt"]
    files[0].write_text("\n".join(joints))
    files[1].write_text(text(MM).replace(" ", "  "))
    said, _ = proposed(tmp_path, files, "--robot", UR10.name)
    assert "to fix" not in said
    table = read_session(tmp_path / "session.toml", UR10).measurements
    np.testing.assert_allclose(table.q, DATA.q, rtol=0, atol=1e-11)  # eleven decimals of a degree


MANY = made(6, 36, robot=UR10)
JOINTS, FLANGE = np.degrees(MANY.q), 1e3 * MANY.T[:, :3, 3]
SEEN = np.random.default_rng(1).permutation(36) % 3
"""Which of three reflectors is seen at each pose."""
POINT_NAMES = np.array([f"p{10 * k}" for k in range(36)])
PLACES = np.array([[80.0, 0.0, 50.0], [-60.0, 90.0, 50.0], [-60.0, -90.0, 70.0]])
POINTS = FLANGE + np.einsum("mij,mj->mi", MANY.T[:, :3, :3], PLACES[SEEN])


def of_targets(tmp_path, *texts):
    """What is said of files in which each row sees one of three reflectors, and what is read."""
    files = [tmp_path / f"{name}.txt" for name in "ab"[: len(texts)]]
    for file, one in zip(files, texts, strict=True):
        file.write_text(one)
    said, _ = proposed(tmp_path, files, "--robot", UR10.name)
    return said, read_session(tmp_path / "session.toml", UR10)


@pytest.mark.parametrize(
    "texts",
    [
        [text(JOINTS, (SEEN + 1).astype(str)), text(POINTS)],
        [text(JOINTS, (SEEN + 1).astype(str), POINTS, mark=",")],
        ["J1,J2,J3,J4,J5,J6,SMR\n" + text(JOINTS, (SEEN + 1).astype(str), mark=","),
         "X,Y,Z\n" + text(POINTS, mark=",")],
        ["J1,J2,J3,J4,J5,J6,target\n" + text(JOINTS, (SEEN + 1).astype(str), mark=","),
         "X,Y,Z\n" + text(POINTS, mark=",")],
    ],
    ids=["in two files", "in one file", "under a name", "under our name"],
)  # fmt: skip
def test_the_number_of_the_reflector_beside_the_joints_is_its_name(texts, tmp_path):
    said, session = of_targets(tmp_path, *texts)
    assert "to fix" not in said
    assert "Not used" not in said
    assert "not used" not in said  # the number was called distances that do not fit beside
    names = np.array(session.reflector_names)[session.measurements.reflector]
    assert names.tolist() == (SEEN + 1).astype(str).tolist()
    np.testing.assert_allclose(session.measurements.q, MANY.q, rtol=0, atol=1e-11)


def test_a_number_that_explains_nothing_is_no_reflector(tmp_path):
    said, session = of_targets(tmp_path, text(JOINTS, SEEN.astype(str)), text(FLANGE))
    assert "a.txt: columns 7" in said
    assert session.reflector_names == ()


def test_names_beside_the_joints_that_never_come_again_are_no_reflectors(tmp_path):
    head = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,target\n"
    _, session = of_targets(
        tmp_path,
        head + text(JOINTS, POINT_NAMES, mark=","),
        "x_mm,y_mm,z_mm\n" + text(FLANGE, mark=","),
    )
    assert session.reflector_names == ()


def test_a_file_of_one_more_target_is_not_left_aside_without_a_word(tmp_path):
    places = FLANGE + np.einsum("mij,j->mi", MANY.T[:, :3, :3], PLACES[0])
    blocks = {"q.txt": JOINTS, "smr1.txt": FLANGE, "smr2.txt": places}
    files = [tmp_path / name for name in blocks]
    for file, block in zip(files, blocks.values(), strict=True):
        file.write_text(text(block))
    said, _ = proposed(tmp_path, files, "--robot", UR10.name)
    assert "reflectors: each file is one, called like the file" in " ".join(said.split())
    session = read_session(tmp_path / "session.toml", UR10)
    assert session.reflector_names == ("smr1", "smr2")
    (tmp_path / "session.toml").unlink()
    under = "smr1_X smr1_Y smr1_Z smr2_X smr2_Y smr2_Z"
    both = tmp_path / "all.txt"  # or side by side
    both.write_text(f"J1 J2 J3 J4 J5 J6 {under}\n" + text(JOINTS, FLANGE, places))
    proposed(tmp_path, [both], "--robot", UR10.name)
    session = read_session(tmp_path / "session.toml", UR10)
    assert session.reflector_names == ("smr1", "smr2")
    assert len(session.measurements) == 72


def test_a_second_file_of_joints_is_no_target(tmp_path):
    files = [tmp_path / name for name in ("q.txt", "smr1.txt", "r.txt")]
    for file, block in zip(files, (DEG, MM, DEG), strict=True):
        file.write_text(text(block))
    said, _ = proposed(tmp_path, files, "--robot", UR10.name)
    assert "reflector" not in said


def test_three_rows_of_points_for_each_row_of_joints_are_to_be_numbered(tmp_path):
    points = MM[:, None] + np.einsum("mij,kj->mki", DATA.T[:, :3, :3], PLACES)
    blocks = {"q.txt": text(DEG), "p.txt": text(points.reshape(-1, 3))}
    for name, lines in blocks.items():
        (tmp_path / name).write_text(lines)
    files = [tmp_path / name for name in blocks]
    done = call("new", "session", *files, "--robot", UR10.name, "--out", tmp_path / "s.toml")
    said = " ".join(done.stderr.split())
    assert "if each joint vector has 3 readings, of several targets or of one again" in said
    pose = np.repeat(np.arange(M), 3).astype(str)
    target = np.tile(["A", "B", "C"], M)
    (tmp_path / "q.csv").write_text(  # as it says
        "pose_id,J1,J2,J3,J4,J5,J6\n" + text(np.arange(M).astype(str), DEG, mark=",")
    )
    (tmp_path / "p.csv").write_text(
        "pose_id,target,X,Y,Z\n" + text(pose, target, points.reshape(-1, 3), mark=",")
    )
    proposed(tmp_path, [tmp_path / "q.csv", tmp_path / "p.csv"], "--robot", UR10.name)
    session = read_session(tmp_path / "session.toml", UR10)
    assert session.reflector_names == ("A", "B", "C")


def test_joints_that_turn_twice_and_a_place_in_meters_are_no_markers(tmp_path):
    """Nine numbers that all stay within the 20 mm by which distances on one tool may vary."""
    q = np.random.default_rng(4).uniform(-2 * np.pi, 2 * np.pi, (M, 6))
    places = UR10.model.poses(q)[:, :3, 3]
    (tmp_path / "a.csv").write_text(text(q, places, mark=","))
    proposed(tmp_path, [tmp_path / "a.csv"], "--robot", UR10.name)
    table = read_session(tmp_path / "session.toml", UR10).measurements
    np.testing.assert_allclose(table.q, q, rtol=0, atol=1e-11)  # eleven decimals
    np.testing.assert_allclose(table.position, places, rtol=0, atol=1e-11)


@pytest.mark.parametrize("behind", [[], [24.3, -9.7, 54.8]], ids=["nothing", "the same each row"])
def test_joints_of_a_small_arm_and_a_place_in_a_row_are_no_markers(behind, tmp_path):
    """Joints that turn by some degrees and places some cm apart hardly leave each other."""
    rng = np.random.default_rng(4)
    joints = rng.normal((3, 15, 39, -89, -88, 79), 7, (M, 6))
    places = rng.normal((1264, 728, -29), 18, (M, 3))
    (tmp_path / "a.csv").write_text(text(joints, places, np.tile(behind, (M, 1)), mark=","))
    (look,) = look_at([tmp_path / "a.csv"], tmp_path)
    assert not markers_in(look, "mm")


ALL_THREE = (FLANGE[:, None] + np.einsum("mij,kj->mki", MANY.T[:, :3, :3], PLACES)).reshape(36, 9)
EMPTY = np.zeros((36, 6))


@pytest.mark.parametrize(
    "rows",
    [
        text(ALL_THREE, EMPTY, JOINTS),
        text(JOINTS, ALL_THREE, mark=","),
        text(np.arange(36)[:, None], JOINTS, EMPTY, ALL_THREE),
        text(np.radians(JOINTS), ALL_THREE / 1e3),
    ],
    ids=["empty columns between", "joints first", "a number before", "in radians and meters"],
)
def test_reflectors_beside_joints_need_no_names(rows, tmp_path):
    said, session = of_targets(tmp_path, rows)
    assert "to fix" not in said
    assert "taken as 3 markers" in said
    table = session.measurements
    assert len(table) == 3 * 36
    for k in range(3):
        own = table.rows(table.reflector == k)
        np.testing.assert_allclose(own.q, MANY.q, rtol=0, atol=1e-11)
        np.testing.assert_allclose(
            own.position, ALL_THREE[:, 3 * k : 3 * k + 3] / 1e3, rtol=0, atol=1e-10
        )


def on_their_side(folder, names):
    """Joints and places as MATLAB has them, a column for each pose."""
    many = made(5, 24, robot=UR10)  # more than any row has numbers
    blocks = {"q": np.degrees(many.q).T, "p": 1e3 * many.T[:, :3, 3].T}
    if names == "in two files":
        for name, block in blocks.items():
            np.savetxt(folder / f"{name}.csv", block, delimiter=",", fmt="%.9f")
        return [folder / "q.csv", folder / "p.csv"]
    both = np.vstack(list(blocks.values()))
    rows = [",".join(f"{v:.9f}" for v in row) for row in both]
    if names != "without names":
        head = {"below numbers": [f"pose,{','.join(map(str, range(24)))}"], "alone": []}[names]
        own = [*(f"J{k}" for k in range(1, 7)), *"XYZ"]
        rows = [*head, *(f"{name},{row}" for name, row in zip(own, rows, strict=True))]
    (folder / "a.csv").write_text("\n".join(rows))
    return [folder / "a.csv"]


@pytest.mark.parametrize("names", ["in two files", "without names", "below numbers", "alone"])
def test_a_table_on_its_side_is_to_be_turned(names, tmp_path):
    """Two files were to lose their "extra rows", and named rows to get names."""
    files, out = on_their_side(tmp_path, names), tmp_path / "o.toml"
    done = call("new", "session", *files, "--robot", UR10.name, "--out", out)
    assert done.exit_code == 2
    said = " ".join(done.stderr.split())
    assert "it seems to lie on its side, with a column for each pose" in said
    assert "writematrix(Q', 'q.csv')" in said


def test_few_rows_of_many_numbers_that_are_read_do_not_lie_on_their_side(tmp_path):
    """Nine poses of joints and a transform."""
    T = DATA.T[:9].copy()
    T[:, :3, 3] *= 1e3
    rows = np.hstack([np.degrees(DATA.q[:9]), T.reshape(9, 16)])
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", fmt="%.12f")
    proposed(tmp_path, [tmp_path / "a.csv"], "--robot", UR10.name)
    assert len(read_session(tmp_path / "session.toml", UR10).measurements) == 9


WIRE = 40
"""Poses of a draw wire: 24 numbers of links and 6 of two points are told apart by 30 or more."""


def wire(kind):
    """Joints and one more number, before or behind them, of a wire from a place beside the arm."""
    data = made(6, WIRE, robot=UR10)
    p = data.T[:, :3, 3] + data.T[:, :3, :3] @ [0.05, 0.03, 0.08]
    d = 1e3 * np.linalg.norm(p - [1.0, -2.0, 0.3], axis=1)[:, None]
    deg, rows = np.degrees(data.q), np.arange(WIRE)
    return {
        "behind": text(deg, d, mark=","),
        "before, counted, in meters": text(rows[:, None], d / 1e3, deg),
        "with one lost": text(deg, np.where(rows == 7, np.nan, d[:, 0])[:, None], mark=","),
        "warmth": text(deg, 20 + 0.05 * rows[:, None] + d % 0.01),
        "a count": text(deg, 1.0 + rows[:, None]),
        "nothing": text(deg, np.random.default_rng(1).uniform(500, 3000, (WIRE, 1))),
    }[kind]


@pytest.mark.parametrize("kind", ["behind", "before, counted, in meters", "with one lost"])
def test_joints_and_the_distance_of_a_draw_wire_need_no_names(kind, tmp_path):
    """They were "no joints and places in any order that is tried"."""
    (tmp_path / "a.csv").write_text(wire(kind))
    said, _ = proposed(tmp_path, [tmp_path / "a.csv"], "--robot", UR10.name)
    assert "all distances are taken as those from one, A" in said
    lost = kind == "with one lost"
    assert ("to fix" in said) == lost
    table = read_session(tmp_path / "session.toml", UR10, options=ReadOptions(drop_invalid=lost))
    table = table.measurements
    assert len(table) == WIRE - lost
    assert table.is_distance.all()
    data = made(6, WIRE, robot=UR10)
    np.testing.assert_allclose(table.q, np.delete(data.q, [7] * lost, axis=0), atol=1e-9)
    # the tracker that the place is near stands some meters away
    assert 1.0 < table.distance.min() < table.distance.max() < 10.0


@pytest.mark.parametrize("kind", ["warmth", "a count", "nothing"])
def test_another_number_beside_joints_is_no_distance(kind, tmp_path):
    (tmp_path / "a.csv").write_text(wire(kind))
    out = ("--out", tmp_path / "s.toml")
    done = call("new", "session", tmp_path / "a.csv", "--robot", UR10.name, *out)
    assert "no line names its 7 columns" in done.stderr


def test_without_a_robot_nothing_tells_a_distance_without_a_name(tmp_path):
    (tmp_path / "a.csv").write_text(wire("behind"))
    done = call("new", "session", tmp_path / "a.csv", "--out", tmp_path / "s.toml")
    assert "no line names its 7 columns" in done.stderr
