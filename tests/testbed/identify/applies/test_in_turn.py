"""Two arms, or two tools, that took turns in one table; and tables in which nothing did."""

from dataclasses import replace

import numpy as np
import pytest

from calib.measurement import tables
from testbed.identify.applies import in_turn
from testbed.identify.applies.in_turn import in_turn_words
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.to_do.next_step import next_step
from tests.calibrated import robot, session_of, table_of, true_model
from tests.command import call
from tests.reference import DEG, pool_r
from tests.testbed.identify.applies.test_mounting import geared

POSES, NOISE = 60, 10e-6
EVEN = np.arange(POSES) % 2 == 1


def of_turns(one, other, q, seed=9, noise=NOISE):
    """Points of one model, and at every second pose of another."""
    p = np.where(EVEN[:, None], other.poses(q)[:, :3, 3], one.poses(q)[:, :3, 3])
    return p + np.random.default_rng(seed).normal(scale=noise, size=(len(q), 3))


def said(found):
    return [text for text in found.warnings if text.startswith("Every second pose differs")]


def test_two_arms_that_take_turns_are_named_from_a_file(tmp_path):
    """Nothing said why errors were half a millimeter: neither arm moved between two rows."""
    q = pool_r(POSES, seed=9)
    xyz = of_turns(true_model(9), true_model(10), q)
    head = ",".join([*(f"q{k + 1}_deg" for k in range(6)), "x_mm", "y_mm", "z_mm"])
    rows = [",".join(f"{x:.6f}" for x in row) for row in np.hstack([np.degrees(q), 1e3 * xyz])]
    (tmp_path / "a.csv").write_text("\n".join([head, *rows]))
    (tmp_path / "session.toml").write_text("[uncertainty]\nposition_um = 10\n")
    done = call("identify", "staubli_tx60", tmp_path / "a.csv", "--config",
                tmp_path / "session.toml", "--out", tmp_path / "out", "--plain")  # fmt: skip
    assert done.exit_code == 0, done.stderr
    assert "Every second pose differs from those between: there the readings are " in done.stdout
    assert "those of another arm" in done.stdout
    assert "To do: First find out what took turns in this table, pose by pose" in done.stdout


def test_a_tool_that_is_another_at_every_second_pose_is_named():
    q, true = pool_r(POSES, seed=9), true_model(9)
    T = true.chain.T_flange_tool.copy()
    T[:3, 3] += [2e-4, -1e-4, 3e-4]
    other = replace(true, chain=replace(true.chain, T_flange_tool=T))
    session = session_of(tables.points(q, of_turns(true, other, q), sd=NOISE))
    found = calibrate(robot(), session, Options(held_out=15))
    (text,) = said(found)
    off = float(text.partition("there the target is ")[2].split(" um off on the tool")[0])
    # 22 points of 10 um on either side: 3 um in each axis, beside what the links take up
    assert off == pytest.approx(374, abs=12)
    assert "First find out what took turns" in next_step(found)


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2))])
def test_what_gears_and_noise_do_takes_no_turns(seed):
    table = table_of(true_model(seed), pool_r(POSES, seed=seed), noise=2.0)
    for one in (table, geared(table, seed)):
        found = calibrate(robot(), session_of(one, model="choose"), Options(seed=seed))
        assert found.refuted
        assert said(found) == []


def test_rows_of_unknown_order_are_not_asked():
    q = pool_r(POSES, seed=9)
    xyz = of_turns(true_model(9), true_model(10), q)
    session = session_of(tables.points(q, xyz, sd=NOISE))
    session = replace(session, wanted=session.wanted.model_copy(update={"order": "unknown"}))
    assert said(calibrate(robot(), session, Options(held_out=15))) == []


def test_turns_are_counted_by_poses_and_with_the_held_out_ones():
    """Of each pose two shots; of a joint that stands off in turn, by which it is told."""
    q, true = pool_r(POSES, seed=9), true_model(9)
    slipped = q + np.outer(EVEN, np.eye(6)[2]) * 0.02 * DEG
    rng, p = np.random.default_rng(1), true.poses(slipped)[:, :3, 3]
    shots = np.repeat(np.arange(POSES), 2)
    xyz = p[shots] + rng.normal(scale=NOISE, size=(2 * POSES, 3))
    table = tables.points(q[shots], xyz, sd=NOISE, pose_id=shots, repeat=np.tile([0, 1], POSES))
    found = calibrate(robot(), session_of(table), Options(held_out=20))
    (text,) = said(found)
    assert "there joint 3 is " in text


def one_arm_or_tool(way=(2e-4, -1e-4, 3e-4), where=EVEN, m=POSES):
    """A session in which some poses are read with another tool, and its calibration."""
    q = pool_r(m, seed=9)
    true = true_model(9)
    T = true.chain.T_flange_tool.copy()
    T[:3, 3] += way
    other = replace(true, chain=replace(true.chain, T_flange_tool=T))
    p = np.where(where[:, None], other.poses(q)[:, :3, 3], true.poses(q)[:, :3, 3])
    p += np.random.default_rng(9).normal(scale=NOISE, size=p.shape)
    session = session_of(tables.points(q, p, sd=NOISE))
    return session, calibrate(robot(), session, Options(held_out=m // 4))


def test_what_else_explains_it_as_well_is_said(monkeypatch):
    session, found = one_arm_or_tool()
    kept = in_turn.moved_once

    def either(*args, **more):
        return replace(kept(*args, **more), or_else=(("joint", 5),))

    monkeypatch.setattr(in_turn, "moved_once", either)
    (text,) = in_turn_words(found, session)
    what = "; or the zero of joint 6 slipped or was set again: the readings do not tell which. That"
    assert what in text


def test_it_is_asked_only_where_something_is_refuted_and_nothing_moved_in_time():
    session, found = one_arm_or_tool()
    assert said(found)
    assert in_turn_words(found, session)
    moved = one_arm_or_tool(where=np.arange(POSES) > 25)[1]
    assert moved.moved is not None
    assert said(moved) == []
    assert in_turn_words(replace(found, moved=moved.moved), session) == ()
    trust = replace(found.proof.trust, refuted=False)
    sound = replace(found, proof=replace(found.proof, trust=trust))
    assert in_turn_words(sound, session) == ()


@pytest.mark.slow
def test_a_step_among_the_poses_of_one_turn_is_none_between_turns():
    """Of the poses at even places only the later ones have another tool."""
    late = np.concatenate([np.zeros(40, dtype=bool), EVEN[:40]])
    found = one_arm_or_tool(where=late, m=80)[1]
    assert found.refuted
    assert said(found) == []
