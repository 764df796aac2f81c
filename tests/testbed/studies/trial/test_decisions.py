"""Decisions on a tolerance: who passes, at what risk, how often the truth says otherwise."""

from dataclasses import replace

import numpy as np
import pytest

from calib.uncertainty.statement.distance import distance_radius
from calib.uncertainty.statement.stated_point import widened
from testbed.robots.catalog import load_robot
from testbed.run.derive import page_of
from testbed.scenario.hashes import scenario_hash
from testbed.scenario.read import changed
from testbed.store.quantities import as_json
from testbed.studies.trial.advice import next_step, quotable
from testbed.studies.trial.decisions import decide, decided_in_words, decision_section, published
from testbed.studies.trial.records import Campaign
from tests.campaign import record_hash
from tests.reported import VERSIONS, bare_campaign, undrawn


def tolerating(limit_um: float, rule: str = "guarded") -> Campaign:
    campaign = bare_campaign()
    table = {"position_um": limit_um, "rule": rule}
    return replace(campaign, scenario=changed(campaign.scenario, {"tolerance": table}))


def decided(campaign: Campaign):
    return decide(campaign, campaign.trials[0].estimates[0])


def radius(campaign: Campaign):
    """R95 of the believed regions [um]."""
    belief = campaign.trials[0].estimates[0].belief
    return 1e6 * distance_radius(widened(belief.regions(campaign.setting.test_q)))


def test_a_program_as_it_was_fails_and_the_corrected_one_passes_if_the_guard_band_fits():
    largest = radius(bare_campaign()).max()
    of = tolerating(1.01 * largest)
    found = decided(of)
    assert found["after"].made.counts == {"pass": 20}
    assert found["after"].wrong == 0
    # errors of the nominal robot are half a millimetre
    assert found["before"].made.counts["fail"] >= 18
    assert found["before"].wrong == 0
    before = of.trials[0].estimates[0].comparison.before
    fails = found["before"].made.outcome == "fail"
    assert (before[fails] > of.scenario.tolerance.position_um * 1e-6).all()
    # the risk of a pass by drawing points of the region
    belief, q = of.trials[0].estimates[0].belief, of.setting.test_q
    rng = np.random.default_rng(0)
    worst = int(np.argmax(found["after"].made.risk))
    S = widened(belief.regions(q))[worst]
    drawn = rng.multivariate_normal(np.zeros(3), S, 40_000)
    out = np.mean(np.linalg.norm(drawn, axis=1) > 1.01e-6 * largest)
    # 40 000 draws of .05: standard deviation .0011
    assert found["after"].made.risk[worst] == pytest.approx(out, abs=0.0045)


def test_below_the_uncertainty_no_decision_is_possible_and_that_is_said():
    of = tolerating(0.9 * radius(bare_campaign()).min())
    found = decided(of)
    assert found["after"].made.counts == {"undecided": 20}
    assert "at 20 of 20 points no pass is possible" in decided_in_words(of)
    assert decision_section(of).blocks[1].rows[1][2:5] == ("0", "20", "0")


def test_without_a_guard_band_poses_at_the_limit_pass_and_some_are_wrong():
    """The limit a nanometer beyond what is predicted of a pose: a pass with a risk of one half."""
    predicted = np.sort(decided(tolerating(100.0))["before"].made.distance)
    of = tolerating(1e6 * float(predicted[9]) + 1e-3, "simple")
    limit = of.scenario.tolerance.decision.tolerance
    found = decided(of)["before"]
    assert found.made.counts == {"pass": 10, "fail": 10}
    before = of.trials[0].estimates[0].comparison.before
    assert found.wrong == int(((found.made.outcome == "pass") != (before <= limit)).sum())
    assert found.made.largest_risk > 0.49
    text = decision_section(of).blocks[0].text
    assert "at the limit a pass has a risk of 50 % or more" in text
    said = as_json(published(of, of.trials[0].estimates[0]))["decisions"]
    assert said["tolerance_um"] == pytest.approx(1e6 * limit)
    assert (said["rule"], said["before"]["pass"], said["after"]["pass"]) == ("simple", 10, 20)
    assert said["before"]["largest_risk_of_a_pass"] == found.made.largest_risk
    assert said["after"]["guard_median_um"] == 0


def test_a_tolerance_and_a_radius_of_millimeters_are_said_in_millimeters():
    of = tolerating(5000.0)
    assert "(tolerance 5 mm, guard band R95" in decided_in_words(of)
    said, table = decision_section(of).blocks
    assert said.text.startswith("Tolerance 5 mm on the distance of the mean tool point")
    assert "within 5 mm of the nominal one" in table.caption
    statement = of.trials[0].estimates[0].statement
    point = replace(statement.point, radius_mean=980e-6, radius_move=1.2e-3)
    quoted = quotable(replace(statement, point=point), "")
    assert quoted.startswith("0.980 mm (3-D radius, 95 %) for the mean of many moves and 1.20 mm")


def test_no_rule_passes_what_is_less_certain_than_the_tolerance():
    of = tolerating(0.9 * radius(bare_campaign()).min(), "simple")
    assert decided(of)["after"].made.counts == {"undecided": 20}
    assert "at 20 of 20 points no pass is possible" in decided_in_words(of)


def test_a_scenario_without_a_tolerance_says_nothing_and_its_hashes_stay():
    campaign = bare_campaign()
    assert decided(campaign) == {}
    assert decision_section(campaign) is None
    assert decided_in_words(campaign) == ""
    assert published(campaign, campaign.trials[0].estimates[0]) == []
    assert "tolerance" not in campaign.scenario.document()
    robot, other = load_robot("staubli_tx60"), tolerating(100.0)
    assert scenario_hash(campaign.scenario, robot) != scenario_hash(other.scenario, robot)
    # nothing is measured or fitted anew for a tolerance
    for key in ("setting", "validation", "only"):
        assert record_hash(campaign.scenario, robot, key) == record_hash(other.scenario, robot, key)


def test_the_report_decides_after_it_has_stated_and_a_nothing_decides_nothing():
    of = tolerating(60.0)
    with undrawn():
        page = page_of(of, VERSIONS)
    anchors = [section.anchor for section in page.sections]
    assert anchors.index("decisions") == anchors.index("believe") + 1
    assert page.next_step == next_step(of) + decided_in_words(of)
    trial = of.trials[0]
    one = trial.estimates[0]
    nothing = replace(one, statement=replace(one.statement, belief=None, point=None))
    empty = replace(of, trials=(replace(trial, estimates=(nothing,)),))
    assert "No decision is possible" in decision_section(empty).blocks[1].text
    assert "cannot be decided" in decided_in_words(empty)
