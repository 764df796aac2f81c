"""Predictions that several statements need are computed once, and no longer than they are made."""

from dataclasses import replace

import numpy as np
import pytest

from calib.measurement.prediction import predict, tool_poses
from calib.measurement.remembered import MOST, remembering
from tests.calib.measurement.test_residual import mixed_table
from tests.reference import tx60


@pytest.mark.parametrize("compute", [predict, tool_poses])
def test_only_what_a_prediction_depends_on_makes_it_another(compute):
    model, rng = tx60(), np.random.default_rng(2)
    table = mixed_table(model, rng, 1e-3)
    noisier = replace(table, covariance=2 * table.covariance)
    others = (
        replace(table, q=table.q + 0.1), replace(table, position=table.position + 0.1),
        replace(table, offset=table.offset + 0.1), table.rows([1, 0, 2, 3, 4, 5]),
    )  # fmt: skip
    assert compute(model, table) is not compute(model, table)
    with remembering():
        first = compute(model, table)
        assert compute(model, table) is compute(model, noisier) is first
        assert compute(model, table.rows(np.ones(6, bool))) is first
        for another in (*others, *others):
            assert compute(model, another) is not first
        assert compute(model.moved(np.full(model.n_numbers, 1e-3)), table) is not first
    assert compute(model, table) is not first


def test_both_results_of_a_table_are_kept_apart_and_old_ones_let_go():
    model, rng = tx60(), np.random.default_rng(3)
    table, *others = (mixed_table(model, rng, 1e-3) for _ in range(MOST + 1))
    with remembering():
        first = predict(model, table)
        assert tool_poses(model, table).shape == (6, 4, 4)
        assert predict(model, table) is first
        with remembering():
            assert predict(model, table) is not first
        for other in others:
            predict(model, other)
        again = predict(model, table)
    assert again is not first
    assert np.array_equal(again.rows, first.rows)


def test_what_several_have_nobody_changes():
    model = tx60()
    table = mixed_table(model, np.random.default_rng(4), 1e-3)
    for shared in (predict(model, table).rows, predict(model, table).residual):
        with pytest.raises(ValueError, match="read-only"):
            shared[0] = 0.0
    with pytest.raises(ValueError, match="read-only"):
        tool_poses(model, table)[0] = 0.0
