"""A session whose poses hardly show its base and tool: named, with what would narrow the radius."""

import re
from dataclasses import replace

import pytest

from testbed.files.read import read_session
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.to_do.next_step import next_step
from testbed.identify.visits.wide import wide_frames, wide_words
from testbed.identify.words import reasons, verdict
from tests.testbed.files.campaign import measured, session, visit, written
from tests.testbed.files.made import ROBOT

GEOMETRIC = Options(model="geometric")
NARROW, WIDE = 0.02, 1.0


def narrowed(k, m, share, **place):
    """A visit whose joints go so far about their middle."""
    data = visit(k, m, **place)
    middle = data.q.mean(axis=0)
    return measured(replace(data, q=middle + share * (data.q - middle)), seed=k)


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    """Two sessions with base and tool of their own, by which of them is narrow, and listed first;
    with a tool that is the same, if asked for."""
    known = {}

    def of(narrow, first, *lines):
        if (narrow, first, *lines) not in known:
            shared = {"tool": 0} if lines else {}
            files = {
                "a": narrowed(0, 50, NARROW if narrow == "a" else WIDE),
                "b": narrowed(1, 40, NARROW if narrow == "b" else WIDE, **shared),
            }
            order = [session("a"), session("b", *lines)]
            order = order if first == "a" else order[::-1]
            read = read_session(written(tmp_path_factory.mktemp("two"), files, *order), ROBOT)
            known[narrow, first, *lines] = calibrate(ROBOT, read, GEOMETRIC)
        return known[narrow, first, *lines]

    return of


def test_the_session_that_makes_the_stated_radius_wide_is_named_first_of_all(calibrated):
    found = calibrated("a", "a")
    (one,) = wide_frames(found)
    assert (one.visit, one.parts[0]) == (0, "base")
    assert one.radius == pytest.approx(found.proof.point.radius_mean, rel=1e-9)
    assert one.radius > 5 * one.known
    assert f'because of the {" and ".join(one.parts)} of session "a"' in verdict(found)
    step = next_step(found)
    assert step.startswith('First measure more poses in session "a" (its frames were fitted to ')
    assert re.search(r"joint 5 by \d deg and joint 6 by \d+ deg only", step)
    assert 'name session "b" first' in step
    # where the session was measured, its own base and tool do not matter
    assert any(f"it is {1e6 * one.own:.3g} um" in text for text in reasons(found))
    assert one.own < one.known


def test_what_is_said_to_narrow_the_radius_does(calibrated):
    """The other session first, or a tool that is known to be the same."""
    (one,) = wide_frames(calibrated("a", "a"))
    name, radius = one.other
    assert name == "b"
    # drawn anew: another order of rows holds out other poses
    other = calibrated("a", "b").proof.point.radius_mean
    assert other == pytest.approx(radius, rel=0.25)
    shared = calibrated("a", "a", 'tool = "same as a"')
    assert shared.proof.point.radius_mean < one.radius / 2


def test_frames_of_another_session_are_told_where_its_own_poses_do_not_show_them(tmp_path):
    """Three poses identify there, and do not tell what the others of the same session see."""
    files = {"a": visit(0, 60), "b": visit(1, 10)}
    read = read_session(written(tmp_path, files, session("a"), session("b")), ROBOT)
    rows = read.is_test.copy()
    rows[read.visit == 1] = [False] * 3 + [True] * 7
    rows[:20] = True
    found = calibrate(ROBOT, replace(read, is_test=rows, split_stated=True), GEOMETRIC)
    assert [one.visit for one in wide_frames(found)] == [1]
    (said,) = wide_words(found)
    assert said.startswith('The poses of session "b" hardly show its base')
    assert 'measure more poses in session "b" (its frames were fitted to 3 poses, which' in said
    assert "so wide because" not in verdict(found)
    assert not next_step(found).startswith("First")


def test_sessions_with_poses_enough_are_not_named(calibrated):
    found = calibrated("none", "a")
    assert wide_frames(found) == ()
    assert "so wide because" not in verdict(found)
    # narrow, and used where it is narrow: its frames are told as well as is needed there
    assert [one.visit for one in wide_frames(calibrated("b", "a"))] == []
