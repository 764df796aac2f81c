"""Fits of many robots at once, held to `identify`, one after the other, and to the rows of each."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.joint_errors import JointErrors, harmonic_terms
from calib.geometry.many import ManyModels
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.identification.joint_models import extended_parameters, with_joint_terms
from calib.identification.many import fit
from calib.identification.many.fit import blocks, fit_many
from calib.identification.many.single import identify_many
from calib.identification.many.tables import (
    ManyRows,
    ManyTables,
    known_to_many,
    position_rows,
    twelve_rows,
)
from calib.identification.prior import Prior, weak_prior
from calib.measurement.noise import with_joint_noise
from calib.measurement.residual import linearize, paper_stack
from tests.calib.kinds import ARMS
from tests.reference import DEG, READABLE30, WEN24, pool_r, rigid_truth, tx60
from tests.truth.measuring import measured

POOL = pool_r()
TX60 = tx60()
ROUNDING = 1e-12
"""Of whitened rows: metres in double precision over a noise of micrometres, times a few."""


def robots(count, rng, wide=TX60):
    """True robots, with joint errors where the model has terms."""
    found = [rigid_truth(rng) for _ in range(count)]
    K = len(wide.joint_errors.terms)
    errors = [JointErrors(wide.joint_errors.terms, rng.normal(size=K) * 2e-5) for _ in found]
    return (
        [RobotModel(one.chain, own) for one, own in zip(found, errors, strict=True)] if K else found
    )


def visits(count, poses=14, *, own=False, scatter=0.0, seed=3, wide=TX60):
    """One table of each robot, of the same poses or of poses of its own."""
    rng = np.random.default_rng(seed)
    true, q, found = robots(count, rng, wide), POOL[:poses], []
    for robot in true:
        at = POOL[rng.choice(len(POOL), poses)] if own else q
        table = measured(robot, at, rng)
        if scatter:
            stated = with_joint_noise(TX60, at, table.covariance, np.full(6, scatter))
            table = type(table)(
                **{name: getattr(table, name) for name in table.__slots__ if name != "covariance"},
                covariance=stated,
            )
        found.append(table)
    if not own:  # one plan
        found = [
            type(t)(
                **{n: getattr(found[0] if n in ("q", "covariance") else t, n) for n in t.__slots__}
            )
            for t in found
        ]
    return found


def moved(model, count, seed=0):
    """Robots anywhere near a model, one by one and together."""
    rng = np.random.default_rng(seed)
    steps = rng.normal(size=(count, model.n_numbers)) * np.where(model.is_length, 1e-3, 0.3 * DEG)
    return [model.moved(step) for step in steps], ManyModels.of(model, count).moved(steps), steps


@pytest.mark.parametrize("arm", ARMS)
def test_many_models_move_and_stand_as_each_does_alone(arm):
    chain = ARMS[arm]
    n = chain.n_joints
    model = RobotModel(chain, JointErrors(harmonic_terms(n)))
    alone, many, steps = moved(model, 3)
    q = np.random.default_rng(1).uniform(-1, 1, (3, 5, n))
    assert many.steps() == pytest.approx(steps, abs=ROUNDING)
    for k, one in enumerate(alone):
        assert many.poses(q)[k] == pytest.approx(one.poses(q[k]), abs=ROUNDING)
        assert many.poses(q[:1])[k] == pytest.approx(one.poses(q[0]), abs=ROUNDING)
        assert many.one(k).poses(q[k]) == pytest.approx(one.poses(q[k]), abs=ROUNDING)
        assert many.some([k]).steps()[0] == pytest.approx(steps[k], abs=ROUNDING)


@pytest.mark.parametrize("arm", ARMS)
def test_points_and_their_derivatives_are_those_of_each_model(arm):
    n = ARMS[arm].n_joints
    model = RobotModel(ARMS[arm], JointErrors(harmonic_terms(n)))
    alone, many, _ = moved(model, 3)
    q = np.random.default_rng(1).uniform(-1, 1, (3, 5, n))
    rng, target = np.random.default_rng(2), np.array([0.1, -0.2, 0.3])
    free = np.sort(rng.choice(model.n_numbers, model.n_numbers // 2, replace=False))
    for offset in (np.zeros(3), target):
        point, J = position_rows(many, q, free, offset)
        for k, one in enumerate(alone):
            T, whole = one.poses_and_jacobian(q[k])
            arm_ = T[:, :3, :3] @ offset
            rows = whole[:, :3] + np.cross(whole[:, 3:], arm_[:, :, None], axis=1)
            seen = point[k].T
            assert seen == pytest.approx(T[:, :3, 3] + arm_, abs=ROUNDING)
            assert np.moveaxis(J[k], 2, 0).swapaxes(1, 2) == pytest.approx(
                rows[:, :, free], abs=ROUNDING
            )


@pytest.mark.parametrize(("own", "scatter"), [(False, 0.0), (True, 0.0), (True, 1e-4)])
def test_rows_are_those_of_each_table(own, scatter):
    """Also with full covariances, and with terms of joints whose own column is held."""
    wide, _, _ = with_joint_terms(TX60, parameters_of(TX60))
    tables = visits(3, own=own, scatter=scatter)
    alone, many, _ = moved(wide, 3)
    free = np.array([3, 7, 16, *range(44, wide.n_numbers)])
    r, A, _ = ManyRows.of(wide, ManyTables.of(tables), free, "whitened").at(many)
    for k, one in enumerate(alone):
        stack = linearize(one, tables[k])
        size = np.abs(stack.A[:, free]).max()
        # a table has its rows pose by pose, many robots number by number
        own_r, own_A = stack.r.reshape(-1, 6), stack.A[:, free].reshape(-1, 6, len(free))
        left = r[k].reshape(6, -1).T
        assert left == pytest.approx(own_r, abs=1e-9 * np.abs(own_r).max())
        found = np.moveaxis(A[k].reshape(len(free), 6, -1), 0, 2).swapaxes(0, 1)
        assert found == pytest.approx(own_A, abs=ROUNDING * size)


def test_rows_of_the_paper_have_its_normal_equations_and_sum_of_squares():
    tables = ManyTables.of(visits(2, own=True))
    alone, many, _ = moved(TX60, 2)
    free = parameters_of(TX60, WEN24).free_index
    r, A, _ = ManyRows.of(TX60, tables, free, "paper").at(many)
    square = twelve_rows(many, tables)
    for k, (one, table) in enumerate(zip(alone, visits(2, own=True), strict=True)):
        stack = paper_stack(one, table)
        H = stack.A[:, free]
        assert A[k] @ A[k].T == pytest.approx(H.T @ H, rel=1e-9, abs=1e-9 * np.abs(H.T @ H).max())
        assert A[k] @ r[k] == pytest.approx(H.T @ stack.r, rel=1e-9, abs=1e-6)
        assert square[k] == pytest.approx(stack.r @ stack.r, rel=1e-12)


def held_to_identify(nominal, tables, parameters, mode="whitened", prior=None, start=None):
    """Every figure of every fit against that of `identify`."""
    found = fit_many(
        nominal, ManyTables.of(tables), parameters, mode=mode, prior=prior, start=start
    )
    assert found.converged.all()
    for k, table in enumerate(tables):
        one = identify(nominal, table, parameters, mode=mode, prior=prior)
        assert one.names == parameters.free_names
        u = one.standard_uncertainty
        # both stop where 1e-10 standard deviations are left
        assert (found.steps[k] - one.step) / u == pytest.approx(0, abs=1e-9)
        away = (found.covariance[k] - one.covariance) / np.outer(u, u)
        assert away == pytest.approx(0, abs=1e-9)
        assert found.standard_uncertainty[k] == pytest.approx(u, rel=1e-9)
        assert found.chi_square[k] == pytest.approx(one.chi_square, rel=1e-11, nan_ok=True)
        assert found.dof[k] == pytest.approx(one.dof_effective, abs=1e-8)
        assert found.p_value[k] == pytest.approx(one.p_value, rel=1e-8, nan_ok=True)
        assert found.variance[k] == pytest.approx(one.variance, rel=1e-9)
        assert found.log_evidence[k] == pytest.approx(one.log_evidence, abs=1e-8, nan_ok=True)
        assert found.models.one(k).poses(POOL[:3]) == pytest.approx(
            one.model.poses(POOL[:3]), abs=1e-13
        )


@pytest.mark.parametrize("own", [False, True])
@pytest.mark.parametrize("mode", ["whitened", "paper"])
def test_each_fit_is_the_one_that_identify_finds(mode, own):
    names = READABLE30 if mode == "whitened" else WEN24
    held_to_identify(TX60, visits(3, own=own), parameters_of(TX60, names), mode)


def test_a_start_and_joint_scatter_change_no_answer():
    tables, parameters = visits(3, scatter=1e-5), parameters_of(TX60, READABLE30)
    start = identify(TX60, tables[0], parameters).model
    held_to_identify(TX60, tables, parameters, start=start)


@pytest.mark.parametrize("believed", [False, True])
@pytest.mark.parametrize("own", [False, True])
def test_no_bit_of_a_fit_hangs_on_the_others(own, believed):
    tables, parameters = visits(5, own=own), parameters_of(TX60, READABLE30)
    prior = weak_prior(parameters) if believed else None
    together, *parts = (
        fit_many(TX60, ManyTables.of(some), parameters, prior=prior, shared=not own)
        for some in (tables, tables[:1], tables[1:])
    )
    for name in ("steps", "covariance", "chi_square", "certificate"):
        both = np.concatenate([getattr(part, name) for part in parts])
        np.testing.assert_array_equal(getattr(together, name), both)


def test_models_of_many_numbers_are_fitted_few_at_a_time(monkeypatch):
    for count, f in ((1, 5), (40, 30), (33, 90), (7, 426), (3, 2000)):
        parts = blocks(count, f)
        assert np.array_equal(
            np.concatenate([np.arange(count)[part] for part in parts]), range(count)
        )
        assert all(part.stop - part.start in (1, min(32, fit.ENTRIES // f**2)) for part in parts)

    def fitted(entries):
        monkeypatch.setattr(fit, "ENTRIES", entries)
        tracemalloc.start()
        found = fit_many(TX60, tables, parameters)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return found, most

    tables, parameters = ManyTables.of(visits(24)), parameters_of(TX60, READABLE30)
    (few, low), (all_, high) = fitted(900), fitted(24 * 900)
    np.testing.assert_array_equal(few.covariance, all_.covariance)
    np.testing.assert_array_equal(few.steps, all_.steps)
    # columns and residuals of one robot instead of 24; results and tables of all stay
    assert low < 0.6 * high


def test_geometry_and_joint_terms_under_a_prior_are_those_of_identify():
    free = parameters_of(TX60)
    held_to_identify(TX60, visits(2), free, prior=weak_prior(free))
    wide, table, _ = with_joint_terms(TX60, free)
    belief = weak_prior(extended_parameters(TX60, wide, free), wide)
    mean = np.random.default_rng(4).normal(size=len(belief.sd)) * belief.sd
    rotated = Prior(mean[::-1], belief.sd[::-1], belief.names[::-1])
    held_to_identify(wide, visits(2, wide=wide), table, prior=rotated)


def test_a_robot_that_no_table_can_tell_is_left_to_identify():
    tables = visits(3, own=True)
    still = type(tables[1])(
        **{n: getattr(tables[1], n) if n != "q" else np.tile(POOL[:1], (14, 1))
           for n in tables[1].__slots__}
    )  # fmt: skip
    seen = [tables[0], still, tables[2]]
    found = fit_many(TX60, ManyTables.of(seen), parameters_of(TX60, READABLE30))
    assert found.converged.tolist() == [True, False, True]


def test_noise_free_tables_give_the_truth():
    rng = np.random.default_rng(5)
    true = robots(2, rng)
    tables = ManyTables.of(visits(2))
    T = np.array([one.poses(POOL[:14]) for one in true])
    exact = ManyTables.read(tables.q, T[:, :, :3, 3], T[:, :, :3, :3], tables.covariance)
    found = fit_many(TX60, exact, parameters_of(TX60, WEN24))
    assert found.converged.all()
    for k, one in enumerate(true):
        step = TX60.step_to(one)[parameters_of(TX60, WEN24).free_index]
        assert found.steps[k] == pytest.approx(step, abs=1e-12)


def test_what_many_fits_do_not_know_is_refused_in_a_sentence():
    from calib.geometry.joint_errors import JointTerm

    grown = RobotModel(TX60.chain, JointErrors((JointTerm("lengths", -1, "lengths", (0,) * 6),)))
    assert not known_to_many(grown)
    assert known_to_many(TX60)
    tables = ManyTables.of(visits(2))
    with pytest.raises(InputError, match="springs of the stiff arm alone"):
        fit_many(grown, tables, parameters_of(grown))
    few = ManyTables.of(visits(2, poses=4))
    with pytest.raises(InputError, match="24 rows for 24 unknowns"):
        fit_many(TX60, few, parameters_of(TX60, WEN24))


@pytest.mark.parametrize("believed", [False, True])
def test_identifications_made_together_say_what_each_says_alone(believed):
    """Also of a table that no model explains, whose chi-square is told in the notes."""
    free, tables = parameters_of(TX60), visits(3)
    tables[2] = replace(
        tables[2], position=tables[2].position + np.eye(3)[POOL[:14, 0].argsort() % 3] * 1e-4
    )
    prior = weak_prior(free) if believed else None
    found = identify_many(TX60, tables, free, prior=prior)
    assert any("chi-square is" in note for note in found[2].notes)
    for one, table in zip(found, tables, strict=True):
        alone = identify(TX60, table, free, prior=prior)
        assert one.names == alone.names
        assert one.notes == alone.notes
        assert (one.dof, one.rank, one.status) == (alone.dof, alone.rank, alone.status)
        assert one.residual == pytest.approx(alone.residual, abs=1e-8)
        assert one.trace[-1] == pytest.approx(alone.trace[-1], rel=1e-11)
        assert one.trace[0] == pytest.approx(alone.trace[0], rel=1e-9)
        assert one.log_evidence == pytest.approx(alone.log_evidence, abs=1e-8, nan_ok=True)
        assert one.reduction.kept == alone.reduction.kept
        assert one.lack_of_fit is None
        assert (one.step - alone.step) / alone.standard_uncertainty == pytest.approx(0, abs=1e-9)
    own = identify_many(TX60, visits(2, own=True), free, prior=prior)
    for one, table in zip(own, visits(2, own=True), strict=True):
        assert np.array_equal(one.step, identify(TX60, table, free, prior=prior).step)
