"""What is believed, what the tests say of it, and the words: sound fits, wrong models and noise."""

import dataclasses

import numpy as np
import pytest

from calib.geometry.joint_errors import JointErrors, gravity_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import Status, identify
from calib.uncertainty.judgement import Circumstances, judge
from calib.uncertainty.outlying.poses import Strays
from calib.uncertainty.tool_point import tool_statement
from calib.uncertainty.trust import trust
from calib.uncertainty.validation import LinearCheck
from tests.reference import DEG, WEN24, pool_r, rigid_truth, tx60
from tests.truth.measuring import measured


def campaign(seed, droop=0.0, mode="whitened", held_out=40):
    """True robot, fit, and the tables identified from and held out."""
    rng = np.random.default_rng(seed)
    chain = rigid_truth(rng).chain
    sag = np.array([10, 6, 8]) * 1e-3 * DEG * droop
    truth = RobotModel(chain, JointErrors(gravity_terms(6), sag))
    train = measured(truth, pool_r()[:29], rng)
    test = measured(truth, pool_r(held_out, seed=99), rng)
    return truth, identify(tx60(), train, parameters_of(tx60(), WEN24), mode=mode), train, test


def test_a_sound_fit_says_what_is_believed_and_that_no_test_proves_it():
    _, fit, train, test = campaign(3)
    made = judge(fit, test, train=train)
    assert (made.trust.believe, made.trust.refuted) == ("region", False)
    radius = f"{1e6 * made.point.radius_mean:#.3g} um of the predicted one with 95 % probability"
    first, *rest = made.trust.sentences
    assert first.startswith(f"The mean tool point lies within {radius} (3-D radius")
    assert first.endswith(" um per axis")
    assert "though that is no proof" in rest[-1]
    assert "40 held-out poses guard the coverage factor" in made.trust.sentence
    assert "stated noise is untested" in made.trust.sentence


def test_without_held_out_poses_the_region_says_that_nothing_guards_it():
    _, fit, train, test = campaign(3)
    made = judge(fit, test.rows([]), train=train)
    assert made.trust.believe == "region"
    assert (
        "instead; 19 poses drawn from where the robot is used would guard it" in made.trust.sentence
    )
    assert "poses like the 29 identified from" in made.trust.sentence


@pytest.mark.parametrize("seed", range(3))
def test_a_model_that_lacks_sag_is_refuted_and_the_region_holds_all_the_same(seed):
    truth, fit, train, test = campaign(seed, droop=3.0)
    assert fit.p_value < 1e-3
    made = judge(fit, test, train=train)
    assert (made.trust.believe, made.trust.refuted) == ("region", True)
    assert "The parameters alone do not explain the readings: the residuals" in made.trust.sentence
    assert "the readings show a misfit of about" in made.trust.sentence.lower()
    # and rightly so: at fresh poses the parameters alone fail, the believed region holds
    fresh = pool_r(200, seed=7)
    true = truth.poses(fresh)[:, :3, 3]
    assert tool_statement(fit.model, fresh, fit.full_covariance).holds(true).mean() < 0.7
    assert made.belief.regions(fresh).holds(true).mean() > 0.9  # one robot: its poses hang together
    within = np.linalg.norm(true - fit.model.poses(fresh)[:, :3, 3], axis=1)
    assert (within <= made.point.radius_mean).mean() > 0.9


def test_held_out_errors_can_refute_a_fit_whose_residuals_look_sound():
    _, fit, train, test = campaign(3)
    off = dataclasses.replace(
        test, position=test.position + np.random.default_rng(0).normal(size=(40, 3)) * 200e-6
    )
    made = judge(fit, off, train=train)
    assert made.trust.refuted
    assert "errors at 40 held-out poses are larger than predicted" in made.trust.sentence
    assert made.belief.misfit.upper > 100e-6


def test_held_out_poses_of_another_frame_are_no_evidence_and_come_first_in_words():
    _, fit, train, test = campaign(3)
    moved = dataclasses.replace(test, position=test.position + np.array([0, 0, 2e-3]))
    made = judge(fit, moved, train=train)
    assert made.trust.sentences[0].startswith("The held-out rows are off as a whole by ")
    # noise of 20 um over 40 poses, and the fit's own
    assert abs(made.frame.size - 2e-3) < 2e-5
    assert made.belief.n_guards == 0
    alone = judge(fit, test.rows([]), train=train)
    assert made.belief.misfit.upper == alone.belief.misfit.upper
    assert not made.point.held_out


def test_a_motion_that_the_region_holds_is_said_to_be_in_it():
    _, fit, train, test = campaign(3)
    made = judge(fit, test, train=train)
    asked = dataclasses.replace(made.questions, p_values=(0.5, 1e-4))
    small = dataclasses.replace(made.frame, p_base=1e-4, within=1.0)
    verdict = trust(
        fit, belief=made.belief, point=made.point, questions=asked, held_out=made.held_out,
        frame=small,
    )  # fmt: skip
    # the smaller of two p-values, twice
    answer = "shows another frame, by less than the region allows for (p = 0.0002)"
    assert answer in verdict.sentence


def test_tests_are_named_in_plain_words_and_those_of_a_shot_apart():
    """A shot too small for chi-square of all poses stands out, and nothing else is contradicted."""
    _, fit, train, test = campaign(3)
    made = judge(fit, test, train=train)
    parts = {"belief": made.belief, "point": made.point, "held_out": made.held_out}
    asked = dataclasses.replace(made.questions, names=("misfit", "drift"), p_values=(1e-4, 1e-5))
    both = trust(fit, **parts, questions=asked)
    assert "shows a misfit and a drift (p " in both.sentences[-1]
    one = Strays(np.array([7]), 151e-6, 35e-6, 39, 0.5)
    shot = trust(fit, **parts, questions=made.questions, strays=one)
    assert shot.sentences[0].startswith("Held-out pose 7 stands out: its error is 151 um")
    assert shot.sentences[-1].startswith("Apart from what stands out: no test of the residuals and")
    nothing = trust(fit, belief=None, point=None, questions=made.questions, strays=one)
    assert nothing.sentences[0].startswith("No statement about the tool point is believed")
    assert nothing.sentences[1].startswith("Held-out pose 7")


def test_a_turn_too_small_to_be_written_is_not_said_to_be_zero():
    _, fit, train, test = campaign(3)
    frame = judge(fit, test, train=train).frame
    turns = {1e-4: "", 7e-4: " and 0.001 deg", 17.7: " and 17.7 deg"}
    for degrees, said in turns.items():
        turn = np.radians([0.0, degrees, 0.0])
        moved = dataclasses.replace(frame, size=5e-5, turn=turn, p_base=0.0, at_tool=False)
        assert f"off as a whole by 50 um{said} (another base" in moved.sentence


@pytest.mark.parametrize(
    ("p", "said"), [(0.0, "< 0.001"), (1.4e-7, "< 0.001"), (2.4e-4, "= 0.00024")]
)
def test_a_tiny_p_value_is_only_called_small(p, said):
    """Nobody knows the tails of a noise so far out."""
    _, fit, train, test = campaign(3)
    made = judge(fit, test, train=train)
    refuted = dataclasses.replace(made.held_out, p_value=p)
    verdict = trust(
        fit, belief=made.belief, point=made.point, questions=made.questions, held_out=refuted,
        frame=made.frame,
    )  # fmt: skip
    assert f"p {said})" in verdict.sentence


def test_nothing_is_believed_of_a_fit_that_did_not_converge():
    _, fit, train, test = campaign(3)
    made = judge(dataclasses.replace(fit, status=Status.LIMIT), test, train=train)
    assert (made.trust.believe, made.belief, made.point) == ("none", None, None)
    assert "iteration limit" in made.trust.sentences[0]
    assert "A number that needs no model: a further reading" in made.trust.sentences[1]


def test_nothing_is_believed_of_an_unweighted_fit():
    _, fit, train, test = campaign(3, mode="paper")
    made = judge(fit, test, train=train)
    assert (made.trust.believe, made.trust.refuted) == ("none", True)
    assert "unweighted fit" in made.trust.sentences[0]


def test_where_linear_propagation_fails_the_parameters_part_is_that_of_the_replicates():
    _, fit, train, test = campaign(3)
    failed = LinearCheck("not validated", np.ones(2), np.ones(2), "first-order is not validated")
    plain = judge(fit, test, train=train)
    rng = np.random.default_rng(1)
    played = judge(fit, test, train=train, rng=rng, replicates=200, linear=failed)
    assert (played.trust.believe, played.trust.refuted) == ("region", True)
    assert "the part of the parameters is taken from virtual calibrations" in played.trust.sentence
    index = fit.parameters.free_index
    part = played.belief.covariance[np.ix_(index, index)]
    np.testing.assert_allclose(part, played.bootstrap.empirical, rtol=1e-12)
    assert np.array_equal(plain.belief.covariance, fit.full_covariance)
    # without replicates that settled nothing is left
    assert judge(fit, test, train=train, linear=failed).trust.believe == "none"
    assert judge(fit, test, train=train, linear=failed).belief is None


def test_a_drift_is_in_the_region_and_one_that_is_known_is_looked_for_whatever_a_test_says():
    _, fit, train, test = campaign(3)
    order = (np.arange(len(train)), len(train) + np.arange(len(test)))
    none = judge(fit, test, train=train, circumstances=Circumstances(order=order))
    assert none.drifting.drift is None
    known = Circumstances(order=order, unmodelled=("the station wanders",))
    made = judge(fit, test, train=train, circumstances=known)
    assert made.trust.sentences[-1].endswith("covered by the stated noise: the station wanders")
    assert made.drifting.drift is not None
    grown = made.belief.covariance - none.belief.covariance
    np.testing.assert_allclose(grown, made.drifting.drift.covariance, atol=1e-20)
    slow = np.cumsum(np.random.default_rng(2).normal(size=(69, 3)), axis=0) * 10e-6
    walked = dataclasses.replace(train, position=train.position + slow[:29])
    there = dataclasses.replace(test, position=test.position + slow[29:])
    refit = identify(tx60(), walked, parameters_of(tx60(), WEN24))
    seen = judge(refit, there, train=walked, circumstances=Circumstances(order=order))
    assert seen.drifting.p_value < 0.05
    assert "uccessive readings are correlated" in seen.trust.sentence


def test_where_virtual_calibrations_settled_it_is_the_misfit_that_bounds_nothing():
    """Theirs is the covariance then: that they bend is no reason to state nothing."""
    _, fit, train, test = campaign(3)
    made = judge(fit, test, train=train, rng=np.random.default_rng(0), replicates=100)
    bent = dataclasses.replace(made.bootstrap, estimates=3.0 * made.bootstrap.estimates)
    said = {
        off: trust(
            fit, belief=None, point=None, questions=made.questions,
            bootstrap=dataclasses.replace(bent, unconverged=off),
        ).sentences[0]
        for off in (0, 100)
    }  # fmt: skip
    assert not bent.agrees
    assert said[0].endswith("too few measurements to bound what the model may miss")
    assert "linear propagation does not hold" in said[100]
