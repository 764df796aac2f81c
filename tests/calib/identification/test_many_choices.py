"""Models chosen for many robots and their extended fits, held to those of one after the other."""

import numpy as np
import pytest

from calib.geometry.joint_errors import JointErrors, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.ladders import ladders_of
from calib.identification.many.choices import choose_many
from calib.identification.many.extended import extended_many
from calib.identification.model_choice import choose, extended_by
from calib.identification.prior import Prior, weak_prior
from tests.calib import kinds
from tests.reference import rigid_truth, tx60

TX60 = tx60()
FREE = parameters_of(TX60)
LADDERS = ladders_of(TX60)
POSES, COUNT = 20, 4


def visits():
    """Tables of the same poses: of one arm that is rigid, of others with ever larger waves."""
    rng = np.random.default_rng(11)
    q, terms = kinds.joints("tx60", rng, POSES), harmonic_terms(6)
    true = [
        RobotModel(rigid_truth(rng).chain, JointErrors(terms, rng.normal(size=len(terms)) * size))
        for size in 2e-4 * np.arange(COUNT)
    ]
    return [kinds.poses(one, q, rng) for one in true]


def level(ladder, name):
    return next(one for of in LADDERS if of.name == ladder for one in of.levels if one.name == name)


def held_to(one, alone):
    """Every figure of a fit against that of the fit made alone."""
    u = alone.standard_uncertainty
    assert one.names == alone.names
    # both stop where 1e-10 standard deviations are left, of a noise as large as the residuals
    away = 1e-9 * max(1.0, np.sqrt(alone.chi_square / alone.dof))
    assert (one.step - alone.step) / u == pytest.approx(0, abs=away)
    assert (one.covariance - alone.covariance) / np.outer(u, u) == pytest.approx(0, abs=1e-9)
    # a step along the prior's pull changes the rows' part to first order, the whole sum to second
    assert one.chi_square == pytest.approx(alone.chi_square, rel=1e-9)
    assert one.trace[-1] == pytest.approx(alone.trace[-1], rel=1e-11)
    assert one.dof_effective == pytest.approx(alone.dof_effective, abs=1e-8)
    assert one.log_evidence == pytest.approx(alone.log_evidence, abs=1e-8)
    assert one.trace[0] == pytest.approx(alone.trace[0], rel=1e-9)
    assert one.notes == alone.notes
    assert one.reduction.practical_rank == alone.reduction.practical_rank
    assert one.prior.names == alone.prior.names
    assert one.prior.sd == pytest.approx(alone.prior.sd, rel=1e-14)


def test_extended_fits_are_those_of_each():
    """Of several levels, each robot with noise and start of its own; springs as well."""
    tables = visits()
    usual = [next(one for one in of.levels if one.usual) for of in LADDERS]
    springs = level("gravity", "sag by torques"), LADDERS[1].levels[0]
    levels = [usual, usual, usual, springs]
    factors, prior = [1.0, 1.7, 3.2, 1.1], weak_prior(FREE)
    near = extended_by(TX60, tables[1], FREE, usual, prior=prior)[1].model
    starts = [None, near, None, None]
    found = extended_many(TX60, tables, FREE, levels, prior=prior, factors=factors, starts=starts)
    for k, (wide, one) in enumerate(found):
        own, alone = extended_by(
            TX60, tables[k], FREE, levels[k], prior=prior, factor=factors[k], start=starts[k]
        )
        assert wide.names == own.names
        held_to(one, alone)
    # no bit of one hangs on who is beside it
    pair = extended_many(
        TX60, tables[1:3], FREE, levels[1:3], prior=prior, factors=factors[1:3],
        starts=starts[1:3],
    )  # fmt: skip
    for (_, one), (_, again) in zip(pair, found[1:3], strict=True):
        np.testing.assert_array_equal(one.step, again.step)
        np.testing.assert_array_equal(one.covariance, again.covariance)


def test_a_prior_of_numbers_that_hang_together_is_weighed_as_one():
    """Also in another order than that of the model, and with a mean of its own."""
    tables, rng = visits()[:2], np.random.default_rng(4)
    sd = weak_prior(FREE).sd
    skew = 0.2 * rng.normal(size=(len(sd), len(sd))) / np.sqrt(len(sd)) + np.eye(len(sd))
    precision = skew @ skew.T / np.outer(sd, sd)
    mean = 0.1 * sd * rng.normal(size=len(sd))
    prior = Prior.of_precision(mean[::-1], precision[::-1, ::-1], FREE.free_names[::-1])
    found = extended_many(
        TX60, tables, FREE, [()] * 2, prior=prior, factors=[2.0, 3.0], starts=[None] * 2
    )
    for (_, one), table, factor in zip(found, tables, (2.0, 3.0), strict=True):
        held_to(one, extended_by(TX60, table, FREE, (), prior=prior, factor=factor)[1])


def test_choices_are_those_of_each():
    tables = visits()
    found = choose_many(TX60, tables, FREE, ladders=LADDERS)
    for one, table in zip(found, tables, strict=True):
        alone = choose(TX60, table, FREE, ladders=LADDERS)
        assert (one.chosen, one.sentence) == (alone.chosen, alone.sentence)
        assert one.log_evidence == pytest.approx(alone.log_evidence, abs=1e-8)
        for fit, other in zip(one.identifications, alone.identifications, strict=True):
            held_to(fit, other)
    assert {one.chosen for one in found} == {"geometric", "extended"}
