"""What may be believed of a calibration: sources, shots, held-out poses, and the words for it."""

import re
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy import stats

from calib.errors import InputError
from calib.geometry.operating import AS_USUAL
from calib.uncertainty.discrepancy import Discrepancy
from calib.uncertainty.outlying.poses import Strays
from calib.uncertainty.tool_point import tool_statement
from testbed.laboratory.tracker.of_scenario import bias_size
from testbed.laboratory.truth.laboratory import open_laboratory
from testbed.laboratory.truth.setting import make_setting
from testbed.robots.catalog import load_robot
from testbed.scenario.read import changed
from testbed.store.codec import pack, unpack
from testbed.store.quantities import as_json
from testbed.studies import load_scenario
from testbed.studies.trial import plots_uncertainty
from testbed.studies.trial.advice import errors_in_words, next_step
from testbed.studies.trial.compare import attained, target_prediction
from testbed.studies.trial.estimator import estimator_for
from testbed.studies.trial.play import validation_visit
from testbed.studies.trial.plots_uncertainty import tool_views
from testbed.studies.trial.records import Campaign, Trial
from testbed.studies.trial.report_secret import secret_section
from testbed.studies.trial.results import statement_headline, truth_headline
from testbed.studies.trial.statement.linear_check import linear_check, moved_targets, moving_axes
from testbed.studies.trial.statement.regions import honest_share
from testbed.studies.trial.statement.report import answer, question_table, reasons, statement_blocks
from testbed.studies.trial.statement.sources import drift_left
from testbed.studies.trial.statement.state import sound_held_out, state
from testbed.studies.trial.verdict import BAD, GOOD, judge, trial_verdict
from tests import campaign
from tests.calib.uncertainty.test_sprung import calibrated
from tests.campaign import record_hash
from tests.testbed.run.test_campaign import same

SMALL: dict[str, Any] = {
    "pool.size": 70,
    "uncertainty.repeats": 3,
    "uncertainty.replications": 0,
    "studies.random_sets": 0,
    "identification.estimators": ["whitened"],
}
AT960 = {"preset": "at960"}
LOOSE = {"preset": "at960", "outliers": 3, "missed": 2}


def played(poses: int = 29, **changes: Any) -> Campaign:
    """Quick with one random trial and other keys, played; dots are written as two underscores."""
    keys = {name.replace("__", "."): value for name, value in changes.items()}
    trial = [{"name": "one", "poses": poses, "method": "random"}]
    scenario = changed(load_scenario("quick"), {**SMALL, "trial": trial, **keys})
    return campaign.played(scenario)


@cache
def rigid() -> Campaign:
    return played()


@cache
def sagging() -> Campaign:
    return played(truth={"preset": "wen2022"})


@cache
def at960() -> Campaign:
    return played(tracker=AT960, truth={"preset": "rigid"})


@cache
def systematic() -> Campaign:
    return played(tracker={**AT960, "systematic": True}, truth={"preset": "rigid"})


@cache
def loose() -> Campaign:
    """Three wrong shots and two missed ones in each visit, and a loss that expects them."""
    return played(61, tracker=LOOSE, identification__loss="cauchy")


def estimate(of: Campaign):
    return of.trials[0].estimates[0]


def visits(of: Campaign):
    bench = open_laboratory(of.scenario, of.setting)
    chosen = of.trials[0].selection.indices
    span = len(chosen) * bench.tracker.pose_time
    return bench, [bench.measure_pool(chosen, "visit", "one", repeat=k, start=k * span)
                   for k in range(of.scenario.uncertainty.repeats)]  # fmt: skip


def test_on_a_rigid_robot_the_region_is_believed_and_holds_the_truth():
    told = estimate(rigid()).statement
    assert told.trust.believe == "region"
    assert not told.trust.refuted
    assert told.names == ("region", "parameters", "bootstrap", "discrepancy", "conformal")
    # points of one robot share its parameter error: the share may be far from 95 %
    assert told.attained.min() > 0.8
    assert told.honest < told.attained[0]
    assert told.radius[0] == told.point.radius_mean > told.radius[1]
    # joints of this scenario come back exactly
    assert np.isnan(told.point.u_move)
    assert "nothing is stated about single moves" in " ".join(reasons(told)).lower()
    assert told.bootstrap.agrees
    assert told.linear.validated
    assert told.lack_of_fit.p_value > 1e-3
    assert told.held_out.p_value > 1e-3
    assert not judge(rigid().trials[0], estimate(rigid())).contradicted


def test_where_joints_sag_the_misfit_is_in_the_region_and_the_parameters_alone_are_refuted():
    trial, one = sagging().trials[0], estimate(sagging())
    told, verdict = one.statement, judge(trial, one)
    share = dict(zip(told.names, told.attained, strict=True))
    assert told.trust.believe == "region"
    assert told.trust.refuted
    assert share["parameters"] < 0.2 < 0.9 < share["region"]
    assert told.belief.misfit.best > 3e-5
    assert told.questions.said == ("misfit",)
    assert verdict.believable
    assert f"within {told.point.radius_mean * 1e6:.3g} um of the predicted one" in verdict.sentence
    assert "with 95 % probability (3-D radius" in verdict.sentence
    assert verdict.mark == GOOD
    said = told.trust.sentence
    assert "The readings show a misfit" in said
    assert "The parameters alone do not explain the readings" in said
    # which the verdict says of each test, and the report not once more
    assert "The parameters alone do not" not in " ".join(reasons(told))
    assert "agree" not in said
    # no p-value of a hundred zeros, and micrometres as one letter
    assert "e-" not in " ".join(reasons(told))
    assert " um" not in " ".join(reasons(told))


def test_the_extended_model_earns_belief_where_the_geometric_one_lost_it():
    of = played(truth={"preset": "wen2022"}, identification__model="choose")
    one = estimate(of)
    assert one.statement.model == "extended"
    assert one.statement.trust.believe == "region"
    assert one.replications is None
    assert one.statement.bootstrap is None
    assert one.statement.attained[0] > 0.9
    # what sag and harmonics explain is no misfit any more
    assert one.statement.belief.misfit.upper < estimate(sagging()).statement.belief.misfit.best / 2
    assert judge(of.trials[0], one).believable
    assert any("rests on a prior" in text for text in one.statement.warnings)
    assert (
        one.comparison.accuracy_after.mean
        < 0.5 * estimate(sagging()).comparison.accuracy_after.mean
    )


def test_the_sources_sum_to_what_the_estimate_states():
    for of in (rigid(), at960(), loose()):
        one = estimate(of)
        told, q = one.statement, of.setting.test_q
        assert np.sqrt((told.source_u**2).sum()) == pytest.approx(told.combined_u, rel=1e-9)
        u = tool_statement(one.identification.model, q, one.identification.full_covariance).point
        # the fit takes its curvature at what was measured, the budget at what is predicted
        assert told.combined_u == pytest.approx(np.sqrt(np.mean(u**2)), rel=2e-3)
    assert estimate(at960()).statement.sources == ("tracker noise", "joint repeatability")
    assert estimate(rigid()).statement.sources == ("tracker noise",)


def test_the_systematic_part_is_what_shifted_readings_do_to_the_fit():
    """Second method: every number of the tracker's error played by itself, and the fit repeated."""
    of = systematic()
    bench, (seen, *_) = visits(of)
    told, found = estimate(of).statement, estimate(of).identification
    T = of.setting.nominal.poses(seen.q)
    size = bias_size(of.scenario.tracker)
    B = size.sensitivity(bench.tracker.targets(T), T[:, :3, :3], bench.tracker.T_world_tracker)
    estimator = estimator_for(bench, "whitened", seen)
    total = np.zeros_like(told.systematic)
    # small enough that turns add like vectors: only the target's turn moves rotations
    for k in range(9):
        moved = replace(seen, position=seen.position + B[:, :3, k] * np.sqrt(size.variance[k]))
        step = estimator.fit(moved, found.parameters).step - found.step
        total += np.outer(step, step)
    own = np.sqrt(np.diag(told.systematic))
    counted = np.sqrt(np.diag(total))
    turned = np.isin(found.names, ("tool.rx", "tool.ry", "tool.rz", "theta6"))
    np.testing.assert_allclose(counted[~turned], own[~turned], rtol=0.02, atol=1e-9)
    assert told.combined_u > 1.5 * estimate(at960()).statement.combined_u
    stated = np.sqrt(
        np.mean(np.trace(estimate(of).comparison.covariance[:, :3, :3], axis1=1, axis2=2))
    )
    assert stated == pytest.approx(told.combined_u, rel=2e-3)
    # repeats of one campaign share the station's errors
    assert estimate(of).replications is None
    assert any("are added to the conformal radius" in text for text in told.warnings)


def test_errors_that_no_held_out_pose_can_show_are_named():
    """Target's place and range scale follow the estimate; both ways of telling them agree."""
    (said,) = [text for text in estimate(systematic()).statement.warnings if "can show its" in text]
    assert "target's place" in said
    assert "the believed region includes" in said
    assert not [text for text in estimate(at960()).statement.warnings if "can show its" in text]


def test_what_is_stated_contains_the_systematic_part_and_the_words_do_not_promise_it_away():
    of = systematic()
    told, found = estimate(of).statement, estimate(of).identification
    judge_q, index = of.validation.judge_q, found.parameters.free_index
    shared = np.zeros_like(found.full_covariance)
    shared[np.ix_(index, index)] = told.systematic
    J = found.model.poses_and_jacobian(judge_q)[1][:, :3]
    whole, part = (J @ C @ np.swapaxes(J, 1, 2) for C in (found.full_covariance + shared, shared))
    volume = np.sqrt(np.linalg.det(whole)) * stats.chi2.ppf(0.95, 3) ** 1.5
    stated = tool_statement(found.model, judge_q, found.full_covariance + shared)
    assert stated.mean_radius == pytest.approx(np.cbrt(volume).mean(), rel=1e-6)
    # the believed region has it, too: its covariance is that of parameters, station and drift
    slow = told.drifting.drift
    drift = 0.0 if slow is None else slow.covariance
    noise = told.belief.misfit.larger_noise**2 * found.full_covariance
    np.testing.assert_allclose(
        told.belief.covariance, noise + shared + drift, rtol=1e-9, atol=1e-24
    )
    said = " ".join(reasons(told))
    assert (told.belief.misfit.larger_noise > 1) == ("times the stated noise" in said)
    # no held-out pose can show what both visits have in common: it is added
    reach = np.sqrt(np.linalg.eigvalsh(part)[:, -1] * stats.chi2.ppf(0.95, 3)).mean()
    added = told.radius[told.names.index("conformal")] - told.conformal.radius
    assert added == pytest.approx(reach, rel=1e-6)
    advice = next_step(of)
    noise = np.isin(told.sources, ("tracker noise", "joint repeatability"))
    part = np.sqrt((told.source_u[noise] ** 2).sum())
    assert advice.startswith(f"Quote {1e6 * told.point.radius_mean:.3g} µm (3-D radius, 95 %)")
    assert f"halve the noise part, {1e6 * part:.2g} µm of u" in advice
    assert part < told.point.u_mean / 2


def test_shares_inside_the_ball_are_counted_at_the_judging_poses():
    of = sagging()
    told, model = estimate(of).statement, estimate(of).identification.model
    gap = of.validation.judge_true - model.poses(of.validation.judge_q)[:, :3, 3]
    distance = np.linalg.norm(gap, axis=1)
    share = np.mean(distance <= told.radius[told.names.index("conformal")])
    assert told.attained[told.names.index("conformal")] == share
    region = tool_statement(model, of.validation.judge_q, np.zeros((model.n_numbers,) * 2))
    shares = attained(of.validation, {"parameters": region}, float(np.median(distance)))
    assert shares[1] == 0.5


def test_a_station_that_wanders_is_looked_for_and_named():
    drifts = {**AT960, "drift_um_per_sqrt_h": 20.0}
    of = played(tracker=drifts, truth={"preset": "rigid"})
    told, verdict = estimate(of).statement, judge(of.trials[0], estimate(of))
    assert told.trust.believe == "region"
    assert any("the station wanders" in text for text in told.trust.sentences)
    assert told.drifting is not None
    assert verdict.believable
    # by playing: what the drift of many visits leaves in the readings
    bench, rng = open_laboratory(of.scenario, of.setting), np.random.default_rng(2)
    drift, time = bench.tracker.drift, np.arange(0.0, 3600.0, 10.0)
    nests = bench.tracker.own_covariance(drift.nests)[:, :3, :3]
    left = [drift.walk(time, rng) + drift.nest_noise(time, nests, rng) for _ in range(200)]
    rms = np.sqrt(np.mean(np.sum(np.square(left), axis=2)))
    # 1200 rounds, each one draw of a walk: 2 % and four of them
    assert drift_left(bench) == pytest.approx(rms, rel=0.08)
    assert drift_left(open_laboratory(at960().scenario, at960().setting)) == 0


def test_chance_is_not_called_a_misfit_of_the_model_and_quiet_tests_are_no_proof():
    told = estimate(rigid()).statement
    said = told.trust.sentence
    assert told.questions.combined > 0.05
    assert (
        "That nothing is found proves nothing." in question_table([(rigid().trials[0], told)]).note
    )
    assert "show a misfit" not in said
    assert "though that is no proof" in said
    assert "would have been detected; these readings allow" in said


def test_wrong_shots_are_named_by_pose_and_cost_next_to_nothing():
    told, clean = estimate(loose()), estimate(played_without_outliers())
    _, (seen, *_) = visits(loose())
    _, (good, *_) = visits(played_without_outliers())
    wrong = np.abs(seen.position - good.position).max(axis=1) > 0
    assert wrong.sum() == 3
    assert set(told.statement.outlier_poses) == set(seen.pose_id[wrong])
    assert len(told.statement.outliers) == 3
    # three gross errors in 61 poses: within 20 % of the clean fit
    after = told.comparison.accuracy_after.mean
    assert after == pytest.approx(clean.comparison.accuracy_after.mean, rel=0.2)
    aside = set(told.statement.set_aside)
    shots, sound = loose().validation.seen, played_without_outliers().validation.seen
    gross = np.linalg.norm(shots.position - sound.position, axis=1) > 0
    assert aside == set(shots.pose_id[gross])
    assert len(told.statement.held_out) == 50 - 2 - 3
    assert told.statement.trust.believe == "region"
    # repeats hold wrong shots, too: they tell nothing of the noise
    assert 0.8 < told.statement.belief.misfit.noise_scale < 1.2
    assert "gross errors" in told.statement.sources


@cache
def played_without_outliers() -> Campaign:
    return played(61, tracker={**LOOSE, "outliers": 0}, identification__loss="cauchy")


def test_under_the_squared_loss_wrong_shots_are_named_and_nothing_is_set_aside():
    of = played(61, tracker=LOOSE)
    told = estimate(of).statement
    assert set(told.outlier_poses) == set(estimate(loose()).statement.outlier_poses)
    assert not len(told.set_aside)
    assert told.trust.refuted
    assert any('write loss = "cauchy"' in text for text in told.warnings)
    # of the three that a robust loss sets aside one is smaller than the misfit by wrong shots
    names = told.strays.poses.tolist()
    assert len(names) == 2
    assert set(names) < set(estimate(loose()).statement.set_aside)
    assert as_json(statement_headline(told))["stray_poses"] == names
    assert as_json(statement_headline(estimate(loose()).statement))["stray_poses"] == []
    brief = reasons(told, brief=True)[0]
    assert brief.startswith(f"Held-out poses {names[0]} and {names[1]} stand out: their errors")
    assert reasons(told)[0] == brief
    assert answer(told) == "misfit, 2 poses stand out"
    assert same(unpack(type(told), pack(told)), told)


def test_held_out_poses_that_stand_out_are_no_fault_of_the_model_in_the_verdict():
    trial, one = rigid().trials[0], estimate(rigid())
    strays = Strays(np.array([7]), 1e-3, 35e-6, 48, 0.5)
    seen = replace(one.statement.held_out, p_value=1e-9)
    told = replace(one.statement, strays=strays, held_out=seen)
    shot = replace(one, statement=told)
    said = judge(trial, shot).reasons[0]
    assert said.startswith("1 held-out pose stands out where all others agree, so a reading is")
    of = replace(rigid(), trials=(replace(trial, estimates=(shot, *trial.estimates[1:])),))
    advice = next_step(of)
    assert advice.startswith("1 held-out pose stands out where all others agree (named below)")
    assert f"Measure it again. Until then quote {1e6 * told.point.radius_mean:#.3g} µm" in advice
    assert answer(told) == "1 pose stands out"
    assert (
        "lacks something"
        in judge(trial, replace(one, statement=replace(told, strays=None))).reasons[0]
    )


def test_what_the_model_misses_everywhere_is_no_gross_error():
    """All held-out errors three times what is stated, and one of a millimetre: only that goes."""
    found, shots = estimate(loose()).identification, rigid().validation.seen
    at = found.model.poses(shots.q)[:, :3, 3]
    true = rigid().setting.test_true[:, :3, 3]
    position = at + 3 * (shots.position - true)
    position[7] += [1e-3, 0.0, 0.0]
    moved, used = replace(shots, position=position), loose().trials[0].measurements
    kept = sound_held_out(found, moved, used)
    assert list(np.setdiff1d(np.arange(len(shots)), kept)) == [7]
    squared = replace(found, loss="squared")
    assert len(sound_held_out(squared, moved, used)) == len(shots)


@pytest.mark.parametrize(
    ("poses", "missing"), [(18, ("conformal",)), (9, ("conformal", "discrepancy"))]
)
def test_too_few_held_out_poses_are_a_warning_and_no_radius(poses, missing):
    of = played(test__poses=poses, truth={"preset": "wen2022"})
    told = estimate(of).statement
    assert not set(missing) & set(told.names)
    assert f"were measured ({poses}) for a 95 % radius" in told.warnings[0]
    assert f"error at {poses} held-out poses reaches" in errors_in_words(estimate(of).comparison)
    assert "write [test] poses = 19 or more" in told.warnings[0]
    assert told.conformal is None
    assert told.trust.believe == "region"
    assert told.belief.n_guards == 0
    assert "No held-out pose guards the coverage factor" in " ".join(reasons(told))
    assert f"poses like the {poses} held out" in trial_verdict(of).sentence


def test_a_validation_set_that_was_identified_from_is_refused():
    of = rigid()
    bench, tables = visits(of)
    estimator = estimator_for(bench, "whitened", tables[0])
    again = replace(of.validation, seen=tables[0])
    with pytest.raises(InputError, match="validation pose 0 is pose 0 of the identification"):
        state(bench, estimator, estimator.fit(tables[0]), tables, again, "one")


def test_no_move_is_believed_to_end_where_its_mean_does():
    """Single moves end in the region of one move as often as it says, less often in that of the
    mean; and where joints do not scatter, moves end at their mean."""
    of = at960()
    told, moved = estimate(of).statement, of.validation.judge_moved
    share = dict(zip(told.names, told.attained, strict=True))
    mean = told.belief.regions(of.validation.judge_q)
    sd = of.setting.joint_repeatability
    move = told.belief.regions(of.validation.judge_q, repeatability=sd)
    assert share["move"] == move.holds(moved).mean() >= told.honest
    assert mean.holds(moved).mean() < share["move"]
    # the scatter of moves about the true mean is that of the joints, drawn by another stream
    J = of.setting.true.poses_and_jacobian(of.validation.judge_q)[1][:, :3, 6:36:5]
    expected = np.sqrt(np.mean(((J * sd) ** 2).sum((1, 2))))
    size = np.sqrt(np.mean(np.sum((moved - of.validation.judge_true) ** 2, axis=1)))
    # 600 numbers, about 1.5 per pose independent: 4 sd of a root mean square
    assert size == pytest.approx(expected, rel=0.17)
    assert np.array_equal(rigid().validation.judge_moved, rigid().validation.judge_true)


def test_an_honest_region_holds_as_much_as_robots_drawn_from_it_say():
    """Second method: whole robots moved by draws of the covariance, one by one."""
    belief, q = estimate(at960()).statement.belief, at960().validation.judge_q[:40]
    region = belief.regions(q, growth=1.0)
    whole = belief.covariance + belief.misfit.upper**2 * belief.misfit_covariance
    moving = np.flatnonzero(np.diag(whole))
    values, axes = np.linalg.eigh(whole[np.ix_(moving, moving)])
    root = axes * np.sqrt(np.maximum(values, 0))
    D = region.covariance - tool_statement(belief.model, q, whole).covariance
    own = np.linalg.cholesky(D + 1e-18 * np.eye(3))
    rng, shares = np.random.default_rng(5), []
    for _ in range(150):
        step = np.zeros(belief.model.n_numbers)
        step[moving] = root @ rng.standard_normal(len(moving))
        at = belief.model.moved(step).poses(q)[:, :3, 3]
        at += (own @ rng.standard_normal((len(q), 3, 1)))[:, :, 0]
        shares.append(region.holds(at).mean())
    least = honest_share(belief, q, np.zeros(3), AS_USUAL, np.random.default_rng(6))
    # the least of 150 robots lies above what 999 of 1000 reach, but for one time in seven
    assert least <= min(shares) + 0.03
    assert least > 0.3
    # robots are the unit
    assert np.mean(shares) == pytest.approx(0.95, abs=4 * np.std(shares) / np.sqrt(150))


def test_the_validation_visit_sees_the_held_out_poses_with_the_stated_noise():
    of = rigid()
    seen, true = of.validation.seen, of.setting.test_true
    assert np.array_equal(seen.q, of.setting.test_q)
    error = (seen.position - true[:, :3, 3]) / np.sqrt(seen.covariance[:, range(3), range(3)])
    # 150 standard normal numbers: mean square 1 -+ 4 sqrt(2 / 150)
    assert np.mean(error**2) == pytest.approx(1, abs=0.46)
    taken = {row.tobytes() for row in (*of.setting.pool_q, *of.setting.test_q)}
    assert not any(row.tobytes() in taken for row in of.validation.judge_q)


def test_the_truth_is_taken_apart_term_by_term():
    scenario = changed(
        rigid().scenario, {"truth": {"preset": "unmodelled", "joint_repeatability_mdeg": 1.0}}
    )
    found = validation_visit(scenario, make_setting(scenario))
    assert found.terms == (
        "geometry", "gravity", "harmonics", "high_harmonics", "backlash", "repeatability"
    )  # fmt: skip
    named = as_json(truth_headline(found))["terms_rms_mm"]
    assert named["geometry"] == pytest.approx(0.7, abs=0.3)
    assert 0.02 < named["harmonics"] < named["gravity"] < 0.3
    table = secret_section(replace(rigid(), validation=found)).blocks[1]
    assert table.rows[0][0] == "geometry"
    assert table.rows[-1][0] == "all together"
    assert (
        "A geometric model cannot describe"
        in secret_section(replace(rigid(), validation=found)).blocks[0].text
    )


def test_a_target_on_the_tool_is_carried_as_moved_models_carry_it():
    nominal, rng = load_robot("staubli_tx60").model, np.random.default_rng(3)
    q, target = rng.uniform(-1, 1, (2, 6)), np.array([0.05, 0.03, 0.08])
    steps = 1e-2 * rng.standard_normal((4, 42))
    expected = [
        [T[:3, 3] + T[:3, :3] @ target for T in nominal.moved(step).poses(q)] for step in steps
    ]
    np.testing.assert_allclose(moved_targets(nominal, q, steps, target), expected, atol=1e-12)
    C = np.diag(rng.uniform(0, 1e-8, 42))
    stated = tool_statement(nominal, q, C, target=target)
    point, _, sigma = target_prediction(nominal, q, target, C)
    np.testing.assert_allclose(stated.position, point, atol=1e-15)
    np.testing.assert_allclose(stated.covariance, sigma[:, :3, :3], rtol=1e-12, atol=1e-20)
    plain, at_zero = (
        tool_statement(nominal, q, C),
        tool_statement(nominal, q, C, target=np.zeros(3)),
    )
    np.testing.assert_allclose(plain.covariance, at_zero.covariance, rtol=1e-12)


def test_a_point_that_scatters_in_a_plane_only_is_judged_in_that_plane():
    flat = np.diag([1.0, 4.0, 0.0])
    axes = moving_axes(flat)
    assert axes.shape == (3, 2)
    assert not axes[2].any()
    assert np.array_equal(moving_axes(np.eye(3)), np.eye(3))


def test_springs_are_checked_by_virtual_calibrations_which_say_that_linear_is_enough():
    fit, table = calibrated()
    check, _ = linear_check(fit, table, table.q[:5], np.zeros(3), np.random.default_rng(1))
    assert check.validated
    assert "virtual calibrations at the held-out pose" in check.sentence


def test_a_statement_survives_the_disk_and_its_keys_have_units():
    for of in (rigid(), loose(), systematic()):
        trial = of.trials[0]
        assert same(unpack(Trial, pack(trial)), trial)
        said = as_json(statement_headline(estimate(of).statement))
        believed = [name for name, one in said["statements"].items() if one["believed"]]
        told = estimate(of).statement
        assert believed == [name for name in told.names if name in ("region", "move")]
        budget = said["budget_u_3d_um"]
        assert budget["parameters alone"] == pytest.approx(told.combined_u * 1e6)
        # the sum of all lines is what is believed, at the factor of the region
        names = "parameters alone", "noise beyond the stated", "drift", "misfit up to its limit"
        parts = [budget.get(name, 0.0) for name in names]
        scale = said["factor"] / stats.chi2.ppf(0.95, 3) ** 0.5
        whole = scale * np.sqrt(np.square(parts).sum())
        # shots that were missed are no posture of the one, but of the other; the fit takes its
        # curvature at what was measured, the budget at what is predicted
        assert said["u_mean_um"] == pytest.approx(whole, rel=0.02 if of is loose() else 2e-3)
        assert budget["believed"] == said["u_mean_um"]
        assert said["R95_mean_um"] == said["statements"]["region"]["radius_um"]
        assert 1.61 < said["R95_mean_um"] / said["u_mean_um"] < 1.97
    assert said["validation"]["poses"] == 50
    assert said["R95_move_um"] > said["R95_mean_um"]
    assert set(said["tests"]) == {"misfit", "another frame", "drift", "combined"}


def test_a_record_hangs_on_the_largest_trial_only_where_the_robot_grows_warm():
    robot = load_robot("staubli_tx60")
    longer = [{"name": "one", "poses": 29, "method": "random"},
              {"name": "two", "poses": 40, "method": "random"}]  # fmt: skip
    for warm, moves in ((0.0, False), (2.0, True)):
        first = changed(rigid().scenario, {"truth.thermal_k": warm})
        more = changed(first, {"trial": longer})
        for key in ("setting", "validation", "one"):
            same_hash = record_hash(first, robot, key) == record_hash(more, robot, key)
            assert same_hash is not moves


def test_the_table_has_a_row_per_trial_and_marks_what_is_contradicted(monkeypatch):
    blocks = statement_blocks(sagging())
    (row,), told = blocks[0].rows, estimate(sagging()).statement
    assert blocks[0].head == (
        "trial", "believed µm", "inside", "parameters alone µm", "inside", "with discrepancy µm",
        "inside", "conformal ball µm", "inside",
    )  # fmt: skip
    shown = dict(zip(told.names, told.radius, strict=True))
    assert row[1] == f"{1e6 * shown['region']:.3g}"
    assert row[3] == f"{1e6 * shown['parameters']:.3g} ✗"
    tests, budget = (block for block in blocks if block.kind == "table" and block != blocks[0])
    assert tests.rows[0][-1] == "misfit"
    assert [one[0] for one in budget.rows][-2:] == ["believed", "discrepancy"]
    assert blocks[-1].svg.startswith("<svg")  # the map: uncertainty grows where the arm sags
    blocks = statement_blocks(rigid())
    assert "✗" not in "".join(blocks[0].rows[0])
    # what is the same everywhere is a sentence, no map
    views = tool_views(rigid(), rigid().trials[0])
    monkeypatch.setattr(plots_uncertainty, "FLAT", 1.01 * views.high / views.low)
    assert views.flat
    (said,) = (b.text for b in statement_blocks(rigid()) if b.kind == "text")
    assert re.fullmatch(r"Believed u .*: \d+ to \d+ µm everywhere in the pool \(.*\).*\.", said)
    # one move has its own column where joints scatter
    assert statement_blocks(at960())[0].head[3] == "one move µm"


def test_a_statement_that_the_truth_alone_contradicts_is_still_not_believed():
    """Sound residuals and held-out poses, but replications that miss: the truth knows better."""
    of = played(uncertainty__replications=10)
    one, trial = estimate(of), of.trials[0]
    assert judge(trial, one).mark == GOOD
    short = replace(one.replications, region_coverage=one.replications.region_coverage * 0.2)
    # parameters alone that fail stand beside what is believed
    alone = replace(one.replications, tool_coverage=one.replications.tool_coverage * 0.2)
    assert judge(trial, replace(one, replications=alone)).mark == GOOD
    missed = replace(one.statement, attained=one.statement.attained * one.statement.honest * 0.9)
    for wrong in (replace(one, replications=short), replace(one, statement=missed)):
        verdict = judge(trial, wrong)
        assert verdict.mark == BAD
        assert verdict.contradicted
        assert "which must not be believed" in verdict.sentence


def test_the_radius_of_a_region_with_discrepancy_is_the_wider_one():
    told = estimate(sagging()).statement
    model, wide = (told.radius[told.names.index(name)] for name in ("parameters", "discrepancy"))
    assert isinstance(told.discrepancy, Discrepancy)
    assert wide > 3 * model
