"""How large joint errors are believed to be: said once, the same at every level and ever after."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.bodies import Z
from calib.geometry.chain import Chain
from calib.geometry.gravity import guessed_moments
from calib.geometry.joint_errors import JointErrors, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.operating import OperatingConditions, approaches
from calib.geometry.parameters import parameters_of
from calib.identification.ladders import ladders_of
from calib.identification.levels import with_errors
from calib.identification.prior import own_prior, weak_prior
from calib.identification.row_ladders import RowTerms, row_ladders
from calib.measurement.tables import poses
from tests.reference import DEG, pool_r, tx60

MDEG = 1e-3 * DEG
POLAR = RobotModel(
    Chain(
        [[0, 0.4, 0, np.pi / 2, 0], [0, 0, 0, np.pi / 2, 0], [0, 0.5, 0, 0, 0]],
        kinds=("revolute", "revolute", "prismatic"),
    )
)


def every_level(nominal, **more):
    """All levels that rows can be asked for which say everything of themselves."""
    n = nominal.chain.n_joints
    q = pool_r(40)[:, :n]
    load = np.random.default_rng(0).normal(size=q.shape) * 30
    at = OperatingConditions(
        approach=approaches(q), torque=load, temperature=np.linspace(20, 35, 40)
    )
    table = replace(poses(q, nominal.poses(q), sd=(1e-5, 1e-4)), conditions=at)
    known = RowTerms(gear=((30.5,), *[()] * (n - 1)))
    ladders = (*ladders_of(nominal, **more), *row_ladders(nominal, table, known))
    return load, [level for ladder in ladders for level in ladder.levels if level.names]


@pytest.mark.parametrize("nominal", [tx60(), POLAR])
@pytest.mark.parametrize("payload", [None, np.zeros(4)])
def test_a_robot_that_has_a_level_believes_of_it_what_the_ladder_did(nominal, payload):
    """As it is calibrated again: each number beside those of its kind, small ones stay small."""
    _, levels = every_level(nominal, payload=payload)
    assert {level.name for level in levels} >= {"approach", "torque", "lengths"}
    for level in levels:
        wide = with_errors(nominal, level.errors)
        prior = own_prior(parameters_of(wide), wide)
        assert prior.names == level.names
        np.testing.assert_array_equal(prior.sd, level.sd)
        assert not prior.mean.any()


def test_each_kind_has_the_width_that_the_specification_gives_it():
    """Written out, by the table of ladders: 20, 12, 6 and 3 mdeg, 50 and 25, 10, 15e-6 1/K."""
    load, levels = every_level(tx60())
    sd = {
        (level.name, name): v
        for level in levels
        for name, v in zip(level.names, level.sd, strict=True)
    }
    largest = np.abs(load).max(axis=0)
    mass = guessed_moments(tx60().chain)[:, 0]
    expected = {
        ("small waves", "harmonic2.sin1"): 5 * MDEG, ("small waves", "harmonic2.cos2"): 3 * MDEG,
        ("waves", "harmonic2.sin1"): 20 * MDEG, ("waves", "harmonic2.cos2"): 12 * MDEG,
        ("waves 1 to 4", "harmonic2.sin2"): 12 * MDEG,
        ("waves 1 to 4", "harmonic6.cos4"): 6 * MDEG,
        ("joint map", "harmonic1.sin3"): 3 * MDEG, ("joint map", "harmonic1.cos32"): 3 * MDEG,
        ("joint map with small waves", "harmonic4.cos1"): 5 * MDEG,
        ("joint map with small waves", "harmonic4.cos31"): 3 * MDEG,
        ("sag", "gravity3.fore"): 50 * MDEG, ("sag by torques", "spring3.z"): 50 * MDEG,
        ("sag and bearings", "spring3.x"): 25 * MDEG,
        ("sag and small bearings", "spring3.x"): 6.25 * MDEG,
        ("springs", "moment4.m"): mass[3] / 2,
        ("approach", "approach5"): 10 * MDEG, ("torque", "torque5"): 50 * MDEG / largest[4],
        ("gear", "gear1.cos30.5"): 6 * MDEG, ("lengths", "lengths"): 15e-6,
    }  # fmt: skip
    assert {key: sd[key] for key in expected} == pytest.approx(expected, rel=1e-12)
    # along a slide an angle counts by 0.3 m
    _, sliding = every_level(POLAR)
    sd = {
        (level.name, name): v
        for level in sliding
        for name, v in zip(level.names, level.sd, strict=True)
    }
    assert sd["sag by torques", "spring3.z"] == pytest.approx(0.3 * 50 * MDEG)
    assert sd["approach", "approach3"] == pytest.approx(0.3 * 10 * MDEG)
    springs = next(level for level in sliding if level.name == "sag by torques").errors.springs
    assert (springs.axis == Z).all()


def test_a_prior_of_joint_errors_asks_whose_they_are():
    wide = RobotModel(tx60().chain, JointErrors(harmonic_terms(6)))
    with pytest.raises(InputError, match=r"harmonic1\.sin1 is a joint error of some kind"):
        weak_prior(parameters_of(wide))
    assert own_prior(parameters_of(wide, ["theta1", "a2"]), wide) is None
    assert own_prior(parameters_of(wide, ["theta1", "harmonic2.cos1"]), wide).names == (
        "harmonic2.cos1",
    )
