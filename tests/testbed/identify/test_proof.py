"""What a session tells the judgement: order in time, repeats, visits, another frame, the target."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.jacobian import joint_columns
from calib.measurement import tables
from calib.measurement.observations import joined
from calib.measurement.tool_target import ToolTarget
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.order import order_words, require_order
from testbed.identify.proof import one_after_another, repeatability, stated_target, target_warnings
from testbed.identify.report.belief import questions_table
from testbed.identify.session import with_test
from testbed.identify.words import ELSEWHERE, UNGUARDED, mark, verdict
from tests.calibrated import robot, session_of, sound, sound_session, table_of, true_model
from tests.reference import SIGMA_POSITION, pool_r

REPEATABILITY = np.full(6, 60e-6)
"""Of the joints [rad]: some three times what the tracker scatters, at the tool."""


@cache
def visited(factor):
    """Twenty poses approached three times by joints that scatter so many times what is stated."""
    rng, q, model = np.random.default_rng(7), pool_r(20), true_model()
    parts = []
    for visit in range(3):
        moved = q + factor * REPEATABILITY * rng.standard_normal(q.shape)
        seen = table_of(model, moved, seed=50 + visit, pose_id=np.arange(20), repeat=visit)
        parts.append(replace(seen, q=q))
    return session_of(joined(parts), joint_scatter=REPEATABILITY)


def test_noise_that_is_only_assumed_counts_as_error_of_the_held_out_poses():
    """The noise is as large as assumed, and R95 wider than by a misfit of which there is none."""
    stated, options = sound().proof, Options(seed=1)
    found = calibrate(robot(), replace(sound_session(), noise_assumed=True), options)
    guessed = found.proof
    assert guessed.belief.n_guards == stated.belief.n_guards > 0
    assert guessed.point.radius_mean > stated.point.radius_mean
    assert "Their noise counts as error" in verdict(found)


def test_noise_that_is_less_than_stated_counts_as_error_like_noise_that_is_assumed():
    """Conservative noise made R95 smaller than it had to be, for a misfit hid in it."""
    quiet = session_of(table_of(true_model(harmonics=5e-4), pool_r(80), noise=0.1))
    found = calibrate(robot(), quiet, Options(seed=1))
    assert found.proof.belief.noise_counts
    assert "Their noise counts as error, since it is less than stated." in verdict(found)
    guessed = calibrate(robot(), replace(quiet, noise_assumed=True), Options(seed=1))
    assert guessed.proof.point.radius_mean == found.proof.point.radius_mean
    assert not sound().proof.belief.noise_counts


def told(session, arm):
    """Factor on the stated repeatability, and what tells it."""
    table, model = session.measurements, true_model()
    J = model.poses_and_jacobian(table.q)[1][:, :, joint_columns(model.chain)]
    added = (J * session.joint_scatter**2) @ np.swapaxes(J, 1, 2)
    whole = replace(table, covariance=table.covariance + added)
    every = np.ones(len(table), dtype=bool)
    sd, by = repeatability(model, arm, session, whole, every)
    return float(sd[0] / arm.repeatability[0]), by


@pytest.mark.parametrize("factor", [0.5, 1.0, 3.0])
def test_repeats_tell_how_well_joints_come_back(factor):
    arm = replace(robot(), repeatability=REPEATABILITY)
    found, by = told(visited(factor), arm)
    # an upper 95 % limit from 120 numbers: above the truth in 19 of 20 cases, by 11 % at most usual
    assert factor < found < 1.35 * factor
    assert by.startswith("repeats show")


def test_without_enough_repeats_or_apart_from_the_instrument_the_description_tells():
    arm = replace(robot(), repeatability=REPEATABILITY)
    session = visited(1.0)
    once = session.rows(session.measurements.repeat == 0)
    inside = replace(session, joint_scatter=np.zeros(6))  # in the stated covariances already
    for one in (once, inside):
        assert told(one, arm) == (1.0, "the robot's description")
    assumed = replace(arm, sources={**arm.sources, "repeatability": "assumed: 14.5 urad"})
    assert told(inside, assumed) == (1.0, "assumed, as the robot's file states none")


def burst(m=20):
    """Poses approached once, and read three times while the arm stands still."""
    rng, q, model = np.random.default_rng(9), pool_r(m), true_model()
    moved = q + REPEATABILITY * rng.standard_normal(q.shape)
    seen = table_of(
        model, np.repeat(moved, 3, axis=0), seed=60, pose_id=np.repeat(np.arange(m), 3),
        repeat=np.tile(np.arange(3), m),
    )  # fmt: skip
    return session_of(replace(seen, q=np.repeat(q, 3, axis=0)), joint_scatter=REPEATABILITY)


def test_readings_at_one_stop_do_not_tell_how_joints_come_back():
    """They scatter by nothing of it: no smaller number than the description's is taken."""
    arm, session = replace(robot(), repeatability=REPEATABILITY), burst()
    found, by = told(session, arm)
    assert found == 1.0
    assert by.startswith("the robot's description, as repeats without another pose between them")
    assert one_after_another(session)
    assert not one_after_another(visited(1.0))
    # the clock, not the file, says what came between
    rounds = np.argsort(np.argsort(np.tile(np.arange(3), 20), kind="stable"))
    assert not one_after_another(replace(session, time=10.0 * rounds))


def test_a_misfit_that_readings_at_one_stop_make_is_said_to_be_theirs_perhaps():
    said = "the rows of a pose follow each other directly"
    found = calibrate(robot(), burst(40), Options(train=25))
    assert sum(text.startswith(said) for text in found.warnings) == 1
    for fine in (sound(), calibrate(robot(), visited(1.0), Options(train=15))):
        assert not any(text.startswith(said) for text in fine.warnings)


def test_a_misfit_that_copies_with_other_last_digits_make_is_said_to_be_theirs_perhaps():
    """Forty poses that all come again at the end of the file, off by a hundredth of noise."""
    said = "rows of one pose agree within 0.0"
    rng, q, again = np.random.default_rng(10), pool_r(40), np.tile(np.arange(40), 2)
    plain = table_of(true_model(), q, seed=61)
    copied = replace(
        plain.rows(again), pose_id=again, repeat=np.repeat([0, 1], 40),
        position=plain.position[again] + 0.01 * SIGMA_POSITION * rng.normal(size=(80, 3)),
    )  # fmt: skip
    found = calibrate(robot(), session_of(copied), Options(train=25))
    assert found.proof.belief.misfit.p_value < 1e-3
    assert sum(text.startswith(said) for text in found.warnings) == 1
    anew = table_of(true_model(), q[again], seed=62, pose_id=again, repeat=np.repeat([0, 1], 40))
    for fine in (anew, plain):
        found = calibrate(robot(), session_of(fine), Options(train=20))
        assert not any(text.startswith("rows of one pose agree") for text in found.warnings)


def test_rows_stand_in_the_order_of_their_times_or_of_the_file():
    session = sound_session()
    assert session.in_time.tolist() == list(range(80))
    time = np.random.default_rng(3).permutation(80) * 12.5
    order = replace(session, time=time).in_time
    assert np.array_equal(np.argsort(order), np.argsort(time))
    assert order_words(replace(session, time=time)) == "their times"
    assert order_words(replace(session, order=order, numbered=True)) == "their column order"


def test_a_drift_is_found_in_the_order_of_times_whatever_the_order_of_rows():
    """A station that walks by three noise sd over the campaign, rows shuffled in the file."""
    rng = np.random.default_rng(8)
    table = sound_session().measurements
    order = rng.permutation(len(table))
    walk = np.cumsum(rng.normal(0, 0.5 * SIGMA_POSITION, (len(table), 3)), axis=0)
    moved = replace(table, position=table.position + (walk - walk.mean(axis=0))[order])
    session = session_of(moved)
    asked = {
        name: calibrate(robot(), one, Options(seed=1)).proof.drifting
        for name, one in (
            ("timed", replace(session, time=10.0 * order)),
            ("numbered", replace(session, order=order, numbered=True)),
            ("rows", session),
        )
    }
    assert asked["timed"].p_value < 0.01
    assert asked["timed"].drift is not None
    assert asked["numbered"].p_value == asked["timed"].p_value
    assert asked["numbered"].drift.sd == asked["timed"].drift.sd
    assert asked["rows"].p_value > asked["timed"].p_value


def test_later_visits_that_identify_nothing_still_tell_the_noise():
    wanted = visited(1.0).wanted.model_copy(update={"visits": "first"})
    # one pose held out: its three visits alone would be too few
    found = calibrate(robot(), replace(visited(1.0), wanted=wanted), Options(train=19))
    assert found.proof.belief.misfit.repeated
    assert not sound().proof.belief.misfit.repeated


def test_held_out_rows_in_another_frame_are_said_and_prove_nothing():
    session, one = sound_session(), sound()
    moved = session.measurements.position.copy()
    moved[one.split.is_test] += [2e-4, 0, 0]
    session = replace(session, measurements=replace(session.measurements, position=moved))
    found = calibrate(robot(), session, Options(seed=1))
    assert found.elsewhere
    assert not found.believable
    assert mark(found) == ELSEWHERE
    assert "the held-out poses should have tested it, and could not." in verdict(found)
    assert np.linalg.norm(found.proof.frame.shift - [2e-4, 0, 0]) < 3e-5
    # what is stated then rests on the rows identified from, and on no guard
    assert found.proof.belief.n_guards == 0
    assert found.proof.point.n_poses == int(found.is_used.sum())


def test_the_point_that_all_rows_look_at_is_stated_if_its_place_is_known():
    q, place = pool_r(5), np.array([0.01, 0.02, 0.03])
    poses = sound_session().measurements
    xyz = np.zeros((5, 3))
    known = tables.points(q, xyz, sd=1e-5, offset=place)
    fit = sound().fit.identification
    assert stated_target(poses, fit) == ToolTarget()
    assert stated_target(known, fit) == ToolTarget((0.01, 0.02, 0.03))
    assert stated_target(joined([known, tables.points(q, xyz, sd=1e-5)]), fit) == ToolTarget()
    one = tables.points(q, xyz, sd=1e-5, reflector=0)
    assert stated_target(joined([known, one]), fit) == ToolTarget()


def test_of_one_point_nothing_is_said_of_another():
    def said(table, name="B", **target):
        return " ".join(target_warnings(table, ToolTarget(**target), [name]))

    q, xyz = pool_r(5), np.zeros((5, 3))
    one, other = (
        tables.points(q, xyz, sd=1e-5, offset=place) for place in ([0, 0, 0], [0.1, 0, 0])
    )
    assert "about that point, none about the tool's orientation" in said(one)
    assert said(joined([one, other])) == said(sound_session().measurements) == ""
    found = tables.points(q, xyz, sd=1e-5, reflector=0)
    assert "are about B; how the flange lies" in said(found, reflector=0)
    assert "how the tool point lies relative to them" in said(joined([one, found]))
    # a lone target of unknown place need not have a name
    assert "are about this point; how the flange lies" in said(found, name="", reflector=0)


def wanting(session, **wanted):
    """The session with other wishes under [identification]."""
    return replace(session, wanted=session.wanted.model_copy(update=wanted))


def test_an_order_by_times_that_nobody_gave_is_refused_before_anything_is_computed():
    with pytest.raises(InputError) as caught:
        calibrate(robot(), wanting(sound_session(), order="time"))
    assert str(caught.value) == (
        'bench.csv: [identification] order is "time", and no row says when it was measured; give '
        "the column time_s, or leave order out: rows then stand in the order of the file. [M35]"
    )
    require_order(wanting(replace(sound_session(), time=np.arange(80.0)), order="time"))


def test_rows_of_unknown_order_are_not_asked_for_a_drift():
    found = calibrate(robot(), wanting(sound_session(), order="unknown"), Options(seed=1))
    assert found.proof.drifting is None
    assert found.order_told_by == ""
    note = questions_table(found).note
    assert "drift: not tested, because the order of the rows is not known" in note


def test_a_drift_is_not_asked_for_on_a_tour_and_that_is_said():
    session = sound_session()
    time = np.argsort(np.argsort(session.measurements.q[:, 0])) * 10.0
    found = calibrate(robot(), replace(session, time=time), Options(seed=1))
    assert found.proof.drifting.void
    assert "drift" not in found.proof.questions.names
    assert "Whether the readings drift cannot be decided, " in found.proof.trust.sentence
    assert "drift: not tested, because neighboring poses" in questions_table(found).note


def test_rows_of_two_files_keep_the_order_of_their_own_times():
    one = replace(sound_session(), time=np.random.default_rng(1).permutation(80) * 1.0)
    apart = session_of(table_of(true_model(), pool_r(30, seed=99), seed=9))
    both = with_test(one, replace(apart, time=np.arange(30.0)[::-1]))
    assert np.array_equal(both.in_time[:80], one.time)
    assert both.in_time[80:].tolist() == list(range(109, 79, -1))
    assert order_words(both) == "the files, held-out ones last"
    kept = both.rows(np.arange(110) % 2 == 0)
    assert np.array_equal(kept.in_time, both.in_time[::2])


def test_designed_or_few_held_out_poses_guard_nothing_and_that_is_said():
    session = wanting(sound_session(), held_out="designed")
    designed = calibrate(robot(), session, Options(seed=1))
    few = calibrate(robot(), sound_session(), Options(seed=1, held_out=18))
    for found, says in ((designed, "27 held-out poses were designed"), (few, "fewer than 19")):
        assert found.proof.belief.n_guards == 0
        assert mark(found) == UNGUARDED
        assert any(says in text for text in found.warnings)
    # a stricter limit of the misfit stands in for the guard
    assert designed.proof.belief.misfit.upper > sound().proof.belief.misfit.upper
    assert not any("guard" in text for text in sound().warnings)
