"""Which statement is believed: sound fits, wrong models, wrong noise, and the words that say so."""

import dataclasses

import numpy as np
import pytest

from calib.geometry.joint_errors import JointErrors, gravity_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import Status, identify
from calib.uncertainty.bootstrap import bootstrap
from calib.uncertainty.conformal import conformal
from calib.uncertainty.discrepancy import discrepancy
from calib.uncertainty.held_out import held_out
from calib.uncertainty.tool_point import tool_statement
from calib.uncertainty.trust import trust
from calib.uncertainty.validation import LinearCheck
from tests.reference import DEG, WEN24, pool_r, rigid_truth, tx60
from tests.truth.measuring import measured

G = pool_r(40, seed=99)


def campaign(seed, droop=0.0, mode="whitened"):
    """Truth, fit, and what 40 held-out poses say."""
    rng = np.random.default_rng(seed)
    chain = rigid_truth(rng).chain
    sag = np.array([10, 6, 8]) * 1e-3 * DEG * droop
    truth = RobotModel(chain, JointErrors(gravity_terms(6), sag))
    q = pool_r()[:29]
    fit = identify(tx60(), measured(truth, q, rng), parameters_of(tx60(), WEN24), mode=mode)
    found = held_out(fit.model, fit.full_covariance, measured(truth, G, rng), q)
    return truth, fit, found


def test_what_is_known_to_be_missing_ends_belief_in_a_sound_fit():
    _, fit, found = campaign(3)
    ball = conformal(found.distance)
    verdict = trust(fit, held_out=found, conformal=ball, unmodelled=["the station wanders"])
    assert verdict.believe == "conformal"
    assert not verdict.model_valid
    assert verdict.sentences[0].endswith("not valid here: the station wanders")


def test_a_sound_fit_is_believed_and_says_why():
    _, fit, found = campaign(3)
    verdict = trust(fit, held_out=found, conformal=conformal(found.distance))
    assert verdict.believe == "model"
    assert verdict.model_valid
    assert verdict.sentence.startswith("The model-based interval may be believed")
    assert "40 held-out poses agree" in verdict.sentence
    assert "no held-out pose has tested it" in trust(fit).sentence


@pytest.mark.parametrize("seed", range(5))
def test_residuals_that_contradict_the_model_come_first_in_words(seed):
    truth, fit, found = campaign(seed, droop=3.0)
    assert fit.p_value < 1e-3
    radius = conformal(found.distance)
    verdict = trust(fit, held_out=found, discrepancy=discrepancy(found), conformal=radius)
    assert (verdict.believe, verdict.model_valid) == ("conformal", False)
    assert verdict.sentences[0].startswith("The model-based interval is not valid here: ")
    assert "the residuals contradict the model" in verdict.sentences[0]
    # and rightly so: at fresh poses the model-based region fails, the believed radius holds
    fresh = pool_r(200, seed=7)
    true = truth.poses(fresh)[:, :3, 3]
    stated = tool_statement(fit.model, fresh, fit.full_covariance)
    assert stated.holds(true).mean() < 0.7
    inside = np.linalg.norm(true - stated.position, axis=1) <= radius.radius
    assert inside.mean() > 0.85  # beta(39, 2): below .85 once in 1500
    # the discrepancy, second choice
    wide = tool_statement(fit.model, fresh, fit.full_covariance, discrepancy=discrepancy(found))
    assert wide.holds(true).mean() > 0.75


def test_without_held_out_poses_a_contradicted_fit_leaves_nothing_to_believe():
    _, fit, found = campaign(1, droop=3.0)
    assert trust(fit).believe == "none"
    assert "19 independent poses" in trust(fit).sentence
    assert trust(fit, discrepancy=discrepancy(found)).believe == "discrepancy"


def test_held_out_errors_can_fell_a_fit_whose_residuals_look_sound():
    _, fit, found = campaign(3)
    bad = dataclasses.replace(found, p_value=1e-9, chi_square=500.0)
    verdict = trust(fit, held_out=bad)
    assert not verdict.model_valid
    assert "errors at 40 held-out poses are larger than it says" in verdict.sentences[0]


def test_a_fit_that_did_not_converge_is_not_believed():
    _, fit, found = campaign(3)
    stuck = dataclasses.replace(fit, status=Status.LIMIT)
    verdict = trust(stuck, discrepancy=discrepancy(found))
    assert (verdict.believe, verdict.model_valid) == ("none", False)
    assert "iteration limit" in verdict.sentences[0]


def test_paper_mode_claims_are_not_believed():
    _, fit, _ = campaign(3, mode="paper")
    verdict = trust(fit)
    assert not verdict.model_valid
    assert "unweighted fit" in verdict.sentences[0]


def test_when_only_linearity_fails_the_replicates_are_believed():
    _, fit, _ = campaign(3)
    q = pool_r()[:29]
    run = bootstrap(
        fit.model,
        measured(fit.model, q, np.random.default_rng(0)),
        fit.parameters,
        np.random.default_rng(1),
        replicates=200,
    )
    good = trust(fit, bootstrap=run)
    assert good.believe == "model"
    assert "scatter as the stated covariance says" in good.sentence
    bent = dataclasses.replace(run, covariance=run.covariance / 4)
    verdict = trust(fit, bootstrap=bent)
    assert (verdict.believe, verdict.model_valid) == ("bootstrap", False)
    # replicates that did not arrive say nothing
    lost = dataclasses.replace(bent, unconverged=200)
    assert (trust(fit, bootstrap=lost).believe, trust(fit, bootstrap=lost).model_valid) == (
        "none",
        False,
    )
    failed = LinearCheck("not validated", np.ones(2), np.ones(2), "first-order is not validated")
    assert trust(fit, bootstrap=run, linear=failed).believe == "bootstrap"
    assert trust(fit, linear=failed).believe == "none"


def test_residuals_smaller_than_the_noise_are_said_to_make_the_interval_too_wide():
    _, fit, _ = campaign(3)
    assert "too wide" in trust(dataclasses.replace(fit, p_value=0.9999)).sentence
