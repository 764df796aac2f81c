"""Many pose sets compared: intervals hold what they say, and the words follow them exactly."""

from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from unittest.mock import patch

import numpy as np
import pytest
from scipy import stats

from calib.design import Problem, best_of_random, detmax, exchange, fedorov, greedy, random_set
from calib.information.criteria.named import criterion_named
from testbed.laboratory.goal import goals_of
from testbed.laboratory.truth.laboratory import open_laboratory
from testbed.laboratory.truth.setting import make_setting
from testbed.report.page import render
from testbed.run.derive import headline, page_of
from testbed.scenario.read import changed
from testbed.scenario.tables import TrialSettings
from testbed.streams import stream
from testbed.studies import load_scenario
from testbed.studies.over_robots import family_confidence, log_ratio_over_robots, outcome_of
from testbed.studies.pose_sets import report as report_pose_sets
from testbed.studies.pose_sets.compare import contest_of, population_of
from testbed.studies.pose_sets.play import set_for
from testbed.studies.pose_sets.plots import forest, kinds
from testbed.studies.protocol import Records
from testbed.studies.trial.play import criterion_of, select
from testbed.studies.trial.records import campaign_of
from tests.calib.slopes import slopes
from tests.campaign import record_hash, with_records
from tests.reported import VERSIONS, played, printed_pages, read, undrawn

ROBOTS, SIZES = 6, (15, 29)
SMALLER = {
    "pool.size": 80,
    "test.poses": 15,
    "uncertainty.repeats": 2,
    "uncertainty.replications": 0,
    "studies.random_sets": 20,
    "studies.population": ROBOTS,
}


def trials():
    everything = load_scenario("pose_sets").trial
    return [trial.model_dump() for trial in everything if trial.poses in SIZES]


@contextmanager
def nothing_proven():
    """No certificate of a set: they take most of a small search, and have tests of their own."""
    with patch("calib.design.selection.certificate_of", lambda *_: None):
        yield


@cache
def crowd():
    """The scene pose_sets with two sizes, a small pool and few robots."""
    with nothing_proven():
        return played("pose_sets", {**SMALLER, "trial": trials()})


@cache
def bench():
    campaign = crowd()
    return open_laboratory(campaign.scenario, campaign.setting)


def with_errors(errors):
    """The campaign with other mean errors (trials, robots), the same for rms."""
    campaign = crowd()
    values = np.array(errors)[:, None, :]
    study = replace(
        population_of(campaign),
        mean_error=values,
        rms_error=values,
        stated_u=np.full(values.shape, 1e-5),
        goal_u=np.full(np.shape(errors), 1e-5),
        before=np.full(np.shape(errors)[1], 5e-4),
    )
    return with_records(campaign, population=study)


def lucky(rng, factors, robots, noise=0.1):
    """Errors (trials, robots): a robot's luck, common to all trials, times each trial's factor."""
    common = rng.lognormal(-9, 0.4, robots)
    return common * np.array(factors)[:, None] * rng.lognormal(0, noise, (len(factors), robots))


def test_all_intervals_hold_at_once_in_95_percent_of_campaigns():
    """24 sets against three references: the reference's luck is common to eight of them."""
    rng, robots, held, each = np.random.default_rng(0), 20, [], []
    z = family_confidence(24)
    for _ in range(400):
        errors = lucky(rng, [1.0] * 27, robots)
        pairs = [(i, 24 + i % 3) for i in range(24)]
        joint = [log_ratio_over_robots(errors[i], errors[k], probability=z) for i, k in pairs]
        held.append(all(r.low <= 0 <= r.high for r in joint))
        single = [log_ratio_over_robots(errors[i], errors[k]) for i, k in pairs]
        each += [r.low <= 0 <= r.high for r in single]
    # Bonferroni promises at least 95 %; 400 campaigns scatter by 1.1 %, three of those allowed
    assert np.mean(held) >= 0.95 - 0.033
    # by themselves: eight share a reference, so a campaign's share scatters by some 0.06, and the
    # mean of 400 by 0.003; three of those
    assert np.mean(each) == pytest.approx(0.95, abs=0.01)


def test_without_the_correction_some_of_24_equal_sets_would_be_called_better_or_worse():
    rng = np.random.default_rng(1)
    wrong = corrected = 0
    for _ in range(60):
        errors = lucky(rng, [1.0] * 25, 20)
        wrong += any(
            outcome_of(log_ratio_over_robots(one, errors[24])) != "undecided" for one in errors[:24]
        )
        z = family_confidence(24)
        corrected += any(
            outcome_of(log_ratio_over_robots(one, errors[24], probability=z)) != "undecided"
            for one in errors[:24]
        )
    assert wrong > 20
    assert corrected < 12  # 5 % of 60 is 3, with a standard deviation of 1.7; five of those


def test_a_set_compared_with_itself_has_ratio_one_exactly():
    errors = lucky(np.random.default_rng(2), [1.0], 9)[0]
    ratio = log_ratio_over_robots(errors, errors)
    assert (ratio.value, ratio.low, ratio.high) == (0.0, 0.0, 0.0)
    assert outcome_of(ratio) == "undecided"


@pytest.mark.slow
def test_a_copy_of_the_random_set_is_undecided_with_ratio_one():
    campaign = crowd()
    errors = population_of(campaign).mean_error[:, 0].copy()
    names = population_of(campaign).trials
    errors[names.index("d-29")] = errors[names.index("random-29")]
    (entry,) = (e for e in contest_of(with_errors(errors)).entries if e.trial.name == "d-29")
    assert (entry.ratio.value, entry.joint.low, entry.joint.high) == (0.0, 0.0, 0.0)
    assert entry.wins == 0.0
    assert entry.outcome == "undecided"


@pytest.mark.slow
def test_the_order_of_the_trials_changes_nothing():
    campaign = crowd()
    order = np.random.default_rng(3).permutation(len(campaign.trials))
    study = population_of(campaign)
    shuffled = with_records(
        replace(campaign, trials=tuple(campaign.trials[i] for i in order)),
        population=replace(
            study,
            trials=tuple(study.trials[i] for i in order),
            mean_error=study.mean_error[order],
            rms_error=study.rms_error[order],
            stated_u=study.stated_u[order],
            inside=study.inside[order],
            goal_u=study.goal_u[order],
        ),
    )
    one, other = contest_of(campaign), contest_of(shuffled)
    for size in SIZES:
        a, b = report_pose_sets.size_table(one, size), report_pose_sets.size_table(other, size)
        assert a.rows == b.rows


def test_trials_played_in_another_order_meet_the_same_robots_with_the_same_sets():
    names = ("v-29", "random-15", "paper-o2-29")
    few = [trial for trial in trials()[::-1] if trial["name"] in names]
    changes = {"trial": few, "studies.population": 2, "studies.random_sets": 0}
    with nothing_proven():
        again = population_of(played("pose_sets", SMALLER | changes))
    first = population_of(crowd())
    assert list(again.trials) != sorted(again.trials, key=first.trials.index)
    for name in names:
        i, k = first.trials.index(name), again.trials.index(name)
        assert np.array_equal(first.mean_error[i, :, :2], again.mean_error[k])
        assert np.array_equal(first.goal_u[i, :2], again.goal_u[k])


@pytest.mark.parametrize("factor", [0.8, 0.97, 1.0, 1.03, 1.25])
@pytest.mark.parametrize("noise", [1e-3, 0.05, 0.4])
def test_the_sentence_says_worse_exactly_when_the_interval_lies_above_one(factor, noise):
    names = population_of(crowd()).trials
    factors = [1.0 if name.startswith("random") else factor for name in names]
    rng = np.random.default_rng(int(1000 * factor * (1 + noise)))
    errors = lucky(rng, factors, 12, noise)
    contest = contest_of(with_errors(errors))
    assert contest.comparisons == 16
    for entry in contest.entries:
        if entry.ratio is None:
            continue
        own, other = (names.index(n) for n in (entry.trial.name, f"random-{entry.poses}"))
        log = np.log(errors[own] / errors[other])
        low, high = stats.t.interval(1 - 0.05 / 16, 11, log.mean(), stats.sem(log))
        said = report_pose_sets.sentence(entry, contest)
        assert (" worse than " in said) == (low > 0)
        assert (" better than " in said) == (high < 0)
        assert ("cannot be told apart" in said) == (low <= 0 <= high)
        assert (report_pose_sets.cell(entry).split()[0] == "worse") == (low > 0)
        table = report_pose_sets.size_table(contest, entry.poses)
        (row,) = (row for row in table.rows if row[0] == entry.trial.name)
        assert (row[table.head.index("result")] == "worse") == (low > 0)


def test_on_paper_many_sets_take_five_pages_and_what_is_left_out_is_said(tmp_path):
    """All 27 sets, by the numbers of those that were played: each row is as long as its own."""
    campaign = crowd()
    third = tuple(
        replace(t, name=t.name.replace("29", "61")) for t in campaign.trials if "29" in t.name
    )
    study, names = population_of(campaign), population_of(campaign).trials
    rows = [*range(len(names)), *(names.index(t.name.replace("61", "29")) for t in third)]
    study = replace(
        study,
        trials=(*names, *(trial.name for trial in third)),
        **{
            name: getattr(study, name)[rows]
            for name in ("mean_error", "rms_error", "stated_u", "inside", "goal_u")
        },
    )
    own = [trial.model_dump() for trial in load_scenario("pose_sets").trial]
    many = with_records(campaign, population=study)
    values = {**many.records.values, **{trial.name: trial for trial in third}}
    made = campaign_of(changed(campaign.scenario, {"trial": own}), Records(values, {}))
    html = render(page_of(made, VERSIONS))
    assert len(names) == 18
    assert len(study.trials) == 27
    assert printed_pages(html, tmp_path) <= 5
    said = " ".join(read(html).said)
    assert "Not printed, but in report.html: What bends this arm" in said
    assert "long tables. Every number is in result.json." in said


def test_a_sentence_reads_as_it_should():
    names = population_of(crowd()).trials
    rng = np.random.default_rng(4)
    factors = [1.0 if name.startswith("random") else 1.12 for name in names]
    factors[names.index("v-29")] = 0.9
    contest = contest_of(with_errors(lucky(rng, factors, 40, 1e-5)))
    said = {e.trial.name: report_pose_sets.sentence(e, contest) for e in contest.entries if e.ratio}
    assert said["paper-o1-29"] == (
        "The paper's O1 set of 29 is 12.0 % worse than random sets of 29 (joint 95 % CI 12.0 "
        "to 12.0 %; smaller error on 0\u202f% of 40 robots)."
    )
    assert said["v-29"].startswith("The V set by exchange of 29 is 10.0 % better than random sets")
    assert said["best-of-random-15"].startswith("The best of 100 random sets by D of 15 is 12.0 %")
    assert report_pose_sets.leader(contest, 15).endswith("better than random ones.")
    assert "the V set by exchange" in report_pose_sets.leader(contest, 29)


def test_a_set_that_is_better_leads_even_if_an_undecided_one_has_the_smaller_mean():
    names = population_of(crowd()).trials
    rng = np.random.default_rng(6)
    errors = lucky(rng, [0.95 if name == "v-29" else 1.0 for name in names], 40, 1e-5)
    luck = rng.normal(size=40)
    errors[names.index("e-29")] *= 0.9 * np.exp(luck - luck.mean())
    contest = contest_of(with_errors(errors))
    outcome = {e.trial.name: e.outcome for e in contest.entries}
    assert (outcome["v-29"], outcome["e-29"]) == ("better", "undecided")
    assert contest.of_size(29)[0].trial.name == "e-29"
    assert "the V set by exchange" in report_pose_sets.leader(contest, 29)


@pytest.mark.parametrize(
    ("method", "call"),
    [
        ("random", random_set),
        ("best_of_random", lambda *a: best_of_random(*a, sets=7)),
        ("greedy", lambda problem, _: greedy(problem)),
        ("detmax", detmax),
        ("fedorov", fedorov),
        ("exchange", exchange),
    ],
)
@pytest.mark.parametrize("criterion", ["D", "V"])
def test_select_is_the_direct_call_of_each_algorithm(method, call, criterion):
    settings = TrialSettings(name="a", poses=9, method=method, criterion=criterion, sets=7)
    blocks = bench().design_blocks("whitened")[:60]
    made = criterion_named(criterion, goals=goals_of(bench()))
    with nothing_proven():
        ours = select(blocks, settings, stream(5, "x"), criterion_of(bench(), settings))
        theirs = call(Problem.of_blocks(blocks, 9, made), stream(5, "x"))
    assert ours.indices.tolist() == theirs.indices.tolist()
    assert (ours.value, ours.method, ours.criterion) == (theirs.value, method, criterion)


@pytest.mark.parametrize("name", ["D", "A", "V", "G", "E", "O1", "O2", "O3", "O4", "O5"])
def test_every_criterion_can_be_asked_of_a_trial(name):
    settings = TrialSettings(name="a", poses=8, method="greedy", criterion=name)
    blocks = bench().design_blocks("whitened")[:40]
    with nothing_proven():
        found = select(blocks, settings, stream(5, "x"), criterion_of(bench(), settings))
    assert found.criterion == name
    assert len(set(found.indices.tolist())) == 8


def brute_force_u(places):
    """RMS 3-D tool-point u over the goal, by finite steps of the model and a plain inverse."""
    setting, table = crowd().setting, bench().kept()
    model, free = setting.nominal, table.free_index
    from testbed.laboratory.bench import open_bench
    from testbed.laboratory.goal import goal_of

    goal = goal_of(open_bench(crowd().scenario))
    q = setting.pool_q[places]
    covariance = bench().covariance(q)
    A = model.poses_and_jacobian(q)[1][:, :, free]
    M = sum(a.T @ np.linalg.inv(c) @ a for a, c in zip(A, covariance, strict=True))
    C = np.linalg.inv(M)
    J = slopes(
        lambda step: model.moved(step).poses(goal.q)[:, :3, 3], np.zeros(model.n_numbers), by=free
    )
    return float(np.sqrt(np.einsum("gip,pq,giq,g->", J, C, J, goal.weights)))


def test_the_figure_of_a_v_trial_is_the_tool_point_u_worked_out_by_hand():
    trial = next(t for t in crowd().trials if t.name == "v-29")
    # central differences of 1e-6 leave 1e-9 relative; the inverse loses cond^2 * eps = 1e-12
    assert trial.selection.value == pytest.approx(brute_force_u(trial.selection.indices), rel=1e-7)
    study = population_of(crowd())
    i = study.trials.index("v-29")
    assert study.goal_u[i] == pytest.approx(trial.selection.value, rel=1e-9)


def test_a_random_set_promises_another_u_to_each_robot():
    campaign = crowd()
    study, trial = (
        population_of(campaign),
        next(t for t in campaign.trials if t.name == "random-15"),
    )
    i = study.trials.index("random-15")
    assert len(np.unique(study.goal_u[i])) == ROBOTS
    places = set_for(bench(), trial, 3)
    assert study.goal_u[i, 3] == pytest.approx(brute_force_u(places), rel=1e-7)


def test_goal_poses_are_neither_held_out_nor_candidates():
    from testbed.laboratory.bench import open_bench
    from testbed.laboratory.goal import goal_of

    setting = crowd().setting
    goal = {row.tobytes() for row in goal_of(open_bench(crowd().scenario)).q}
    assert len(goal) == 200
    assert not goal & {row.tobytes() for row in np.vstack([setting.test_q, setting.pool_q])}


def test_a_trial_depends_on_the_goal_only_if_its_criterion_does():
    from testbed.robots.catalog import load_robot

    scenario = crowd().scenario
    other = changed(scenario, {"plan.goal": {"kind": "box", "poses": 50}})
    robot = load_robot(scenario.robot)
    moved = {
        key
        for key in ("setting", "d-29", "v-29", "population")
        if record_hash(scenario, robot, key) != record_hash(other, robot, key)
    }
    assert moved == {"v-29", "population"}


def test_a_goal_out_of_reach_is_refused_before_any_trial():
    from calib.errors import InputError
    from tests import campaign

    far = {"kind": "list", "tool_mm_deg": [[9000.0, 0.0, 0.0, 0.0, 0.0, 0.0]]}
    scenario = changed(crowd().scenario, {"plan.goal": far})
    with pytest.raises(InputError, match="outside the robot's reach"):
        campaign.compute(scenario, "setting", None)
    only_d = changed(scenario, {"studies.population": 0, "trial": [trials()[2]]})
    make_setting(only_d)
    campaign.compute(only_d, "setting", None)


def test_the_report_of_many_trials_opens_with_the_contest():
    campaign = crowd()
    with undrawn():
        page = page_of(campaign, VERSIONS)
    assert page.sections[0].title == "Which pose set is best?"
    assert page.headline.head == ("pose set", "15 poses", "29 poses")
    assert len(page.headline.rows) == 9
    assert [row[0] for row in page.headline.rows] == list(kinds(contest_of(campaign)))
    text = " ".join(read(render(page)).text)
    for trial in campaign.trials:
        assert trial.name in text
    assert "16 comparisons" in text
    # the first words answer the scene's question; the first trial's own comes last
    assert "of 16 chosen pose sets beat random ones of their size" in page.mark
    assert page.verdict.startswith("Of 16 chosen sets")
    assert "mean tool error on held-out poses" in page.reasons[-1]
    assert page.next_step.startswith(("Take the set shown best", "No set is shown to be better"))
    assert forest(contest_of(campaign)).startswith("<svg")
    figures = headline(campaign)["population"]["trials"]
    assert {"against_random" in figures[name] for name in ("random-15", "random-29")} == {False}
    ratio = figures["v-29"]["against_random"]
    assert ratio["joint_ci_95"][0] < ratio["ci_95"][0] < ratio["error_ratio"] < ratio["ci_95"][1]


def test_figures_in_a_table_have_their_units():
    from testbed.studies.trial.report_design import beaten, beaten_table, figure

    sets = {one.trial: one for one in crowd().random_sets}
    v = sets["v-29"]
    assert (v.unit, v.larger_is_better) == ("m", False)
    assert v.beaten == 20
    assert v.best == v.values.min()
    assert "µm" in beaten(v)
    assert "below their mean" in beaten(v)
    assert (sets["paper-o1-29"].unit, sets["d-29"].unit) == ("1", "1")
    assert figure("m", 12.5e-6) == "12.50 µm"
    rows = {row[0]: row for row in beaten_table(tuple(sets.values())).rows}
    assert rows["v-29"][2].endswith("µm")
    assert float(rows["v-29"][-1]) > 0
    assert "µm" not in rows["e-29"][2]


def test_few_trials_make_no_contest():
    from testbed.studies.pose_sets.compare import has_contest

    campaign = crowd()
    assert has_contest(campaign)
    assert not has_contest(replace(campaign, trials=campaign.trials[:4]))
    assert not has_contest(with_records(campaign, population=None))
