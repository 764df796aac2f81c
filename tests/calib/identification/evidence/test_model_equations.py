"""A model's part of the normal equations, against rows and matrices written out."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.parameters import parameters_of
from calib.identification.evidence.normal_equations import normal_equations
from calib.identification.evidence.shared_misfit import SharedMisfit
from calib.identification.identify import identify
from calib.identification.ladders import ladders_of
from calib.identification.levels import asked_of
from calib.identification.prior import weak_prior
from tests.calib.identification.test_joint_models import bent, seen
from tests.reference import tx60

FREE = parameters_of(tx60())
PRIOR = weak_prior(FREE)
LEVELS = {level.name: level for ladder in ladders_of(tx60()) for level in ladder.levels}
SCALE = 1.3
"""Of the noise."""


@pytest.fixture(scope="module")
def equations():
    """Of all levels of a bent arm at 30 poses, two visits each, with readings of one pose apart."""
    table = seen(bent(4), 30, 1)
    twice = table.rows(np.repeat(np.arange(30), 2))
    noisy = twice.position + 1e-5 * np.random.default_rng(0).normal(size=twice.position.shape)
    twice = replace(twice, position=noisy, repeat=np.tile([0, 1], 30))
    near = identify(tx60(), twice, FREE, prior=PRIOR).model
    every = [level.errors for level in LEVELS.values()]
    return normal_equations(tx60(), near, twice, FREE, every, PRIOR), twice


def levels(*names):
    return asked_of(tuple(LEVELS[name] for name in names))


MODELS = {
    "geometry": (),
    "waves": ("waves",),
    "springs": ("springs",),
    "springs and bearings": ("waves", "springs and bearings"),
    "on a tilted base": ("waves", "springs and bearings on a tilted base"),
}


@pytest.mark.parametrize("names", MODELS.values(), ids=MODELS)
@pytest.mark.parametrize("out", [0, 5])
def test_a_model_is_solved_as_by_all_its_rows_and_the_matrix_of_its_numbers(equations, names, out):
    system, table = equations
    rows = ~np.isin(table.pose_id, np.arange(out))
    rest, asked = system.without(~rows) if out else system, levels(*names)
    found, model = rest.solved(*asked, scale=SCALE), rest.of_model(*asked)
    k, springs = len(model.size), model.springs
    A, r = system.A[rows].reshape(-1, model.width), system.r[rows].ravel()
    x = found.step[k:] / springs.sd
    of_products, slopes = springs.at(x)
    linear = A[:, model.columns[:k]] * model.size
    B = np.hstack([linear, A[:, springs.columns] @ slopes]) / SCALE
    held = np.eye(B.shape[1])
    held[:k, :k] = model.precision
    H = B.T @ B + held
    # what is left, and the force on the linear numbers, which vanishes
    left = r - linear @ (found.step[:k] / model.size) - A[:, springs.columns] @ of_products
    beside = found.step[:k] / model.size + model.away
    force = linear.T @ left / SCALE**2 - model.precision @ beside
    assert np.abs(force / np.sqrt(np.diag(H)[:k])).max() < 1e-6  # of a sd: conditions to 1e7
    np.testing.assert_allclose(r - A @ found.applied, left, atol=1e-9 * np.abs(r).max())
    loss = left @ left / SCALE**2 + beside @ model.precision @ beside + x @ x
    evidence = (np.linalg.slogdet(model.precision)[1] - loss - np.linalg.slogdet(H)[1]) / 2
    assert found.evidence == pytest.approx(evidence, abs=1e-6)  # odds of 20 are 3
    assert found.left == pytest.approx(left @ left, rel=1e-9)
    learned = H.shape[0] - np.trace(held @ np.linalg.inv(H))
    assert model.learned(SCALE) == pytest.approx(learned, abs=1e-6)


def test_products_that_no_row_sees_are_left_out_and_change_nothing(equations):
    """A joint does not feel the moments of links before it; nor does the arm's own stand, upright,
    turn joint 1."""
    system, _ = equations
    asked = levels("springs and bearings")
    model = system.of_model(*asked)
    every = model.springs.columns
    unseen = np.setdiff1d(np.arange(len(every)), model.live)
    assert len(unseen) > len(every) / 4
    assert not system.A[:, :, every[unseen]].any()
    own = np.append(model.columns[: len(model.size)], every)
    whole = replace(model, columns=own, live=np.arange(len(every)))
    whole = replace(whole, sums=whole.picked(system.sums))
    one, all_of_it = model.solved(SCALE), whole.solved(SCALE)
    assert one.evidence == pytest.approx(all_of_it.evidence, abs=1e-9)
    np.testing.assert_allclose(one.step, all_of_it.step, rtol=1e-7, atol=1e-12)
    assert model.learned(SCALE) == pytest.approx(whole.learned(SCALE), abs=1e-9)


def test_numbers_learned_beside_a_prior_that_ties_them_together(equations):
    """Each number by itself is as uncertain as before, and every two of them are correlated."""
    system, _ = equations
    model = system.of_model(*levels("waves"))
    k = len(model.size)
    root = np.sqrt(np.diag(model.precision))
    tied = replace(model, precision=np.where(np.eye(k), 1.0, 0.5) * root[:, None] * root)
    A = system.A.reshape(-1, model.width)[:, model.columns[:k]] * model.size / SCALE
    expected = k - np.trace(tied.precision @ np.linalg.inv(A.T @ A + tied.precision))
    assert tied.learned(SCALE) == pytest.approx(expected, abs=1e-6)
    assert abs(tied.learned(SCALE) - model.learned(SCALE)) > 0.1  # or this would show nothing


@pytest.mark.parametrize("v", [0.3, 20.0])
def test_a_model_under_a_misfit_is_its_part_of_all_equations_under_it(equations, v):
    system, table = equations
    shared, asked = SharedMisfit.of(system, table), levels("waves", "springs")
    part, whole = shared.of_model(asked).at(v), shared.at(v).of_model(*asked)
    np.testing.assert_array_equal(part.live, whole.live)
    size = np.abs(whole.sums.normal).max()
    np.testing.assert_allclose(part.sums.normal, whole.sums.normal, atol=1e-12 * size)
    assert part.solved(SCALE).evidence == pytest.approx(whole.solved(SCALE).evidence, abs=1e-7)
