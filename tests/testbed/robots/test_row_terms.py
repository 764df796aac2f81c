"""Terms that follow the rows leave the house and come back: robot.toml, table, joint map, hash."""

from dataclasses import replace

import numpy as np
import pytest

from calib.compensation import compensate, corrected_poses
from calib.errors import InputError
from calib.geometry.chain import forward
from calib.geometry.inverse import joint_jacobian
from calib.geometry.joint_errors import JointErrors, JointTerm
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from testbed.robots.catalog import load_robot
from testbed.robots.write.dh_table import dh_rows
from testbed.robots.write.folder import _geometric_words
from testbed.robots.write.joint_map import joint_map
from testbed.robots.write.toml import robot_toml
from testbed.scenario.hashes import robot_hash
from tests.calib.geometry.test_operating import conditions, one_of_each
from tests.calib.slopes import slopes

TX60 = replace(load_robot("staubli_tx60"), visuals=())
TERMS, NUMBERS = one_of_each(TX60.model.chain)
MINE = replace(TX60, model=RobotModel(TX60.model.chain, JointErrors(TERMS, NUMBERS)))
Q = np.random.default_rng(1).uniform(*(0.8 * TX60.limits).T, (40, 6))
AT = conditions(np.random.default_rng(2), 40, 6)


def back(folder, text):
    (folder / "robot.toml").write_text(text)
    return load_robot(folder / "robot.toml")


def test_robot_toml_brings_every_term_back(tmp_path):
    again = back(tmp_path, robot_toml(MINE))
    assert again.model.joint_errors.terms == TERMS
    away = again.model.poses(Q, AT)[:, :3, 3] - MINE.model.poses(Q, AT)[:, :3, 3]
    assert np.abs(away).max() < 1e-9
    # the terms do move the arm
    assert np.abs(MINE.model.poses(Q, AT) - MINE.model.poses(Q)).max() > 1e-4


def test_the_table_has_their_units_and_the_hash_their_reference():
    table = parameters_of(MINE.model, ["lengths", "torque2"])
    rows = {r.name: r for r in dh_rows(TX60.model, MINE.model, table, np.diag([1e-12, 4e-12]))}
    assert (rows["lengths"].unit, rows["lengths"].new) == ("1e-6/K", pytest.approx(40.0))
    assert rows["lengths"].expanded == pytest.approx(4.0)  # 2 u of 2e-6: names are in model order
    assert rows["torque2"].unit == "deg per N m, N or A"
    colder = tuple(replace(t, reference=t.reference - 1) for t in TERMS)
    other = replace(MINE, model=RobotModel(MINE.model.chain, JointErrors(colder, NUMBERS)))
    assert robot_hash(other) != robot_hash(MINE)


def test_the_joint_map_holds_waves_of_one_joint_alone():
    found = joint_map(MINE.model, parameters_of(MINE.model, ["lengths"]), np.eye(1))
    assert found.joints.tolist() == [0, 1]
    turn = NUMBERS[1] * np.cos(30.5 * found.angle)
    np.testing.assert_allclose(found.turn[:, 1], turn, atol=1e-15)


def test_a_program_is_corrected_under_its_conditions():
    found = compensate(TX60.model, MINE.model, Q, TX60.limits, AT)
    done = found.corrected
    assert done.sum() > 30
    wanted, there = TX60.model.poses(Q[done]), MINE.model.poses(found.q[done], AT.rows(done))
    # where the search ends counts as reached
    assert np.abs(there - wanted)[:, :3, 3].max() < 1e-9
    poses = corrected_poses(TX60.model, MINE.model, TX60.model.poses(Q), Q, TX60.limits, AT)
    both = done & poses.corrected
    np.testing.assert_allclose(poses.q[both], found.q[both], atol=1e-7)


def test_the_joint_jacobian_is_the_derivative_under_conditions():
    _, J = joint_jacobian(MINE.model, Q, AT)
    numeric = slopes(lambda q: MINE.model.poses(q, AT)[:, :3, 3], Q)
    # rounding 1e-16 / h, and curvature of waves of order 30
    assert np.abs(numeric - J[:, :3]).max() < 1e-8


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("coefficient_per_k", "coefficient_deg", "needs coefficient_per_k, and joint = 0"),
        ("joint = 0", "joint = 1", "needs coefficient_per_k, and joint = 0"),
        ('wave = "approach"', 'wave = "lengths"', "needs coefficient_per_k"),
        ('name = "approach1"\njoint = 1', 'name = "approach1"\njoint = 0', "needs a joint"),
    ],
)
def test_terms_that_make_no_sense_are_refused(tmp_path, old, new, message):
    with pytest.raises(InputError, match=message):
        back(tmp_path, robot_toml(MINE).replace(old, new, 1))


def test_what_urdf_leaves_out_of_play_is_not_said_to_be_nothing():
    """Arms that come from either side stand half the play off, as leaving it out has them."""
    play = np.full(6, 5e-3 * np.pi / 180)
    terms = tuple(
        JointTerm(f"approach{k + 1}", k, "approach", tuple(np.eye(6)[k])) for k in range(6)
    )
    model = replace(TX60.model, joint_errors=JointErrors(terms, play))
    said = _geometric_words(replace(TX60, model=model))
    rng = np.random.default_rng(5)
    q = rng.uniform(*TX60.limits.T, (400, 6))
    away = forward(model.chain, q + play * rng.choice([-1, 1], q.shape)) - forward(model.chain, q)
    rms = 1e3 * np.sqrt(np.square(away[:, :3, 3]).sum(axis=1).mean())
    # other poses and other sides of the same limits: each of some hundred tells an rms to 10 %
    assert float(said.split(" rms ")[1].split()[0]) == pytest.approx(rms, rel=0.3)
