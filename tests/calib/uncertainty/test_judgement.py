"""The one proof: the same numbers as its parts, none where they decide nothing, and short words."""

import dataclasses

import numpy as np
import pytest

from calib.calibration import calibrate
from calib.errors import InputError
from calib.geometry.chain import Chain
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import Status, identify
from calib.measurement.observations import joined
from calib.measurement.tables import points
from calib.uncertainty.bootstrap import bootstrap
from calib.uncertainty.conformal import conformal
from calib.uncertainty.discrepancy import discrepancy
from calib.uncertainty.held_out import held_out
from calib.uncertainty.judgement import Circumstances, judge
from calib.uncertainty.statement.believe import believe
from tests.reference import SIGMA_POSITION, WEN24, pool_r, rigid_truth, tx60
from tests.truth.measuring import measured


def measured_tables(count=40):
    """A fit, what it was identified from, and what was held out; all of one robot."""
    rng = np.random.default_rng(3)
    truth = rigid_truth(rng)
    train = measured(truth, pool_r()[:29], rng)
    test = measured(truth, pool_r(count, seed=99), rng)
    return identify(tx60(), train, parameters_of(tx60(), WEN24)), train, test


def test_a_judgement_is_what_its_parts_are_to_the_last_bit():
    fit, train, test = measured_tables()
    made = judge(fit, test, train=train, rng=np.random.default_rng(5), replicates=100)
    seen = held_out(fit.model, fit.full_covariance, test, train.q)
    played = bootstrap(fit.model, train, fit.parameters, np.random.default_rng(5), replicates=100)
    assert made.held_out.chi_square == seen.chi_square
    assert np.array_equal(made.discrepancy.covariance, discrepancy(seen).covariance)
    assert made.conformal == conformal(seen.distance)
    assert np.array_equal(made.bootstrap.estimates, played.estimates)
    belief = believe(fit, train, test)
    assert made.belief.factor == belief.factor
    assert made.belief.misfit.upper == belief.misfit.upper


def test_noise_that_nothing_measured_tells_is_misfit_in_the_region_and_noise_in_the_tests():
    fit, train, test = measured_tables()
    plain = judge(fit, test, train=train)
    half = (0.5 * train.covariance, 0.5 * test.covariance)
    found = judge(fit, test, train=train, circumstances=Circumstances(doubted=half))
    assert found.belief.misfit.p_value == plain.belief.misfit.p_value
    assert found.belief.misfit.upper > 1.5 * plain.belief.misfit.upper
    assert found.point.radius_mean > plain.point.radius_mean
    assert "all of that scatter counts as misfit" in found.belief.misfit.sentence
    nothing = (0.0 * train.covariance, 0.0 * test.covariance)
    again = judge(fit, test, train=train, circumstances=Circumstances(doubted=nothing))
    assert again.belief.misfit.upper == plain.belief.misfit.upper
    assert again.belief.factor == plain.belief.factor
    # repeats tell the noise: then nothing of it is doubted
    apart = np.sqrt(2) * SIGMA_POSITION * np.random.default_rng(6).normal(size=(29, 3))
    again = dataclasses.replace(train, repeat=train.repeat + 1, position=train.position + apart)
    visits = joined([train, again])
    told = Circumstances(visits=visits, doubted=half)
    repeated = judge(fit, test, train=train, circumstances=told)
    assert not repeated.belief.misfit.doubted


def test_noise_that_nobody_states_is_error_of_what_guards_unless_repeats_tell_it():
    fit, train, test = measured_tables()
    plain, found = (
        judge(fit, test, train=train, circumstances=Circumstances(unstated=one))
        for one in (False, True)
    )
    assert found.belief.misfit.upper == plain.belief.misfit.upper
    none = dataclasses.replace(test, covariance=1e-6 * test.covariance)
    belief = believe(fit, train, test, guarding=none)
    assert found.belief.factor == belief.factor > plain.belief.factor
    assert plain.point.radius_mean < found.point.radius_mean
    apart = np.sqrt(2) * SIGMA_POSITION * np.random.default_rng(6).normal(size=(29, 3))
    again = dataclasses.replace(train, repeat=train.repeat + 1, position=train.position + apart)
    visits = joined([train, again])
    told = [
        judge(fit, test, train=train, circumstances=Circumstances(visits=visits, unstated=one))
        for one in (False, True)
    ]
    assert told[0].belief.factor == told[1].belief.factor
    assert told[0].point.radius_mean == told[1].point.radius_mean


def test_a_drift_that_visits_show_is_at_every_tool_point_as_large_as_it_was():
    fit, train, test = measured_tables()
    plain = judge(fit, test, train=train, circumstances=Circumstances(target=(0.1, 0.0, 0.2)))
    known = Circumstances(target=(0.1, 0.0, 0.2), drifts=40e-6)
    found = judge(fit, test, train=train, circumstances=known)
    q, upper = pool_r(9, seed=5), (plain.belief.misfit.upper, found.belief.misfit.upper)
    assert upper[0] == upper[1]
    one, other = (each.belief.regions(q, target=(0.1, 0.0, 0.2)) for each in (plain, found))
    more = other.covariance - one.covariance
    # to rounding of the sum
    np.testing.assert_allclose(more, np.tile(40e-6**2 * np.eye(3), (9, 1, 1)), atol=1e-20)
    assert found.point.radius_mean > np.hypot(plain.point.radius_mean, 2 * 40e-6)
    with pytest.raises(InputError, match="drifts"):
        judge(fit, test, train=train, circumstances=Circumstances(drifts=-1e-6))


def test_the_order_of_rows_changes_no_statement():
    fit, train, test = measured_tables()
    made = judge(fit, test, train=train)
    turned = judge(fit, test.rows(np.arange(40)[::-1]), train=train)
    # sums in another order: some 1e-12 of a limit that is read off a grid
    assert turned.belief.misfit.upper == pytest.approx(made.belief.misfit.upper, rel=1e-9)
    assert turned.belief.factor == pytest.approx(made.belief.factor, rel=1e-9)
    assert turned.point.radius_mean == pytest.approx(made.point.radius_mean, rel=1e-6)


def test_several_rows_of_a_pose_count_once_by_the_worst():
    fit, train, test = measured_tables()
    off = 1e-3 * np.random.default_rng(4).normal(size=(40, 3))
    again = dataclasses.replace(test, position=test.position + off)
    once = judge(fit, again, train=train)
    for order in ([test, again], [again, test]):
        twice = judge(fit, joined(order), train=train)
        assert len(twice.held_out) == 40
        assert twice.conformal == once.conformal
        assert twice.belief.n_guards == 40
    twice = judge(fit, joined([test, again]), train=train)
    assert twice.held_out.chi_square == judge(fit, test, train=train).held_out.chi_square


def test_long_tails_of_the_residuals_are_said_and_a_robust_loss_is_proposed():
    fit, train, test = measured_tables()
    assert judge(fit, test, train=train).tails is None
    rng = np.random.default_rng(8)
    away = 3 * SIGMA_POSITION * rng.standard_t(2, (40, 1)) * rng.normal(size=(40, 3))
    far = dataclasses.replace(test, position=test.position + away)
    for loss, proposed in (("squared", True), ("huber", False)):
        again = identify(tx60(), train, parameters_of(tx60(), WEN24), loss=loss)
        made = judge(again, far, train=train)
        assert made.tails.source == ""
        assert made.strays is None  # the tails are those of all rows, not of a few
        assert "second visit of every pose" in made.trust.sentence
        assert ('With loss = "huber"' in made.trust.sentence) == proposed


def test_virtual_calibrations_are_played_only_where_they_decide_anything():
    fit, train, test = measured_tables()

    def played(fit, **options):
        rng = np.random.default_rng(5)
        return judge(fit, test, train=train, rng=rng, replicates=100, **options).bootstrap

    assert judge(fit, test, train=train).bootstrap is None
    assert played(fit) is not None
    for rejected in ({"status": Status.LIMIT}, {"p_value": 0.0}):
        changed = dataclasses.replace(fit, **rejected)
        assert played(changed) is None
        assert played(changed, rejected_too=True) is not None
    robust = dataclasses.replace(fit, loss="cauchy", weights=np.ones(len(train)))
    assert played(robust, rejected_too=True) is None


@pytest.mark.parametrize(
    ("count", "spread", "guards"), [(9, False, 0), (10, True, 0), (19, True, 19)]
)
def test_what_too_few_poses_cannot_state_is_left_out(count, spread, guards):
    fit, train, test = measured_tables(count)
    made = judge(fit, test, train=train)
    assert (made.discrepancy is not None, made.conformal is not None) == (spread, guards > 0)
    assert made.belief.n_guards == guards


def test_held_out_rows_in_another_frame_are_in_no_search_for_a_drift():
    fit, train, test = measured_tables()
    far = dataclasses.replace(test, position=test.position + np.array([0, 0, 1e-3]))
    order = (np.arange(29), 29 + np.arange(40))
    known = Circumstances(order=order, unmodelled=("the station wanders",))
    made = judge(fit, far, train=train, circumstances=known)
    none = dataclasses.replace(known, order=(order[0], order[1][:0]))
    alone = judge(fit, test.rows(np.zeros(0, int)), train=train, circumstances=none)
    assert made.frame.found
    assert made.belief.n_guards == 0
    assert np.array_equal(made.belief.covariance, alone.belief.covariance)


def test_no_pose_of_the_identification_may_judge_it():
    fit, train, _ = measured_tables()
    with pytest.raises(InputError, match="pose 0 of the identification"):
        judge(fit, train, train=train)


def test_what_is_known_of_the_campaign_is_in_the_statement():
    fit, train, test = measured_tables()
    shared = np.zeros((fit.model.n_numbers,) * 2)
    shared[0, 0] = (80e-6) ** 2
    known = Circumstances(shared=shared, repeatability=np.full(6, 200e-6), told_by="a test")
    plain, made = judge(fit, test, train=train), judge(fit, test, train=train, circumstances=known)
    assert np.isnan(plain.point.radius_move)
    assert made.point.radius_mean > plain.point.radius_mean
    assert made.point.radius_move > 1.1 * made.point.radius_mean
    assert "joint repeatability: a test" in made.trust.sentence
    assert made.belief.covariance[0, 0] == pytest.approx(
        fit.full_covariance[0, 0] + (80e-6) ** 2, rel=1e-12
    )


def test_all_visits_tell_the_noise_where_only_the_first_identify():
    """Noise stated half as large again as it is: repeats tell, and the limit falls less."""
    rng = np.random.default_rng(8)
    truth = rigid_truth(rng)
    visits = [measured(truth, pool_r()[:29], rng) for _ in range(3)]
    visits = [dataclasses.replace(v, repeat=np.full(29, k)) for k, v in enumerate(visits)]
    test = measured(truth, pool_r(40, seed=99), rng)
    large = [dataclasses.replace(v, covariance=2.25 * v.covariance) for v in visits]
    fit = identify(tx60(), large[0], parameters_of(tx60(), WEN24))
    known = Circumstances(visits=joined(large))
    told = judge(fit, test, train=large[0], circumstances=known).belief.misfit
    assert told.repeated
    # 174 degrees of freedom: 5 % of the scale, and what the residuals say of it
    assert told.noise_scale == pytest.approx(1 / 1.5, rel=0.15)
    assert "is untested" not in told.sentence


def test_words_are_short_in_a_shell_and_whole_in_a_summary():
    fit, train, test = measured_tables()
    made = judge(fit, test, train=train)
    assert repr(made).startswith("Judgement(believe='region', held-out poses: 40, radius: ")
    lines = made.summary().splitlines()
    assert [line.split(":")[0] for line in lines[:4]] == [
        "held-out poses",
        "discrepancy",
        "conformal radius",
        "believe",
    ]
    assert lines[-1] == made.trust.sentence
    nothing = judge(fit, test.rows(np.zeros(40, dtype=bool)), train=train)
    assert repr(nothing).startswith("Judgement(believe='region', held-out poses: 0, radius: ")


def test_a_stage_of_nanometers_is_not_said_to_be_right_to_nothing():
    """Whole micrometers would be zero of them: "lies within 0 um with 95 % probability"."""
    rng = np.random.default_rng(2)
    nominal = RobotModel(Chain([[0, 3e-3, 1e-3, -1.5, 0], [0, 0, 5e-3, 0, 0], [0, 0, 4e-3, 0, 0]]))
    arm = nominal.moved(rng.normal(scale=1e-6, size=nominal.n_numbers))
    q = rng.uniform(-1.5, 1.5, (60, 3))
    seen = arm.poses(q)[:, :3, 3] + rng.normal(scale=20e-9, size=(60, 3))
    train, test = points(q, seen, sd=20e-9).split(held_out=20)
    judged = calibrate(nominal, train).judge(test)
    size = 1e6 * judged.held_out.distance
    assert f"mean error {size.mean():.2g} um, largest {size.max():.2g} um" in judged.summary()
    assert f"lies within {1e6 * judged.conformal.radius:.2g} um with 95 %" in judged.summary()
    assert f"radius: {1e6 * judged.point.radius_mean:.2g} um" in repr(judged)
    assert " 0 um" not in judged.summary() + repr(judged)


def test_the_question_of_another_frame_is_asked_twice_and_counted_so():
    """Of a motion of the base and an offset of the target: Bonferroni."""
    fit, train, test = measured_tables()
    made = judge(fit, test, train=train)
    p = dict(zip(made.questions.names, made.questions.p_values, strict=True))["another frame"]
    assert p == min(1.0, 2 * min(made.frame.p_base, made.frame.p_tool))
    moved = dataclasses.replace(test, position=test.position + np.array([12e-6, 0, 0]))
    made = judge(fit, moved, train=train)
    p = dict(zip(made.questions.names, made.questions.p_values, strict=True))["another frame"]
    assert 0 < p == 2 * min(made.frame.p_base, made.frame.p_tool) < 0.5
