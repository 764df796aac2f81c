"""One fixed ball that a scanner on the flange sees, in its own frame: no places of the tool."""

from types import SimpleNamespace

import numpy as np
import pytest

from calib.geometry.frames import exp_so3
from calib.measurement import tables
from testbed.files.frames_fit import flange_poses
from testbed.files.read import read_session
from testbed.proposal.fits.seen_from_flange import seen_from_flange
from tests.command import call
from tests.testbed.files.made import ROBOT, csv, made
from tests.testbed.files.rows.test_touched import TIP, touching

BALL = np.array([0.35, 0.0, 0.25])
"""In the base of the robot [m]."""
AIM = np.radians(2.0)
"""By which joints are off those with which the scanner would see the ball at one place [rad]."""
M = 40


def scanned(turn, seed=3):
    """Joints (m, 6) [rad] and places of the ball in a scanner that is turned on the flange [m]."""
    rng = np.random.default_rng(seed)
    q = touching(BALL, M, rng)
    q += AIM * rng.uniform(-1, 1, q.shape)
    F = flange_poses(made().truth, q)
    in_flange = np.einsum("mji,mj->mi", F[:, :3, :3], BALL - F[:, :3, 3])
    return q, (in_flange - TIP) @ exp_so3(np.asarray(turn, dtype=float))


def table_of(q, places, name="{}_mm"):
    """Columns of joints and places."""
    table = {f"q{k + 1}_deg": np.degrees(q[:, k]) for k in range(q.shape[1])}
    return table | {name.format(axis): 1e3 * places[:, k] for k, axis in enumerate("xyz")}


@pytest.mark.parametrize("turn", [[0, 0, 0], [0.03, 3.1, 0], [1.2, -0.9, 2.0]])
def test_a_ball_that_a_scanner_sees_is_said_to_be_one_and_how_it_is_read(tmp_path, turn):
    q, seen = scanned(turn)
    file = tmp_path / "a.csv"
    file.write_text(csv(table_of(q, seen)))
    asked = ("new", "session", file, "--robot", "staubli_tx60", "--out", tmp_path / "session.toml")
    done = call(*asked)
    assert done.exit_code == 2
    assert "those of one fixed point in the frame of an instrument on the flange" in done.stderr
    assert "call their columns reflector_x_mm" in done.stderr
    # what it says is read as it was meant: a point of the tool for each row, all at one place
    place = np.tile([1.0, 0.0, 0.0], (M, 1))
    file.write_text(csv(table_of(q, place) | table_of(q, seen, "reflector_{}_mm")))
    done = call(*asked)
    assert done.exit_code == 0, done.stderr
    assert f"each point of the tool in {file} is at too few poses" in " ".join(done.stdout.split())
    rows = read_session(tmp_path / "session.toml", ROBOT).measurements
    np.testing.assert_allclose(rows.offset, seen, rtol=0, atol=1e-9)
    np.testing.assert_allclose(rows.position, place, rtol=0, atol=1e-12)


def test_what_wanders_and_what_hardly_differs_is_no_ball_seen_from_the_flange(tmp_path):
    q, seen = scanned([0, 0, 0])
    rng = np.random.default_rng(1)
    (tmp_path / "s.toml").write_text("[points]\n[uncertainty]\nposition_um = 20\n")
    still = TIP + 1e-3 * rng.standard_normal(seen.shape)
    for places in (rng.uniform(-0.5, 0.5, seen.shape), still):
        (tmp_path / "a.csv").write_text(csv(table_of(q, places)))
        session = read_session(tmp_path / "a.csv", ROBOT, config=tmp_path / "s.toml")
        assert seen_from_flange(session, ROBOT) is None


def told(q, places):
    """What is said of joints (m, 6) and places (m, 3)."""
    rows = tables.points(q, places, sd=2e-5)
    return seen_from_flange(SimpleNamespace(measurements=rows, where="a.csv"), ROBOT)


def test_few_readings_and_a_ball_that_stays_where_it_is_seen_tell_nothing():
    """Nine numbers follow eleven readings well; what the flange alone keeps needs no fit."""
    q, seen = scanned([0, 0, 0])
    assert told(q[:12], seen[:12]) is not None
    assert told(q[:11], seen[:11]) is None
    rng = np.random.default_rng(4)
    q = touching(BALL, M, rng)
    assert told(q, 1e-3 * rng.standard_normal((M, 3))) is None


def test_some_readings_of_something_else_hide_no_ball():
    q, seen = scanned([1.2, -0.9, 2.0])
    seen[::5] += np.random.default_rng(5).normal(size=seen[::5].shape)
    assert told(q, seen) is not None
