"""One missed or extra shot anywhere in a file is found, and named by its row."""

import re

import numpy as np
import pytest
from typer.testing import CliRunner

from calib.errors import InputError
from testbed.cli import app
from testbed.files.frames_fit import flange_poses
from testbed.files.probe import probe
from testbed.files.read import read_session
from testbed.files.slips import find_slip
from tests.testbed.files.made import ROBOT, columns, csv, made, with_spread

ARM = np.array([0.05, 0.03, 0.08])
LINES = [f"a.csv:{row + 2}" for row in range(1000)]


def order(m, at, kind):
    """Poses of the readings in their order: one is missing, comes twice, or is of elsewhere."""
    if kind == "missing":
        return np.delete(np.arange(m), at)
    return np.insert(np.arange(m), at, at - 1 if kind == "twice" else (at + m // 2) % m)[:m]


def found(m, at, kind, *, poses, seed=0):
    """The slip that is found in m readings."""
    data, rows = made(seed, m), order(m, at, kind)
    position, rotation = data.T[:, :3, 3], data.T[:, :3, :3]
    position = position if poses else position + rotation @ ARM
    return find_slip(
        flange_poses(ROBOT.model, data.q),
        np.arange(len(rows)),
        position[rows],
        rotation[rows] if poses else None,
    )


def check(m, at, kind, *, poses, seed=0):
    slip = found(m, at, kind, poses=poses, seed=seed)
    by = 1 if kind == "missing" else -1
    assert slip is not None, (m, at, kind)
    assert slip.shifts == (by,)
    # a row of elsewhere belongs nowhere: either side of it is right
    assert slip.rows[0] in ((at,) if kind != "elsewhere" else (at, at + 1))
    assert slip.left.score < 2e-3
    line = f"line {slip.rows[0] + 2} on, row k{-by:+d} belongs to pose k"
    told = f"from {line}; one shot is {'missing' if by > 0 else 'too many'}"
    assert slip.sentence(LINES) == told


@pytest.mark.parametrize("poses", [True, False])
@pytest.mark.parametrize("kind", ["missing", "twice", "elsewhere"])
def test_one_shot_too_few_or_too_many_is_found_anywhere(kind, poses):
    for at in (2, 14, 26):
        check(29, at, kind, poses=poses)
    check(12, 6, kind, poses=poses)
    check(80, 57, kind, poses=poses)


@pytest.mark.study
@pytest.mark.parametrize("m", [15, 20, 29, 60, 200, 1000])
@pytest.mark.parametrize("kind", ["missing", "twice", "elsewhere"])
def test_one_shot_is_found_at_every_row_of_every_file(m, kind):
    for seed in range(2):
        for at in range(2, m - 4) if m < 100 else np.linspace(2, m - 5, 30).astype(int):
            for poses in (True, False):
                check(m, int(at), kind, poses=poses, seed=seed)


def outcome(file, rows):
    """What becomes of a file whose readings belong to these joints: named, left out, or refused."""
    wrong = set(np.flatnonzero(rows != np.arange(len(rows))).tolist())
    try:
        session = read_session(file, ROBOT)
        left = {int(place.rpartition(":")[2]) - 2 for place in session.place}
        if not left & wrong and len(left) >= len(rows) - 3:
            return "left out"
        probe(ROBOT, session).raise_if_wrong()
    except InputError as error:
        return "named" if "from line" in str(error) else "refused"
    return "taken"


@pytest.mark.parametrize(
    "counts", [(8, 10), *(pytest.param((m,), marks=pytest.mark.study) for m in range(7, 31))]
)
def test_no_row_of_other_joints_is_ever_taken_in_silence(counts, tmp_path):
    """At every row of short files, the first and the last too."""
    file, seen = tmp_path / "a.csv", []
    for m in counts:
        step = 4 if len(counts) > 1 else 1
        for kind in ("missing", "twice", "elsewhere"):
            for at in range(1, m - (kind == "missing"), step):
                table = slipped(at, kind, m)
                file.write_text(csv(table))
                seen.append((kind, at, outcome(file, order(m, at, kind))))
    assert not [one for one in seen if one[2] == "taken"]
    told = [at for _, at, what in seen if what != "refused"]
    assert len(told) >= (0.0 if counts[0] < 8 else 0.25 if counts[0] < 11 else 0.85) * len(seen)
    if counts[0] > 15:
        for which in ("missing", "twice", "elsewhere"):
            of_kind = {at for kind, at, what in seen if (kind, what) == (which, "named")}
            assert of_kind >= set(range(2, counts[0] - 3)), which


def test_two_missed_shots_and_one_of_each_are_told_apart():
    data = made(0, 60)
    F, whole = flange_poses(ROBOT.model, data.q), np.arange(60)
    for rows, shifts, words in (
        (
            np.delete(whole, [20, 41]),
            (1, 2),
            "row k-1 .*is missing; .*line 42 on, row k-2 .*missing",
        ),
        (
            np.insert(np.delete(whole, 20), 40, 40),
            (1, 0),
            "row k-1 .*; .*row k belongs to pose k; one",
        ),
        (
            np.delete(whole, [20, 21]),
            (2,),
            "from line 22 on, row k-2 belongs to pose k; 2 shots are",
        ),
    ):
        slip = find_slip(F, np.arange(len(rows)), data.T[rows, :3, 3], data.T[rows, :3, :3])
        assert slip.shifts == shifts
        assert re.search(words, slip.sentence(LINES))


def test_right_rows_and_rows_that_fit_nowhere_are_no_slip():
    data = made(0, 29)
    F, index = flange_poses(ROBOT.model, data.q), np.arange(29)
    position, rotation = data.T[:, :3, 3], data.T[:, :3, :3]
    assert find_slip(F, index, position, rotation) is None
    swapped = np.array([0, 2, 1, *range(3, 29)])
    assert find_slip(F, index, position[swapped], rotation[swapped]) is None
    anywhere = np.random.default_rng(0).permutation(29)
    assert find_slip(F, index, position[anywhere], rotation[anywhere]) is None
    assert find_slip(F, index, position * 1e3, rotation) is None
    assert find_slip(F[:7], index[:7], position[:7], rotation[:7]) is None


READINGS = ("x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg")


def slipped(at, kind, m=29):
    """One table whose readings have slipped against the joints."""
    table = with_spread(columns(made(0, m))) | {"euler": np.array(["XYZ"] * m)}
    rows = order(m, at, kind)
    joints = {name: values[: len(rows)] for name, values in table.items() if name not in READINGS}
    readings = {name: table[name][rows] for name in READINGS}
    readings["x_mm"] += 1e-3 * np.arange(len(rows))  # no digits come twice
    return joints | readings


@pytest.mark.parametrize("at", [2, 10, 20, 25])
@pytest.mark.parametrize(("kind", "k", "what"), [
    ("missing", "k-1", "missing"), ("elsewhere", "k+1", "too many")])  # fmt: skip
def test_the_line_of_the_file_is_named(at, kind, k, what, tmp_path):
    file = tmp_path / "a.csv"
    file.write_text(csv(slipped(at, kind)))
    told = rf"from line \d+ on, row {k.replace('+', '.')} belongs to pose k; one shot is {what}"
    with pytest.raises(InputError, match=told) as caught:
        read_session(file, ROBOT)
    line = int(str(caught.value).split("from line ")[1].split()[0])
    assert line - 2 in (at, at + 1)
    assert caught.value.where == f"{file}:{line}"
    assert caught.value.code == "M31"


@pytest.mark.parametrize("first", [0, 7, 14, 20, 27])
@pytest.mark.parametrize("poses", [True, False])
def test_two_wrong_rows_never_spoil_the_whole_file(first, poses, tmp_path):
    """At another lock, 400 mm away: left out and named, the other 27 are read."""
    table = with_spread(columns(made())) | {"euler": ["XYZ"] * 29}
    table["x_mm"] = np.where(np.isin(np.arange(29), [first, first + 1]), 404.0, table["x_mm"])
    if not poses:
        turns = ("rx_deg", "ry_deg", "rz_deg", "urx_deg", "ury_deg", "urz_deg", "euler")
        table = {name: values for name, values in table.items() if name not in turns}
    file = tmp_path / "a.csv"
    file.write_text(csv(table))
    session = read_session(file, ROBOT)
    lines = [f"{file}:{row + 2}: left out: " for row in (first, first + 1)]
    assert len(session.masked) == 2
    assert all(text.startswith(line) for text, line in zip(session.masked, lines, strict=True))
    assert len(session.measurements) == 27


def test_the_last_two_rows_are_left_out_where_no_joints_remain_for_the_last(tmp_path):
    """One fit of all rows is spoiled by them: a part of the rows is not."""
    file = tmp_path / "a.csv"
    file.write_text(csv(slipped(26, "missing")))
    session = read_session(file, ROBOT)
    assert [text.split(": ")[0] for text in session.masked] == [f"{file}:28", f"{file}:29"]
    assert "fits the joints of row +1" in session.masked[0]
    assert len(session.measurements) == 26


def test_the_missing_shot_is_named_where_the_order_matches_rows(tmp_path):
    table = slipped(10, "missing")
    whole = columns(made())
    joints = {name: values for name, values in whole.items() if name[0] == "q"}
    (tmp_path / "joints.csv").write_text(csv(joints))
    (tmp_path / "frames.csv").write_text(csv({k: v for k, v in table.items() if k[0] not in "pq"}))
    (tmp_path / "session.toml").write_text(
        'match = "order"\n[joints]\nfile = "joints.csv"\n[frames]\nfile = "frames.csv"\n'
    )
    with pytest.raises(InputError, match=r"28 readings for 29 joint .* from line 12 on, row k-1"):
        read_session(tmp_path, ROBOT)


def test_the_missing_shot_at_a_cycling_target_is_named(tmp_path):
    data = made()
    points = {name: data.T[:, :3, 3] + data.T[:, :3, :3] @ arm for name, arm in
              (("A", ARM), ("B", -ARM))}  # fmt: skip
    lines = [
        f"{name}, {x:.6f}, {y:.6f}, {z:.6f}"
        for k in range(29)
        for name in "AB"
        if (k, name) != (10, "B")
        for x, y, z in [points[name][k] * 1e3]
    ]
    joints = {name: values for name, values in columns(data).items() if name[0] == "q"}
    (tmp_path / "joints.csv").write_text(csv(joints))
    (tmp_path / "smr.txt").write_text("\n".join(lines))
    (tmp_path / "session.toml").write_text(
        '[joints]\nfile = "joints.csv"\n[points]\nfile = "smr.txt"\nformat = "sa"\n'
        'length = "mm"\n[uncertainty]\nposition_um = 20\n'
    )
    with pytest.raises(InputError, match=r"shot A 29, B 28 times .* from line 23 on") as caught:
        read_session(tmp_path, ROBOT)
    assert caught.value.where == "smr.txt:23"


def test_the_whole_program_names_the_missing_shot_and_writes_nothing(tmp_path):
    file, out = tmp_path / "a.csv", tmp_path / "out"
    file.write_text(csv(slipped(10, "missing")))
    done = CliRunner().invoke(app, ["identify", "staubli_tx60", str(file), "--out", str(out)])
    assert done.exit_code == 2
    assert done.stderr.startswith(
        f"{file}:12: from line 12 on, row k-1 belongs to pose k; one shot "
    )
    assert done.stderr.count("\n") == 1
    assert not out.exists()
