"""[springs] of robot.toml and the tables of a robot that gives way: read back to rounding."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.gravity import Weight
from calib.geometry.joint_errors import JointErrors, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.geometry.springs import SprungJoints
from calib.identification.ladders import ladders_of
from calib.identification.levels import with_errors
from testbed.laboratory.truth.robot import TrueRobot
from testbed.laboratory.truth.terms import UnmodelledTerms
from testbed.robots.catalog import load_robot
from testbed.robots.write.dh_table import dh_rows
from testbed.robots.write.folder import write_robot_folder
from testbed.robots.write.identified import identified_robot
from testbed.robots.write.toml import robot_toml
from testbed.scenario.hashes import robot_hash
from tests.calib.geometry.test_gravity import random_moments
from tests.testbed.robots.robot_cases import TX60, joint_vectors, slider

PLAIN = replace(TX60, visuals=())


def anything(seed: int) -> RobotModel:
    """Slides, tilts, a payload, some moments free, two passes, waves beside them."""
    rng, (chain, _) = np.random.default_rng(seed), slider()
    weight = Weight(
        chain.moved(rng.normal(size=chain.n_numbers) * 1e-3), random_moments(rng, 4),
        random_moments(rng, 1)[0], rng.normal(size=3) * 5,
    )  # fmt: skip
    joint, axis = np.array([0, 0, 1, 2, 3]), np.array([2, 0, 2, 2, 1])
    free = rng.uniform(size=(4, 4)) > 0.5
    load = rng.uniform(1, 100, 5)
    springs = SprungJoints(weight, joint, axis, load, free, passes=2, tilts=True)
    terms = tuple(t for t in harmonic_terms(4, (1,)) if chain.kinds[t.joint] == "revolute")
    numbers = rng.normal(size=len(terms) + len(springs.names)) * 1e-3
    return RobotModel(chain, JointErrors(terms, numbers, springs))


def tx60_at_rest() -> RobotModel:
    """The TX60 as a calibration finds it."""
    level = ladders_of(PLAIN.model, limits=PLAIN.limits)[0].levels[-1]
    wide, rng = with_errors(PLAIN.model, level.errors), np.random.default_rng(0)
    step = rng.normal(size=wide.n_numbers) * 1e-4
    step[-len(level.sd) :] = level.sd * rng.normal(size=len(level.sd))
    return wide.moved(step)


@pytest.mark.parametrize("seed", range(3))
def test_springs_of_every_kind_come_back_from_robot_toml(seed, tmp_path):
    model, (_, robot) = anything(seed), slider()
    robot = replace(robot, model=model, free_sets={})
    (tmp_path / "robot.toml").write_text(robot_toml(robot), encoding="utf-8")
    back = load_robot(tmp_path)
    assert back.model.names == model.names
    own, found = model.joint_errors, back.model.joint_errors
    np.testing.assert_allclose(found.coefficients, own.coefficients, rtol=1e-15, atol=1e-18)
    assert (found.springs.passes, found.springs.tilts) == (2, True)
    q = joint_vectors(50, robot=robot)
    # degrees and millimeters: some roundings of 2e-16 in a few meters
    np.testing.assert_allclose(back.model.poses(q), model.poses(q), rtol=0, atol=2e-14)


def test_a_folder_of_a_sprung_robot_has_all_of_it_and_says_what_urdf_lacks(tmp_path):
    model, q = tx60_at_rest(), joint_vectors(60)
    mine = identified_robot(PLAIN, model, name="mine")
    told = write_robot_folder(mine, tmp_path / "out")
    assert "16 springs of robot.toml cannot be said in URDF or MJCF" in told[-1]
    assert "16 springs" in (tmp_path / "out" / "mine.urdf").read_text()
    back = load_robot(tmp_path / "out")
    np.testing.assert_allclose(back.model.poses(q), model.poses(q), rtol=0, atol=1e-14)
    assert back.sources["springs"].startswith("identified from measurements of")
    assert robot_hash(back) != robot_hash(replace(back, model=RobotModel(model.chain)))


def test_every_row_of_the_table_has_the_unit_that_people_read():
    model = tx60_at_rest()
    parameters = parameters_of(model)
    sd = np.full(parameters.n_free, 1e-3)
    rows = {r.name: r for r in dh_rows(PLAIN.model, model, parameters, np.diag(sd**2))}
    assert tuple(rows) == model.names
    springs, values = model.joint_errors.springs, model.joint_errors.of_springs
    k = springs.names.index("moment6.m")
    assert (rows["moment6.m"].unit, rows["moment6.hx"].unit) == ("kg", "kg m")
    assert rows["moment6.m"].new == values[k]
    assert rows["moment6.m"].expanded == pytest.approx(2e-3)
    assert rows["spring2.z"].unit == "deg"
    assert rows["spring2.z"].new == pytest.approx(
        np.degrees(values[springs.names.index("spring2.z")])
    )


def test_a_virtual_robot_bends_as_its_maker_states():
    """The true robot of a described one with springs: its poses are those of the model."""
    model, q = tx60_at_rest(), joint_vectors(20)
    true = TrueRobot(model, np.zeros(6), UnmodelledTerms())
    np.testing.assert_allclose(true.poses(q), model.poses(q), rtol=0, atol=1e-14)
