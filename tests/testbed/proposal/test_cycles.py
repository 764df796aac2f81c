"""Poses that are visited again and again in turn are proposed as a test after ISO 9283."""

from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbed.files.sources import session_file
from testbed.iso9283.read import read_test
from tests.command import call
from tests.testbed.files.made import columns, csv, made

PLACES = {f"P{k}": 500.0 + 100 * np.array([k, (-1) ** k, k % 3]) for k in range(1, 6)}
AXES = "xyz"


def rows(cycles, poses=5):
    """Name, cycle, command and reading of each visit [mm]."""
    rng = np.random.default_rng(2)
    for cycle in range(1, cycles + 1):
        for name in list(PLACES)[:poses]:
            yield name, cycle, PLACES[name], PLACES[name] + rng.normal(scale=0.03, size=3)


def written(path, head, lines, mark=","):
    text = "\n".join(mark.join(map(str, line)) for line in (head, *lines))
    path.write_text(text.replace(".", ",") if mark == ";" else text)


def proposed(folder, monkeypatch):
    monkeypatch.chdir(folder)
    done = call("new", "session", "a.csv")
    assert done.exit_code == 0, done.stderr
    return done.stdout


def own(folder, cycles=30, poses=5):
    head = ["pose_id", "cycle", *(f"command_{a}_mm" for a in AXES), *(f"{a}_mm" for a in AXES)]
    lines = [(name, k, *sent, *seen) for name, k, sent, seen in rows(cycles, poses)]
    written(folder / "a.csv", head, lines)


def test_columns_of_ours_need_no_more_than_the_file(tmp_path, monkeypatch):
    own(tmp_path)
    said = proposed(tmp_path, monkeypatch)
    assert said.startswith("5 poses in turn, each 30 times: read as a test after ISO 9283.")
    assert said.endswith("Next       truebed iso9283 session.toml\n")
    text = (tmp_path / "session.toml").read_text()
    assert '\n[cycles]\nfile = "a.csv"\n\n' in text
    assert "\n[joints]" not in text


def test_foreign_columns_are_mapped_and_a_running_number_is_no_name_of_a_pose(
    tmp_path, monkeypatch
):
    own(tmp_path)
    plain = read_test(tmp_path / "a.csv").visits
    head = ["Nr", "Point", "Zyklus", *(f"Target {a} [m]" for a in "XYZ"), *"XYZ"]
    lines = [
        (k, name, cycle, *(sent / 1e3), *seen)
        for k, (name, cycle, sent, seen) in enumerate(rows(30))
    ]
    written(tmp_path / "a.csv", head, lines, ";")
    said = proposed(tmp_path, monkeypatch)
    assert "positions: no column states its unit; assumed: mm" in said
    found = read_test(session_file(tmp_path)).visits
    assert found.pose == plain.pose
    # both are read from the same decimal digits, in m and in mm
    np.testing.assert_allclose(found.position, plain.position, rtol=1e-15)
    np.testing.assert_allclose(found.command, plain.command, rtol=1e-15)


def test_check_says_the_same(tmp_path):
    own(tmp_path)
    for words in ([], ["--robot", "staubli_tx60"]):
        said = call("check", tmp_path / "a.csv", *words).stdout
        assert "\n  5 poses in turn, each 30 times: read as a test after ISO 9283\n" in said
        assert said.endswith(f"\n  type truebed iso9283 {tmp_path / 'a.csv'}\n")


def test_check_of_a_session_tells_what_both_verbs_would_read(tmp_path):
    own(tmp_path)
    seen = columns(made())
    (tmp_path / "b.csv").write_text(csv({k: v for k, v in seen.items() if k[0] != "r"}))
    cycles = '[cycles]\nfile = "a.csv"\n[uncertainty]\nposition_um = 9\n'
    (tmp_path / "session.toml").write_text(cycles)
    said = call("check", tmp_path).stdout
    assert "a session of cycles\n  for truebed iso9283: 30 cycles of 5 poses" in said
    both = '[joints]\nfile = "b.csv"\n[points]\nfile = "b.csv"\n'
    (tmp_path / "session.toml").write_text(both + cycles)
    said = call("check", tmp_path, "--robot", "staubli_tx60").stdout
    assert "a session of points and cycles; for truebed iso9283: 30 cycles of 5 poses" in said
    assert "29 rows of 29 poses; commanded joints" in said


@pytest.mark.parametrize("form", ["euler", "rv"])
def test_rotations_of_cycles_are_read_by_an_order_that_is_said_to_be_assumed(
    tmp_path, monkeypatch, form
):
    head = ["pose_id", *(f"command_{a}_mm" for a in AXES), *(f"{a}_mm" for a in AXES)]
    names = [f"rv{a}_deg" if form == "rv" else f"r{a}_deg" for a in AXES]
    head += [f"command_{name}" for name in names] + names
    sent, seen = (10, 20, 30), (10.01, 20.02, 30.03)
    lines = [(name, *at, *there, *sent, *seen) for name, _, at, there in rows(30)]
    written(tmp_path / "a.csv", head, lines)
    said = proposed(tmp_path, monkeypatch)
    assert ("turn; assumed: XYZ" in said) == (form == "euler")
    found = read_test(session_file(tmp_path)).visits
    by_scipy = {"euler": partial(Rotation.from_euler, "XYZ"), "rv": Rotation.from_rotvec}[form]
    # fifteen digits of the degrees above
    np.testing.assert_allclose(
        found.rotation[0, 0], by_scipy(np.radians(seen)).as_matrix(), rtol=0, atol=1e-13
    )


def test_without_commands_it_says_what_iso9283_needs(tmp_path, monkeypatch):
    head = ["pose_id", *(f"q{k}_deg" for k in range(1, 7)), *(f"{a}_mm" for a in AXES)]
    lines = [(name, *[10 * int(name[1])] * 6, *seen) for name, _, _, seen in rows(12)]
    written(tmp_path / "a.csv", head, lines)
    said = proposed(tmp_path, monkeypatch)
    assert "5 poses in turn, each 12 times: for truebed iso9283 write [cycles]" in said
    assert said.endswith("truebed identify ROBOT session.toml\n")


def readings_alone(folder):
    """Cycles with foreign names and no commands, as a tracker's program exports them."""
    lines = [(k, name, *seen) for name, k, _, seen in rows(30)]
    written(folder / "a.csv", ["Cycle", "Pose", *(f"{a}[mm]" for a in "XYZ")], lines)


@pytest.mark.parametrize("head", ["pose_id,x_mm,y_mm,z_mm", "Pose,X,Y,Z"])
def test_commands_of_another_file_make_a_test(head, tmp_path, monkeypatch):
    """They were "unused", and Next was identify."""
    monkeypatch.chdir(tmp_path)
    readings_alone(tmp_path)
    written(tmp_path / "c.csv", head.split(","), [(name, *at) for name, at in PLACES.items()])
    done = call("new", "session", "a.csv", "c.csv")
    assert done.exit_code == 0, done.stderr
    assert "unused" not in done.stdout
    assert done.stdout.endswith("Next       truebed iso9283 session.toml\n")
    assert 'commanded = "c.csv"' in (tmp_path / "session.toml").read_text()
    if head[0] == "P":
        assert "c.csv: has no readings; needed: x_mm y_mm z_mm" in done.stdout
        return
    found = read_test(tmp_path / "session.toml").visits
    np.testing.assert_allclose(1e3 * found.command, list(PLACES.values()), rtol=0, atol=1e-9)


def test_readings_alone_lead_to_a_test_and_say_what_it_needs(tmp_path, monkeypatch):
    readings_alone(tmp_path)
    said = proposed(tmp_path, monkeypatch)
    assert "commands.csv: write the commanded position of each pose there" in said
    assert said.endswith("Next       truebed iso9283 session.toml\n")
    done = call("iso9283", "a.csv", "--out", "out")
    assert "name the columns so, let `truebed new session` propose it, or say" in done.stderr
    # what was asked for is all that was missing
    lines = [(name, *at) for name, at in PLACES.items()]
    written(tmp_path / "commands.csv", ["pose_id", "x_mm", "y_mm", "z_mm"], lines)
    found = read_test(tmp_path / "session.toml").visits
    np.testing.assert_allclose(1e3 * found.command, list(PLACES.values()), rtol=0, atol=1e-9)


@pytest.mark.parametrize("shuffled", [False, True])
def test_a_few_visits_or_no_order_are_no_cycles(shuffled, tmp_path, monkeypatch):
    own(tmp_path, cycles=30 if shuffled else 9)
    if shuffled:
        head, *lines = (tmp_path / "a.csv").read_text().splitlines()
        mixed = np.random.default_rng(1).permutation(lines)
        (tmp_path / "a.csv").write_text("\n".join([head, *mixed]))
    assert "ISO" not in proposed(tmp_path, monkeypatch)


def test_a_cycle_that_is_not_whole_is_to_be_mended(tmp_path, monkeypatch):
    own(tmp_path)
    lines = (tmp_path / "a.csv").read_text().splitlines()
    (tmp_path / "a.csv").write_text("\n".join(lines[:77] + lines[78:]))
    said = proposed(tmp_path, monkeypatch)
    assert "to fix" in said
    assert "[M31]" in said
    assert said.endswith("Next       truebed iso9283 session.toml --drop-invalid\n")
    command = said.split("Next       truebed ")[1].split()
    assert call(*command, "--out", tmp_path / "out", "--quiet").exit_code == 0
