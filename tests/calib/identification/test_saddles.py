"""Fits that begin on a saddle of a number that only its prior tells go on to a minimum."""

import numpy as np
import pytest

from calib.geometry.chain import Chain
from calib.geometry.fixtures import Fixtures
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import Status, identify
from calib.identification.least_squares import solve
from calib.identification.prior import Prior
from calib.identification.tangent import Believed, System
from calib.identification.untold.saddles import way_down
from calib.measurement import tables

NOISE = 20e-6
ANCHOR = ("anchor1.x", "anchor1.y", "anchor1.z")
Q = np.random.default_rng(0).uniform(-2, 2, (60, 2))


def arm(z: float) -> RobotModel:
    """Two links in a plane, and an anchor above it."""
    chain = Chain([[0, 0, 0.5, 0, 0], [0, 0, 0.4, 0, 0]])
    return RobotModel(chain, fixtures=Fixtures(anchors=[[1.5, 0.3, z]]))


def measured(z: float):
    anchor = arm(z).fixtures.anchors[0]
    far = np.linalg.norm(arm(z).poses(Q)[:, :3, 3] - anchor, axis=1)
    noise = NOISE * np.random.default_rng(1).normal(size=len(far))
    return tables.distances(Q, far + noise, sd=NOISE)


def fitted(table, start: RobotModel | None = None):
    prior = Prior([0.0], [0.2], ANCHOR[2:])
    return identify(arm(0.0), table, parameters_of(arm(0.0), ANCHOR), prior=prior, start=start)


@pytest.mark.parametrize("z", [0.1, 0.02])
def test_an_anchor_above_the_plane_that_a_fit_begins_in_is_found(z):
    """Distances have no slope by its height there: chi-square was 257 083 of 58, CONVERGED."""
    table = measured(z)
    found, near = fitted(table), fitted(table, arm(1e-3))
    assert found.status is Status.CONVERGED
    np.testing.assert_allclose(found.step, near.step, atol=1e-9)
    assert found.p_value > 1e-3
    assert len(found.trace) == found.iterations + 1
    assert (np.diff(found.trace) <= 1e-10 * found.trace[1:]).all()  # rounding
    # three coordinates within four standard uncertainties
    off = found.model.fixtures.anchors[0] - arm(z).fixtures.anchors[0]
    assert (np.abs(off) < 4 * found.standard_uncertainty).all()
    (said,) = [note for note in found.notes if "anchor1.z" in note]
    assert "the readings look alike on both sides of anchor1.z" in said
    assert not any("both sides" in note for note in near.notes)
    # beside the saddle it is told apart: the sentence that it is not is no note any more
    assert "anchor1.z" in {one.name for one in found.reduction.dependencies}
    assert found.notes_of_fit == found.notes == (said,)


def test_a_number_that_no_reading_ever_tells_stays_where_it_is_believed():
    """A reflector at the tool's origin: its turns move nothing that is measured."""
    chain = Chain([[0, 0, 0.5, 0, 0], [0, 0, 0.4, 1.0, 0]])
    model = RobotModel(chain)
    table = tables.points(Q, model.poses(Q)[:, :3, 3], sd=NOISE)
    names = ("tool.rx", "tool.ry", "tool.rz")
    prior = Prior(np.zeros(3), np.full(3, 1e-2), names)
    found = identify(model, table, parameters_of(model, ["a1", *names]), prior=prior)
    assert found.status is Status.CONVERGED
    assert not np.abs(found.step[1:]).max()
    assert found.standard_uncertainty[1:] == pytest.approx(1e-2)


def test_a_product_of_two_numbers_is_a_saddle_where_both_are_zero():
    """3 = x y under priors of sd 1: at the best point x^2 = y^2 = 2, and along neither axis down.

    (3 - x y)^2 + x^2 + y^2 is least where x = y and 2 (3 - x^2) = 2.
    """

    def evaluate(x):
        r = np.array([3.0 - x[0] * x[1], -x[0], -x[1]])
        return System(r, np.array([[x[1], x[0]], [1.0, 0.0], [0.0, 1.0]]))

    def move(x, step):
        return x + step

    def told(x):
        """The same with the prior apart, as fits under one have it."""
        r, A = evaluate(x)[:2]
        return System(r[:1], A[:1], Believed(r[:0], A[:0], r[1:], np.ones(2)))

    start = np.zeros(2)
    stuck = solve(told, start, move=move)
    assert stuck.iterations == 0
    down = way_down(told, move, stuck.x, np.arange(2), np.ones(2))
    assert down is not None
    assert down.both
    assert down.along.tolist() == [0, 1]
    found = solve(told, move(stuck.x, down.step), move=move).x
    np.testing.assert_allclose(np.abs(found), np.sqrt(2), rtol=1e-6)
    assert found[0] * found[1] > 0
    assert way_down(told, move, found, np.arange(2), np.ones(2)) is None
