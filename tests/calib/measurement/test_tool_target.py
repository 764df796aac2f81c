"""The point of the tool that is stated, against differences and what its own rows say."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.fixtures import Fixtures
from calib.measurement import tables
from calib.measurement.prediction import predict
from calib.measurement.tool_target import ToolTarget
from tests.calib.slopes import slopes
from tests.reference import pool_r, tx60

PLACES = np.array([[0.05, 0.03, 0.08], [-0.06, 0.02, 0.1]])
MODEL = replace(tx60(), fixtures=Fixtures(reflectors=PLACES))


@pytest.mark.parametrize("target", [ToolTarget((0.01, 0.02, 0.03)), ToolTarget(reflector=1)])
def test_rows_are_the_differences_of_positions(target):
    q = pool_r(4)
    position, rows = target.positions_and_rows(MODEL, *MODEL.poses_and_jacobian(q))
    np.testing.assert_array_equal(position, target.positions(MODEL, MODEL.poses(q)))

    def seen(step):
        model = MODEL.moved(step)
        return target.positions(model, model.poses(q))

    found = slopes(seen, np.zeros(MODEL.n_numbers))
    # central differences of 1 m: h^2 / 6 and 2e-16 / h
    np.testing.assert_allclose(rows, found, rtol=0, atol=1e-9)


def test_rows_of_a_reflector_are_those_of_its_readings():
    q = pool_r(4)
    seen = predict(MODEL, tables.points(q, np.zeros((4, 3)), sd=1e-5, reflector=1))
    rows = ToolTarget(reflector=1).positions_and_rows(MODEL, *MODEL.poses_and_jacobian(q))[1]
    np.testing.assert_allclose(rows, seen.rows[:, :3], rtol=0, atol=1e-15)


def test_a_point_of_the_tool_is_one_and_a_reflector_that_is_not_there_is_refused():
    assert ToolTarget.of([0, 0, 0.1]) == ToolTarget((0.0, 0.0, 0.1))
    assert ToolTarget.of(ToolTarget(reflector=1)) == ToolTarget(reflector=1)
    with pytest.raises(InputError, match="0 to 1"):
        ToolTarget(reflector=2).place(MODEL)
    with pytest.raises(InputError, match="no reflectors"):
        ToolTarget(reflector=0).place(tx60())
