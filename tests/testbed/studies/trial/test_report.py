"""report.html: verdict first, self-contained, each number with its unit and as in the record."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from testbed.report.page import SIMULATED, Table, rejections, render
from testbed.run.derive import page_of
from testbed.studies.trial import report_accuracy, report_design, report_parameters, verdict
from testbed.studies.trial.advice import next_step
from testbed.studies.trial.report_accuracy import CLEARLY, too_narrow, truth_table
from testbed.studies.trial.set_records import RandomSets
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
    said_twice,
    undrawn,
)

EVERY = [paper_campaign, rigid_campaign, bare_campaign, point_campaign]
COUNTED = re.compile(  # columns whose numbers count, compare or index, and so have no unit
    r"inside|^poses$|χ²/dof|\bp$|rank|NEES|coverage|better than|index and error"
    r"|stated / true|^#$|^O[1-5]$|number|share|^u_?|ratio|parameters inside|/ u$"
    r"|^type A: (t$|(\|P\||point) in)|point in region"
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
    first_section = text.index("Uncertainty, and whether it holds")
    first_screen = " ".join(text[:first_section])
    assert " ".join(page(make).verdict.split()) in first_screen
    for wanted in ("mean mm", "χ²/dof", "believe", "Next step.", "recording"):
        assert wanted in first_screen


@pytest.mark.parametrize("make", EVERY)
def test_no_sentence_is_said_twice(make):
    assert said_twice(html(make)) == []


@pytest.mark.parametrize("make", EVERY)
def test_the_page_is_well_formed_and_needs_nothing_from_outside(make):
    seen = read(html(make))
    assert seen.open == []
    assert not {"script", "link", "img", "iframe", "object", "base"} & set(seen.tags)
    inside = {link[1:] for link in seen.links if link.startswith("#")}
    assert inside <= set(seen.ids)
    assert {link for link in seen.links if not link.startswith("#")} == {"campaign.rrd"}
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
    poses = table.head.index("poses")
    for trial in campaign.trials:
        for estimate in trial.estimates:
            row = next(rows)
            first = estimate is trial.estimates[0]
            assert row[poses] == (str(len(trial.measurements)) if first else "")
            error = [
                1e3 * np.linalg.norm(T[:3, 3] - estimate.identification.model.poses([q])[0, :3, 3])
                for q, T in zip(setting.test_q, setting.test_true, strict=True)
            ]
            # the last digit of the smallest mean decides the decimals of all
            half = 0.5001 * 10.0 ** -len(row[mean].partition(".")[2])
            assert number(row[mean]) == pytest.approx(np.mean(error), abs=half)
            assert number(row[p95]) == pytest.approx(np.quantile(error, 0.95), abs=half)
    assert next(rows, None) is None


def test_parameter_rows_hold_identified_minus_nominal_and_the_stated_uncertainty():
    campaign = rigid_campaign()
    trial = campaign.trials[0]
    estimate = trial.estimates[0]
    found = estimate.identification
    table = report_parameters.parameter_table(campaign.setting.nominal, trial, estimate)
    assert tuple(row[0] for row in table.rows) == found.names
    factor = stats.t.ppf(0.975, len(estimate.repeated) - 1)
    assert f"Student's t = {factor:.2f} for {len(estimate.repeated) - 1} degree" in table.note
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
        # Student's factor, as the note says
        assert (row[-1] == "yes") == (abs(true - step) <= factor * scatter)


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
        "accuracy",
        "believe",
        "poses",
        "secret",
        "bends",
        "calibrated-sets",
        "tool",
        "paper",
        "parameters",
        "words",
        "record",
    ]
    assert anchors(page(paper_campaign)) == everything
    # a rigid robot bends nowhere; of one trial the first screen shows the errors
    of_the_paper = ("accuracy", "bends", "calibrated-sets", "tool", "paper")
    assert anchors(page(bare_campaign)) == [a for a in everything if a not in of_the_paper]
    moved = without(paper_campaign(), "paper_budget", "tool_point", "random_calibrations")
    step = np.zeros(moved.setting.nominal.n_numbers)
    step[8] = 0.01
    own = replace(moved.setting, nominal=moved.setting.nominal.moved(step))
    with undrawn():
        assert "paper" not in anchors(page_of(with_records(moved, setting=own), VERSIONS))


def test_a_robot_of_ones_own_is_named_without_the_path_of_this_machine():
    campaign = bare_campaign()
    own = campaign.scenario.model_copy(update={"robot": "/home/me/mine/robot.toml"})
    with undrawn():
        page = page_of(replace(campaign, scenario=own), VERSIONS)
    assert page.subtitle.endswith("robot mine")


def test_what_a_user_writes_is_text_never_markup():
    campaign = bare_campaign()
    title = '<script>alert(1)</script> & "quotes"'
    named = campaign.scenario.model_copy(update={"title": title})
    text = render(page_of(replace(campaign, scenario=named), {"<b>": "1"}))
    assert "<script" not in text
    assert "<b>1" not in text
    assert title in " ".join(read(text).text)


def test_seed_and_versions_are_printed_and_where_the_scenario_lies():
    campaign = rigid_campaign()
    text = " ".join(read(html(rigid_campaign)).text)
    assert f"seed {campaign.scenario.seed}" in text
    assert "truebed 0.0.0, numpy 0." in text
    assert "scenario.toml beside this page" in text


def test_a_model_that_lacks_something_says_so_and_what_is_believed_is_quoted():
    wrong = next_step(paper_campaign())
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
    assert next_step(good).startswith(f"Quote {radius:.3g} µm (3-D radius, 95 %)")


def test_intervals_that_are_too_narrow_are_counted_and_the_worst_named():
    estimate = rigid_campaign().trials[0].estimates[0]
    names = estimate.identification.names
    covered = np.full(len(names), 0.95)
    honest = replace(
        estimate.replications, parameter_coverage=covered, coverage_band=np.array([0.8, 0.99])
    )
    assert too_narrow(names, honest) == "none"
    worse, best = covered.copy(), covered.copy()
    worse[[3, 5, 7, 9]], best[2] = (0.1, 0.3, 0.2, 0.7), 1.0
    said = too_narrow(names, replace(honest, parameter_coverage=worse))
    assert said == f"4 of {len(names)}: {names[3]}, {names[7]}, {names[5]}, …"
    assert too_narrow(names, replace(honest, parameter_coverage=best)) == "none; 1 too wide"


def test_paper_mode_intervals_are_reported_as_failing_on_a_rigid_robot():
    table = truth_table(rigid_campaign())
    for row in table.rows:
        assert (row[-1] == "none") == (row[1] == "default")


def test_dropped_parameters_are_named_with_those_that_stand_for_them():
    found = rigid_campaign().trials[0].estimates[0].identification.reduction
    assert len(found.kept) == 30
    text = " ".join(read(html(rigid_campaign)).text)
    assert len(found.sentences) >= 12
    for name in found.dropped:
        assert re.search(rf"\b{name} \(as [\w.]+\)", text), name


def test_every_candidate_is_accounted_for():
    said = report_design.design_section(paper_campaign()).blocks[0].items[0]
    refused, _, kept = said.partition("; the pool is ")
    drawn, lost, *counts = map(int, re.findall(r"\d+", refused))
    feasible = int(re.findall(r"\d+", kept)[-1])
    assert lost == sum(counts)
    assert drawn == lost + feasible
    assert feasible >= 160
    assert rejections(9, ["floor"], np.array([0]), 9) == (
        "Of 9 candidate poses none was refused; the pool is 9 feasible ones."
    )


def test_a_set_as_large_as_the_pool_is_compared_without_dividing_by_zero():
    one = replace(paper_campaign().random_sets[0], values=np.full(30, 2.0), chosen_value=2.0)
    assert "beats 0 of 30" in report_design.beaten(one)


def test_random_sets_that_leave_a_number_undetermined_are_beaten_and_have_no_figure():
    some = RandomSets("d", "O1", "1", True, 16, 3.0, np.array([1.0, 2.0]), 4)
    assert (some.drawn, some.beaten, some.mean, some.best) == (6, 6, 1.5, 2.0)
    said = report_design.beaten(some)
    assert "beats all 6 random sets" in said
    assert "mean 1.500, best 2.000, but for 4 that leave a number undetermined" in said
    none = RandomSets("d", "O1", "1", True, 16, 3.0, np.zeros(0), 6)
    assert (none.mean, none.best, report_design.ahead(none)) == (None, None, 0.0)
    assert "as none of 6 random sets does" in report_design.beaten(none)
    (row,) = report_design.beaten_table([none]).rows
    assert row[2:5] == ("3.000", "-", "-")
    assert row[5] == "6 of 6"


def test_a_rule_that_never_stops_is_said_in_words():
    study = replace(paper_campaign().pose_count, chosen=(None, 31))
    said = report_design.settling(study)
    assert "nowhere up to 150 poses for O1, 31 poses for O2" in said


def test_printed_tables_stand_beside_ours_in_their_places():
    campaign = without(paper_campaign(), "random_calibrations")
    table = report_paper.error_table(campaign)
    assert table.rows[0][0] == "61 optimal (O1)"
    assert [row[1] for row in table.rows] == ["0.545", "0.593", "0.377", "0.587"]
    ours = campaign.trials[3].estimates[1].comparison
    assert campaign.trials[3].name == "random-29"
    assert table.rows[3][4] == f"{ours.identification_after.mean * 1e3:.3f}"
    assert table.rows[3][6] == f"{ours.accuracy_after.mean * 1e3:.3f}"
    budget = paper_budget_of(campaign)
    ratios = report_paper.ratio_table(budget, "")
    assert ratios.rows[0] == ("printed", "0.11", "0.37")
    assert ratios.rows[1][1] == f"{np.mean(budget.best[0] / budget.random):.2f}"


def test_a_refuted_statement_beside_a_smaller_error_is_explained_where_the_verdict_stands():
    for make in (rigid_campaign, paper_campaign, bare_campaign):
        campaign = make()
        pairs = [
            (trial, one, other)
            for trial in campaign.trials
            for one in trial.estimates
            for other in trial.estimates
            if verdict.judge(trial, one).contradicted
            and verdict.judge(trial, other).believable
            and CLEARLY * one.comparison.after.mean() < other.comparison.after.mean()
        ]
        said = page(make).verdict
        assert ("estimator has the smaller mean error" in said) == bool(pairs)
        if pairs:
            trial, one, other = pairs[0]
            means = [1e3 * e.comparison.after.mean() for e in (one, other)]
            assert f"With {trial.name} the paper estimator" in said
            assert f"({means[0]:.4f} against {means[1]:.4f} mm)" in said
            assert report_accuracy.percent(one.inside.mean()) in said
    assert "smaller mean error" in page(rigid_campaign).verdict
