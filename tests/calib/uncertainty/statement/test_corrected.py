"""What rigid corrections are wrong by is shared by the readings that they were taken off."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.frames import exp_so3
from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.measurement import corrections as stored
from calib.measurement.corrections import Corrections
from calib.uncertainty.statement.shared import corrected_errors
from tests.memory import peak_below
from tests.reference import READABLE30, pool_r, tx60
from tests.truth.measuring import measured

SIZES = np.array([*[30e-6] * 3, *[20e-6] * 3])
"""Of shifts and rotations [m, rad]."""


def corrections(m, seed=0):
    """Two corrections, of random shares and covariances."""
    rng = np.random.default_rng(seed)
    root = SIZES[:, None] * rng.normal(size=(2, 6, 6))
    every = np.tile(np.arange(2), (m, 1))
    return Corrections(every, rng.uniform(-1, 1, (m, 2)), rng.normal(size=(m, 3)), root @ root.mT)


def dense(each):
    """(m, r) share of each reading in each correction."""
    share = np.zeros((len(each.lever), len(each.covariance)))
    rows = np.arange(len(each.lever))[:, None]
    np.add.at(share, (rows, each.which), each.share)
    return share


def errors(each, k):
    """(m, 6, 6) what correction k does to each reading, its errors of size one, one by one."""
    out = []
    for share, lever in zip(dense(each)[:, k], each.lever, strict=True):
        B = np.eye(6)
        B[:3, 3:] = np.cross(np.eye(3), lever)  # column j is e_j x lever
        B[:3, 3:] = B[:3, 3:].T
        out.append(share * B @ np.linalg.cholesky(each.covariance[k]))
    return np.array(out)


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
        for mine, other in zip(errors(own, k).T, errors(theirs, k).T, strict=True):
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
        found = errors(both, k)
        assert np.array_equal(found[rows], errors(own, k if k < 2 else 0))
        others = np.ones(9, dtype=bool)
        others[rows] = False
        assert not found[others].any()
    assert Corrections.stacked([(3, None), (2, None)]) is None


def rounds(m, r, seed=2):
    """A row of each of m readings between two of r rounds, as a drift is taken off by nests."""
    rng = np.random.default_rng(seed)
    at = np.linspace(0, r - 1, m)
    before = np.minimum(at.astype(int), r - 2)
    which = np.column_stack([before, before + 1, np.zeros(m, int)])
    share = np.column_stack([1 - at + before, at - before, -np.ones(m)])
    root = SIZES[:, None] * rng.normal(size=(r, 6, 6))
    return Corrections(which, share, rng.normal(size=(m, 3)), root @ root.mT)


def test_blocks_of_a_few_shares_a_row_leave_what_whole_matrices_do(monkeypatch):
    """Summed one correction after the other over all rows, as JCGM 100 writes it."""
    rng = np.random.default_rng(1)
    own, theirs = rounds(40, 9), rounds(15, 9, seed=2)
    gain, rows = rng.normal(size=(40, 7, 6)), rng.normal(size=(15, 3, 7))
    monkeypatch.setattr(stored, "BLOCK", 18 * 15 * 2)  # two corrections at a time
    moved = own.followed(gain)
    expected = [np.einsum("mfe,mek->fk", gain, errors(own, k)) for k in range(9)]
    # sums of 40 products in another order: some 1e-15 of the largest
    np.testing.assert_allclose(moved, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    seen = sum(
        np.square(errors(theirs, k)[:, :3] - rows @ one).sum(axis=(1, 2))
        for k, one in enumerate(expected)
    )
    np.testing.assert_allclose(theirs.left(rows, moved), seen, rtol=1e-12)


def test_five_thousand_rounds_over_nests_fit_into_memory():
    """A matrix of rows by rounds alone is 400 MB; one correction at a time takes hours."""
    own, theirs = rounds(10_000, 5000), rounds(200, 5000)
    gain, rows = np.ones((10_000, 20, 6)), np.ones((200, 3, 20))
    with peak_below(150e6):
        both = Corrections.stacked([(10_000, own), (200, None)])
        moved = both.rows(np.arange(10_000)).followed(gain)
        assert np.isfinite(theirs.left(rows, moved)).all()
