"""Faulty files: `new session` names the true fault, as `identify` does, or what does not fit."""

import re
import tomllib

import numpy as np
import pytest

from tests.command import call
from tests.testbed.files.made import columns, csv, made, with_spread

M = 24
JOINTS = tuple(f"q{k}_deg" for k in range(1, 7))
PLACES = ("x_mm", "y_mm", "z_mm")
SEEN = (*PLACES, "qw", "qx", "qy", "qz")


def table(m=M):
    """Full poses in the project's own names."""
    return with_spread(columns(made(3, m), form="quaternion"))


def foreign(m=M):
    """The same in names that say no unit."""
    own = table(m)
    names = dict(zip((*JOINTS, *PLACES), ("J1", "J2", "J3", "J4", "J5", "J6", *"XYZ"), strict=True))
    return {names[k]: own[k] for k in names}


def renamed(old, new, source=None):
    own = table() if source is None else source
    return {k.replace(old, new) if k.endswith(old) else k: v for k, v in own.items()}


def some(names, factor, rows=slice(None)):
    own = table()
    for name in names:
        own[name] = own[name].copy()
        own[name][rows] *= factor
    return own


def cell(name, row, text, source=None):
    own = table() if source is None else source
    values = [f"{value:.9g}" for value in own[name]]
    values[row] = text
    return own | {name: values}


def shifted(shift):
    """Readings `shift` rows further up than their joints."""
    own = table(M + abs(shift))
    rows = {True: slice(max(shift, 0), M + max(shift, 0)),
            False: slice(max(-shift, 0), M + max(-shift, 0))}  # fmt: skip
    return {k: v[rows[k in SEEN]] for k, v in own.items()}


def wrong_order():
    own = table()
    return own | dict(zip(("qw", "qx", "qy", "qz"),
                          (own[f"q{a}"] for a in "xyzw"), strict=True))  # fmt: skip


def proposal(folder, content, *more):
    (folder / "a.csv").write_text(csv(content))
    out = folder / "session.toml"
    words = ["new", "session", str(folder / "a.csv"), "--out", str(out), *more]
    return call(*words), out


TX60 = ("--robot", "staubli_tx60")
REFUSED = {
    "no rows": (lambda: table(0), r"a\.csv: names its columns and has no rows below them"),
    "no rows, foreign": (lambda: foreign(0), r"a\.csv: names its columns and has no rows below"),
    "mm as m": (lambda: renamed("_mm", "_m"), r"a\.csv: .* if the positions are in mm, not m;"),
    "m as mm": (lambda: some(PLACES, 1e-3), r"a\.csv: .* if the positions are in m, not mm;"),
    "rad as deg": (
        lambda: some(JOINTS, np.pi / 180),
        r"a\.csv: .* if the joints are in rad, not deg; name the columns q1_rad",
    ),
    "deg as rad": (
        lambda: renamed("_deg", "_rad"),
        r"a\.csv:2: .*outside the limits .* if these are deg, name the columns q1_deg",
    ),
    "two joints rad": (
        lambda: some(JOINTS[3:5], np.pi / 180),
        r"a\.csv: .* if q4, q5 are in rad, not deg; name these columns q4_rad \.\.\.",
    ),
    "one joint rad": (
        lambda: some(JOINTS[1:2], np.pi / 180),
        r"a\.csv: .* if q2 is in rad, not deg; name this column q2_rad\.",
    ),
    "quaternions": (wrong_order, r"a\.csv: .* if the columns qw qx qy qz hold x y z w"),
    "all cells words": (
        lambda: table() | {"q3_deg": ["abc"] * M},
        r'a\.csv: 24 of 24 rows have cells that are not numbers \(line 2 q3_deg "abc"',
    ),
    "one row up": (lambda: shifted(1), r"row k-1 belongs to pose k; move the readings one row do"),
    "one row down": (lambda: shifted(-1), r"row k\+1 belongs to pose k; move the readings one row"),
    "two rows": (lambda: shifted(2), r"row k-2 belongs to pose k; move the readings 2 rows down"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_the_true_fault_is_named_and_no_session_is_written(name, tmp_path):
    content, told = REFUSED[name]
    done, out = proposal(tmp_path, content(), *TX60)
    assert (done.exit_code, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert re.search(told, done.stderr), done.stderr
    assert not out.exists()
    again = call("check", tmp_path / "a.csv", *TX60)
    if "foreign" not in name:  # identify asks for our names first
        assert again.stderr.replace(" or add --drop-invalid", "") == done.stderr.replace(
            " or add --drop-invalid", ""
        )


@pytest.mark.parametrize("source", [table, foreign])
def test_joints_that_are_not_all_there_are_named(source, tmp_path):
    own = {k: v for k, v in source().items() if k not in ("q6_deg", "J6")}
    done, out = proposal(tmp_path, own, *TX60)
    assert done.exit_code == 2
    told = "a.csv: has columns for 5 joints, and none for q6; staubli_tx60 has 6 joints; give all"
    assert told in done.stderr
    assert not out.exists()


@pytest.mark.slow
def test_more_joints_than_the_robot_has_are_said_where_nothing_fits(tmp_path):
    own = table() | {"q7_deg": np.linspace(0, 9, M)}
    done, out = proposal(tmp_path, own, *TX60)
    assert "joints, and" not in done.stdout  # it may be an axis beside the robot
    out.unlink()
    rng = np.random.default_rng(0)
    done, _ = proposal(tmp_path, own | {k: rng.uniform(-90, 90, M) for k in JOINTS}, *TX60)
    assert "There are 7 joints, and staubli_tx60 has 6." in done.stdout


MENDED = {
    "word": (lambda: cell("x_mm", 7, "abc"), 'line 9 x_mm "abc"'),
    "nan": (lambda: cell("q3_deg", 7, "nan"), 'line 9 q3_deg "nan"'),
    "blank": (lambda: cell("X", 0, "", foreign()), 'line 2 X ""'),
    "rows in rad": (
        lambda: some(JOINTS, np.pi / 180, slice(14, None)),
        "if the joints of some rows, the first in line 16, are in rad, not deg",
    ),
}


@pytest.mark.parametrize("name", MENDED)
def test_what_identify_will_refuse_stands_in_the_session(name, tmp_path):
    content, told = MENDED[name]
    done, out = proposal(tmp_path, content(), *TX60)
    assert done.exit_code == 0, done.stderr
    (line,) = (line for line in done.stdout.splitlines() if line.startswith("  to fix"))
    assert told in line
    assert "a.csv: " in line
    text = out.read_text()
    assert "# To be corrected before identify takes these files:" in text
    assert line.removeprefix("  to fix   ") in text
    tomllib.loads(text)
    refused = call("check", out, *TX60)
    assert (refused.exit_code, told in refused.stderr) == (2, True)


@pytest.mark.parametrize("name", ["word", "nan", "blank"])
def test_cells_are_looked_at_without_a_robot_too(name, tmp_path):
    content, told = MENDED[name]
    done, _ = proposal(tmp_path, content())
    assert done.exit_code == 0
    assert re.search(rf"  to fix   .*{re.escape(told)}", done.stdout)


def test_a_joint_beyond_its_limits_and_the_row_that_is_left_out_are_told(tmp_path):
    done, _ = proposal(tmp_path, cell("q3_deg", 3, "500"), *TX60)
    assert done.exit_code == 0
    assert re.search(r"  odd      .*a\.csv:5: left out: \d+ mm off", done.stdout)
    assert (
        "1 joint value lies outside the limits of staubli_tx60, the first is in line 5: "
        'q3_deg = "500"; its limits are -142.5 to 142.5 deg' in done.stdout
    )
    assert "to fix" not in done.stdout


@pytest.mark.parametrize("content", [table, foreign])
def test_too_few_rows_are_said_to_be_too_few_and_not_of_another_robot(content, tmp_path):
    done, _ = proposal(tmp_path, content(5), *TX60)
    assert done.exit_code == 0
    assert re.match(
        r"5 different poses in .*a\.csv, too few to try interpretations of", done.stdout
    )
    assert "is it the robot" not in done.stdout
    (tmp_path / "session.toml").unlink()
    if content is table:  # a unit shows in three poses already
        done, _ = proposal(tmp_path, {k: v[:5] for k, v in some(PLACES, 1e-3).items()}, *TX60)
        assert (done.exit_code, "check the unit of the positions" in done.stderr) == (2, True)


def test_only_what_no_file_says_is_called_assumed(tmp_path):
    """Columns qw to qz say which number is which; four without names do not."""
    done, _ = proposal(tmp_path, table(), *TX60)
    assumed = [line for line in done.stdout.splitlines() if line.startswith("  assumed")]
    assert assumed == ["  assumed  transforms: assumed to be those of the tool in the tracker"]
    (tmp_path / "session.toml").unlink()
    own = {k: v for k, v in table().items() if k in (*JOINTS, *SEEN)}
    bare = "\n".join(csv(own).splitlines()[1:])
    (tmp_path / "b.csv").write_text(bare)
    words = ["new", "session", str(tmp_path / "b.csv"), "--out", str(tmp_path / "session.toml")]
    said = call(*words, *TX60).stdout
    assert (
        "assumed  rotations: no name states the order of the quaternions; assumed: x y z w" in said
    )


def test_a_part_that_fits_is_not_said_to_be_all_rows(tmp_path):
    own = table(30)
    slipped = {k: np.concatenate([v[:15], v[16:]]) if k in SEEN else v[:-1] for k, v in own.items()}
    done, _ = proposal(tmp_path, slipped, *TX60)
    assert done.exit_code == 0
    assert "in one of 3 equal parts of the file, but larger over all rows" in done.stdout
    assert re.search(r"to fix   .*a\.csv:17: from line 17 on, row k-1 belongs", done.stdout)


def named_poses(without=()):
    """Joints and poses of the same names in two files; of some poses there is no reading."""
    own, keep = table(), [k for k in range(M) if k not in without]
    names = {"pose_id": np.arange(M)}
    seen = {k: v[keep] for k, v in (names | {k: own[k] for k in SEEN}).items()}
    return {"j.csv": names | {k: own[k] for k in JOINTS}, "p.csv": seen}


@pytest.mark.parametrize(
    ("files", "faulty"),
    [
        ({"a.csv": table()}, False),
        ({"a.csv": cell("y_mm", 3, "ERR")}, True),
        ({"a.csv": cell("x_mm", 3, "1e9")}, True),
        (named_poses(), False),
        (named_poses([5]), True),
    ],
    ids=["sound", "no number", "no such place", "two files", "a lost reading"],
)
def test_the_next_command_runs_as_it_is_printed(files, faulty, tmp_path):
    """Without --drop-invalid it was refused, which the proposal itself had foretold."""
    for name, content in files.items():
        (tmp_path / name).write_text(csv(content))
    paths = [tmp_path / name for name in files]
    done = call("new", "session", *paths, "--out", tmp_path / "s.toml", *TX60)
    assert done.exit_code == 0, done.stderr
    command = done.stdout.partition("Next       truebed ")[2].split()
    assert ("--drop-invalid" in command) is faulty
    assert (f"# Then: truebed {' '.join(command)}\n" in (tmp_path / "s.toml").read_text()) is True
    run = call(*command, "--out", tmp_path / "out", "--quiet")
    assert run.exit_code == 0, run.stderr


def test_without_a_robot_the_next_command_drops_cells_that_are_no_numbers(tmp_path):
    done, _ = proposal(tmp_path, cell("y_mm", 3, "ERR"))
    assert done.stdout.endswith("session.toml --drop-invalid\n")
