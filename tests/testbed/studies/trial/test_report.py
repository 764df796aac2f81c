"""report.html: verdict first, self-contained, each number with its unit and as in the record."""

import re
from dataclasses import replace

import numpy as np
import pytest

from testbed.report.page import SIMULATED, Table, render
from testbed.run.derive import page_of
from testbed.scenario.read import dump_scenario
from testbed.studies.trial import report_accuracy, report_design, report_parameters, verdict
from testbed.studies.trial.report_accuracy import intervals_in_words
from testbed.studies.wen2022 import report_paper
from testbed.studies.wen2022.records import paper_budget_of
from tests.campaign import with_records, without
from tests.reported import (
    VERSIONS,
    bare_campaign,
    html,
    page,
    paper_campaign,
    point_campaign,
    read,
    rigid_campaign,
)

EVERY = [paper_campaign, rigid_campaign, bare_campaign, point_campaign]
COUNTED = re.compile(  # columns whose numbers count, compare or index, and so have no unit
    r"inside|χ²/dof|^p$|^p, adjusted$|cond\.|rank|NEES|gain|replications|band|coverage"
    r"|stated / true|^#$|^O[1-5]$|number|share|^u_?|ratio|parameters inside|/ u$"
    r"|^type A: (\|P\||point) in|point in region"
)


def number(text):
    """A written number read back."""
    return float(text.replace("−", "-"))


def tables(make):
    """All tables of a report."""
    blocks = [block for section in page(make).sections for block in section.blocks]
    return [page(make).headline, *(block for block in blocks if isinstance(block, Table))]


@pytest.mark.parametrize("make", EVERY)
def test_the_banner_is_the_first_line_and_the_verdict_comes_before_any_section(make):
    text = read(html(make)).text
    assert text[0] == text[-1] == SIMULATED
    first_section = text.index("What to believe here, and why")
    first_screen = " ".join(text[:first_section])
    assert " ".join(page(make).verdict.split()) in first_screen
    for wanted in ("mean mm", "χ²/dof", "cond.", "Next step."):
        assert wanted in first_screen


@pytest.mark.parametrize("make", EVERY)
def test_the_page_is_well_formed_and_needs_nothing_from_outside(make):
    seen = read(html(make))
    assert seen.open == []
    assert not {"script", "link", "img", "iframe", "object", "base"} & set(seen.tags)
    assert all(link.startswith("#") for link in seen.links)
    assert {link[1:] for link in seen.links} <= set(seen.ids)
    addresses = set(re.findall(r"https?://[^\s\"'<]+", html(make)))
    # names of XML dialects, never fetched
    assert addresses <= {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}
    assert len(html(make).encode()) < 3e6


def test_the_same_campaign_gives_the_same_page():
    assert render(page_of(bare_campaign(), VERSIONS)) == html(bare_campaign)


def test_headline_errors_equal_those_computed_from_truth_and_model_one_pose_at_a_time():
    campaign = paper_campaign()
    setting = campaign.setting
    table = report_accuracy.headline_table(campaign)
    rows = iter(table.rows[1:])
    mean, p95 = table.head.index("mean mm"), table.head.index("p95 mm")
    for trial in campaign.trials:
        for estimate in trial.estimates:
            row = next(rows)
            error = [
                1e3 * np.linalg.norm(T[:3, 3] - estimate.identification.model.poses([q])[0, :3, 3])
                for q, T in zip(setting.test_q, setting.test_true, strict=True)
            ]
            # written with four decimals of a millimetre
            assert number(row[mean]) == pytest.approx(np.mean(error), abs=0.5001e-4)
            assert number(row[p95]) == pytest.approx(np.quantile(error, 0.95), abs=0.5001e-4)
    assert next(rows, None) is None


def test_parameter_rows_hold_identified_minus_nominal_and_the_stated_uncertainty():
    campaign = rigid_campaign()
    trial = campaign.trials[0]
    estimate = trial.estimates[0]
    found = estimate.identification
    table = report_parameters.parameter_table(campaign.setting.nominal, trial, estimate)
    assert tuple(row[0] for row in table.rows) == found.names
    start = {"theta3": 90.0, "d4": 310.0, "alpha1": -90.0, "a2": 290.0, "base.x": 0.0}
    for row, step, u, scatter, true in zip(
        table.rows,
        found.step,
        found.standard_uncertainty,
        estimate.repeated.std(axis=0, ddof=1),
        estimate.comparison.true_step,
        strict=True,
    ):
        name, unit, nominal, identified, truth, error, expanded = row[:7]
        scale = 1e3 if unit == "mm" else 180 / np.pi
        half = 0.5 * 10.0 ** -len(expanded.partition(".")[2]) * 1.0001
        if name in start:
            assert number(nominal) == start[name]
        assert number(identified) - number(nominal) == pytest.approx(step * scale, abs=half)
        assert number(truth) - number(nominal) == pytest.approx(true * scale, abs=half)
        assert number(error) == pytest.approx((true - step) * scale, abs=half)
        assert number(expanded) == pytest.approx(2 * u * scale, abs=half)
        assert (row[-2] == "yes") == (abs(true - step) <= 1.959964 * u)
        assert (row[-1] == "yes") == (abs(true - step) <= 1.959964 * scatter)


@pytest.mark.parametrize("make", EVERY)
def test_every_column_of_numbers_says_its_unit(make):
    for table in tables(make):
        unit = re.compile(r"\[?\b(mm|deg|µm|%)\]?")
        own_unit = "unit" in table.head or unit.search(table.caption)
        for head, letter in zip(table.head, table.letters, strict=True):
            if letter == "r":
                assert own_unit or unit.search(head) or COUNTED.search(head), (table.caption, head)


@pytest.mark.parametrize("make", EVERY)
def test_tables_are_rectangular(make):
    for table in tables(make):
        assert len(table.head) == len(table.letters)
        assert {len(row) for row in table.rows} == {len(table.head)}


def test_sections_without_data_are_left_out_and_all_others_are_there():
    def anchors(page):
        return [section.anchor for section in page.sections]

    everything = [
        "believe",
        "accuracy",
        "belief",
        "identifiable",
        "poses",
        "secret",
        "bends",
        "calibrated-sets",
        "tool",
        "paper",
        "parameters",
        "record",
    ]
    assert anchors(page(paper_campaign)) == everything
    of_the_paper = ("bends", "calibrated-sets", "tool")  # a rigid robot bends nowhere
    assert anchors(page(bare_campaign)) == [a for a in everything if a not in of_the_paper]
    moved = bare_campaign()
    step = np.zeros(moved.setting.nominal.n_numbers)
    step[8] = 0.01
    own = replace(moved.setting, nominal=moved.setting.nominal.moved(step))
    assert "paper" not in anchors(page_of(with_records(moved, setting=own), VERSIONS))


def test_what_a_user_writes_is_text_never_markup():
    campaign = bare_campaign()
    title = '<script>alert(1)</script> & "quotes"'
    named = campaign.scenario.model_copy(update={"title": title})
    text = render(page_of(replace(campaign, scenario=named), {"<b>": "1"}))
    assert "<script" not in text
    assert "<b>1" not in text
    assert title in " ".join(read(text).text)


def test_seed_versions_and_the_whole_scenario_are_printed():
    campaign = rigid_campaign()
    text = " ".join(read(html(rigid_campaign)).text)
    assert f"seed {campaign.scenario.seed}" in text
    assert "truebed 0.0.0" in text
    for line in dump_scenario(campaign.scenario).splitlines():
        assert line.strip() in text


def test_a_model_that_lacks_something_says_so_and_what_is_believed_is_quoted():
    wrong = verdict.next_step(paper_campaign())
    assert "the model lacks something that the robot has" in wrong
    assert "µm (3-D radius, 95 %) for the mean of many moves" in wrong
    campaign = rigid_campaign()
    trial = campaign.trials[0]
    fit = replace(trial.estimates[0].identification, chi_square=150.0, dof=150, p_value=0.48)
    honest = replace(
        trial.estimates[0],
        identification=fit,
        replications=None,
        comparison=replace(trial.estimates[0].comparison, inside=np.ones(20, dtype=bool)),
    )
    good = replace(campaign, trials=(replace(trial, estimates=(honest,)),))
    radius = 1e6 * honest.statement.point.radius_mean
    assert verdict.next_step(good).startswith(f"Quote {radius:.3g} µm (3-D radius, 95 %)")


def test_failing_intervals_are_named_and_holding_ones_are_said_to_hold():
    campaign = rigid_campaign()
    trial = campaign.trials[0]
    estimate = trial.estimates[0]
    f = len(estimate.identification.names)
    honest = replace(
        estimate.replications,
        nees=np.full(40, float(f)),
        nees_band=np.array([f - 1.0, f + 1.0]),
        parameter_coverage=np.full(f, 0.95),
        coverage_band=np.array([0.8, 1.0]),
    )
    said = intervals_in_words(trial, replace(estimate, replications=honest))
    assert "the intervals of the parameters hold" in said
    covered = np.full(f, 0.95)
    covered[3] = 0.10
    one = replace(honest, parameter_coverage=covered)
    said = intervals_in_words(trial, replace(estimate, replications=one))
    assert "the intervals of the parameters fail" in said
    assert f"too narrow for 1 of {f} parameters ({estimate.identification.names[3]} 10" in said


def test_paper_mode_intervals_are_reported_as_failing_on_a_rigid_robot():
    campaign = rigid_campaign()
    for trial in campaign.trials:
        said = intervals_in_words(trial, trial.estimates[1])
        assert (
            "paper mode, covariance of the unweighted fit: the intervals of the parameters fail"
            in said
        )


def test_dropped_parameters_are_explained_by_the_sentences_of_the_reduction():
    campaign = rigid_campaign()
    found = campaign.trials[0].estimates[0].identification.reduction
    assert len(found.kept) == 30
    text = " ".join(read(html(rigid_campaign)).text)
    assert len(found.sentences) >= 12
    for sentence in found.sentences:
        assert " ".join(sentence.split()) in text


def test_every_candidate_is_accounted_for_in_the_pool_table():
    table = report_design.design_section(paper_campaign()).blocks[0]
    count = {row[0]: int(row[1]) for row in table.rows}
    refused = sum(n for name, n in count.items() if name.startswith("refused"))
    assert count["drawn"] == refused + count["feasible"]
    assert count["feasible"] >= 160


def test_a_set_as_large_as_the_pool_is_compared_without_dividing_by_zero():
    one = replace(paper_campaign().random_sets[0], values=np.full(30, 2.0), chosen_value=2.0)
    assert "beats 0 of 30" in report_design.beaten(one)


def test_a_rule_that_never_stops_is_said_in_words():
    study = replace(paper_campaign().pose_count, chosen=(None, 31))
    said = report_design.settling(study)
    assert "nowhere up to 150 poses for O1, 31 poses for O2" in said


def test_printed_tables_stand_beside_ours_in_their_places():
    campaign = without(paper_campaign(), "random_calibrations")
    one, two = report_paper.error_tables(campaign)
    assert one.rows[0][0] == "61 optimal (O1)"
    assert [row[1] for row in one.rows] == ["0.545", "0.593", "0.377", "0.587"]
    ours = campaign.trials[3].estimates[1].comparison
    assert campaign.trials[3].name == "random-29"
    assert one.rows[3][4] == f"{ours.identification_after.mean * 1e3:.3f}"
    assert two.rows[3][4] == f"{ours.accuracy_after.mean * 1e3:.3f}"
    budget = report_paper.budget_table(paper_budget_of(campaign), "")
    theta3 = next(row for row in budget.rows if row[0] == "theta3")
    assert theta3[2].startswith("0.0015 / ")
    k = paper_budget_of(campaign).names.index("theta3")
    assert theta3[6].endswith(f"{np.degrees(paper_budget_of(campaign).best[0, k]):.4f}")
