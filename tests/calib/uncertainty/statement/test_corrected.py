"""What rigid corrections are wrong by is shared by the readings that they were taken off."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.frames import exp_so3
from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.measurement.corrections import Corrections
from calib.uncertainty.statement.shared import corrected_errors
from tests.reference import READABLE30, pool_r, tx60
from tests.truth.measuring import measured

SIZES = np.array([*[30e-6] * 3, *[20e-6] * 3])
"""Of shifts and rotations [m, rad]."""


def corrections(m, seed=0):
    """Two corrections, of random shares and covariances."""
    rng = np.random.default_rng(seed)
    root = SIZES[:, None] * rng.normal(size=(2, 6, 6))
    return Corrections(rng.uniform(-1, 1, (m, 2)), rng.normal(size=(m, 3)), root @ root.mT)


def shifted(table, error):
    """A table whose readings are off by errors (m, 6) in the world [m, rad]."""
    return replace(
        table,
        position=table.position + error[:, :3],
        rotation=exp_so3(error[:, 3:]) @ table.rotation,
    )


def test_what_corrections_leave_is_how_the_estimate_follows_each_of_their_errors():
    model, q = tx60(), pool_r(40)
    parameters = parameters_of(model, READABLE30)
    train, judged = measured(model, q[:25]), measured(model, q[25:])
    each = corrections(len(q))
    own, theirs = each.rows(np.arange(25)), each.rows(np.arange(25, 40))
    first = identify(model, train, parameters)
    found = corrected_errors("nests", first, train, judged, (own, theirs))
    left, seen = np.zeros((len(model.names),) * 2), 0.0
    for k in range(2):
        for mine, other in zip(own.errors(k).T, theirs.errors(k).T, strict=True):
            again = identify(model, shifted(train, mine.T), parameters)
            step = np.zeros(len(model.names))
            step[parameters.free_index] = again.step - first.step
            left += np.outer(step, step)
            moved = again.model.poses(judged.q)[:, :3, 3] - judged.position
            seen += (other[:3].T - moved) ** 2
    # errors of 1e-4 bend a fit by their square, a few 1e-4 of what they do
    size = np.sqrt(np.diag(left))
    assert np.abs(found.covariance - left).max() <= 2e-3 * np.outer(size, size).max()
    assert found.seen[0] == pytest.approx(np.sqrt(seen.sum(axis=1).mean()), rel=2e-3)
    rows = model.poses_and_jacobian(judged.q)[1][:, :3]
    whole = np.trace(rows @ left @ rows.mT, axis1=1, axis2=2).mean()
    assert found.at_tool[0] == pytest.approx(np.sqrt(whole), rel=2e-3)


def test_tables_one_below_the_other_keep_their_own_corrections():
    a, b = corrections(3), corrections(4, seed=1)
    both = Corrections.stacked([(3, a), (2, None), (4, b)])
    for k, (own, rows) in enumerate([(a, slice(0, 3)), (a, slice(0, 3)), (b, slice(5, 9))]):
        errors = both.errors(k)
        assert np.array_equal(errors[rows], own.errors(k if k < 2 else 0))
        others = np.ones(9, dtype=bool)
        others[rows] = False
        assert not errors[others].any()
    assert Corrections.stacked([(3, None), (2, None)]) is None
