"""The next step is what the strongest finding asks for, whatever else is found."""

from dataclasses import replace

import numpy as np
import pytest

from calib.uncertainty.drift.between_repeats import RepeatDrift
from testbed.files.tried.interpretations import Probe
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.calibration import FRAMES, MOUNTING
from testbed.identify.session import origin_of
from testbed.identify.to_do.causes import CHECK
from testbed.identify.to_do.next_step import next_step
from testbed.identify.words import COMPUTED, GUARDED, UNSETTLED, mark, verdict
from tests.calibrated import robot, session_of, sound, table_of, true_model
from tests.reference import pool_r
from tests.testbed.identify.to_do.test_too_few import asking, worse

DRIFT = RepeatDrift(1e-6, False, False, 5e-5, np.zeros((1, 3)))


def apart(found):
    """The same, its held-out poses off as a whole."""
    return replace(found, proof=replace(found.proof, frame=replace(found.proof.frame, p_base=1e-9)))


def from_controller(found):
    return replace(found, source=replace(found.source, exact=True))


def test_poses_of_a_controller_are_told_first_though_the_model_is_worse_and_all_else_is_off():
    for found in (sound(), worse(sound()), apart(sound()), worse(asking())):
        step = next_step(from_controller(found))
        assert step.startswith("First find out whether these are measurements")
        assert CHECK not in step
        assert mark(from_controller(found)) == COMPUTED
        assert not from_controller(found).believable
        assert "computed prove nothing of it" in verdict(from_controller(found))


def test_what_is_read_as_exactly_as_a_controller_computes_it_is_such_poses():
    """The nominal robot itself, without noise: the warning stood below "Check the description"."""
    model, q = robot().model, pool_r(60)
    plain = table_of(model, q, noise=0.0)
    session = session_of(plain)
    found = calibrate(robot(), session, Options(seed=1))
    assert any("a controller's own poses" in text for text in found.source.warnings)
    assert next_step(found).startswith("First find out whether these are measurements")
    assert not origin_of(robot(), session, (Probe("", ""),)).exact


@pytest.mark.parametrize("make", [sound, asking])
def test_held_out_poses_that_are_off_as_a_whole_are_no_fault_of_the_description(make):
    step = next_step(apart(worse(make())))
    assert step.startswith("First find out why the held-out poses are off as a whole")
    assert "Do not use" not in step


def test_a_worse_model_is_put_down_to_what_was_found_and_else_to_the_description():
    found = worse(sound())
    assert next_step(found).endswith(CHECK)
    for doubted, said in ((FRAMES, "where base and tool are"), (MOUNTING, "hangs on a wall")):
        step = next_step(replace(found, doubted=(doubted,)))
        assert said in step
        assert CHECK not in step
        assert "Until then" not in step
        assert mark(sound()) == GUARDED
        assert mark(replace(sound(), doubted=(doubted,))) == UNSETTLED
        fine = replace(sound(), doubted=(doubted,))
        assert said in next_step(fine)
        assert "oad the identified robot" not in next_step(fine)
        assert sound().settled
        assert not fine.settled
        assert "can be believed" in verdict(sound())
        assert "can be believed" not in verdict(fine)
        assert "first settle what the readings contradict" in verdict(fine)
    drifts = next_step(replace(found, repeats_drift=DRIFT))
    assert drifts.startswith("Do not use this model")
    assert "The readings drift: let the instrument" in drifts
    assert CHECK not in drifts
    rounds = replace(DRIFT, joints=True)
    assert "differ from round to round" in next_step(replace(found, repeats_drift=rounds))
    assert CHECK in next_step(replace(found, repeats_drift=None))


def test_what_sound_readings_ask_for_is_to_use_the_robot():
    found = calibrate(robot(), session_of(table_of(true_model(), pool_r(80))), Options(seed=1))
    assert found.doubted == ()
    assert not found.source.exact
    assert next_step(found).startswith("Load the identified robot from robot/")
