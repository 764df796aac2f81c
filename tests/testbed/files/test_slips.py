"""One missed or extra shot anywhere in a file is found, and named by its row."""

import re

import numpy as np
import pytest

from calib.errors import InputError
from testbed.files.frames_fit import flange_poses
from testbed.files.gap_alignment import ALONE, aligned
from testbed.files.probe import probe
from testbed.files.read import read_session
from testbed.files.slips import find_slip
from tests.command import call
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
        flange_poses(ROBOT.model, data.q), position[rows], rotation[rows] if poses else None
    )


def check(m, at, kind, *, poses, seed=0):
    slip = found(m, at, kind, poses=poses, seed=seed)
    by = 1 if kind == "missing" else -1
    assert slip is not None, (m, at, kind)
    assert slip.shifts == (by,)
    # a row of elsewhere belongs nowhere: either side of it is right
    assert slip.rows[0] in ((at,) if kind != "elsewhere" else (at, at + 1))
    assert slip.left.score < 2e-3
    # of two shots of one pose nobody knows which one is too many
    first, last = slip.spans[0]
    assert (first, last) == ((at - 1, at) if kind == "twice" else (at, at))
    line = f"line {slip.rows[0] + 2} on, row k{-by:+d} belongs to pose k"
    extra = f"line {at + 1} or {at + 2}" if kind == "twice" else f"line {at + 2}"
    told = f"from {line}; one shot is {'missing' if by > 0 else f'too many ({extra})'}"
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


@pytest.mark.slow
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
    assert len(told) >= (0.0 if counts[0] < 8 else 0.5 if counts[0] < 10 else 0.8) * len(seen)
    if counts[0] > 15:
        for which in ("missing", "twice", "elsewhere"):
            of_kind = {at for kind, at, what in seen if (kind, what) == (which, "named")}
            assert of_kind >= set(range(2, counts[0] - 2)), which


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
        slip = find_slip(F, data.T[rows, :3, 3], data.T[rows, :3, :3])
        assert slip.shifts == shifts
        assert re.search(words, slip.sentence(LINES))


def test_right_rows_and_rows_that_fit_nowhere_are_no_slip():
    data = made(0, 29)
    F = flange_poses(ROBOT.model, data.q)
    position, rotation = data.T[:, :3, 3], data.T[:, :3, :3]
    assert find_slip(F, position, rotation) is None
    swapped = np.array([0, 2, 1, *range(3, 29)])
    assert find_slip(F, position[swapped], rotation[swapped]) is None
    anywhere = np.random.default_rng(0).permutation(29)
    assert find_slip(F, position[anywhere], rotation[anywhere]) is None
    assert find_slip(F, position * 1e3, rotation) is None
    assert find_slip(F[:7], position[:7], rotation[:7]) is None


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


def test_one_row_that_fits_other_joints_shows_a_missing_shot(tmp_path):
    """The next to last row has the joints of the one before, the last one has none."""
    file = tmp_path / "a.csv"
    file.write_text(csv(slipped(26, "missing")))
    with pytest.raises(InputError, match=r"from line 28 on, row k-1 .*; one shot is missing;"):
        read_session(file, ROBOT)


def gap_and_extra(seed, m=60):
    """Where a shot was missed, which row is too many, and the poses of the readings."""
    rng = np.random.default_rng([15, seed])
    gap, extra = (int(k) for k in rng.integers(m, size=2))
    left = np.delete(np.arange(m), gap)
    twice = seed % 2 and extra > 0
    return gap, extra, np.insert(left, extra, left[extra - 1] if twice else (gap + m // 2) % m)


@pytest.mark.parametrize(
    "seeds", [range(8), pytest.param(range(8, 208), marks=pytest.mark.study)], ids=["few", "all"]
)
def test_one_gap_and_one_extra_row_are_found_anywhere_in_60_rows(seeds):
    for seed in seeds:
        gap, extra, rows = gap_and_extra(seed)
        data = made(seed, 60)
        T = data.T[rows]
        for poses in (True, False):
            at = T[:, :3, 3] if poses else T[:, :3, 3] + T[:, :3, :3] @ ARM
            F = flange_poses(ROBOT.model, data.q)
            slip = find_slip(F, at, T[:, :3, :3] if poses else None)
            if slip is None:
                # side by side they are one wrong row, which is left out by name
                assert (rows != np.arange(60)).sum() == 1, seed
                continue
            before = (0, *slip.shifts[:-1])
            told = {
                "gap" if shift > old else "extra": span
                for shift, old, span in zip(slip.shifts, before, slip.spans, strict=True)
            }
            # at the end of a file nothing is behind them
            row = gap + (extra <= gap)
            assert told.get("gap", (59, 60))[0] <= row <= told.get("gap", (59, 60))[1], seed
            first, last = told.get("extra", (59, 59))
            assert first <= extra <= last <= first + 1, seed


def test_the_cheapest_way_is_that_of_all_ways():
    """All alignments of five readings with six poses, one by one."""
    rng, shifts = np.random.default_rng(0), np.arange(-3, 5)
    for _ in range(20):
        cost = rng.uniform(0, 120, (5, len(shifts)))

        def best(i, j, cost=cost):
            if i == 5 or j == 6:
                return ALONE * (5 - i + 6 - j)
            ways = [best(i + 1, j) + ALONE, best(i, j + 1) + ALONE]
            if j - i in shifts:
                ways.append(best(i + 1, j + 1) + cost[i, j - i + 3])
            return min(ways)

        total, way = aligned(cost, shifts, 6)
        assert total == pytest.approx(best(0, 0), rel=1e-12)
        used = np.flatnonzero(way >= 0)
        poses = used + shifts[way[used]]
        assert (np.diff(poses) > 0).all()
        alone = ALONE * (11 - 2 * len(used))
        assert total == pytest.approx(cost[used, way[used]].sum() + alone, rel=1e-12)


def test_what_the_file_cannot_tell_apart_is_said():
    """Poses 20 to 23 are one: which of their shots was missed nobody knows."""
    data = made(0, 60)
    same = np.where((np.arange(60) > 19) & (np.arange(60) < 24), 20, np.arange(60))
    F, T = flange_poses(ROBOT.model, data.q)[same], data.T[same]
    rows = np.delete(np.arange(60), 21)
    slip = find_slip(F, T[rows, :3, 3], T[rows, :3, :3])
    assert slip.spans == ((20, 23),)
    assert slip.sentence(LINES).startswith("from one of lines 22 to 25 on, row k-1 belongs to")
    rows = np.insert(np.arange(60), 22, 21)
    slip = find_slip(F, T[rows, :3, 3], T[rows, :3, :3])
    assert slip.spans == ((20, 24),)
    assert slip.sentence(LINES).endswith("one shot is too many (one of lines 22 to 26)")


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
    done = call("identify", "staubli_tx60", file, "--out", out)
    assert done.exit_code == 2
    assert done.stderr.startswith(
        f"{file}:12: from line 12 on, row k-1 belongs to pose k; one shot "
    )
    assert done.stderr.count("\n") == 1
    assert not out.exists()
