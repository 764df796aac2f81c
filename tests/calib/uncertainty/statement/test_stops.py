"""Rows of one stop share what the joints scatter: in the evidence and in the numbers."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from scipy.special import chdtrc

from calib.geometry.fixtures import Fixtures
from calib.geometry.jacobian import joint_columns
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.fit_statistics import squared_notes
from calib.identification.identify import identify
from calib.measurement.observations import joined
from calib.measurement.prediction import predict
from calib.measurement.residual import linearize, table_whiteners
from calib.uncertainty.judgement import Circumstances, judge
from calib.uncertainty.statement.believe import believe
from calib.uncertainty.statement.evidence import position_rows
from calib.uncertainty.statement.gain import estimator_gain
from calib.uncertainty.statement.misfit import misfit, misfit_shape
from calib.uncertainty.statement.questions import fisher
from calib.uncertainty.statement.stops import judged_by_stops, stop_covariance
from tests.calib import kinds

SCATTER = 20e-6
"""Repeatability of every joint [rad]; at a meter as large as the noise of a reading."""
TRAIN, TEST, ROBOTS = 50, 25, 12


def seen(true, q, rng, first, visits=1):
    """Three reflectors at poses q, the joints not quite where they were sent, `visits` times."""
    m, tables = len(q), []
    for visit in range(visits):
        went = q + SCATTER * rng.normal(size=q.shape)
        for k in range(3):
            table = kinds.points(true, went, rng, reflector=k)
            numbers = {"pose_id": first + np.arange(m), "repeat": np.full(m, visit)}
            tables.append(replace(table, q=q, **numbers))
    return joined_as_they_are(tables)


def joined_as_they_are(tables):
    """One table, with the numbers of poses that its parts have."""
    pose = np.concatenate([table.pose_id for table in tables])
    repeat = np.concatenate([table.repeat for table in tables])
    return replace(joined(tables), pose_id=pose, repeat=repeat)


def with_scatter(model, table):
    """The table with the scatter of its joints in its noise, and the root of that part."""
    columns = joint_columns(model.chain)
    root = SCATTER * predict(model, table).rows[:, :, columns]
    return replace(table, covariance=table.covariance + root @ np.swapaxes(root, 1, 2)), root


def campaign(seed, visits=1):
    """A rigid TX60 with three reflectors, identified: fit, both tables, their roots, the truth."""
    rng = np.random.default_rng([seed, 31])
    true = kinds.true_robot("tx60", rng)
    true = replace(true, fixtures=Fixtures(true.fixtures.reflectors))
    q = kinds.joints("tx60", rng, TRAIN), kinds.joints("tx60", rng, TEST)
    train, own = with_scatter(true, seen(true, q[0], rng, 0, visits))
    test, theirs = with_scatter(true, seen(true, q[1], rng, TRAIN, visits))
    chain = true.chain
    start = RobotModel(replace(chain, links=kinds.ARMS["tx60"].links), fixtures=true.fixtures)
    return identify(start, train, parameters_of(start)), train, test, (own, theirs), true


@pytest.mark.slow
def test_rows_of_one_stop_are_no_misfit():
    """By the likelihood ratio, of which half is no misfit at all, at the level of one in a hundred.

    Taken apart, three targets of one stop count one scatter three times.
    """
    chance = []
    for seed in range(ROBOTS):
        fit, train, test, stops, _ = campaign(seed)
        apart = misfit(fit, train, test)
        together = misfit(fit, train, test, stops=stops)
        chance.append([0.5 * chdtrc(1, max(one.ratio, 0.0)) for one in (apart, together)])
    apart, together = np.array(chance).T
    assert (apart < 0.01).mean() > 0.5
    assert (together < 0.01).sum() <= 1  # two in twelve: seven in a thousand


@pytest.mark.parametrize("visits", [1, 2])
def test_the_evidence_and_the_numbers_have_the_noise_that_stops_share(visits):
    """Against one dense covariance of all rows, filled stop by stop."""
    fit, train, _, (root, _), _ = campaign(1, visits)
    m = len(train)
    V = np.zeros((m, 3, m, 3))
    for i in range(m):
        for j in range(m):
            if (train.pose_id[i], train.repeat[i]) == (train.pose_id[j], train.repeat[j]):
                V[i, :, j] = root[i, :3] @ root[j, :3].T
        V[i, :, i] = train.covariance[i, :3, :3]
    V = V.reshape(3 * m, 3 * m)
    model, free = fit.model, fit.parameters
    A = predict(model, train).rows[:, :3, free.free_index] * free.free_scale
    A = A.reshape(3 * m, -1)
    every = np.ones(m, dtype=bool)
    rows = position_rows(model, free, train, misfit_shape(model, train), every, root)
    whole = A.T @ np.linalg.solve(V, A)
    np.testing.assert_allclose(rows.A.T @ rows.A, whole, rtol=1e-8, atol=1e-8 * np.abs(whole).max())
    F = estimator_gain(fit, train)[:, :, :3].transpose(1, 0, 2).reshape(-1, 3 * m)
    both = fit.full_covariance + stop_covariance(fit, train, root)
    own = both[np.ix_(free.free_index, free.free_index)]
    scale = np.sqrt(np.diagonal(own))
    np.testing.assert_allclose((F @ V @ F.T) / np.outer(scale, scale), own / np.outer(scale, scale),
                               atol=1e-6)  # fmt: skip
    # noise that is shared averages over fewer: the tool is known less well than by rows apart
    lever = predict(model, train).rows[0, :3]
    more = lever @ stop_covariance(fit, train, root) @ lever.T
    assert np.trace(more) > 0


def test_residuals_are_tested_by_the_noise_that_stops_share():
    """Against the covariance of all residuals, written out; of 56 sound arms with most of the noise
    in the joints 19 had a p above .95, and 4 have."""
    fit, train, _, (root, _), _ = campaign(3, 2)
    found = judged_by_stops(fit, train, root)
    stack = linearize(fit.model, train)
    A = stack.A[:, fit.parameters.free_index]
    M = np.eye(len(A)) - A @ fit.covariance @ A.T
    R = (table_whiteners(train) @ root)[:, :3].reshape(len(A), -1)
    stop = np.column_stack([train.pose_id, train.repeat])[stack.row_of]
    shared = (stop[:, None] == stop).all(axis=2) & (stack.row_of[:, None] != stack.row_of)
    V = M + M @ (R @ R.T * shared) @ M
    nu = np.trace(V) ** 2 / np.trace(V @ V)
    # the covariance of the numbers is solved to eight digits
    np.testing.assert_allclose(
        found.p_value, chdtrc(nu, fit.chi_square * nu / np.trace(V)), rtol=1e-5
    )
    again = judged_by_stops(found, train, root)
    assert (again.p_value, again.notes) == (found.p_value, found.notes)
    apart = replace(train, repeat=np.arange(len(train)))
    for same in (judged_by_stops(fit, train, 0 * root), judged_by_stops(fit, apart, root)):
        assert same is fit


def test_what_is_said_of_residuals_is_said_of_stops():
    """Notes by the p-value of rows apart give way, and the tests together have the new one."""
    fit, train, test, stops, _ = campaign(3)
    told = replace(
        fit, notes=("kept", *squared_notes(fit.chi_square, fit.dof_effective, 1.0, None))
    )
    found = judged_by_stops(replace(told, p_value=1.0), train, stops[0])
    p = found.p_value
    assert 0.0 < p < 1.0
    assert found.notes == ("kept", *squared_notes(fit.chi_square, fit.dof_effective, p, None))
    known = Circumstances(stops=stops)
    seen = judge(fit, test, train=train, circumstances=known)
    assert seen.questions.combined == fisher([p, seen.held_out.p_value])


def test_held_out_errors_are_judged_by_numbers_that_know_of_stops():
    """Of 50 arms with three targets, 12 % of the p-values were below .05, and 6 % are.

    p against the whole covariance of the first rows, written out.
    """
    fit, train, test, stops, _ = campaign(2)
    seen = judge(fit, test, train=train, circumstances=Circumstances(stops=stops)).held_out
    plain = judge(fit, test, train=train).held_out
    first = test.rows(np.unique(test.pose_id, return_index=True)[1])
    J = predict(fit.model, first).rows[:, :3].reshape(3 * TEST, -1)
    P = fit.full_covariance + stop_covariance(fit, train, stops[0])
    noise = scipy.linalg.block_diag(*first.covariance[:, :3, :3])
    e = seen.error.ravel()
    square = e @ np.linalg.solve(J @ P @ J.T + noise, e)
    # the numbers are in three units: solved to eight digits
    np.testing.assert_allclose(seen.chi_square, square, rtol=1e-8)
    np.testing.assert_allclose(seen.p_value, chdtrc(3 * TEST, square), rtol=1e-6)
    assert seen.chi_square < plain.chi_square


@pytest.mark.slow
def test_the_believed_region_of_several_targets_holds_the_truth():
    """Of the first target, at poses that nobody measured."""
    share = []
    for seed in range(ROBOTS):
        fit, train, test, stops, true = campaign(seed)
        belief = believe(fit, train, test, stops=stops)
        rng = np.random.default_rng(seed)
        there = kinds.points(true, kinds.joints("tx60", rng, 40), rng, reflector=0)
        share.append(belief.seen_regions(there).holds(kinds.places(true, there)).mean())
    assert np.mean(share) >= 0.94
