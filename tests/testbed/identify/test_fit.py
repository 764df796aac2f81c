"""Geometric or extended: chosen within the training, priors weighed against the noise there is."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from calib.geometry.frames import exp_so3
from calib.geometry.joint_errors import JointErrors, gravity_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.climbing import ASKED
from calib.identification.identify import identify
from calib.identification.joint_models import extended_model, extended_parameters
from calib.identification.larger_noise import noise_factor
from calib.identification.model_choice import identify_extended
from calib.identification.prior import weak_prior
from calib.measurement.prediction import predict
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.errors import figures_of
from testbed.identify.fit import fit
from testbed.identify.records import Choice, RowErrors
from testbed.identify.session import scatter_root, with_scatter
from testbed.store.codec import pack, unpack
from tests.calib import kinds
from tests.calibrated import real, robot, session_of, table_of, true_model
from tests.reference import pool_r


def train_of(**how):
    noise = how.pop("noise", 1.0)
    return table_of(true_model(own_frames=True, **how), pool_r(60), noise=noise)


@pytest.mark.parametrize(("harmonics", "model"), [(0.0, "geometric"), (0.01, "extended")])
def test_joint_errors_are_chosen_when_they_are_there(harmonics, model):
    start = robot().model
    pairs, choice = fit(
        start,
        train_of(harmonics=harmonics),
        parameters_of(start),
        model="choose",
        loss="squared",
        seed=0,
    )
    assert choice.chosen == model
    assert choice.sentence.startswith(model)
    assert [name for name, *_ in pairs] == ["geometric", "extended"]
    assert len(choice.confirmation) == 2
    rows_say = {"approach", "torque", "gear", "lengths"}
    assert {offer.ladder for offer in choice.offered} == {"gravity", "waves"} | rows_say
    # 10 mdeg of harmonics move a TX60 by some 0.1 mm: geometry alone cannot follow
    assert (choice.confirmation[1] < 0.6 * choice.confirmation[0]) == (model == "extended")


def test_without_poses_enough_to_confirm_geometry_it_is():
    start, train = robot().model, train_of(harmonics=0.01)
    few = train.rows(np.arange(19))
    _, choice = fit(start, few, parameters_of(start), model="choose", loss="squared", seed=0)
    # the evidence asks, and on a measured UR10 was wrong: 0.9 mm before, 82 mm after
    assert choice.log_evidence > ASKED
    assert choice.chosen == "geometric"
    assert "fewer than 20 poses cannot confirm" in choice.sentence
    # what nobody left out is no number, and a record says so
    assert len(choice.confirmation) == 0
    assert np.isnan(choice.steps[0].before)
    again = unpack(Choice, pack(choice))
    assert np.isnan(again.steps[0].after)
    assert pack(again) == pack(choice)


def test_gravity_is_judged_where_the_arm_stands_not_in_the_trackers_frame():
    chain = true_model(harmonics=0.01, own_frames=True).chain
    turn = exp_so3(np.array([0.5, 0.0, 0.0]))
    figures = []
    for R in (np.eye(3), turn):
        tilted = np.eye(4)
        tilted[:3, :3] = R
        model = RobotModel(
            replace(chain, T_world_base=tilted @ chain.T_world_base),
            JointErrors(gravity_terms(6), np.radians([0.02, 0.01, 0.015])),
        )
        # without noise the second table is the first one, turned
        table = table_of(model, pool_r(60), noise=0.0)
        found = calibrate(robot(), session_of(table, model="extended"), Options(seed=1))
        names = found.fit.identification.names
        assert {"gravity2.upper", "gravity2.fore", "gravity3.fore"} <= set(names)
        figures.append(found.fit.test.position.mean)
    # micrometers of prior are left, and as many whichever way the tracker leans
    assert figures[1] == pytest.approx(figures[0], rel=1e-3)
    assert figures[0] < 2e-6


def test_a_prior_is_weighed_against_the_noise_that_the_residuals_have():
    start, train = robot().model, train_of(harmonics=0.01, noise=4.0)
    found = identify_extended(start, train, parameters_of(start))
    # the same: honest covariances and the weak prior as it is
    wide = extended_model(start)
    table = extended_parameters(start, wide, parameters_of(start))
    terms = weak_prior(table.freeing(set(wide.names) - set(start.names)), wide)
    first = identify(wide, train, table, prior=terms)
    factor = noise_factor(first.model, train)
    assert factor == pytest.approx(4.0, rel=0.1)
    honest = replace(train, covariance=train.covariance * factor**2)
    again = identify(wide, honest, table, prior=terms)
    # both minimize one function, up to a factor; both end within 1e-9 standard deviations
    np.testing.assert_allclose(
        found.step / found.standard_uncertainty, again.step / found.standard_uncertainty, atol=1e-6
    )
    assert found.chi_square == pytest.approx(again.chi_square * factor**2, rel=1e-9)


def test_with_honest_noise_the_weak_prior_stays_as_it_is():
    start, train = robot().model, train_of(harmonics=0.01)
    found = identify_extended(start, train, parameters_of(start))
    wide = extended_model(start)
    table = extended_parameters(start, wide, parameters_of(start))
    terms = weak_prior(table.freeing(set(wide.names) - set(start.names)), wide)
    assert np.array_equal(found.prior.sd, terms.sd)


def test_both_models_are_reported_and_the_better_one_is_handed_out():
    found = real()
    geometric, extended = found.fits
    assert (geometric.model, extended.model) == ("geometric", "extended")
    assert found.choice.chosen == "extended"
    errors = [fit.test.position.mean for fit in (extended, geometric)]
    assert errors == sorted(errors)
    assert errors[-1] < found.before_test.position.mean


def test_a_pose_of_several_rows_counts_once_in_every_figure():
    table = replace(train_of().rows(np.arange(4)), pose_id=np.array([0, 0, 1, 2]))
    missed = np.array([3e-3, 4e-3, 5e-3, 1e-3])
    errors = RowErrors(np.zeros((4, 3)), missed, missed)
    found = figures_of(errors, table, np.array([True, True, True, False]))
    first = np.sqrt((3e-3**2 + 4e-3**2) / 2)
    for one in (found.position, found.rotation):
        assert (one.mean, one.maximum) == pytest.approx(((first + 5e-3) / 2, 5e-3))
    assert found.median == pytest.approx((first + 5e-3) / 2)


def test_what_joints_scatter_is_that_of_the_target_the_station_and_the_distance():
    """Of every kind of row, against readings of an arm whose joints went aside one by one."""
    rng, sd, step = np.random.default_rng(4), 1e-5 * np.arange(1.0, 7.0), 1e-6
    true = kinds.true_robot("tx60", rng)
    table = kinds.everything(true, kinds.joints("tx60", rng, 4), rng)
    session = SimpleNamespace(joint_scatter=sd, measurements=table)
    root = scatter_root(session, true)
    here = predict(true, table).residual
    for joint in range(6):
        aside = replace(table, q=table.q + step * np.eye(6)[joint])
        moved = (here - predict(true, aside).residual) / step * sd[joint]
        # forward differences of 1e-6 rad, and angles whose residuals are some 1e-4
        np.testing.assert_allclose(root[:, :, joint], moved, atol=1e-3 * sd[joint])
    added = with_scatter(session, root)
    far = table.is_distance
    along = (root[far, 0] ** 2).sum(axis=1)
    np.testing.assert_allclose((added.covariance - table.covariance)[far, 0, 0], along, rtol=1e-6)
