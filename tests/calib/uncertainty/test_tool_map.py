"""The tool point as stated, at postures and as a map: content of the region, sums over cells."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from calib.errors import InputError
from calib.uncertainty.discrepancy import Discrepancy
from calib.uncertainty.tool_map import tool_map
from calib.uncertainty.tool_point import tool_statement
from tests.calib.uncertainty.test_monte_carlo import calibration_covariance
from tests.reference import TX60_LIMITS, pool_r, tx60


def test_the_region_holds_the_tool_point_of_moved_robots_95_times_in_100():
    C, q = calibration_covariance(), pool_r(40, seed=99)
    stated = tool_statement(tx60(), q, C)
    moving = np.flatnonzero(np.diag(C))
    L = np.linalg.cholesky(C[np.ix_(moving, moving)])
    rng, hits = np.random.default_rng(0), []
    for _ in range(300):
        step = np.zeros(42)
        step[moving] = L @ rng.standard_normal(len(moving))
        hits.append(stated.holds(tx60().moved(step).poses(q)[:, :3, 3]).mean())
    # robots are the unit: poses of one robot share its error
    assert np.mean(hits) == pytest.approx(0.95, abs=4 * np.std(hits) / np.sqrt(300))
    assert np.std(hits) < 0.2


@pytest.mark.parametrize("extra", [None, Discrepancy(np.eye(3) * 1e-9, np.eye(3), 20)])
def test_semi_axes_are_on_the_edge_of_the_region(extra):
    stated = tool_statement(tx60(), pool_r(3), calibration_covariance(), discrepancy=extra)
    half, turn = stated.region
    for k in range(3):
        tip = stated.position + half[:, k, None] * turn[:, :, k]
        assert stated.holds(tip + 1e-3 * (stated.position - tip)).all()
        assert not stated.holds(tip - 1e-3 * (stated.position - tip)).any()
    assert stated.point == pytest.approx(np.linalg.norm(stated.axes, axis=1))
    assert (half**2).sum(axis=1) == pytest.approx(stated.factor**2 * stated.point**2)


def test_a_discrepancy_widens_every_region():
    C, q = calibration_covariance(), pool_r(5)
    extra = Discrepancy(np.diag([1e-8, 0, 0]), np.eye(3), 40)
    plain, wide = tool_statement(tx60(), q, C), tool_statement(tx60(), q, C, discrepancy=extra)
    assert (np.linalg.eigvalsh(wide.covariance - plain.covariance) > -1e-20).all()
    assert wide.factor > plain.factor == pytest.approx(2.795483, abs=1e-6)
    assert wide.axes[:, 0] == pytest.approx(np.sqrt(plain.axes[:, 0] ** 2 + 1e-8))
    none = Discrepancy(np.zeros((3, 3)), np.eye(3), 40)
    same = tool_statement(tx60(), q, C, discrepancy=none)
    assert same.factor == plain.factor


def test_the_map_holds_every_posture_once_and_its_cells_are_means():
    rng = np.random.default_rng(0)
    q = rng.uniform(TX60_LIMITS[:, 0], TX60_LIMITS[:, 1], (3000, 6))
    C = calibration_covariance()
    stating = partial(tool_statement, tx60(), covariance=C)
    made, stated = tool_map(stating, q, cell=0.1), stating(q)
    assert made.count.sum() == 3000
    assert np.nansum(made.mean**2 * made.count) == pytest.approx((stated.point**2).sum())
    assert np.nanmax(made.worst) == pytest.approx(stated.point.max())
    assert (np.isnan(made.mean) == (made.count == 0)).all()
    # one cell by hand
    x, y, z = made.centers
    i, j, k = np.unravel_index(np.argmax(made.count), made.count.shape)
    own = (np.abs(stated.position - [x[i], y[j], z[k]]) <= 0.05).all(axis=1)
    assert own.sum() == made.count[i, j, k]
    assert made.covariance[i, j, k] == pytest.approx(stated.covariance[own].mean(axis=0))
    assert made.worst[i, j, k] == pytest.approx(stated.point[own].max())
    assert made.mean[i, j, k] == pytest.approx(np.sqrt((stated.point[own] ** 2).mean()))


def test_a_map_of_nothing_or_of_too_many_cells_is_refused():
    stating = partial(tool_statement, tx60(), covariance=calibration_covariance())
    with pytest.raises(InputError, match="cells of 0"):
        tool_map(stating, pool_r(5), cell=0.0)
    with pytest.raises(InputError, match="larger cells"):
        tool_map(stating, pool_r(50), cell=1e-5)
    with pytest.raises(InputError, match="0 postures"):
        tool_map(stating, np.zeros((0, 6)))


def test_a_factor_above_the_chi_square_one_counts_in_the_map():
    q = pool_r(20)

    def wide(at):
        one = tool_statement(tx60(), at, calibration_covariance())
        return replace(one, factor=1.5 * one.factor)

    plain = tool_map(partial(tool_statement, tx60(), covariance=calibration_covariance()), q)
    assert tool_map(wide, q).mean == pytest.approx(1.5 * plain.mean, nan_ok=True)
