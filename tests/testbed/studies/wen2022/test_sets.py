"""Designed sets among random ones: the same sets as elsewhere, calibrated one by one, and ranks."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.stats import spearmanr

from calib.errors import CalibError
from calib.identification.identify import identify
from calib.identification.least_squares import Status
from testbed.laboratory.truth.laboratory import open_laboratory
from testbed.report.page import Points, Text
from testbed.run.derive import arrays, headline
from testbed.scenario.read import changed
from testbed.studies import load_scenario
from testbed.studies.protocol import Records
from testbed.studies.wen2022 import paper
from testbed.studies.wen2022.calibrated_sets import play, plots
from testbed.studies.wen2022.calibrated_sets.records import (
    AgainstRandom,
    CalibratedSets,
    RandomCalibrations,
    random_calibrations_of,
)
from testbed.studies.wen2022.calibrated_sets.report import rank_table, sets_section
from testbed.studies.wen2022.calibrated_sets.summary import (
    OverSets,
    rank_correlation,
    rank_of,
    ranks,
    spread_of,
    table_rows,
)
from testbed.studies.wen2022.claims_one_robot import calibration_errors, held_out_errors
from testbed.studies.wen2022.records import ESTIMATORS
from testbed.studies.wen2022.report_paper import error_table
from tests.campaign import planned, with_records, without
from tests.reported import assert_same, bare_campaign, paper_campaign, rigid_campaign

SETS = 30
"""Random sets of each size in the small campaign."""


def study():
    return random_calibrations_of(paper_campaign())


def designed_beside(one):
    """The trial of a designed set, and its place in the record."""
    return next(t for t in paper_campaign().trials if t.name == one.trial)


def test_index_and_calibration_belong_to_the_same_random_sets():
    for one, drawn in zip(study().sets, paper_campaign().random_sets, strict=True):
        assert (one.trial, one.poses) == (drawn.trial, drawn.n_poses)
        row = ("O1", "O2").index(one.criterion)
        # the pool is drawn from by the same stream, and singular values see the same rows
        assert one.random.index[row] == pytest.approx(drawn.values, rel=1e-12)
        assert one.designed.index[row] == pytest.approx(drawn.chosen_value, rel=1e-9)
        assert one.random.indices.shape == (SETS, one.poses)
        assert one.failed == ()


def test_the_designed_set_is_the_one_of_its_trial_with_the_numbers_of_its_trial():
    for one in study().sets:
        trial = designed_beside(one)
        np.testing.assert_array_equal(one.designed.indices[0], trial.selection.indices)
        for k, mode in enumerate(ESTIMATORS):
            seen = next(e.comparison for e in trial.estimates if e.mode == mode)
            # both fits end within 1e-10 standard deviations of the minimum: some 1e-15 m
            assert one.designed.error[k, 0] == pytest.approx(seen.accuracy_after.mean, rel=1e-9)
            after = seen.identification_after.mean
            assert one.designed.own_after[k, 0] == pytest.approx(after, rel=1e-9)
            before = seen.identification_before.mean
            assert one.designed.own_before[0] == pytest.approx(before, rel=1e-12)
        assert study().before == pytest.approx(seen.accuracy_before.mean, rel=1e-12)


@pytest.mark.parametrize("k", [0, 7, 29])
def test_a_random_set_measured_and_identified_by_hand_gives_the_same_errors(k):
    campaign = paper_campaign()
    setting = campaign.setting
    bench = open_laboratory(campaign.scenario, setting)
    for one in study().sets:
        seen = bench.measure_pool(one.random.indices[k], "random_calibrations", one.trial, repeat=k)
        own = np.linalg.norm(seen.position - setting.nominal.poses(seen.q)[:, :3, 3], axis=1)
        assert one.random.own_before[k] == pytest.approx(own.mean(), rel=1e-12)
        for row, mode in enumerate(ESTIMATORS):
            found = identify(setting.nominal, seen, bench.free("paper"), mode=mode).model
            own = np.linalg.norm(seen.position - found.poses(seen.q)[:, :3, 3], axis=1)
            off = found.poses(setting.test_q)[:, :3, 3] - setting.test_true[:, :3, 3]
            assert one.random.own_after[row, k] == pytest.approx(own.mean(), rel=1e-9)
            error = np.linalg.norm(off, axis=1).mean()
            assert one.random.error[row, k] == pytest.approx(error, rel=1e-9)


def test_one_piece_for_each_designed_trial_and_they_join_in_order():
    campaign, key = paper_campaign(), "random_calibrations"
    record = planned(campaign.scenario)[key][1]
    assert (record.kind, record.cut.count) == (RandomCalibrations, 2)
    needed = Records({name: campaign.records.values[name] for name in record.needs}, {})
    setting = campaign.setting
    again = play.random_calibrations(campaign.scenario, setting, needed, 1)
    assert_same(again.sets[0].random, study().sets[1].random)
    assert play.gather([again, again]).sets == (*again.sets, *again.sets)


def test_they_are_played_where_the_budget_is_and_random_sets_are_wanted():
    scenario = load_scenario("wen2022")
    for off in ({"studies.random_sets": 0}, {"studies.paper_budget": False}):
        assert "random_calibrations" not in planned(changed(scenario, off))
    for name in ("quick", "pose_sets", "coverage", "wen2022_reexamined"):
        assert "random_calibrations" not in planned(load_scenario(name))
    assert sets_section(bare_campaign()) is sets_section(rigid_campaign()) is None
    assert ranks(bare_campaign()) == ()


def made(designed, drawn, *, own=None, index=None, criterion="O1", trial="best"):
    """A designed set among random ones with given held-out errors [m], the same by each
    estimator."""
    drawn = np.asarray(drawn, dtype=float)

    def sets(error, own, index):
        k = len(error)
        return CalibratedSets(
            np.zeros((k, 4), dtype=int),
            np.array([index, index]),
            np.full(k, 4e-4),
            np.array([own, own]),
            np.array([error, error]),
        )

    poses = {"O1": 61, "O2": 29}[criterion]
    own = drawn if own is None else own
    index = np.arange(len(drawn), dtype=float) if index is None else index
    chosen = sets(np.array([designed]), np.array([designed]), np.array([9.0]))
    return AgainstRandom(trial, poses, criterion, chosen, sets(drawn, own, index), ())


def test_a_rank_counts_the_random_sets_that_are_worse():
    one = made(2.5, [1.0, 2.0, 3.0, 4.0, 5.0], own=np.array([1.0, 2.0, 2.4, 2.4, 9.0]))
    rank = rank_of(one, "whitened")
    assert (rank.better_than, rank.sets, rank.own_lower_than) == (3, 5, 1)
    assert (rank.smallest, rank.largest, rank.random) == (1.0, 5.0, OverSets(3.0, np.sqrt(2.5)))
    assert rank.starts_lower_than == 0
    assert rank.correlation == pytest.approx(1.0)
    # a tie is not a victory
    assert rank_of(made(2.0, [2.0, 2.0, 3.0]), "paper").better_than == 1
    # a set that was chosen by another criterion stands beside O1
    assert rank_of(replace(one, criterion="V"), "paper").index == "O1"


def test_the_rank_correlation_is_that_of_scipy_and_its_interval_holds_what_it_should():
    rng = np.random.default_rng(4)
    x, y = rng.normal(size=(2, 60))
    y[:9] = y[9]  # ties too
    assert rank_correlation(x, y)[0] == pytest.approx(spearmanr(x, y).statistic, abs=1e-12)
    for _ in range(300):  # few values each, so that most are tied
        values = rng.integers(2, 9, 2)
        x, y = rng.integers(0, values[:, None], (2, rng.integers(4, 40))) * [[1.0], [-0.1]]
        if np.ptp(x) and np.ptp(y):
            expected = spearmanr(x, y).statistic
            assert rank_correlation(x, y)[0] == pytest.approx(expected, abs=1e-12)
    x = rng.normal(size=60)
    assert rank_correlation(x, np.exp(x))[0] == pytest.approx(1.0)
    assert rank_correlation(x, np.zeros(60)) == rank_correlation(x[:3], x[:3]) == (0.0, -1.0, 1.0)
    # 1000 unrelated pairs: 95 % of the intervals hold zero, +- 3 sd of a share of 1000
    ends = [rank_correlation(*rng.normal(size=(2, 100)))[1:] for _ in range(1000)]
    assert np.mean([low <= 0 <= high for low, high in ends]) == pytest.approx(0.95, abs=0.021)


def test_a_spread_is_written_with_its_standard_deviation_and_a_single_set_without():
    assert spread_of(np.array([0.1e-3])).millimetres == "0.100"
    assert spread_of(np.array([0.080e-3, 0.084e-3])).millimetres == "0.082 ± 0.003"


def test_random_rows_of_tables_1_and_2_are_means_over_all_random_sets():
    first, second = table_rows(paper_campaign())[:2]
    one = study().sets[0]
    assert (first.sets, second.sets) == (1, SETS)
    assert second.error == spread_of(one.random.error[0])
    assert second.weighed == spread_of(one.random.error[1])
    assert second.own_before == spread_of(one.random.own_before)
    assert first.error == OverSets(one.designed.error[0, 0], 0.0)
    table = error_table(paper_campaign())
    assert table.rows[1][0] == f"61 random, {SETS} sets"
    assert table.rows[1][6] == second.error.millimetres
    assert "± standard deviation between random sets" in table.caption


def test_without_calibrated_sets_the_tables_show_the_one_random_trial():
    lone = without(paper_campaign(), "random_calibrations")
    rows = table_rows(lone)
    trial = next(t for t in lone.trials if t.name == "random-29")
    seen = next(e.comparison for e in trial.estimates if e.mode == "paper")
    assert [row.sets for row in rows] == [1] * 4
    assert rows[3].error == OverSets(seen.accuracy_after.mean, 0.0)
    table = error_table(lone)
    assert table.rows[1][0] == "61 random"
    assert "±" not in table.caption + "".join(map("".join, table.rows))
    assert "one of each can neither prove nor disprove" in held_out_errors(lone).sentence
    assert held_out_errors(lone).verdict in ("holds", "in part")


@cache
def with_sets(o1, o2):
    """The small campaign with these two designed sets among random ones [mm]."""
    sets = tuple(
        made(np.float64(own) * 1e-3, np.array(drawn) * 1e-3, criterion=name, trial=f"best-{name}")
        for name, (own, drawn) in zip(("O1", "O2"), (o1, o2), strict=True)
    )
    return with_records(paper_campaign(), random_calibrations=RandomCalibrations(4e-4, sets))


def test_claim_13_is_judged_against_the_mean_of_all_random_sets():
    drawn = (0.120, 0.125, 0.130, 0.133)
    printed = held_out_errors(with_sets((0.097, drawn), (0.098, drawn)))
    assert printed.verdict == "holds"
    # 1 - 97/127 and 1 - 98/127 against the mean; the printed 24 and 26 % against single sets
    assert "24\u202f% more accurate than the mean of 4 random sets" in printed.sentence
    assert "here such a gain occurs against 2 of 4 and 1 of 4" in printed.sentence
    assert "0.127 ± 0.006" in printed.ours
    worse = held_out_errors(with_sets((0.128, drawn), (0.128, drawn)))
    assert worse.verdict == "does not hold"
    assert "less accurate than the mean of 4 random sets, and better than 2" in worse.sentence
    assert "against none of 4 and none of 4" in worse.sentence
    assert held_out_errors(with_sets((0.097, drawn), (0.128, drawn))).verdict == "in part"


def test_one_lucky_random_trial_moves_no_word_of_claims_12_and_13():
    campaign = paper_campaign()
    trials = []
    for trial in campaign.trials:
        lucky = []
        for estimate in trial.estimates:
            seen = estimate.comparison
            if trial.method == "random":
                seen = replace(
                    seen,
                    accuracy_after=replace(seen.accuracy_after, mean=1e-6),
                    identification_after=replace(seen.identification_after, mean=1e-6),
                )
            lucky.append(replace(estimate, comparison=seen))
        trials.append(replace(trial, estimates=tuple(lucky)))
    other = replace(campaign, trials=tuple(trials))
    for claim in (calibration_errors, held_out_errors):
        assert claim(other) == claim(campaign)
        assert claim(other).sentence.startswith("This campaign: ")


def test_claim_12_says_where_the_sets_stand_on_their_own_poses():
    found = calibration_errors(paper_campaign())
    one, two = (rank_of(part, "paper") for part in study().sets)
    above, below = re.findall(r"(?:larger error|smaller one) than (\d+) of 30", found.sentence)
    assert (int(above), int(below)) == (30 - one.own_lower_than, two.starts_lower_than)
    assert found.ours.count("±") == 4


def test_a_set_without_an_estimate_is_left_out_and_said(monkeypatch):
    campaign = paper_campaign()
    record = planned(campaign.scenario)["random_calibrations"][1]
    needed = Records({name: campaign.records.values[name] for name in record.needs}, {})
    whole, usual = study().sets[1], play.fit_each

    def failing(nominal, tables, parameters, *, mode):
        found = usual(nominal, tables, parameters, mode=mode)
        status = list(found.status)
        if len(status) > 1 and mode == "whitened":
            status[3] = Status.LIMIT
        return replace(found, status=tuple(status))

    monkeypatch.setattr(play, "fit_each", failing)
    (one,) = play.random_calibrations(campaign.scenario, campaign.setting, needed, 1).sets
    assert one.failed == (f"set 4, whitened: the fit {Status.LIMIT.value}",)
    np.testing.assert_array_equal(one.random.error, np.delete(whole.random.error, 3, axis=1))
    np.testing.assert_array_equal(one.random.indices, np.delete(whole.random.indices, 3, axis=0))
    shown = RandomCalibrations(4e-4, (study().sets[0], one))
    section = sets_section(with_records(campaign, random_calibrations=shown))
    assert Text("1 random set gave no estimate and are left out:") not in section.blocks
    assert Text("1 random set gave no estimate and is left out:") in section.blocks
    assert Points((f"best-29, {one.failed[0]}",)) in section.blocks
    monkeypatch.setattr(
        play,
        "fit_each",
        lambda *_, **__: replace(
            usual(campaign.setting.nominal, [campaign.trials[2].measurements],
                  open_laboratory(campaign.scenario, campaign.setting).free("paper")),
            status=(Status.DEFICIENT,),
        ),
    )  # fmt: skip
    monkeypatch.setattr(play, "drawn_sets", lambda *_: whole.random.indices[:1])
    with pytest.raises(CalibError, match="best-29 and random sets of its size cannot be compared"):
        play.random_calibrations(campaign.scenario, campaign.setting, needed, 1)


def test_the_section_shows_every_designed_set_by_both_estimators():
    section = sets_section(paper_campaign())
    table = rank_table(ranks(paper_campaign()))
    assert table in section.blocks
    assert [row[0] for row in table.rows] == ["best-61", "", "best-29", ""]
    rank = rank_of(study().sets[1], "paper")
    assert table.rows[2][5] == f"{rank.better_than} of 30"
    assert table.rows[2][6].startswith(f"{rank.correlation:.2f} (".replace("-", "−"))
    svg = plots.error_against_index(study().sets)
    assert svg.count("<svg") == 1
    assert "held-out" in svg
    assert f"better than {rank.better_than} of 30" in svg


def test_ranks_and_errors_are_published_with_their_units():
    published = headline(paper_campaign())["random_calibrations"]
    one, rank = study().sets[0], rank_of(study().sets[0], "paper")
    found = published["best-61"]
    assert found["paper"]["better_than"] == rank.better_than
    assert found["paper"]["held_out_mm"] == one.designed.error[0, 0] * 1e3
    assert found["whitened"]["random_held_out_mean_mm"] == pytest.approx(
        one.random.error[1].mean() * 1e3, rel=1e-12
    )
    assert found["index"]["name"] == "O1"
    written = arrays(paper_campaign())
    np.testing.assert_array_equal(
        written["random_calibrations/best-61/random/held_out_error_m"], one.random.error
    )
    np.testing.assert_array_equal(
        written["random_calibrations/best-61/random/indices"], one.random.indices
    )
    assert written["random_calibrations/best-29/designed/own_error_after_m"].shape == (2, 1)


def test_the_gains_of_the_paper_are_those_it_prints():
    gains = [1 - paper.SETS[k].held_out_mm / paper.SETS[k + 1].held_out_mm for k in (0, 2)]
    assert gains == pytest.approx([0.236, 0.258], abs=5e-4)
