"""A tip that touches known places from many sides, without a tracker."""

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.frames import target_points
from testbed.files.probe import probe
from testbed.files.read import read_session
from testbed.files.readings import are_touched
from testbed.proposal.fits.draft_fit import EXPLAINED, _moved, fit_of
from testbed.proposal.fits.touches_alone import _scatter
from tests.command import call
from tests.testbed.files.made import ROBOT, csv, made
from tests.testbed.proposal.test_session import proposed

TIP = np.array([0.02, 0.01, 0.15])
PLACES = np.array([[0.35, 0.0, 0.25], [0.35, 0.2, 0.25], [0.25, 0.1, 0.4]])
"""In the base of the robot, in round numbers as on a drawing [m]."""


def touching(place, m, rng):
    """Joints (m, 6) [rad] with which the tip of an arm 0.15 mm and 0.04 deg off is at a place."""
    truth = made().truth

    def tip(q):
        base = np.linalg.inv(truth.chain.T_world_base)
        tool = np.linalg.inv(truth.chain.T_flange_tool)
        return target_points(base @ truth.poses(q) @ tool, TIP)

    lower, upper = ROBOT.limits.T
    found = np.zeros((0, len(ROBOT.limits)))
    while len(found) < m:
        q = rng.uniform(0.8 * lower, 0.8 * upper, (200, len(lower)))
        for _ in range(25):
            p = tip(q)
            J = np.stack([(tip(q + e) - p) / 1e-6 for e in 1e-6 * np.eye(len(lower))], axis=-1)
            step = np.clip(place - p, -0.1, 0.1)
            q = q + (np.linalg.pinv(J, rcond=1e-2) @ step[..., None])[..., 0]
        there = np.linalg.norm(tip(q) - place, axis=1) < 1e-7
        inside = ((q > lower) & (q < upper)).all(axis=1)
        found = np.vstack([found, q[there & inside]])
    return found[:m]


def touched(places, m=15, seed=12):
    """Columns of a table of m rows at each of some places."""
    rng = np.random.default_rng(seed)
    q = np.vstack([touching(place, m, rng) for place in places])
    table = {f"q{k + 1}_deg": np.degrees(q[:, k]) for k in range(q.shape[1])}
    xyz = np.repeat(1e3 * places, m, axis=0)
    return table | dict(zip(("x_mm", "y_mm", "z_mm"), xyz.T, strict=True))


def test_round_places_that_are_touched_again_are_not_called_a_controllers_poses(tmp_path):
    """Whole millimeters would leave as much as links do: "poses that calibrate nothing"."""
    (tmp_path / "a.csv").write_text(csv(touched(PLACES)))
    (tmp_path / "s.toml").write_text("[points]\n[uncertainty]\nposition_um = 20\n")
    session = read_session(tmp_path / "a.csv", ROBOT, config=tmp_path / "s.toml")
    found = probe(ROBOT, session)
    found.raise_if_wrong()
    assert found.stated.position < 1e-3
    assert not found.exact
    # each place once, in tenths of a millimeter, is a screen's
    (tmp_path / "a.csv").write_text(csv(rounded_poses()))
    session = read_session(tmp_path / "a.csv", ROBOT, config=tmp_path / "s.toml")
    assert probe(ROBOT, session).exact


def test_a_touch_beside_its_place_is_not_said_to_fit_the_joints_of_another_touch(tmp_path):
    """All others of that place have the same coordinates: whose joints fit them is no news. On a
    real arm the first of them was named, as if lines had been swapped."""
    table = touched(PLACES)
    table["q1_deg"][7] += 9
    (tmp_path / "a.csv").write_text(csv(table))
    (tmp_path / "s.toml").write_text("[points]\n[uncertainty]\nposition_um = 20\n")
    (said,) = read_session(tmp_path / "a.csv", ROBOT, config=tmp_path / "s.toml").masked
    assert said.endswith("mm off")


def rounded_poses():
    """Columns of the nominal robot's own places, to a tenth of a millimeter."""
    q = made().q
    table = {f"q{k + 1}_deg": np.degrees(q[:, k]) for k in range(q.shape[1])}
    xyz = np.round(1e3 * ROBOT.model.poses(q)[:, :3, 3], 1)
    return table | dict(zip(("x_mm", "y_mm", "z_mm"), xyz.T, strict=True))


def moved_to(origin):
    """The places of a table in a frame of their own, one of them in its origin."""
    table = touched(PLACES)
    return table | {
        f"{axis}_mm": table[f"{axis}_mm"] - 1e3 * place
        for axis, place in zip("xyz", origin, strict=True)
    }


def test_a_place_in_the_origin_is_touched_and_not_missed(tmp_path):
    """Its rows were left out as missed shots."""
    (tmp_path / "a.csv").write_text(csv(moved_to(PLACES[0])))
    (tmp_path / "s.toml").write_text("[points]\n[uncertainty]\nposition_um = 20\n")
    session = read_session(tmp_path / "a.csv", ROBOT, config=tmp_path / "s.toml")
    assert len(session.measurements) == 45
    assert not session.masked


def test_a_reading_and_its_copy_are_no_touched_place_and_an_origin_alone_is_a_missed_shot(tmp_path):
    assert are_touched(np.repeat(PLACES, 3, axis=0))
    assert not are_touched(np.repeat(PLACES, 2, axis=0))
    assert not are_touched(np.vstack([np.repeat(PLACES, 3, axis=0), PLACES[:1] / 2]))
    (tmp_path / "a.csv").write_text(csv(touched(PLACES) | {f"{k}_mm": np.zeros(45) for k in "xyz"}))
    (tmp_path / "s.toml").write_text("[points]\n[uncertainty]\nposition_um = 20\n")
    with pytest.raises(InputError, match="no row is left"):
        read_session(tmp_path / "a.csv", ROBOT, config=tmp_path / "s.toml")


def test_two_sessions_may_touch_places_of_the_same_coordinates(tmp_path):
    """A plate that was set down twice: its places were "readings of session a again"."""
    for name, seed in (("a", 12), ("b", 13)):
        (tmp_path / f"{name}.csv").write_text(csv(touched(PLACES, seed=seed)))
    (tmp_path / "session.toml").write_text(
        "format = 1\n[uncertainty]\nposition_um = 20\n"
        '[[session]]\nname = "a"\nfile = "a.csv"\n'
        '[[session]]\nname = "b"\nfile = "b.csv"\ntool = "same as a"\n'
    )
    assert len(read_session(tmp_path / "session.toml", ROBOT).measurements) == 90
    # joints and places of one file are still refused
    (tmp_path / "session.toml").write_text(
        (tmp_path / "session.toml").read_text().replace("b.csv", "a.csv")
    )
    with pytest.raises(InputError, match="name each file once"):
        read_session(tmp_path / "session.toml", ROBOT)


def test_copies_of_some_touched_rows_are_no_session_of_their_own(tmp_path):
    """The copies alone, of few rows of each place, did not look like places that are touched."""
    (tmp_path / "a.csv").write_text(csv(touched(PLACES)))
    lines = (tmp_path / "a.csv").read_text().splitlines()
    (tmp_path / "b.csv").write_text("\n".join([*lines[:3], *lines[16:18], ""]))
    (tmp_path / "session.toml").write_text(
        "format = 1\n[uncertainty]\nposition_um = 20\n"
        '[[session]]\nname = "a"\nfile = "a.csv"\n'
        '[[session]]\nname = "b"\nfile = "b.csv"\ntool = "same as a"\n'
    )
    with pytest.raises(InputError, match="name each file once"):
        read_session(tmp_path / "session.toml", ROBOT)


def test_files_of_joints_alone_are_told_to_state_what_was_touched(tmp_path):
    """Those of the second socket were taken as readings, and no interpretation fitted."""
    joints = [{k: v for k, v in touched(PLACES[[k]]).items() if k[0] == "q"} for k in (0, 1)]
    for name, table in zip("ab", joints, strict=True):
        bare = np.radians(np.column_stack(list(table.values())))
        bare[0, 1] += 0.3 * (name == "b")  # the tip was not in its socket then
        np.savetxt(tmp_path / f"{name}.csv", bare, delimiter=",")
    (tmp_path / "c.csv").write_text(csv(joints[0]))
    for files in ("a", "ab", "c", "cb"):
        done = call(
            "new", "session", *(tmp_path / f"{name}.csv" for name in files),
            "--out", tmp_path / "session.toml", "--robot", ROBOT.name,
        )  # fmt: skip
        said = done.stderr
        assert done.exit_code == 2
        assert "joints and no readings; a nominal staubli_tx60 keeps one point of its tool" in said
        assert "in columns x_mm, y_mm, z_mm" in said
        assert ("write all rows into one table" in said) == (len(files) == 2)


def test_a_flange_that_moves_while_its_tip_stays_has_moved_what_is_seen():
    """Of a real Panda, 9 mm off at two sockets 50 mm apart, they said that no interpretation fits
    and asked whether it was the robot that was measured."""
    rng = np.random.default_rng(0)
    F = np.tile(np.eye(4), (40, 1, 1))
    F[:, :3, 3] = rng.normal(size=(40, 3))
    sockets = np.repeat([[0.0, 0, 0], [0.05, 0, 0]], 20, axis=0)
    assert _moved(F, sockets) == pytest.approx(np.sqrt(np.var(F[:, :3, 3], axis=0).sum()))
    assert _moved(F, sockets / 10) == pytest.approx(0.0025)  # one place tells no length


def test_an_arm_that_is_off_by_more_than_a_third_of_its_sockets_spread_is_still_fitted(tmp_path):
    table = touched(PLACES[:1] + np.array([[0.0, 0, 0], [0, 0.05, 0]]))
    rng = np.random.default_rng(1)
    for name in (name for name in table if name[0] == "q"):
        table[name] = table[name] + 1.2 * rng.standard_normal(30)
    (tmp_path / "a.csv").write_text(csv(table))
    (tmp_path / "s.toml").write_text("[points]\n[uncertainty]\nposition_um = 20\n")
    session = read_session(tmp_path / "a.csv", ROBOT, config=tmp_path / "s.toml")
    assert 0.025 / EXPLAINED < fit_of(ROBOT, session, 1).score < 0.02


def test_a_flange_that_stays_tells_no_touch():
    q = np.outer(np.linspace(-2, 2, 20), np.eye(6)[5])
    assert _scatter(ROBOT.model, q) == np.inf


def test_one_place_is_told_to_say_nothing_of_lengths(tmp_path):
    """It said: none of 1 interpretations fits; is it the robot that was measured?"""
    (tmp_path / "a.csv").write_text(csv(touched(PLACES[:1], 30)))
    said, _ = proposed(tmp_path, [tmp_path / "a.csv"], "--robot", ROBOT.name)
    assert "are of one place" in said
    assert "touch several, whose distances are known" in said
    assert "is it the robot that was measured" not in said
