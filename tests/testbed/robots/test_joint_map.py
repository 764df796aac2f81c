"""The joint map: the turns of a model, in a band of what is known of them."""

import numpy as np

from calib.geometry.joint_errors import JointErrors, gravity_terms, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from testbed.robots.write.joint_map import joint_map, joint_map_rows
from testbed.units import MDEG
from tests.reference import tx60

RNG = np.random.default_rng(1)
TERMS = (*gravity_terms(6), *harmonic_terms(6, (1, 7)))
MODEL = RobotModel(tx60().chain, JointErrors(TERMS, 1e-4 * RNG.normal(size=len(TERMS))))
PARAMETERS = parameters_of(MODEL).freeing([t.name for t in TERMS if t.joint != 4])
ROOT = 1e-5 * RNG.normal(size=(PARAMETERS.n_free, PARAMETERS.n_free))


def test_it_is_what_each_joint_turns_beside_its_command_whatever_the_others_do():
    found = joint_map(MODEL, PARAMETERS, ROOT @ ROOT.T)
    own = [k for k, term in enumerate(TERMS) if not term.name.endswith("fore")]
    waves = JointErrors(tuple(TERMS[k] for k in own), MODEL.joint_errors.coefficients[own])
    at = RNG.uniform(-3, 3, (len(found.angle), 6))  # of no matter where the others are
    for joint in range(6):
        q = at.copy()
        q[:, joint] = found.angle
        np.testing.assert_allclose(found.turn[:, joint], waves.offsets(q)[:, joint], atol=1e-18)


def test_its_band_is_the_spread_of_maps_drawn_from_the_covariance():
    found = joint_map(MODEL, PARAMETERS, ROOT @ ROOT.T)
    names = [term.name for term in TERMS]
    drawn = []
    for _ in range(400):
        coefficients = MODEL.joint_errors.coefficients.copy()
        at = [names.index(name) for name in PARAMETERS.free_names]
        coefficients[at] += ROOT @ RNG.normal(size=len(at))
        other = RobotModel(MODEL.chain, JointErrors(TERMS, coefficients))
        drawn.append(joint_map(other, PARAMETERS, ROOT @ ROOT.T).turn)
    ratio = np.std(drawn, axis=0)[:, [0, 1, 2, 3, 5]] / found.u[:, [0, 1, 2, 3, 5]]
    # 400 draws leave 3.5 % in a standard deviation; angles of one joint hang together
    assert abs(ratio.mean() - 1) < 0.05
    assert np.abs(ratio - 1).max() < 0.2
    assert not found.u[:, 4].any()  # held, not estimated


def test_its_table_has_a_line_for_each_degree_in_millidegrees():
    found = joint_map(MODEL, PARAMETERS, ROOT @ ROOT.T)
    head, rows = joint_map_rows(found)
    assert head[:3] == ("angle_deg", "joint1_mdeg", "joint1_U_k2_mdeg")
    assert [int(row[0]) for row in rows] == list(range(-180, 181))
    assert float(rows[100][1]) == round(MDEG * found.turn[100, 0], 4)
    assert all(len(row) == 13 for row in rows)


def test_an_arm_without_waves_has_no_map():
    assert not len(joint_map(tx60(), parameters_of(tx60()), np.eye(42)).joints)
