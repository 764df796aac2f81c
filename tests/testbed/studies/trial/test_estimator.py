"""What the default estimator fits: model, prior in units, loss; and the truth held against it."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib.geometry.model import RobotModel
from calib.geometry.operating import AS_USUAL, OperatingConditions
from calib.identification.identify import identify
from calib.identification.joint_models import extended_model, extended_parameters
from calib.identification.prior import weak_prior
from testbed.laboratory.truth.laboratory import Laboratory, open_laboratory
from testbed.laboratory.truth.setting import make_setting
from testbed.scenario.checks import default_parameters
from testbed.scenario.read import changed
from testbed.scenario.tables import PriorSettings
from testbed.studies import load_scenario
from testbed.studies.trial.compare import drawn_step
from testbed.studies.trial.estimator import (
    WEAK,
    estimator_for,
    scenario_ladders,
    scenario_prior,
)

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
    waves = scenario_ladders(settings, bench("rigid").setting.nominal, bench("rigid").robot)[1]
    usual = dict(zip(waves.levels[2].names, waves.levels[2].sd, strict=True))
    assert usual["harmonic2.cos1"] == pytest.approx(np.radians(0.003))
    assert usual["harmonic2.sin1"] == pytest.approx(np.radians(0.008))
    assert usual["harmonic1.sin2"] == pytest.approx(np.radians(0.004))


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
    assert climbed.why.startswith(
        "extended by sag and small waves: the measurements ask for it (log"
    )
    assert {o.level for o in climbed.offered if o.outcome == "taken"} == {"sag", "small waves"}
    assert [step.taken for step in climbed.steps] == [True, True]
    rigid = bench("rigid", model="choose")
    stayed = estimator_for(rigid, "whitened", seen(rigid))
    assert not stayed.extended
    assert stayed.log_evidence < -10
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
