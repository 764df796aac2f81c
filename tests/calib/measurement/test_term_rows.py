"""Columns of many joint terms as products: against the whole derivative, and what is left out."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.gravity import Weight, guessed_moments
from calib.geometry.joint_errors import JointErrors, JointTerm, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.operating import OperatingConditions
from calib.geometry.parameters import parameters_of
from calib.geometry.springs import SprungJoints
from calib.identification.identify import identify
from calib.identification.prior import weak_prior
from calib.identification.robust import flattened
from calib.measurement.observations import Measurements, joined
from calib.measurement.residual import linearize, table_whiteners
from calib.measurement.term_rows import TermRows
from tests.calib.kinds import distances, joints, points, poses, true_robot

LENGTHS = JointTerm("lengths", -1, "lengths", (0,) * 6, 20.0)
MIXED = (LENGTHS, *harmonic_terms(6, tuple(range(1, 9))))
"""97 terms, one of which moves no joint."""


def case(springs: bool) -> tuple[RobotModel, Measurements]:
    """A robot of many terms, and poses, points and distances of two stations, all of them warm."""
    rng = np.random.default_rng(60)
    true = true_robot("tx60", rng)
    tables = [
        poses(true, joints("tx60", rng, 30), rng, station=1),
        points(true, joints("tx60", rng, 30), rng, reflector=1),
        distances(true, joints("tx60", rng, 30), rng, anchor=2),
    ]
    table = joined(tables)
    warm = OperatingConditions(temperature=20 + 5 * rng.random(len(table)))
    weight = Weight(true.chain, guessed_moments(true.chain))
    giving = SprungJoints(weight, [1, 2], [2, 0], [50.0, 9.0], np.zeros((6, 4), dtype=bool))
    model = replace(true, joint_errors=JointErrors(MIXED, springs=giving if springs else None))
    return model.moved(1e-4 * rng.normal(size=model.n_numbers)), replace(table, conditions=warm)


@pytest.mark.parametrize("loss", ["squared", "cauchy"])
@pytest.mark.parametrize("springs", [False, True], ids=["stiff", "springs"])
def test_products_and_columns_are_those_of_the_whole_derivative(springs, loss):
    """Of some numbers only, in rows of any kind, and as a loss weighs them."""
    model, table = case(springs)
    names = np.random.default_rng(61).permutation(model.names)[: model.n_numbers - 20]
    some, W = parameters_of(model, names), table_whiteners(table)
    rows = TermRows.of(model, table, W, some)
    there = model.moved(1e-4 * np.random.default_rng(62).normal(size=model.n_numbers))
    stack = linearize(there, table)
    r, A = flattened(stack.r, stack.A[:, some.free_index], stack.row_of, loss)
    ours, columns = flattened(*rows.at(there), loss)
    found = rows.by_joint(columns)
    size = np.abs(A).max()
    np.testing.assert_allclose(ours, r, rtol=1e-12, atol=1e-12 * np.abs(r).max())
    np.testing.assert_allclose(found.dense, A, rtol=1e-12, atol=1e-12 * size)
    for seen, whole in zip(found.products(r), (A.T @ A, A.T @ r), strict=True):
        np.testing.assert_allclose(seen, whole, rtol=1e-10, atol=1e-12 * np.abs(whole).max())


def test_a_fit_by_products_is_the_fit_by_columns(monkeypatch):
    model, table = case(False)
    table = table.rows(table.is_pose)
    nominal = replace(model, joint_errors=JointErrors(MIXED))
    parameters = parameters_of(nominal)
    fits = []
    for many in (64, 1000):
        monkeypatch.setattr("calib.measurement.term_rows.MANY", many)
        prior = weak_prior(parameters, nominal)
        fits.append(identify(nominal, table, parameters, prior=prior, loss="huber"))
    ours, theirs = fits
    u = np.sqrt(np.diag(theirs.covariance))
    noise = max(1.0, np.sqrt(theirs.chi_square / theirs.dof))
    assert np.abs((ours.step - theirs.step) / u).max() < 1e-9 * noise
    assert np.abs((ours.covariance - theirs.covariance) / np.outer(u, u)).max() < 1e-9
    assert ours.status.name == theirs.status.name == "CONVERGED"


def test_few_terms_are_left_as_columns():
    model, table = case(False)
    few = replace(model, joint_errors=JointErrors(harmonic_terms(6)))
    assert TermRows.of(few, table, table_whiteners(table), parameters_of(few)) is None


def test_joint_errors_follow_what_moves_them():
    """Poses change with a condition if, and only if, it is followed."""
    rng = np.random.default_rng(63)
    q, errors = joints("tx60", rng, 5), [case(springs)[0].joint_errors for springs in (False, True)]
    stated = [OperatingConditions(**{name: rng.random(5)}) for name in ("temperature", "payload")]
    true = true_robot("tx60", rng)
    waves = JointErrors(MIXED[1:], rng.normal(size=len(MIXED) - 1))
    for each in (waves, *errors):
        model = replace(true, joint_errors=each)
        for at in stated:
            changed = bool((model.poses(q, at) != model.poses(q)).any())
            assert each.follow(at) == changed
