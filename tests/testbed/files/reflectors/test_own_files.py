"""Files of one reflector each: read as if they were one, and refused where they are not."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib.errors import InputError
from calib.geometry.chain import Chain
from calib.geometry.model import RobotModel
from testbed.files.read import ReadOptions, read_session
from testbed.files.reflectors import own_files
from testbed.robots.controller import Controller
from tests.calib.kinds import SCARA
from tests.testbed.files.made import ROBOT, csv, made

M = 30
PLACES = np.array([[60, 0, 20], [-40, 50, 25], [-30, -55, 80.0]]) / 1e3
NAMES = [f"P{k + 1}" for k in range(M)]
TURN = Rotation.from_euler("xyz", [10, 20, 70], degrees=True).as_matrix()
FILES = 'reflector_files = { A = "a.csv", B = "b.csv", C = "c.csv" }\n'
STATIONS = 'files = ["a.csv", "b.csv", "c.csv"]\n'
JOINTS = '[joints]\nfile = "joints.csv"\n'


@cache
def seen():
    """(3, m, 3) readings of three reflectors [mm]."""
    data, rng = made(seed=2, m=M), np.random.default_rng(5)
    T = data.truth.poses(data.q)
    exact = np.array([T[:, :3, :3] @ place + T[:, :3, 3] for place in PLACES])
    return 1e3 * (exact + 20e-6 * rng.normal(size=exact.shape))


def joints():
    return {f"q{k + 1}_deg": np.degrees(made(seed=2, m=M).q[:, k]) for k in range(6)}


def place(readings):
    return dict(zip(("x_mm", "y_mm", "z_mm"), readings.T, strict=True))


def read(folder, tables, points=FILES, *, how="", joined=JOINTS, robot=ROBOT, options=None):
    """The session of some tables, each with poses by name unless it says otherwise."""
    for name, table in tables.items():
        text = table if isinstance(table, str) else csv(table)
        (folder / f"{name}.csv").write_text(text)
    toml = f"{how}{joined}[points]\n{points}[uncertainty]\nposition_um = 20\n"
    (folder / "session.toml").write_text(toml)
    return read_session(folder, robot, options=options)


def apart(*readings, names=NAMES, **more):
    """Joints, and a file for each reflector."""
    files = {
        name: {"pose_id": names} | more | place(xyz)
        for name, xyz in zip("abc", readings, strict=True)
    }
    return {"joints": {"pose_id": NAMES} | joints()} | files


def same(one, other):
    """Whether two sessions hold the same rows, in whatever order."""
    tables = []
    for session in (one, other):
        table = session.measurements
        rows = {
            (session.reflector_names[table.reflector[k]], session.pose_name(k)): np.hstack(
                [table.q[k], table.position[k]]
            )
            for k in range(len(table))
        }
        tables.append(rows)
    first, second = tables
    assert len(first) == len(one.measurements)
    return first.keys() == second.keys() and all(
        np.allclose(row, second[key], rtol=0, atol=1e-13) for key, row in first.items()
    )  # rounding of mm in m


@pytest.fixture
def by_hand(tmp_path):
    """The same readings in one file with a column target."""
    whole = {key: np.tile(values, 3) for key, values in joints().items()}
    whole |= {"pose_id": NAMES * 3, "target": [name for name in "ABC" for _ in range(M)]}
    (tmp_path / "hand").mkdir()
    toml = 'file = "all.csv"\n'
    return read(
        tmp_path / "hand", {"all": whole | place(np.vstack(seen()))}, toml,
        joined='[joints]\nfile = "all.csv"\n',
    )  # fmt: skip


def test_poses_are_told_by_their_names(by_hand, tmp_path):
    found = read(tmp_path, apart(*seen()))
    assert same(found, by_hand)
    assert found.station_names == ("",)
    assert found.reflector_names == ("A", "B", "C")


def test_missed_shots_keep_their_places_where_the_order_matches_rows(tmp_path):
    """96 of 100 shots of a reflector, the others written as 0 0 0, were refused as too few."""
    lost = {"A": [3, 7], "B": [11], "C": []}
    each = [readings.copy() for readings in seen()]
    each[0][lost["A"]] = 0.0
    each[1][lost["B"]] = np.nan
    tables = {"joints": joints()} | dict(zip("abc", map(place, each), strict=True))
    drop = ReadOptions(drop_invalid=True)
    found = read(tmp_path, tables, how='match = "order"\n', options=drop)
    table, q = found.measurements, made(seed=2, m=M).q
    for k, (name, rows) in enumerate(lost.items()):
        there = np.delete(np.arange(M), rows)
        own = table.rows(table.reflector == found.reflector_names.index(name))
        np.testing.assert_allclose(own.q, q[there], rtol=0, atol=1e-12)
        np.testing.assert_allclose(own.position, seen()[k][there] / 1e3, rtol=0, atol=1e-9)
    assert any("missed shots, written as 0 0 0" in text for text in found.masked)
    # shots that were taken again behind those missed: the good ones are as many as the joints
    again = [np.insert(readings, 5, 0.0, axis=0) for readings in seen()]
    tables = {"joints": joints()} | dict(zip("abc", map(place, again), strict=True))
    found = read(tmp_path, tables, how='match = "order"\n')
    np.testing.assert_allclose(found.measurements.q[:M], q, rtol=0, atol=1e-12)


def test_joints_stand_beside_the_readings_of_each_file(by_hand, tmp_path):
    files = {
        name: {"pose_id": NAMES} | joints() | place(xyz)
        for name, xyz in zip("abc", seen(), strict=True)
    }
    assert same(read(tmp_path, files, joined=""), by_hand)
    # or the joints alone tell which pose it is
    nameless = {
        name: {key: values for key, values in file.items() if key != "pose_id"}
        for name, file in files.items()
    }
    found = read(tmp_path, nameless, joined="").measurements
    np.testing.assert_array_equal(found.pose_id, np.tile(np.arange(M), 3))


def test_the_kth_row_of_each_file_is_of_the_kth_joints(by_hand, tmp_path):
    files = {"joints": joints()} | {n: place(xyz) for n, xyz in zip("abc", seen(), strict=True)}
    found = read(tmp_path, files, how='match = "order"\n').measurements
    order = np.argsort(found.reflector, kind="stable")
    np.testing.assert_array_equal(found.position[order], by_hand.measurements.position)
    np.testing.assert_array_equal(found.pose_id[order], np.tile(np.arange(M), 3))


def exported(k):
    """The lines of an export of Spatial Analyzer of one reflector."""
    rows = zip(NAMES, seen()[k].tolist(), strict=True)
    lines = [f"A, {'ABC'[k]}, {name}, {x!r}, {y!r}, {z!r}" for name, (x, y, z) in rows]
    return "\n".join(lines) + "\n"


def test_exports_have_a_file_or_a_group_for_each_reflector(by_hand, tmp_path):
    files = {"joints": {"pose_id": NAMES} | joints()}
    how = 'format = "sa"\nlength = "mm"\n'
    each = {name: exported(k) for k, name in enumerate("abc")}
    assert same(read(tmp_path, files | each, FILES + how), by_hand)
    whole = files | {"all": "".join(each.values())}
    found = read(tmp_path, whole, f'file = "all.csv"\npose = "target"\n{how}')
    assert same(found, by_hand)


def test_a_visit_may_have_a_file_for_each_reflector(tmp_path):
    """Its files were no files: a [[session]] of them "names no file"."""
    for name, table in apart(*seen()).items():
        (tmp_path / f"{name}.csv").write_text(csv(table))
    toml = "[uncertainty]\nposition_um = 20\n"
    for name, files in (("spring", 'A = "a.csv", B = "b.csv"'), ("autumn", 'A = "c.csv"')):
        toml += f'[[session]]\nname = "{name}"\n[session.joints]\nfile = "joints.csv"\n'
        toml += f"[session.points]\nreflector_files = {{ {files} }}\n"
    (tmp_path / "session.toml").write_text(toml)
    found = read_session(tmp_path, ROBOT)
    assert len(found.measurements) == 3 * M
    assert [len(one.measurements) for one in found.alone] == [2 * M, M]
    assert found.alone[0].reflector_names == ("A", "B")


@pytest.mark.parametrize(
    ("files", "points", "said"),
    [
        (apart(*seen()[[0, 1, 1]]), FILES, r'c.csv: "B" and "C" lie 0 mm from each other'),
        (
            apart(seen()[0], seen()[1] @ TURN.T, seen()[2]), FILES,
            r'b.csv: "A" and "B" do not stay together: .* the files are in different frames or '
            "units, or their rows are of different poses",
        ),
        # 5 mm are less than what tells a robot's file, and more than a tool gives
        (
            apart(seen()[0], seen()[1] + [5, 0, 0], seen()[2]), FILES,
            'b.csv: "A" and "B" do not stay together',
        ),
        (
            apart(seen()[0], seen()[0] + [50, 0, 0], seen()[2]), FILES,
            'b.csv: "A" and "B" lie beside each other in one direction at all poses, though the '
            r"tool turns by \d+ deg: they are one point in two frames",
        ),
        (
            apart(seen()[0], np.roll(seen()[1], 1, axis=0), seen()[2]), FILES,
            'b.csv: "A" and "B" do not stay together: .* and they do if the readings of "B" are '
            "taken one row further down",
        ),
        (
            apart(*seen(), target=["D"] * M), FILES,
            'a.csv: is the file of the reflector "A", and has another name in its column target: D;'
            " call it D under reflector_files",
        ),
        (apart(*seen(), target=["D", "E"] * (M // 2)), FILES, "has 2 targets in its column target"),
        (
            apart(*seen(), names=[f"N{k}" for k in range(M)]), FILES,
            "joints.csv has no joints for poses N0, N1",
        ),
        (
            apart(*seen()), 'reflector_files = { A = "a.csv", B = "a.csv" }\n',
            'reflector_files has "a.csv" for two reflectors',
        ),
        (
            apart(*seen()), f'file = "a.csv"\n{FILES}',
            "write either reflector_files or file, files and targets",
        ),
        (
            apart(*seen()), STATIONS,
            "b.csv: its points stay as far from those of a.csv at all poses, as two reflectors on "
            "one tool do, and not as one reflector that two stations see",
        ),
    ],
)  # fmt: skip
def test_files_that_are_not_as_stated_are_refused_in_a_sentence(files, points, said, tmp_path):
    with pytest.raises(InputError) as caught:
        read(tmp_path, files, points)
    assert re.search(said, str(caught.value))


def test_poses_without_any_other_reflector_are_refused(tmp_path):
    """Files that have joints of their own, and no pose in common."""
    files = {}
    for k, name in enumerate("abc"):
        rows = slice(10 * k, 10 * k + 10)
        files[name] = {"pose_id": NAMES[rows]} | {q: v[rows] for q, v in joints().items()}
        files[name] |= place(seen()[k][rows])
    with pytest.raises(InputError, match='no pose of "A" is one of the other reflectors'):
        read(tmp_path, files, joined="")


def test_stations_are_no_reflectors(tmp_path):
    """One point in turned frames, in moved ones, and two points in each of them."""
    frames = [(np.linalg.matrix_power(TURN, k), [500.0 * k, 0, 0]) for k in range(3)]
    turned = [seen()[0] @ R.T + t for R, t in frames]
    moved = [seen()[0] + t for _, t in frames]
    for readings in (turned, moved):
        assert read(tmp_path, apart(*readings), STATIONS).station_names == ("1", "2", "3")
    both = [np.vstack(seen()[:2]) @ R.T + t for R, t in frames]
    more = {"target": ["A"] * M + ["B"] * M}
    found = read(tmp_path, apart(*both, names=NAMES * 2, **more), STATIONS)
    assert found.reflector_names == ("A", "B")


def scara(folder, second, moved=(0, 0, 0)):
    """A session of two files on an arm whose tool turns about the vertical alone [m]."""
    lower, upper = np.array([[-2.9, 2.9], [-2.5, 2.5], [-0.3, 0.3], [-3.1, 3.1]]).T
    kinds = ("revolute", "revolute", "prismatic", "revolute")
    arm = replace(
        ROBOT, name="scara", model=RobotModel(Chain(SCARA, kinds)), controller=Controller(),
        limits=np.column_stack([lower, upper]),
    )  # fmt: skip
    rng = np.random.default_rng(4)
    q = rng.uniform(lower, upper, (M, 4))
    T = arm.model.poses(q)
    there = {
        f"q{k + 1}_{'mm' if k == 2 else 'deg'}": q[:, k] * (1e3 if k == 2 else 180 / np.pi)
        for k in range(4)
    }
    files = {"joints": {"pose_id": NAMES} | there}
    for name, own, by in (("a", [0.03, 0.02, 0.02], 0), ("b", second, moved)):
        exact = T[:, :3, :3] @ np.array(own) + T[:, :3, 3] + by
        readings = 1e3 * (exact + 20e-6 * rng.normal(size=(M, 3)))
        files[name] = {"pose_id": NAMES} | place(readings)
    return read(folder, files, 'reflector_files = { A = "a.csv", B = "b.csv" }\n', robot=arm)


def test_one_reflector_above_another_on_a_tool_that_stays_upright_is_read(tmp_path):
    """It was called one point in two frames: what stands above another does not turn about it."""
    assert len(scara(tmp_path, [0.03, 0.02, 0.12]).measurements) == 2 * M
    with pytest.raises(InputError, match="one point in two frames"):
        scara(tmp_path, [0.03, 0.02, 0.02], (0.3, 0.05, 0.01))


def test_files_are_held_against_a_few_others():
    """Of 1000 files each against each took minutes."""
    pairs = list(own_files._near([str(k) for k in range(1000)]))
    assert len(pairs) < 20 * 1000
    assert {one for pair in pairs for one in pair} == {str(k) for k in range(1000)}
    assert set(own_files._near("abc")) == {("a", "b"), ("a", "c"), ("b", "c")}


def test_nests_in_the_file_of_a_reflector_are_no_other_reflector(tmp_path):
    """It was refused with "call it N1 under reflector_files"."""
    table = apart(*seen())
    nest = np.array([[900.0, 200, 50], [100, 1500, 60], [-800, 300, 900]])
    for name in "abc":
        own = table[name]
        count = 2 * len(nest)
        table[name] = {"pose_id": [""] * 3 + NAMES + [""] * 3} | {
            "target": ["N1", "N2", "N3", *[""] * M, "N1", "N2", "N3"],
            **place(np.vstack([nest, np.column_stack([own[f"{a}_mm"] for a in "xyz"]), nest])),
        }
        assert len(table[name]["x_mm"]) == M + count
    drift = '[drift]\nnests = ["N1", "N2", "N3"]\n'
    found = read(tmp_path, table, FILES, how="", joined=drift + JOINTS)
    assert len(found.measurements) == 3 * M
    assert found.reflector_names == ("A", "B", "C")
    with pytest.raises(InputError, match=r"fixed points that .* belong under \[drift\] nests"):
        read(tmp_path, table)


@pytest.mark.parametrize("wide", [False, True])
def test_a_reflector_all_of_whose_shots_were_missed_is_named(wide, tmp_path):
    """It was gone without a word on the first page, and its poses were "in other files only"."""
    points, (a, b, c) = FILES, seen()
    tables = apart(a, b, np.zeros_like(c))
    if wide:
        three = {"A": a, "B": b, "C": 0 * c}
        columns = {f"{n}_{x}_mm": three[n][:, k] for n in "ABC" for k, x in enumerate("xyz")}
        tables = {"joints": tables["joints"], "a": {"pose_id": NAMES} | columns}
        targets = ", ".join(f"{name} = {[f'{name}_{x}_mm' for x in 'xyz']}" for name in "ABC")
        points = f'file = "a.csv"\ntargets = {{ {targets} }}\n'
    found = read(tmp_path, tables, points)
    assert found.reflector_names == ("A", "B")
    (said,) = found.warnings
    file = "a.csv" if wide else "c.csv"
    assert said.endswith(f"{file}: all 30 shots of target C were missed, so it takes no part")
    if not wide:  # one that was met once is no such target
        c = 0 * c
        c[4] = seen()[2][4]
        few = read(tmp_path, apart(a, b, c))
        assert few.reflector_names == ("A", "B", "C")
        assert not any("takes no part" in text for text in few.warnings)
