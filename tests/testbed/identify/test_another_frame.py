"""Rows in another frame: held-out ones are no proof, and a step between two rows is named."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.frames import step_transform
from calib.identification.outliers.moved import moved_once
from calib.measurement import tables
from calib.uncertainty.statement.conditions import Conditions
from testbed.files.read import read_held_out, read_session
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.handback.delivered import Delivered
from testbed.identify.report.page import page_of
from testbed.identify.results import headline
from testbed.identify.session import with_test
from testbed.identify.to_do.next_step import next_step
from testbed.identify.visits.report import visit_words
from testbed.identify.words import MOVED, reasons, verdict
from tests.calibrated import robot, session_of, true_model
from tests.reference import pool_r
from tests.reported import VERSIONS, undrawn
from tests.testbed.files.campaign import HEAD, session, table, visit, written
from tests.testbed.files.made import ROBOT, Made
from tests.testbed.identify.test_report import DELIVERED

GEOMETRIC = Options(model="geometric")
ONE = HEAD.replace("[frames]", '[frames]\nfile = "a.csv"')


def moved(data, millimetres, degrees, *, tool=False):
    """The same poses, the station or the target of the robot elsewhere."""
    way = np.array([0.6, -0.64, 0.48])
    M = step_transform(np.concatenate([1e-3 * millimetres * way, np.radians(degrees) * way[::-1]]))
    return Made(data.q, data.T @ M if tool else M @ data.T, data.truth)


def judged_by(folder, held_out):
    """A calibration by 40 poses, and further ones given by --test."""
    written(folder, {"a": visit(0, 40), "t": held_out}, head=ONE)
    test = read_held_out(folder / "t.csv", ROBOT, folder)
    return calibrate(ROBOT, with_test(read_session(folder, ROBOT), test), GEOMETRIC)


@pytest.mark.parametrize("size", [(0.05, 0.01), (623.0, 17.7)], ids=str)
def test_a_moved_station_is_no_proof(tmp_path, size):
    found = judged_by(tmp_path, moved(visit(0, 20, seed=5), *size))
    said = verdict(found)
    assert found.elsewhere
    assert said.startswith("The held-out rows are off as a whole by ")
    assert "they prove nothing without a base or target of their own" in said
    assert "falls from" not in said
    if size[1] > 0.1:
        assert f"{size[1]:.3g} deg" in said
    assert "First find out" in next_step(found)
    assert found.proof.belief.n_guards == 0


def test_a_wrong_shot_among_held_out_poses_is_named_first_and_nothing_is_said_to_have_moved(
    tmp_path,
):
    """Of 20 shots one is off by a millimetre; 130 others identify: R95 is wide by it alone."""
    data = visit(0, 150)
    T = data.T.copy()
    T[140, :3, 3] += [6e-4, -8e-4, 0.0]
    split = ["identify"] * 130 + ["test"] * 20
    text = table(Made(data.q, T, data.truth), split=split)
    found = calibrate(
        ROBOT, read_session(written(tmp_path, {"a": text}, head=ONE), ROBOT), GEOMETRIC
    )
    without = f"{found.gross.radius_without * 1e6:.3g} um"
    assert found.gross.radius_without < 0.1 * found.proof.point.radius_mean
    (name,) = found.gross.held_out_names
    assert name == f"pose {found.pose_names[found.measurements.pose_id[140]]}"
    first = verdict(found)
    assert "it can be believed" in first
    assert first.endswith(
        "It is so wide because of 1 held-out row that stands out: without it, R95 would be "
        f"{without}."
    )
    assert next_step(found).startswith(f"First look into held-out {name}, which stands out: ")
    said = reasons(found)
    assert said[0].startswith(f"Held-out {name} stands out: its error is ")
    assert "the other 19 agree with the calibration" in said[0]
    assert not any("payload" in text or "motion" in text for text in said)
    told = headline(found, Delivered((), (), 0))["outliers"]
    assert told["held_out_rows"] == [name]
    assert told["R95_mean_without_um"] == pytest.approx(found.gross.radius_without * 1e6)
    assert found.split.is_test.sum() == found.proof.belief.n_guards == 20


def test_held_out_rows_under_a_load_may_be_off_for_that(tmp_path):
    """Four kilograms that the file states were called another base, and nothing else."""
    found = judged_by(tmp_path, moved(visit(0, 20, seed=5), 0.05, 0.01))
    assert "It may be their conditions" not in verdict(found)
    assert "conditions" not in next_step(found)
    loaded = replace(found, conditions=Conditions(payload=np.where(found.split.is_test, 4.0, 0.0)))
    said = "It may be their conditions instead: 20 held-out rows carry 4 kg; "
    assert said in verdict(loaded)
    assert "another tool, or what their conditions do. Then" in next_step(loaded)


def test_a_station_that_stood_still_is_proof(tmp_path):
    found = judged_by(tmp_path, visit(0, 20, seed=5))
    assert not found.elsewhere
    assert found.proof.belief.n_guards == 20


def test_another_target_is_told_where_it_is(tmp_path):
    found = judged_by(tmp_path, moved(visit(0, 20, seed=5), 300.0, 30.0, tool=True))
    said = verdict(found)
    assert 'with held_out = true, tool = "free" and frame_poses = 10.' in next_step(found)
    # millimeters of a robot that is not nominal do not matter to 300 mm
    assert said.startswith("The held-out rows see another target: 300 mm")
    assert "another frame" not in said


def test_a_joint_that_was_bumped_is_no_other_frame(tmp_path):
    """0.5 deg in joint 2: no rigid motion does that, so the rows go on to judge."""
    data = visit(0, 20, seed=5)
    found = judged_by(tmp_path, Made(data.q + np.radians([0, 0.5, 0, 0, 0, 0]), data.T, None))
    assert not found.elsewhere
    assert found.proof.belief.n_guards == 20
    # what is believed then holds what is seen
    assert found.proof.point.radius_mean > found.fit.test.position.rms


def test_held_out_rows_of_one_file_that_stand_elsewhere_are_not_left_out_as_wrong_shots(tmp_path):
    """Ten of fifty rows: few enough to be taken for strays, if they were asked with the others."""
    both = [visit(0, 40), moved(visit(0, 10, seed=5), 623.0, 17.7)]
    whole = Made(*(np.concatenate([getattr(one, k) for one in both]) for k in ("q", "T")), None)
    text = table(whole, split=["identify"] * 40 + ["test"] * 10)
    read = read_session(written(tmp_path, {"a": text}, head=ONE), ROBOT)
    assert not read.masked
    found = calibrate(ROBOT, read, GEOMETRIC)
    assert "17.7 deg" in verdict(found)


def test_a_test_file_that_is_read_wrongly_is_still_refused(tmp_path):
    """Inches are no frame."""
    data = visit(0, 20, seed=5)
    T = data.T.copy()
    T[:, :3, 3] /= 25.4
    with pytest.raises(InputError, match="M21"):
        judged_by(tmp_path, Made(data.q, T, data.truth))


STEP = 34
SPLIT = Options(model="geometric", held_out=20)


def pushed(millimetres):
    """Poses of one visit, the station pushed before one of them."""
    data = visit(0, 60, seed=8)
    later = np.arange(60)[:, None, None] >= STEP
    return Made(data.q, np.where(later, moved(data, millimetres, 0.0).T, data.T), data.truth)


def test_a_station_pushed_halfway_is_named_with_the_poses_between_which_it_was(tmp_path):
    written(tmp_path, {"a": pushed(0.2)}, head=ONE)
    found = calibrate(ROBOT, read_session(tmp_path, ROBOT), SPLIT)
    names = [found.pose_names[found.measurements.pose_id[row]] for row in
             (found.moved.last, found.moved.row)]  # fmt: skip
    # held-out poses say nothing: the last and the first of those that identify
    used = np.flatnonzero(found.is_used)
    assert found.moved.last == used[used < STEP].max()
    assert found.moved.row == used[used >= STEP].min()
    said = reasons(found)[0]
    assert said.startswith(f"Between pose {names[0]} and pose {names[1]} something moved: ")
    assert abs(found.moved.size / 200e-6 - 1) < 0.15  # a few poses of 17 um on each side
    assert f"are {found.moved.size * 1e6:.0f} um off as a whole" in said
    assert '[[session]] of their own, tool = "same as" the first' in said
    assert "do not tell which" not in said
    untold = replace(found, moved=replace(found.moved, or_else=(("target", 0), ("joint", 1))))
    said = reasons(untold)[0]
    assert (
        "; or the target came loose, or was remounted, or the zero of joint 2 slipped or was set "
        "again: the readings do not tell which." in said
    )
    assert said.endswith('own, tool or base "same as" the first if you know that it stayed.')
    assert next_step(found).startswith("First find out what moved")
    with undrawn():
        page = page_of(found, DELIVERED, VERSIONS)
    assert page.mark == MOVED
    where = f"Between pose {names[0]} and pose {names[1]} something moved: "
    assert where in page.verdict
    assert not any(where in text for text in page.reasons)
    # what it advises mends it
    data = pushed(0.2)
    halves = {"a": Made(data.q[:STEP], data.T[:STEP], data.truth),
              "b": Made(data.q[STEP:], data.T[STEP:], data.truth)}  # fmt: skip
    two = tmp_path / "two"
    two.mkdir()
    written(two, halves, session("a"), session("b", 'tool = "same as a"'))
    apart = calibrate(ROBOT, read_session(two, ROBOT), SPLIT)
    assert apart.moved is None
    assert apart.proof.point.radius_mean < 0.4 * found.proof.point.radius_mean


def test_another_tool_for_some_poses_is_named_with_both_ends_and_what_to_leave_out(tmp_path):
    """Twelve of 60 rows: no step is in them, and the verdict was that R95 can be believed."""
    data, inside = visit(0, 60, seed=8), slice(30, 42)
    T = data.T.copy()
    T[inside] = moved(data, 1.0, 0.0, tool=True).T[inside]
    written(tmp_path, {"a": Made(data.q, T, data.truth)}, head=ONE)
    found = calibrate(ROBOT, read_session(tmp_path, ROBOT), SPLIT)
    used = np.flatnonzero(found.is_used)
    within = used[(used >= 30) & (used < 42)]
    ends = used[used < 30].max(), within.min(), within.max(), used[used >= 42].min()
    step = found.moved
    assert (step.last, step.row, step.until, step.back) == ends
    before, first, last, after = (found.pose_names[found.measurements.pose_id[k]] for k in ends)
    said = reasons(found)[0]
    assert said.startswith(
        f"Between pose {before} and pose {first} something moved, and between pose {last} and "
        f"pose {after} it was as before: in the rows between the target is "
    )
    assert f"leave the rows from pose {first} to pose {last} out" in said
    assert "leave the rows out in which it was not as before" in next_step(found)
    assert "can be believed" not in verdict(found)
    assert ", and covers what moved: first find out what." in verdict(found)


def test_a_probe_that_turned_in_its_seat_is_told_by_its_turn(tmp_path):
    """The point that is seen stays where it was: micrometers alone would say that nothing moved."""
    data = visit(0, 60, seed=8)
    T = data.T.copy()
    T[STEP:] = T[STEP:] @ step_transform(np.radians([0, 0, 0, 0.1, -0.2, 0.2]))
    written(tmp_path, {"a": Made(data.q, T, data.truth)}, head=ONE)
    found = calibrate(ROBOT, read_session(tmp_path, ROBOT), SPLIT)
    said = reasons(found)[0]
    assert found.moved.what == "target"
    assert float(said.partition("turned by ")[2].split()[0]) == pytest.approx(0.3, rel=0.02)
    assert "um off on the tool, turned by " in said


def test_rows_of_an_unknown_order_are_not_asked_and_a_still_station_is_not_accused(tmp_path):
    written(tmp_path, {"a": pushed(0.2)}, head=f'{ONE}\n[identification]\norder = "unknown"\n')
    assert calibrate(ROBOT, read_session(tmp_path, ROBOT), SPLIT).moved is None
    still = tmp_path / "still"
    still.mkdir()
    written(still, {"a": visit(0, 60, seed=8)}, head=ONE)
    assert calibrate(ROBOT, read_session(still, ROBOT), SPLIT).moved is None


@pytest.mark.parametrize("part", ["tool", "base"])
def test_a_tool_or_base_that_is_the_same_by_the_file_alone_is_named(tmp_path, part):
    """By 0.15 mm: too little to refuse, and enough to make the radius several times as wide."""
    own = visit(1, 40, seed=3, **{part: 0})
    data = {"a": visit(0, 40, seed=2), "b": moved(own, 0.15, 0.0, tool=part == "tool")}
    sessions = session("a"), session("b", f'{part} = "same as a"')
    found = calibrate(ROBOT, read_session(written(tmp_path, data, *sessions), ROBOT), SPLIT)
    said = reasons(found)[0]
    assert said.startswith('From session "b" on something differs from "a": ')
    assert found.moved.size == pytest.approx(0.15e-3, rel=0.15)  # some tens of poses of 17 um
    assert f'write {part} = "free" in the [[session]]' in said
    other, kind = ("base", "station") if part == "tool" else ("tool", "target")
    untold = replace(found, moved=replace(found.moved, or_else=((kind, 0),)))
    assert f'write {part} = "free" and {other} = "free" in the [[session]]' in reasons(untold)[0]
    # what it advises mends it
    free = written(tmp_path / "free", data, session("a"), session("b"))
    mended = calibrate(ROBOT, read_session(free, ROBOT), SPLIT)
    assert mended.moved is None
    # and within what the arm is the same is said: 17 um at half a meter, of 30 poses or so
    (text,) = (one for one in visit_words(mended) if "changed from session" in one)
    assert text.startswith('no joint is shown to have changed from session "b" on')
    assert 0 < float(text.partition("joint 2 by ")[2].split()[0]) < 0.01
    assert not any("changed from session" in one for one in visit_words(found))
    assert mended.proof.point.radius_mean < 0.7 * found.proof.point.radius_mean


@pytest.mark.parametrize("part", ["tool", "base"])
def test_a_tool_or_base_that_is_the_same_is_not_accused(tmp_path, part):
    data = {"a": visit(0, 40, seed=2), "b": visit(1, 40, seed=3, **{part: 0})}
    sessions = session("a"), session("b", f'{part} = "same as a"')
    found = calibrate(ROBOT, read_session(written(tmp_path, data, *sessions), ROBOT), SPLIT)
    assert found.moved is None


def test_a_zero_that_slipped_is_named_where_waves_of_the_joints_took_it_up():
    """Of a dozen such arms a map of the joints was chosen for two, and nothing had moved."""
    rng, q, true = np.random.default_rng(8), pool_r(65, seed=8), true_model(8)
    slipped = q + np.radians([0, 0, 0.02, 0, 0, 0]) * (np.arange(65) >= 30)[:, None]
    xyz = true.poses(slipped)[:, :3, 3] + rng.normal(scale=10e-6, size=(65, 3))
    data = session_of(tables.points(q, xyz, sd=10e-6))
    found = calibrate(robot(), data, Options(model="choose", held_out=25))
    assert found.choice.chosen == "extended"
    table = found.measurements.rows(found.is_used)
    assert moved_once(found.fit.identification, table, np.arange(len(table))) is None
    assert (found.moved.what, found.moved.number) == ("joint", 2)
    # forty readings of 10 um, some tenths of a meter from that joint
    assert np.degrees(found.moved.change) == pytest.approx(0.02, rel=0.05)
    assert next_step(found).startswith("First find out what moved")


@pytest.mark.slow
def test_a_payload_that_no_row_states_and_another_arm_are_told_as_such():
    rng, q, true, second = (
        np.random.default_rng(9),
        pool_r(90, seed=9),
        true_model(9),
        true_model(10),
    )
    later = np.arange(90) >= 45
    reach = 0.3 * np.sin(q[:, 1]) + 0.3 * np.sin(q[:, 1] + q[:, 2])
    bends = later[:, None] * np.outer(2e-3 * reach, [0, 1, 0, 0, 0, 0])
    for way, start, mend in (
        (true.poses(q + bends), "the arm bends by ", "state payload_kg for each row"),
        (np.where(later[:, None, None], second.poses(q), true.poses(q)), "the readings are ",
         "identify from one side only"),
    ):  # fmt: skip
        xyz = way[:, :3, 3] + rng.normal(scale=10e-6, size=(90, 3))
        found = calibrate(robot(), session_of(tables.points(q, xyz, sd=10e-6)), SPLIT)
        said = reasons(found)[0]
        assert "something changed: from there on " + start in said
        assert mend in said
        assert next_step(found).startswith("First find out what changed, and separate the rows")
