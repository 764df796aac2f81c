"""A robot that was corrected before, identified again: no rise, and nothing left to calibrate."""

from dataclasses import replace

import numpy as np
import pytest

from testbed.identify.calibrate import Options, calibrate
from testbed.identify.errors import figures_of
from testbed.identify.to_do.change import NOTHING_LEFT, changes, nothing_left
from testbed.identify.to_do.next_step import next_step
from testbed.identify.words import verdict
from tests.calibrated import (
    real,
    real_session,
    session_of,
    sound,
    sound_session,
    table_of,
    true_model,
)
from tests.reference import pool_r
from tests.testbed.identify.test_again import BARE, written


@pytest.mark.parametrize(("make", "session"), [(sound, sound_session), (real, real_session)])
def test_the_robot_handed_back_and_the_same_readings_leave_nothing_to_calibrate(
    make, session, tmp_path
):
    """Of 0.1374 mm it had said that they rise to 0.1407, and "Check the robot's description"."""
    arm = written(make().fit.identification.model, tmp_path)
    again = calibrate(arm, session(), Options(seed=1))
    assert not nothing_left(make())
    assert nothing_left(again)
    said = verdict(again)
    assert "RISES" not in said
    assert NOTHING_LEFT[:-1] in said
    step = next_step(again)
    assert step.startswith(f"{NOTHING_LEFT} Keep the robot as it is described ")
    assert "Do not use" not in step
    assert "Check the robot's description" not in step
    assert "Quote R95" in step or "quote R95" in step
    assert "may help" not in step


def test_new_readings_of_a_robot_that_is_as_described_leave_nothing_to_calibrate():
    described = replace(BARE, model=true_model(own_frames=True))
    table = table_of(true_model(), pool_r(70), seed=11)
    found = calibrate(described, session_of(table), Options(seed=1))
    assert nothing_left(found)
    # what noise does to numbers that were right
    assert found.fit.test.position.mean > found.before_test.position.mean
    assert "RISES" not in verdict(found)


def errors(found, before, after):
    """The calibration as if held-out poses were missed so before and after [m]."""
    rows = found.split.is_test
    kinds = []
    for misses, values in ((found.before_misses, before), (found.fit.misses, after)):
        position = misses.position.copy()
        position[rows] = values
        kinds.append(replace(misses, position=position))
    figures = [figures_of(each, found.measurements, rows) for each in kinds]
    fit = replace(found.fit, misses=kinds[1], test=figures[1])
    return replace(found, before_misses=kinds[0], before_test=figures[0], fits=(fit,))


def test_only_a_rise_that_chance_does_not_make_is_called_one():
    found = sound()
    before = np.full(int(found.split.is_test.sum()), 1e-4)
    spread = 2e-5 * np.random.default_rng(0).standard_normal(len(before))
    spread -= spread.mean()
    sd = float(spread.std(ddof=1)) / np.sqrt(len(spread))
    for size, word in ((0.0, "stays at 0.100"), (1.9, "goes, by no more than chance, from 0.100"),
                       (2.1, "RISES from 0.100"), (-2.1, "falls from 0.100")):  # fmt: skip
        turned = errors(found, before, before + spread + size * sd)
        assert changes(turned)[0].startswith(word)
        # what its residuals show of the links does not hang on them
        assert not nothing_left(turned)
    worse = errors(found, before, before + spread + 2.1 * sd)
    assert next_step(worse).startswith("Do not use this model: on held-out poses it is worse than")
    chance = errors(found, before, before + spread + 1.9 * sd)
    assert next_step(chance).startswith("Do not use this model: on held-out poses it is no better")
