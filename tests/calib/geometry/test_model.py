"""Joint errors, robot model and parameter table."""

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.chain import forward
from calib.geometry.joint_errors import JointErrors, JointTerm, gravity_terms, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.measurement.tables import poses
from tests.calib.slopes import slopes
from tests.reference import WEN24, pool_r, tx60


def model_with_terms(rng):
    terms = gravity_terms(6) + harmonic_terms(6)
    return RobotModel(tx60().chain, JointErrors(terms, rng.normal(size=27) * 1e-3))


def test_joint_offsets_are_the_closed_forms_written_out():
    rng = np.random.default_rng(0)
    q = pool_r(50)
    model = model_with_terms(rng)
    c = model.joint_errors.coefficients
    dq = np.zeros_like(q)
    dq[:, 1] = c[0] * np.sin(q[:, 1]) + c[1] * np.sin(q[:, 1] + q[:, 2])
    dq[:, 2] = c[2] * np.sin(q[:, 1] + q[:, 2])
    for i in range(6):
        s1, c1, s2, c2 = c[3 + 4 * i : 7 + 4 * i]
        x = q[:, i]
        dq[:, i] += s1 * np.sin(x) + c1 * np.cos(x) + s2 * np.sin(2 * x) + c2 * np.cos(2 * x)
    assert np.abs(model.joint_errors.offsets(q) - dq).max() < 1e-17
    assert np.array_equal(model.poses(q), forward(model.chain, q + model.joint_errors.offsets(q)))


def test_every_column_including_joint_terms_is_the_derivative_of_the_pose():
    rng = np.random.default_rng(1)
    model, q = model_with_terms(rng), pool_r(20)
    _, J = model.poses_and_jacobian(q)
    assert J.shape == (20, 6, 69)
    numeric = slopes(lambda step: model.moved(step).poses(q)[:, :3, 3], np.zeros(69))
    assert np.abs(J[:, :3] - numeric).max() < 1e-8  # central difference at h = 1e-6


def test_a_model_moved_by_its_step_to_another_is_that_other():
    rng = np.random.default_rng(2)
    model = model_with_terms(rng)
    other = model.moved(rng.normal(size=69) * 1e-2)
    assert (
        np.abs(model.moved(model.step_to(other)).poses(pool_r(5)) - other.poses(pool_r(5))).max()
        < 1e-13
    )


def test_a_model_without_terms_is_its_chain():
    q = pool_r(5)
    T, J = tx60().poses_and_jacobian(q)
    assert J.shape[-1] == 42
    assert np.abs(T - forward(tx60().chain, q)).max() < 1e-15
    assert (tx60().joint_errors.offsets(q) == 0).all()


def test_parameter_table_names_units_and_scales():
    table = parameters_of(tx60(), WEN24)
    assert table.n_free == 24
    assert table.free_names == WEN24
    assert table.scale[table.names.index("d3")] == 1.0
    assert table.scale[table.names.index("theta3")] == pytest.approx(1 / 0.3)
    step = np.arange(1.0, 25)
    assert np.array_equal(table.expand(step)[table.free], step)
    assert (table.expand(step)[~table.free] == 0).all()


def test_an_unknown_parameter_name_gets_a_suggestion():
    with pytest.raises(InputError, match='no parameter is called "thta1"; did you mean "theta1"'):
        parameters_of(tx60(), ["thta1"])


def test_terms_without_coefficients_do_nothing():
    errors = JointErrors(gravity_terms(6))
    assert np.array_equal(errors.coefficients, np.zeros(3))
    assert (errors.offsets(pool_r(5)) == 0).all()


def test_a_summary_lists_joint_terms_with_their_values():
    """What is listed is a step from a model of nothing, which has the terms but no coefficients."""
    nominal, q = RobotModel(tx60().chain, JointErrors(gravity_terms(6))), pool_r(20)
    true = nominal.moved(np.r_[np.zeros(42), np.radians([1e-3, 2e-3, 3e-3])])
    table = poses(q, true.poses(q), sd=(1e-5, 1e-4))
    found = identify(nominal, table, parameters_of(nominal, nominal.joint_errors.names))
    lines = dict(line.split()[:2] for line in found.summary().splitlines()[1:4])
    assert {name: float(value) for name, value in lines.items()} == pytest.approx(
        {"gravity2.upper": 1e-3, "gravity2.fore": 2e-3, "gravity3.fore": 3e-3}, rel=0.05
    )


def test_terms_and_coefficients_must_match():
    with pytest.raises(InputError, match="one per term, 1"):
        JointErrors((JointTerm("a", 0, "sin", (1,)),), np.zeros(2))
    with pytest.raises(InputError, match="needs three joints"):
        gravity_terms(2)
