"""Robots on springs as arrays, held to the model, the rows and the fit of each robot alone."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.felt_springs import Felt, postures
from calib.geometry.gravity import weight_of
from calib.geometry.joint_errors import JointErrors, harmonic_terms
from calib.geometry.many import ManyModels
from calib.geometry.many_springs import ManySprings
from calib.geometry.model import RobotModel
from calib.geometry.operating import OperatingConditions
from calib.geometry.parameters import parameters_of
from calib.identification.levels import with_errors
from calib.identification.many import extended
from calib.identification.many.extended import extended_many
from calib.identification.many.single import together
from calib.identification.many.tables import ManyRows, ManyTables, known_to_many, position_rows
from calib.identification.model_choice import extended_by
from calib.identification.prior import weak_prior
from calib.measurement.residual import linearize
from tests.calib import kinds
from tests.calib.identification.test_many_choices import held_to, level
from tests.calib.slopes import slopes
from tests.reference import rigid_truth, tx60

ROUNDING = 1e-12
"""Of metres and whitened rows, times a few."""
LEAN = 0.5
"""Tilt at which springs are looked for [rad]."""
TX60 = tx60()
FREE = parameters_of(TX60)
PRIOR = weak_prior(FREE)
LEVELS = (
    "springs",
    "springs and bearings",
    "sag and small bearings",
    "sag by torques on a tilted base",
    "springs and bearings on a tilted base",
)
POSES, COUNT = 24, 3


def on_springs(arm, tilt):
    """An arm with springs at every axis that gravity loads, free moments, and waves; all zero."""
    chain = kinds.ARMS[arm]
    springs, _ = Felt.of(weight_of(chain), postures(chain), tilt=tilt).springs(free_moments=True)
    return RobotModel(chain, JointErrors(harmonic_terms(chain.n_joints), springs=springs))


def bent(model, count, seed=0):
    """Robots near a model, bent by some tenths of a degree: one by one and together."""
    size = np.where(model.is_length, 1e-3, 5e-3)
    size[[name.startswith("moment") for name in model.names]] = 0.5
    size[[name.startswith("tilt") for name in model.names]] = 0.2
    steps = np.random.default_rng(seed).normal(size=(count, model.n_numbers)) * size
    return [model.moved(step) for step in steps], ManyModels.of(model, count).moved(steps), steps


@pytest.mark.parametrize("tilt", [0.0, LEAN])
@pytest.mark.parametrize("arm", kinds.ARMS)
def test_robots_on_springs_stand_and_follow_their_numbers_as_each_does_alone(arm, tilt):
    """Positions and their derivatives, by all numbers and where own columns are held."""
    model = on_springs(arm, tilt)
    alone, many, steps = bent(model, 3)
    rng = np.random.default_rng(1)
    q = rng.uniform(-1, 1, (3, 5, model.chain.n_joints))
    assert many.steps() == pytest.approx(steps, abs=ROUNDING)
    some = np.sort(rng.choice(model.n_numbers, model.n_numbers // 2, replace=False))
    every = np.arange(model.n_numbers)
    for at in (q, q[:1]):
        T, (point, J) = many.poses(at), position_rows(many, at, every)
        part = position_rows(many, at, some)[1]
        for k, one in enumerate(alone):
            own, rows = one.poses_and_jacobian(at[k % len(at)])
            stiff = replace(one, joint_errors=JointErrors()).poses(at[k % len(at)])
            assert np.abs(own - stiff)[:, :3, 3].max() > 1e-3
            assert T[k] == pytest.approx(own, abs=ROUNDING)
            seen = point[k].T
            assert seen == pytest.approx(own[:, :3, 3], abs=ROUNDING)
            found = np.moveaxis(J[k], 2, 0).swapaxes(1, 2)
            assert found == pytest.approx(rows[:, :3], abs=ROUNDING * np.abs(rows).max())
            np.testing.assert_array_equal(part[k], J[k, some])


@pytest.mark.parametrize("tilt", [0.0, LEAN])
def test_rows_of_robots_on_springs_are_those_of_each_table(tilt):
    model, rng = on_springs("iiwa", tilt), np.random.default_rng(3)
    q = kinds.joints("iiwa", rng, 6)
    tables = [kinds.poses(model, q, rng) for _ in range(3)]
    alone, many, _ = bent(model, 3)
    system = ManyRows.of(model, ManyTables.of(tables), np.arange(model.n_numbers), "whitened")
    for k, (r, A) in enumerate(zip(*system.at(many)[:2], strict=True)):
        stack = linearize(alone[k], tables[k])
        own_r, left, size = stack.r.reshape(-1, 6), r.reshape(6, -1).T, np.abs(stack.A).max()
        assert left == pytest.approx(own_r, abs=1e-9 * np.abs(own_r).max())
        found = A.reshape(len(A), 6, -1).transpose(2, 1, 0).reshape(stack.A.shape)
        assert found == pytest.approx(stack.A, abs=ROUNDING * size)


@pytest.mark.parametrize("tilt", [0.0, LEAN])
def test_slopes_of_bends_change_as_their_curvature_tells(tilt):
    """By differences of slopes, whose own error is 1e-8; the turn of gravity itself is left out."""
    springs = on_springs("iiwa", tilt).joint_errors.springs
    rng, p, s = np.random.default_rng(4), len(springs.load), len(springs.names)
    at = ManySprings.of(springs, rng.uniform(-1, 1, (2, 3, 7)))
    numbers = rng.normal(size=(2, s)) * np.where(np.arange(s) < p, 1e-3, 0.2)

    def pulled(x):
        """Slopes (2, s) of what is pulled at by all numbers."""
        loads = at.loads(x)
        weights = (loads.slopes(k).swapaxes(0, 1) for k in range(p, s))
        by_weights = [(pull * each).sum(axis=(1, 2)) for each in weights]
        return np.column_stack([(pull * loads.load).sum(axis=2), *by_weights])

    pull = rng.normal(size=(2, p, 3))
    found = at.loads(numbers).curvature(pull)
    for k, change in enumerate(np.moveaxis(slopes(pulled, numbers, 1e-5), 2, 0)):
        kept = np.arange(s) < s - 2 * (tilt > 0 and k >= s - 2)
        size = np.abs(change).max()
        assert found[:, kept, k] == pytest.approx(change[:, kept], abs=1e-8 * size)


def test_products_of_springs_and_moments_bend_rows_as_gradients_tell():
    """Of springs that give nothing yet, where all else a moment does is nothing: A'r is linear."""
    model, rng = on_springs("ur10", 0.0), np.random.default_rng(3)
    true = model.moved(1e-3 * rng.normal(size=model.n_numbers))
    tables = ManyTables.of([kinds.poses(true, kinds.joints("ur10", rng, 6), rng)])
    names = np.array(model.names)
    moments = np.flatnonzero(np.char.startswith(names, "moment"))
    springs = np.flatnonzero(np.char.startswith(names, "spring"))
    rows = ManyRows.of(model, tables, np.arange(model.n_numbers), "whitened")
    here = rows.at(ManyModels.of(model, 1))
    assert here.bend is not None
    others = np.setdiff1d(np.arange(model.n_numbers), [*springs, *moments])
    assert not here.bend[0, others].any()
    np.testing.assert_array_equal(here.bend[0], here.bend[0].T)
    for k in moments:
        step = np.zeros((1, model.n_numbers))
        step[0, k] = 0.7
        there = rows.at(ManyModels.of(model, 1).moved(step))
        pull = ((there.A - here.A) @ here.r[:, :, None])[0, springs, 0]
        size = np.abs(pull).max()
        assert -0.7 * here.bend[0, springs, k] == pytest.approx(pull, abs=1e-9 * size)


def visits(name, count=COUNT):
    """Tables of the same poses, of arms bent as a level believes them to be."""
    rng = np.random.default_rng(12)
    q, errors, found = kinds.joints("tx60", rng, POSES), level("gravity", name), []
    for _ in range(count):
        wide = with_errors(rigid_truth(rng), errors.errors)
        step = np.zeros(wide.n_numbers)
        step[wide.chain.n_numbers :] = errors.sd * rng.normal(size=len(errors.sd))
        found.append(kinds.poses(wide.moved(step), q, rng))
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    # the last one has the springs and bearings of the first two
    [pytest.param(name, marks=[pytest.mark.study] * (k < 2)) for k, name in enumerate(LEVELS)],
)
def test_fits_of_robots_on_springs_are_those_of_each(name, monkeypatch):
    """From as near as a climb leads, or twice as far, with noise of their own.

    Alone each goes on from where the arrays ended. From elsewhere it may not get there: where
    products bend a model, each of its steps leaves much of the way, and the last ones are lost in
    rounding up to 1e-5 standard uncertainties before the end.
    """
    tables, one_by_one = visits(name), extended_by
    own, factors = (level("gravity", name), level("waves", "small waves")), [1.0, 1.6, 1.0]

    def alone(k, start):
        return one_by_one(TX60, tables[k], FREE, own, prior=PRIOR, factor=factors[k], start=start)

    starts = []
    for k, far in enumerate((0.02, 0.02, 0.04)):
        wide, one = alone(k, None)
        root = np.linalg.cholesky(one.covariance)
        away = far * root @ np.random.default_rng(k).normal(size=len(one.step))
        starts.append(wide.moved(one.parameters.expand(one.step + away)))
    # arrays alone: no robot is left to itself
    monkeypatch.delattr(extended, "extended_by")
    found = extended_many(
        TX60, tables, FREE, [own] * COUNT, prior=PRIOR, factors=factors, starts=starts
    )
    for k, (wide, one) in enumerate(found):
        same, other = alone(k, one.model)
        assert wide.names == same.names
        assert other.certificate < 1e-9
        assert other.iterations <= 1
        # the start is another one
        held_to(replace(one, trace=other.trace[[0, -1]]), other)
        begun = alone(k, starts[k])[1]
        assert one.trace[0] == pytest.approx(begun.trace[0], rel=1e-9)
        assert one.trace[-1] == pytest.approx(begun.trace[-1], rel=1e-9)
    # no bit of one hangs on who is beside it
    ((_, again),) = extended_many(
        TX60, tables[2:], FREE, [own], prior=PRIOR, factors=factors[2:], starts=starts[2:]
    )
    for key in ("step", "covariance", "chi_square", "log_evidence", "residual"):
        np.testing.assert_array_equal(getattr(again, key), getattr(found[2][1], key))


def test_springs_that_rows_load_or_bends_load_again_are_left_to_each():
    model = on_springs("tx60", 0.0)
    springs = model.joint_errors.springs
    plain, loaded = OperatingConditions(), OperatingConditions(payload=np.ones(POSES))
    assert known_to_many(model, [plain])
    assert known_to_many(TX60, [loaded])
    assert not known_to_many(model, [plain, loaded])
    assert not known_to_many(model)
    again = replace(model.joint_errors, springs=replace(springs, passes=2))
    assert not known_to_many(replace(model, joint_errors=again), [plain])
    free = parameters_of(model)
    tables = visits("springs", 2)
    heavy = [replace(table, conditions=loaded) for table in tables]
    assert together(model, heavy, free, weak_prior(free, model)) == [None, None]
