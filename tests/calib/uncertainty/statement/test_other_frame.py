"""Another frame: false alarms, shifts that are seen, what the sentence says of a moved station."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from calib.errors import InputError
from calib.measurement.observations import joined
from calib.uncertainty.statement.belief import believe
from calib.uncertainty.statement.other_frame import other_frame
from tests.calib import kinds
from tests.calib.uncertainty.statement.test_belief import campaign


def shifted(table, shift, turn=(0.0, 0.0, 0.0)):
    """The table seen from a station that moved by `shift` [m] and turned by `turn` [rad]."""
    R = kinds.exp_so3(np.asarray(turn))
    return replace(table, position=table.position @ R.T + shift, rotation=R @ table.rotation)


def test_false_alarms_are_rare():
    """Of 60 robots, rigid and bent, at p < .001 for the base and for the tool."""
    found = 0
    for robot in range(60):
        rng = np.random.default_rng([robot, 41])
        _, fit, train, held_out = campaign(rng, [0.0, 15e-6, 60e-6][robot % 3])
        found += other_frame(believe(fit, train, held_out), held_out).found
    assert found <= binom.ppf(0.999, 60, 0.002)


def test_twice_the_believed_radius_is_seen():
    seen = 0
    for robot in range(20):
        rng = np.random.default_rng([robot, 42])
        _, fit, train, held_out = campaign(rng, 15e-6)
        U = believe(fit, train, held_out).regions(held_out.q).mean_radius
        way = rng.normal(size=3)
        moved = shifted(held_out, 2 * U * way / np.linalg.norm(way))
        seen += other_frame(believe(fit, train, moved), moved).found
    # bar: 99 % of robots
    assert seen >= binom.ppf(0.001, 20, 0.99)


def test_motion_is_the_one_that_was_made():
    rng = np.random.default_rng(1)
    _, fit, train, held_out = campaign(rng, 0.0)
    shift, turn = np.array([300e-6, -100e-6, 50e-6]), np.array([0.0, 1e-3, -2e-3])
    moved = shifted(held_out, shift, turn)
    found = other_frame(believe(fit, train, moved), moved)
    assert found.found
    # noise of 20 um over 20 poses and the fit's own: within 30 um and .1 mrad
    np.testing.assert_allclose(found.turn, turn, atol=1e-4)
    middle = held_out.position.mean(axis=0)
    np.testing.assert_allclose(found.shift, np.cross(turn, middle) + shift, atol=4e-5)
    assert "another base frame, or the station moved" in found.sentence
    assert f"{np.degrees(np.linalg.norm(found.turn)):.2g} deg" in found.sentence
    assert "another" in repr(found)


def test_another_target_is_told_from_another_station():
    rng = np.random.default_rng(2)
    _, fit, train, held_out = campaign(rng, 0.0)
    offset = np.array([200e-6, 0.0, 100e-6])
    moved = replace(held_out, position=held_out.position + held_out.rotation @ offset)
    found = other_frame(believe(fit, train, moved), moved)
    assert found.p_tool < found.p_base
    np.testing.assert_allclose(found.tool, offset, atol=4e-5)
    assert "another target" in found.sentence


def test_half_a_metre_is_said_in_millimetres():
    rng = np.random.default_rng(3)
    _, fit, train, held_out = campaign(rng, 0.0)
    moved = shifted(held_out, [0.6, 0.1, 0.1], [0.0, 0.0, 0.3])
    sentence = other_frame(believe(fit, train, moved), moved).sentence
    assert " mm (17 deg) from the calibration" in sentence


def test_rows_of_one_pose_share_their_misfit():
    """Ten readings of each pose prove no frame: they show one draw of the misfit again."""
    found = 0
    for robot in range(8):
        rng = np.random.default_rng([robot, 43])
        true, fit, train, held_out = campaign(rng, 60e-6)
        again = [
            replace(
                kinds.poses(true, held_out.q, rng),
                pose_id=held_out.pose_id, repeat=np.full(len(held_out), k),
            )
            for k in range(8)
        ]  # fmt: skip
        table = joined(again)
        found += other_frame(believe(fit, train, table), table).found
    assert found == 0


def test_too_few_poses_cannot_tell():
    rng = np.random.default_rng(4)
    _, fit, train, held_out = campaign(rng, 0.0)
    few = held_out.rows(np.arange(5))
    with pytest.raises(InputError, match="6 poses or more"):
        other_frame(believe(fit, train, few), few)
