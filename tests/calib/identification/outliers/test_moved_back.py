"""What moved between two rows and came back: where, what, how far; and nothing where none did."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.chain import Chain
from calib.geometry.fixtures import Fixtures
from calib.geometry.joint_errors import JointErrors, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.identification.outliers import moved
from calib.identification.outliers.moved import moved_or_back
from calib.identification.outliers.spans import intervals_of
from tests.calib import kinds

POSES = 60


def of(true, table):
    """What moved, by a geometric fit from frames that are about right."""
    chain = true.chain
    start = RobotModel(
        Chain(kinds.ARMS["tx60"].links, chain.kinds, chain.T_world_base, chain.T_flange_tool),
        fixtures=true.fixtures,
    )
    found = identify(start, table, parameters_of(start))
    return moved_or_back(found, table, np.arange(len(table)))


def robot(seed, poses=POSES):
    """A TX60 that is wrong everywhere, and what draws its readings."""
    rng = np.random.default_rng([seed, 29])
    true = replace(kinds.true_robot("tx60", rng), fixtures=Fixtures())
    return true, kinds.joints("tx60", rng, poses), rng


def between(first, end, poses=POSES):
    """Rows of the span."""
    return (np.arange(poses) >= first) & (np.arange(poses) < end)


def pushed(table, way, rows):
    """The table, of which the instrument was pushed for some rows [m]."""
    return replace(table, position=table.position + np.where(rows[:, None], way, 0.0))


def with_tool(true, q, rng, way, rows):
    """Readings of a target that sits elsewhere on the tool for some rows [m]."""
    offsets = np.where(rows[:, None], way, 0.0)
    moved = (true.poses(q)[:, :3, :3] @ offsets[:, :, None])[:, :, 0]
    table = kinds.points(true, q, rng)
    return replace(table, position=table.position + moved)


WAY = np.array([0.6, -0.64, 0.48])


@pytest.mark.parametrize("size", [3e-4, 1e-3, 1e-2])
@pytest.mark.parametrize(("first", "end"), [(30, 34), (22, 32), (40, 55)])
def test_another_tool_for_some_poses_is_named_with_both_ends_and_its_size(size, first, end):
    true, q, rng = robot(first)
    found = of(true, with_tool(true, q, rng, size * WAY, between(first, end)))
    assert (found.what, found.last, found.row) == ("target", first - 1, first)
    assert (found.until, found.back, found.rows) == (end - 1, end, end - first)
    # four readings of 20 um, and what links take of it
    np.testing.assert_allclose(found.change, size * WAY, atol=30e-6 + 5e-3 * size)
    assert found.explained > 0.95


@pytest.mark.parametrize(("first", "end"), [(30, 36), (22, 32)])
def test_an_instrument_that_was_pushed_and_put_back_is_named(first, end):
    true, q, rng = robot(end)
    found = of(true, pushed(kinds.points(true, q, rng), 5e-4 * WAY, between(first, end)))
    assert (found.what, found.row, found.back) == ("station", first, end)


def test_what_stayed_is_no_span_and_what_came_back_no_step():
    """20 of 60 poses: a step at either end explains much of what the span does."""
    true, q, rng = robot(3)
    assert of(true, pushed(kinds.points(true, q, rng), 5e-4 * WAY, between(25, POSES))).back is None
    assert of(true, pushed(kinds.points(true, q, rng), 5e-4 * WAY, between(25, 45))).back == 45


def test_too_few_rows_between_two_ends_may_be_wrong_shots():
    true, q, rng = robot(4)
    assert of(true, pushed(kinds.points(true, q, rng), 5e-4 * WAY, between(30, 33))) is None


def hump(table, rng):
    """All moves a little for a while, and comes back."""
    del rng
    way = np.exp(-(((np.arange(len(table)) - 30) / 6.0) ** 2))[:, None] * 3e-4 * WAY
    return replace(table, position=table.position + way)


def wave(table, rng):
    """All goes one way and back, again and again."""
    way = np.sin(np.arange(len(table)) / 6.0 + rng.uniform(0, 6))[:, None] * 2e-4 * WAY
    return replace(table, position=table.position + way)


def gross(table, rng):
    """A tenth of the rows are bad shots."""
    bad = rng.random((len(table), 1)) < 0.1
    return replace(table, position=table.position + bad * rng.normal(size=(len(table), 3)) * 1e-3)


def pair(table, rng):
    """Two rows one after the other are bad shots."""
    position = table.position.copy()
    position[30:32] += rng.normal(size=(2, 3)) * 2e-3
    return replace(table, position=position)


@pytest.mark.parametrize("how", [hump, wave, gross, pair])
def test_nothing_came_back_where_readings_wander_or_shots_are_bad(how):
    for seed in range(6):
        true, q, rng = robot(20 + seed)
        found = of(true, how(kinds.points(true, q, rng), rng))
        assert found is None or found.back is None


@pytest.mark.parametrize("order", ["random", "sorted"])
def test_nothing_came_back_where_joints_have_waves(order):
    """Sorted, the poses between two rows lie near each other, and have a misfit of their own."""
    for seed in range(6):
        true, q, rng = robot(40 + seed)
        terms = harmonic_terms(6, (1, 2, 5))
        errors = JointErrors(terms, rng.normal(size=len(terms)) * 0.01 * kinds.DEG)
        wavy = RobotModel(true.chain, errors, true.fixtures)
        q = q if order == "random" else q[np.argsort(q[:, 0])]
        assert of(true, kinds.points(wavy, q, rng)) is None


def test_the_chance_is_of_all_spans_that_were_tried(monkeypatch):
    true, q, rng = robot(5)
    table = with_tool(true, q, rng, 1e-4 * WAY, between(22, 32))
    one = of(true, table)
    monkeypatch.setattr(
        moved, "intervals_of", lambda rows: replace(intervals_of(rows), tried=1000 * (57 * 56 // 2))
    )
    many = of(true, table)
    assert (one.row, one.back) == (many.row, many.back)
    assert 0 < one.p_value < 1e-6
    assert many.p_value / one.p_value == pytest.approx(1000)
