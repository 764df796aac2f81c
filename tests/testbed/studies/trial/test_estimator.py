"""What the default estimator fits: model, prior in units, loss; and the truth held against it."""

import tomllib
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from calib.geometry.gravity import moments_of
from calib.geometry.joint_errors import JointErrors, JointTerm
from calib.geometry.model import RobotModel
from calib.geometry.operating import AS_USUAL, OperatingConditions
from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.identification.joint_models import extended_model, extended_parameters
from calib.identification.ladders import ladders_of
from calib.identification.levels import with_errors
from calib.identification.prior import weak_prior
from calib.identification.row_ladders import gear_terms
from calib.measurement.observations import Measurements
from testbed.files.rows.gear import GearTable
from testbed.laboratory.truth.laboratory import Laboratory, open_laboratory
from testbed.laboratory.truth.robot import unmodelled_terms
from testbed.laboratory.truth.setting import in_turn, make_setting
from testbed.run.export_toml import gear_lines
from testbed.scenario.checks import default_parameters
from testbed.scenario.read import changed
from testbed.scenario.tables import PriorSettings
from testbed.studies import load_scenario
from testbed.studies.trial.compare import compare, drawn_step, true_step
from testbed.studies.trial.estimator import (
    WEAK,
    estimator_for,
    gear_orders,
    scenario_ladders,
    scenario_prior,
)
from testbed.studies.trial.records import Estimate, judged_numbers
from testbed.studies.trial.report_parameters import parameter_table

SMALL = {"pool.size": 40, "test.poses": 20, "uncertainty.replications": 0}
MDEG = np.pi / 180e3


@cache
def laboratory(preset: str) -> Laboratory:
    """A small laboratory of quick with another robot."""
    scenario = changed(load_scenario("quick"), {"truth": {"preset": preset}, **SMALL})
    return open_laboratory(scenario, make_setting(scenario))


def bench(preset: str, **identification: object) -> Laboratory:
    """The same with other keys of [identification], which no robot or reading hangs on."""
    of = laboratory(preset)
    keys = {f"identification.{key}": value for key, value in identification.items()}
    return replace(of, scenario=changed(of.scenario, keys))


def seen(of: Laboratory, poses: int = 29):
    return of.measure_pool(np.arange(poses), "visit", "x")


def test_without_keys_it_is_plain_identification_bit_for_bit():
    of = bench("rigid")
    table = seen(of)
    plain = identify(of.setting.nominal, table, of.free("whitened"))
    found = estimator_for(of, "whitened", table).fit(table)
    assert np.array_equal(found.step, plain.step)
    assert found.prior is None
    for keys in ({"model": "extended"}, {"loss": "cauchy"}, {"prior": {}}):
        assert estimator_for(bench("rigid", **keys), "paper", table).prior is None


def test_the_prior_of_an_empty_table_is_the_weak_one():
    of = bench("rigid")
    free = of.free("whitened")
    wide = extended_model(of.setting.nominal)
    nominal = of.setting.nominal
    for model, table in ((nominal, free), (wide, extended_parameters(nominal, wide, free))):
        made, weak = scenario_prior(WEAK, table, model), weak_prior(table, model)
        assert made.names == weak.names
        # the same standard deviations, up to the rounding of their units
        np.testing.assert_allclose(made.sd, weak.sd, rtol=1e-14)
        assert not made.mean.any()


def test_each_key_of_the_prior_reaches_its_numbers_in_its_unit():
    of = bench("rigid")
    wide = extended_model(of.setting.nominal)
    table = extended_parameters(of.setting.nominal, wide, of.free("whitened"))
    prior = scenario_prior(
        PriorSettings(
            angles_deg=0.5,
            lengths_mm=2.0,
            frame_angles_deg=0.25,
            frame_lengths_mm=4.0,
            gravity_mdeg=30.0,
            harmonics_mdeg=(8.0, 3.0),
            sd_deg={"alpha2": 0.01, "harmonic4.cos2": 0.002},
            sd_mm={"base.x": 7.0, "d3": 0.05},
        ),
        table,
        wide,
    )
    sd = dict(zip(prior.names, prior.sd, strict=True))
    expected = {
        "alpha1": np.radians(0.5), "beta6": np.radians(0.5), "d1": 2e-3, "a3": 2e-3,
        "base.rz": np.radians(0.25), "tool.x": 4e-3, "gravity2.fore": 30 * MDEG,
        "harmonic1.sin1": 8 * MDEG, "harmonic1.cos2": 3 * MDEG, "alpha2": np.radians(0.01),
        "harmonic4.cos2": 2 * MDEG, "base.x": 7e-3, "d3": 0.05e-3,
    }  # fmt: skip
    assert {name: sd[name] for name in expected} == pytest.approx(expected, rel=1e-12)


def test_a_tight_prior_holds_its_number_and_a_wide_one_lets_go():
    tight, free = (
        estimator_for(of, "whitened", seen(of)).fit(seen(of))
        for of in (
            bench("rigid", prior={"sd_mm": {"a2": 1e-4}}),
            bench("rigid", prior={"sd_mm": {"a2": 10.0}}),
        )
    )
    at = tight.names.index("a2")
    # the drawn error is of the order of 0.1 mm
    assert abs(tight.step[at]) < 1e-6 < abs(free.step[at])
    assert tight.standard_uncertainty[at] <= 1e-7


def test_sizes_that_a_scenario_states_of_single_waves_are_those_of_its_ladders():
    settings = PriorSettings(sd_deg={"harmonic2.cos1": 0.003}, harmonics_mdeg=(8.0, 4.0))
    of = bench("rigid")
    waves = scenario_ladders(settings, of.setting.nominal, of.robot, seen(of))[1]
    usual = dict(zip(waves.levels[2].names, waves.levels[2].sd, strict=True))
    assert usual["harmonic2.cos1"] == pytest.approx(np.radians(0.003))
    assert usual["harmonic2.sin1"] == pytest.approx(np.radians(0.008))
    assert usual["harmonic1.sin2"] == pytest.approx(np.radians(0.004))


def with_truth(poses: int = 40, **truth: object) -> tuple[Laboratory, Measurements]:
    """A small laboratory of quick whose robot has other errors, and what is seen of it."""
    keys = {"truth": truth, "identification.model": "choose", **SMALL}
    scenario = changed(load_scenario("quick"), keys)
    of = open_laboratory(scenario, make_setting(scenario))
    return of, seen(of, poses)


def test_rows_say_from_which_side_each_joint_came():
    of = bench("rigid")
    table = of.measure(of.setting.pool_q[[3, 1, 2]], np.array([30, 10, 20]), "x")
    last, side = np.zeros(6), []
    for q in of.setting.pool_q[[3, 1, 2]]:
        side.append(np.sign(q - last))
        last = q
    np.testing.assert_array_equal(table.q, of.setting.pool_q[[3, 1, 2]])
    np.testing.assert_array_equal(table.conditions.approach, side)
    np.testing.assert_array_equal(table.rows([2]).conditions.approach, side[2:])


def test_play_is_found_by_the_side_from_which_joints_come():
    play = [0.0, 0.0, 30.0, 0.0, 30.0, 0.0]
    of, table = with_truth(preset="rigid", backlash_mdeg=play, backlash_side="approach")
    chosen = estimator_for(of, "whitened", table)
    assert [step.ladder for step in chosen.steps if step.taken] == ["approach"]
    found = chosen.fit(table)
    half = [found.model.first_fixture - 6 + i for i in range(6)]
    sd = np.sqrt(np.diag(found.full_covariance))[half]
    off = found.model.joint_errors.coefficients - np.radians(play) / 2e3
    # a joint goes on by half of its play; 4 sd
    assert (np.abs(off) < 4 * sd).all()
    q, true = of.setting.test_q, of.setting.test_true[:, :3, 3]
    away, told = (
        np.linalg.norm(found.model.poses(q, at)[:, :3, 3] - true, axis=1).mean()
        for at in (AS_USUAL, in_turn(q))
    )
    assert told < 20e-6 < 60e-6 < away
    judged = compare(of.setting, found, table, np.zeros(found.rank))
    assert judged.after.mean() == pytest.approx(told)


def test_gears_are_offered_where_the_scene_has_them_and_judged_by_what_was_drawn():
    of, table = with_truth(poses=38, preset="gears")
    orders = gear_orders(of)
    assert orders[3:5] == ((60.5, 121.0), (50.4, 100.8))
    assert gear_orders(bench("rigid")) == ()
    assert gear_lines(bench("rigid")) == []
    stated = tomllib.loads("\n".join(gear_lines(of)))["gear"]
    assert GearTable(**stated).of_joints(6, "session.toml") == orders
    names = [term.name for term in gear_terms(6, 4, 50.4)]
    wide = with_errors(of.setting.nominal, JointErrors(gear_terms(6, 4, 50.4)))
    free = parameters_of(wide, names)
    found = identify(wide, table, free)
    true = of.truth.model.joint_errors
    drawn = dict(zip(true.names, true.coefficients, strict=True))
    expected = [drawn["gear5.sin1"], drawn["gear5.cos1"]]
    assert drawn_step(of.setting, found).tolist() == expected
    ladders = scenario_ladders(WEAK, of.setting.nominal, of.robot, table, orders)
    said = {ladder.name: ladder for ladder in ladders}
    assert len(said["gear"].levels[1].names) == 24
    assert said["torque"].why_not == ("torque: the rows of this laboratory say none",)


def test_a_model_that_follows_the_payload_takes_the_usual_one_where_nobody_says():
    loaded = bench("payloads", model="choose")
    table = seen(loaded, 40)
    np.testing.assert_array_equal(table.conditions.payload, np.resize([0.0, 5.0], 40))
    found = estimator_for(loaded, "whitened", table).fit(table).model
    q, true = loaded.setting.test_q, loaded.held_out(loaded.setting.test_q)[:, :3, 3]
    center = np.tile([0.0, 0.0, 0.05], (len(q), 1))
    said = OperatingConditions(payload=np.full(len(q), 2.5), center=center)
    away, told = (
        np.linalg.norm(found.poses(q, at)[:, :3, 3] - true, axis=1).mean()
        for at in (AS_USUAL, said)
    )
    assert away < 50e-6  # three times as much if nothing hung there
    # and 2.5 kg did on average
    assert away == pytest.approx(told, rel=1e-9)


def test_the_model_is_chosen_by_what_the_robot_needs_and_the_result_says_why():
    sagging = bench("wen2022", model="choose")
    climbed = estimator_for(sagging, "whitened", seen(sagging))
    assert climbed.extended
    assert climbed.log_evidence > 30
    assert climbed.reason.sentence.startswith(
        "extended by sag and small waves: the measurements support it (log"
    )
    assert {o.level for o in climbed.offered if o.outcome == "taken"} == {"sag", "small waves"}
    assert [step.taken for step in climbed.steps] == [True, True]
    rigid = bench("rigid", model="choose")
    stayed = estimator_for(rigid, "whitened", seen(rigid))
    assert not stayed.extended
    # at best for the six numbers of the approach, on 29 poses
    assert stayed.log_evidence < -5
    plain = identify(rigid.setting.nominal, seen(rigid), rigid.free("whitened"))
    assert np.array_equal(stayed.fit(seen(rigid)).step, plain.step)


def test_the_numbers_of_the_extended_model_can_be_the_true_robot_exactly():
    """`drawn_step` by a second method: the model moved by it repeats MuJoCo's true poses."""
    of = bench("wen2022", model="extended")
    found = estimator_for(of, "whitened", seen(of)).fit(seen(of))
    step = drawn_step(of.setting, found)
    wide = extended_model(of.setting.nominal)
    rebuilt = wide.moved(found.parameters.expand(step))
    # 1e-12 m: two codes for one chain, metres long
    np.testing.assert_allclose(rebuilt.poses(of.setting.test_q), of.setting.test_true, atol=1e-12)
    knowing = replace(
        of.setting, nominal=replace(of.setting.nominal, joint_errors=of.setting.true.joint_errors)
    )
    left = drawn_step(knowing, found)
    harmonic = [k for k, name in enumerate(found.names) if name.startswith("harmonic")]
    assert step[harmonic].any()
    assert not left[harmonic].any()
    error = (found.step - step) / found.standard_uncertainty
    # 69 numbers under a prior five times wider than the truth: less than one standard deviation
    assert np.sqrt(np.mean(error**2)) < 1.2


def test_all_numbers_that_it_may_ever_free_can_have_a_prior_of_their_own():
    of = bench("rigid")
    geometric = default_parameters(of.scenario, of.robot)
    wide = default_parameters(bench("rigid", model="choose").scenario, of.robot)
    assert set(wide.free_names) - set(geometric.free_names) == set(
        extended_model(RobotModel(of.setting.nominal.chain)).joint_errors.names
    )


def test_true_springs_bend_the_model_as_the_robot_and_moments_have_no_true_value():
    """A bend is the load over the stiffness: by the first order within 2 % of MuJoCo's rest."""
    of = laboratory("elastic")
    load = moments_of([of.scenario.truth.payload_kg], [[0.0, 0.0, 0.05]])[0]
    gravity, _ = ladders_of(
        of.setting.nominal, moments=of.robot.moments, limits=of.robot.limits, payload=load
    )
    levels = {level.name: level.errors for level in gravity.levels}
    q, true = of.setting.pool_q[:20], of.truth
    rest = true.simulator.bends(q)
    for name, known in (("sag and bearings", True), ("springs on a tilted base", False)):
        model = with_errors(of.setting.nominal, levels[name])
        found = SimpleNamespace(model=model, names=model.names)
        step = drawn_step(of.setting, found, true.unmodelled)
        own = dict(zip(model.names, step, strict=True))
        of_springs = np.array([own[name] for name in model.joint_errors.springs.names])
        count = len(model.joint_errors.springs.load)
        assert np.isfinite(of_springs[:count]).all()
        assert np.isnan(of_springs[count:]).all()
        assert judged_numbers(found, step).sum() == of.setting.nominal.n_numbers
        if known:
            bends = model.joint_errors.springs.bends(q, of_springs)
            assert np.abs(bends - rest).max() < 0.02 * np.abs(rest).max()
    stiff = drawn_step(laboratory("rigid").setting, found)
    named = dict(zip(model.names, stiff, strict=True))
    assert named["spring2.z"] == 0.0  # nothing gives way
    assert np.isnan(named["tilt1"])


@pytest.mark.parametrize("side", ["approach", "load"])
def test_true_play_is_a_number_where_the_approach_decides(side):
    truth = changed(
        load_scenario("quick"),
        {"truth": {"preset": "rigid", "backlash_mdeg": 6.0, "backlash_side": side}},
    ).truth
    terms = tuple(
        JointTerm(f"approach{i + 1}", i, "approach", tuple(float(k == i) for k in range(6)))
        for i in range(6)
    )
    of = laboratory("rigid")
    model = RobotModel(of.setting.nominal.chain, JointErrors(terms, np.zeros(6)))
    found = SimpleNamespace(model=model, names=tuple(term.name for term in terms))
    play = unmodelled_terms(of.robot, truth)
    step = drawn_step(of.setting, found, play)
    if side == "load":
        assert np.isnan(step).all()
        return
    q = np.random.default_rng(0).uniform(-1, 1, (8, 6))
    before = np.zeros_like(q)
    reached = replace(model.joint_errors, coefficients=step).of_terms(
        q, OperatingConditions(approach=np.sign(q - before))
    )
    np.testing.assert_allclose(reached, play.backlash.offsets(q, np.sign(q - before)), rtol=1e-14)
    assert not drawn_step(of.setting, found).any()  # a robot without play


def test_the_table_shows_true_springs_without_a_u_and_counts_only_what_has_one():
    of = laboratory("elastic")
    gravity, _ = ladders_of(of.setting.nominal, limits=of.robot.limits)
    springs = next(level for level in gravity.levels if level.name == "springs")
    model, table = with_errors(of.setting.nominal, springs.errors), seen(of)
    free = parameters_of(model)
    first = identify(model, table, free, prior=weak_prior(free, model))
    truth = true_step(of.setting, first, table, of.truth.unmodelled)
    f = len(first.names)
    of_table = Estimate(
        mode="whitened", identification=first, repeated=first.step[None], type_a=np.ones(f),
        comparison=compare(of.setting, first, table, truth), replications=None,
    )  # fmt: skip
    shown = parameter_table(of.setting.nominal, SimpleNamespace(name="any"), of_table)
    rows = {row[0]: row[3:] for row in shown.rows}
    assert f"of {of.setting.nominal.n_numbers} inside by the fit" in shown.caption
    _, true, error, expanded, _, *inside = rows["spring2.z"]
    stiff = of.truth.unmodelled.springs.drive[1]
    place = springs.errors.springs.names.index("spring2.z")
    expected = np.degrees(springs.errors.springs.load[place] / stiff)
    assert float(true) == pytest.approx(expected, abs=1e-3)
    assert error != "–"
    assert (expanded, *inside) == ("–", "–", "–")
    assert rows["moment4.m"][1:4] == ("–", "–", "–")
    assert "–" not in rows["a2"]
    # the count of numbers, and what is expected of their errors, are those of the chain alone
    wrong = (first.step - truth)[: of.setting.nominal.n_numbers]
    C = first.covariance[: len(wrong), : len(wrong)]
    assert of_table.comparison.nees == pytest.approx(wrong @ np.linalg.solve(C, wrong), rel=1e-6)
