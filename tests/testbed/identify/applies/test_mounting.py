"""An arm on a wall whose file says nothing of it, and arms that stand upright."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib.geometry.frames import exp_so3
from calib.identification.ladders import ladders_of
from calib.identification.levels import with_errors
from testbed.identify.applies import mounting
from testbed.identify.applies.mounting import LOUD
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.words import reasons
from tests.calibrated import robot, session_of, table_of, true_model
from tests.reference import pool_r

WALL = np.eye(4)
WALL[:3, :3] = exp_so3(np.radians([90.0, 0.0, 0.0]))


def on_wall(model):
    """The model with its base turned as an arm on a wall has it."""
    return replace(model, chain=replace(model.chain, T_world_base=WALL))


@cache
def hanging():
    """Eighty poses of an arm that bends under gravity along y of its base."""
    plain, arm = true_model(), robot()
    bends = ladders_of(arm.model, on_wall(arm.model).chain, limits=arm.limits)[0].levels[1]
    true = with_errors(plain, bends.errors)
    step = np.zeros(true.n_numbers)
    step[[true.names.index(name) for name in bends.names]] = 0.7 * np.asarray(bends.sd)
    return session_of(table_of(true.moved(step), pool_r(80)), model="choose")


def said(found):
    return [text for text in found.warnings if "rotation_vector_deg" in text]


def test_an_arm_on_a_wall_is_told_to_say_so_and_saying_so_mends_it():
    found = calibrate(robot(), hanging(), Options(seed=1))
    (text,) = said(found)
    assert text.endswith("= [90, 0, 0] or [-90, 0, 0])")  # a compliance may have either sign
    assert f"{text}." in reasons(found)
    stated = replace(robot(), model=on_wall(robot().model))
    mended = calibrate(stated, hanging(), Options(seed=1))
    assert said(mended) == []
    assert mended.fit.test.position.mean < 0.5 * found.fit.test.position.mean


def gains_of(session, turns, monkeypatch):
    """Log evidence of gravity on each of some bases, each worked out for itself."""
    got = []
    monkeypatch.setattr(mounting, "ALIKE", {})
    monkeypatch.setattr(mounting, "TURNS", turns)
    kept = mounting._gains
    monkeypatch.setattr(mounting, "_gains", lambda *args: got.append(kept(*args)) or got[0])
    calibrate(robot(), session, Options(seed=1))
    return dict(zip([(0, 0, 0), *turns], got[0], strict=True))


@pytest.mark.parametrize("turn", [(0, 90, 0), (90, 0, 0), (0, 0, 0)])
def test_gravity_the_other_way_round_explains_as_much(turn, monkeypatch):
    """What gives way may have either sign: three of six bases need no climb of their own."""
    (other,) = (one for one, alike in mounting.ALIKE.items() if alike == turn)
    gains = gains_of(hanging(), tuple({turn, other} - {(0, 0, 0)}), monkeypatch)
    # sums of 1e5 squares, and rounding of bases turned by 90 deg
    assert gains[turn] == pytest.approx(gains[other], rel=1e-8)


def test_larger_noise_of_an_upright_arm_is_no_hint_of_a_wall():
    loud = session_of(table_of(true_model(), pool_r(60), noise=2.0), model="choose")
    found = calibrate(robot(), loud, Options(seed=1))
    assert found.refuted  # by the noise that is stated
    assert said(found) == []


def sagging(turn, noise=1.0):
    """Eighty poses of an arm whose joints give way, gravity turned in its base [deg]."""
    rng, plain, arm = np.random.default_rng(3), true_model(), robot()
    stands = np.eye(4)
    stands[:3, :3] = exp_so3(np.radians(turn))
    chain = replace(arm.model.chain, T_world_base=stands)
    bends = ladders_of(arm.model, chain, limits=arm.limits)[0].levels[1]
    true = with_errors(plain, bends.errors)
    step = np.zeros(true.n_numbers)
    size = 2.0 * np.asarray(bends.sd) * rng.uniform(0.3, 1.3, len(bends.names))
    step[[true.names.index(name) for name in bends.names]] = size
    return session_of(table_of(true.moved(step), pool_r(80), noise=noise), model="choose")


def taken(found):
    return [o for o in found.choice.offered if o.ladder == "gravity" and o.outcome == "taken"]


def test_springs_that_follow_much_of_a_wrong_way_do_not_silence_the_hint():
    found = calibrate(robot(), sagging([0.0, 90.0, 0.0]), Options(seed=1))
    assert taken(found)
    (text,) = said(found)
    assert "explains less of the readings than if the arm hung on a wall" in text
    assert text.endswith("= [0, 90, 0] or [0, -90, 0])")


def test_an_upright_arm_that_sags_under_larger_noise_than_stated_is_no_hint_of_a_wall():
    found = calibrate(robot(), sagging([0.0, 0.0, 0.0], noise=3.0), Options(seed=1))
    assert taken(found)
    assert found.refuted
    assert found.fit.noise_factor > LOUD
    assert said(found) == []


SEEDS = [pytest.param(seed, marks=[pytest.mark.study] * (seed > 1)) for seed in (1, 4, 5, 6)]
"""Of gears. Without other levels beside gravity the first would be taken for those of a wall."""


def geared(table, seed):
    """The table of an arm whose gears err besides: once and twice a turn, and by their ratio."""
    rng, k = np.random.default_rng(seed), table.q.shape[1]
    once, twice, ratio = np.array([[2e-4], [1e-4], [3e-4]]) * rng.normal(size=(3, k))
    way = rng.uniform(0, 6.3, (2, k))
    q = table.q
    errors = once * np.sin(q + way[0]) + twice * np.sin(2 * q + way[1]) + ratio * q
    return replace(table, q=q - errors)


@pytest.mark.parametrize("seed", SEEDS)
def test_gears_of_an_upright_arm_are_no_hint_of_a_wall(seed):
    """What gears do at joint 1 once a turn, a wall would do as well."""
    session = session_of(geared(table_of(true_model(), pool_r(80)), seed), model="choose")
    found = calibrate(robot(), session, Options(seed=1))
    assert found.refuted
    assert said(found) == []


@pytest.mark.parametrize("seed", SEEDS)
def test_gears_do_not_hide_a_wall(seed):
    hanging = sagging([90.0, 0.0, 0.0])
    session = replace(hanging, measurements=geared(hanging.measurements, seed))
    (text,) = said(calibrate(robot(), session, Options(seed=1)))
    assert text.endswith("= [90, 0, 0] or [-90, 0, 0])")
