"""Joints that turn with others by ratios that base and tool alone do not show."""

import numpy as np
import pytest

from calib.geometry.joint_errors import JointErrors, harmonic_terms
from calib.geometry.model import RobotModel
from calib.measurement import tables
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.to_do.next_step import next_step
from testbed.identify.words import reasons
from tests.calibrated import robot, session_of, true_model
from tests.reference import pool_r

CHOOSE = Options(model="choose", held_out=25)
NOISE = 10e-6


def seen(true, q, turned):
    """Readings of joints q, in rad, that stand at `turned`."""
    xyz = true.poses(turned)[:, :3, 3]
    xyz = xyz + np.random.default_rng(4).normal(scale=NOISE, size=xyz.shape)
    return session_of(tables.points(q, xyz, sd=NOISE))


def with_ratios(q, ratios):
    out = q.copy()
    for (a, b), ratio in ratios.items():
        out[:, b] += ratio * q[:, a]
    return out


def said(found):
    return [text for text in found.warnings if "pass through each other" in text]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ratios", "lines"),
    [({(3, 5): 0.004}, ("q6 = J6 + 0.004",)),
     ({(3, 4): -0.01, (3, 5): 0.012}, ("q5 = J5 - 0.01", "q6 = J6 + 0.0"))],
    ids=["one", "two"],
)  # fmt: skip
def test_ratios_below_what_links_are_off_by_are_named_and_stating_them_mends_it(ratios, lines):
    true, q = true_model(11), pool_r(90, seed=11)
    found = calibrate(robot(), seen(true, q, with_ratios(q, ratios)), CHOOSE)
    (text,) = said(found)
    assert f"{text}." in reasons(found)
    assert next_step(found).startswith("First state by which ratios the drives of the wrist turn")
    joints = text.partition("joints = [")[2].partition("]")[0]
    assert len(joints.split(", ")) == len(lines)
    for line in lines:
        assert line in joints
    turned = text.partition("(")[2].partition(")")[0].replace(" and ", ", ").split(", ")
    read = {(int(one.split()[-1]) - 1, int(one.split()[1]) - 1): float(one.split()[3])
            for one in turned}  # fmt: skip
    assert read.keys() == ratios.keys()
    for pair, ratio in ratios.items():
        # links that are fitted beside a ratio take some of it
        assert read[pair] == pytest.approx(ratio, abs=1e-4)
    mended = calibrate(robot(), seen(true, with_ratios(q, read), with_ratios(q, ratios)), CHOOSE)
    # what links have taken of a ratio is read from the first fit, up to its square
    assert mended.proof.point.radius_mean < 0.1 * found.proof.point.radius_mean


@pytest.mark.slow
def test_joints_that_err_otherwise_are_not_said_to_turn_with_others():
    """Of 2 arms whose joints do not return, and of 2 with waves that no model has, none is.

    If half of such arms were said to, 15 of 16 such fours would show it.
    """
    for seed in range(2):
        rng, true, q = np.random.default_rng(seed), true_model(seed), pool_r(70, seed=seed)
        play = 6e-5 * rng.choice([-1.0, 1.0], size=q.shape)
        terms = harmonic_terms(6, (3, 51))
        wavy = RobotModel(true.chain, JointErrors(terms, rng.normal(size=len(terms)) * 1e-4))
        for data in (seen(true, q, q + play), seen(wavy, q, q)):
            found = calibrate(robot(), data, CHOOSE)
            assert found.proof.point.radius_mean > 100e-6  # noise alone makes 30 um
            assert said(found) == []


@pytest.mark.slow
def test_an_eccentric_that_joint_5_turns_is_no_ratio():
    """Of 8 arms, 4 were told to state ratios."""
    home, half = np.radians([0, 20, 60, 30, 60, 0]), np.radians([60, 36, 36, 60, 60, 90])
    told = []
    for seed in range(3):
        rng, q = (
            np.random.default_rng(seed + 100),
            home + half * (np.random.default_rng(seed).uniform(-1, 1, (50, 6))),
        )
        turned = q.copy()
        turned[:, 5] += 1.5e-3 * np.sin(2 * q[:, 4] + rng.uniform(0, 6))
        options = Options(model="choose", held_out=25, seed=seed)
        found = calibrate(robot(), seen(true_model(seed), q, turned), options)
        assert found.refuted
        told += said(found)
    assert told == []


def test_nothing_is_said_of_a_sound_arm():
    true, q = true_model(12), pool_r(70, seed=12)
    assert said(calibrate(robot(), seen(true, q, q), CHOOSE)) == []
