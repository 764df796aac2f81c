"""Many robots: the robot is the unit, pairs are pairs, and the words follow the numbers."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from calib.information.criteria.linear import v_of
from testbed.laboratory.goal import goals_of
from testbed.laboratory.truth.laboratory import open_laboratory
from testbed.run.derive import headline
from testbed.scenario.read import changed
from testbed.studies.over_robots import log_ratio_over_robots, mean_over_robots
from testbed.studies.pose_sets.compare import contest_of, population_of
from testbed.studies.pose_sets.play import gather, play_robot, play_robots, play_together
from testbed.studies.pose_sets.report_population import population_section, sentences
from tests.reported import SMALL, assert_same, played

ROBOTS = 20


@pytest.fixture(scope="module")
def crowd():
    changes = {**SMALL, "uncertainty.replications": 0, "studies.population": ROBOTS}
    return played("quick", changes)


def test_each_trial_and_estimator_has_one_figure_per_robot(crowd):
    study = population_of(crowd)
    assert study.mean_error.shape == (2, 2, ROBOTS)
    assert len(np.unique(study.before)) == ROBOTS
    assert (study.rms_error >= study.mean_error).all()
    assert headline(crowd)["population"]["robots"] == ROBOTS


def test_on_rigid_robots_stated_u_is_the_empirical_error(crowd):
    """Each rms over 20 robots and 20 poses; poses share a robot's 30 numbers."""
    study = population_of(crowd)
    for i in range(2):
        rms = np.sqrt(np.mean(study.rms_error[i, 0] ** 2))
        u = np.sqrt(np.mean(study.stated_u[i, 0] ** 2))
        # the mean square of a robot scatters by about sqrt(2/5) (a few numbers dominate it);
        # over 20 robots the root scatters by 7 %, and four of those are allowed
        assert rms / u == pytest.approx(1.0, abs=0.28)
        # the paper's estimator claims far less than it errs
        paper = np.sqrt(np.mean(study.rms_error[i, 1] ** 2))
        assert paper / np.sqrt(np.mean(study.stated_u[i, 1] ** 2)) > 1.28


def test_a_mean_over_robots_has_students_interval():
    values = np.random.default_rng(0).normal(3.0, 0.5, 24)
    mean = mean_over_robots(values)
    low, high = stats.t.interval(0.95, 23, values.mean(), stats.sem(values))
    assert (mean.low, mean.high) == pytest.approx((low, high), rel=1e-12)


def test_confidence_intervals_hold_the_true_ratio_in_95_percent():
    rng, held = np.random.default_rng(1), 0
    for _ in range(2000):
        luck = rng.lognormal(0, 0.5, 12)  # shared by both: the pairing removes it
        ratio = log_ratio_over_robots(
            luck * 0.9 * rng.lognormal(0, 0.1, 12), luck * rng.lognormal(0, 0.1, 12)
        )
        held += ratio.low <= np.log(0.9) <= ratio.high
    # binomial: sd of 2000 trials at 0.95 is 0.0049; 3.5 of those
    assert held / 2000 == pytest.approx(0.95, abs=0.017)


def test_words_say_better_worse_or_that_it_cannot_be_told(crowd):
    contest, rng = contest_of(crowd), np.random.default_rng(2)
    entry = next(entry for entry in contest.entries if entry.joint is not None)
    other = rng.lognormal(0, 0.1, 30)
    for errors, words in (
        (other * 0.8, "designed-29 is better than random-29 ("),
        (other * 1.2, "designed-29 is worse than random-29 ("),
        (rng.permutation(other), "designed-29 and random-29 cannot be told apart ("),
    ):
        joint = log_ratio_over_robots(errors, other)
        entries = (*contest.entries, replace(entry, joint=joint))
        assert sentences(replace(contest, entries=entries))[-1].startswith(words)


def test_the_report_has_the_section_only_where_many_robots_were_played(crowd):
    section = population_section(crowd)
    text = " ".join(section.blocks[2].items)
    assert "designed-29" in text
    assert "random-29" in text
    bare = played("quick", {**SMALL, "uncertainty.replications": 0})
    assert population_section(bare) is None


def test_robots_played_in_pieces_are_those_played_at_once(crowd):
    given = crowd.scenario, crowd.setting, crowd.trials
    parts = [play_robots(*given, range(3)), play_robots(*given, range(3, ROBOTS))]
    assert_same(gather(parts), population_of(crowd))


@pytest.mark.parametrize("truth", ["wen2022", "elastic"])
def test_robots_played_together_are_those_played_alone(crowd, truth):
    """Fits end within 1e-10 standard deviations, and points of a few meters are rounded."""
    scenario = changed(crowd.scenario, {"truth": {"preset": truth}})
    laboratory = open_laboratory(scenario, crowd.setting)
    given = crowd.trials, laboratory.design_blocks("whitened"), v_of(goals_of(laboratory))
    assert crowd.scenario.identification.estimators == ("whitened", "paper")
    many = play_together(laboratory, *given, range(3))
    alone = gather([play_robot(laboratory, *given, k) for k in range(3)])
    for name in ("mean_error", "rms_error", "stated_u", "before", "goal_u"):
        assert getattr(many, name) == pytest.approx(getattr(alone, name), rel=1e-8), name
    assert np.array_equal(many.inside, alone.inside)


def test_what_arrays_do_not_know_is_played_one_by_one(crowd):
    for keys in ({"truth": {"preset": "payloads"}}, {"identification.model": "choose"}):
        scenario = changed(crowd.scenario, keys)
        laboratory = open_laboratory(scenario, crowd.setting)
        given = crowd.trials, laboratory.design_blocks("whitened"), v_of(goals_of(laboratory))
        assert play_together(laboratory, *given, range(2)) is None
