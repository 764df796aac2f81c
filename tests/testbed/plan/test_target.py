"""A target is asked of an arm whose joints sag and wave, unless they are said not to."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib.identification.folds import parts_of
from testbed.laboratory.bench import open_bench
from testbed.plan.for_joints import BESIDE, FEWEST, NEAR, for_joints
from testbed.plan.foresight import planned_rows
from testbed.plan.plan import plan
from testbed.plan.promises import promise
from testbed.plan.rehearsal import Rehearsals
from testbed.plan.report import plan_report_html
from testbed.plan.results import plan_csv, plan_numbers
from testbed.plan.sufficiency import Sufficiency
from testbed.plan.target import enough_words
from testbed.plan.words import headline_rows, next_step, terminal_text
from tests.planned import BARE, ROBOT, few_rehearsals, quick_plan, scenario
from tests.reported import VERSIONS

ASKED = {"plan.poses": 0, "plan.stiff_joints": False, "plan.method": "exchange"}
LINKS = 6
"""Poses that the links alone need for an equation to spare."""


@cache
def asked(target, held_out=0, **more):
    """A plan for a target [um] of an arm whose joints may sag and wave."""
    changes = {**BARE, **ASKED, "plan.held_out": held_out, "plan.target_um": target, **more}
    with few_rehearsals():
        return plan(scenario(changes))


@cache
def short():
    """A plan that links alone allow, and no number of poses does where joints sag and wave."""
    return asked(60.0, 12, **{"truth.joint_repeatability_mdeg": 4.0, "pool.size": 40})


def test_a_target_has_the_poses_that_joint_errors_need_to_be_confirmed():
    made = asked(300.0)
    assert len(made.places) == FEWEST
    assert made.curve.reached == made.curve.fewest == LINKS
    assert f"6 poses would do for the links alone; with {FEWEST}" in enough_words(made)
    bench, rng = open_bench(made.scenario), np.random.default_rng(1)
    rows = planned_rows(bench, made.pool.q[made.places])
    assert parts_of(rows, rng) is not None
    assert parts_of(rows.rows(np.arange(len(rows)) > 0), rng) is None


def test_stiff_joints_ask_for_no_more_poses_than_the_links_need():
    made = asked(300.0, **{"plan.stiff_joints": True})
    assert len(made.places) == LINKS
    assert made.sufficiency is None
    assert enough_words(made) == ""


def test_poses_measured_already_count_among_those_that_confirm(tmp_path):
    (tmp_path / "measured.csv").write_text(plan_csv(quick_plan()), encoding="utf-8")
    made = asked(300.0, **{"plan.measured": str(tmp_path / "measured.csv")})
    assert len(made.measured_q) + len(made.places) == FEWEST


def test_what_will_be_stated_of_an_arm_that_sags_reaches_the_target():
    made = asked(300.0, 12)
    seen = made.sufficiency
    assert len(made.places) == FEWEST
    assert seen.reached
    assert seen.allowed == pytest.approx(300e-6)  # k = 2
    # both rehearsals of the table keep to it, with room
    assert seen.radius == BESIDE * made.foresight.stated.joints[:, 1].max()
    assert promise(made).startswith("20 poses will locate")
    assert "measure the poses of plan.csv in order" in next_step(made)
    said = plan_numbers(made, ROBOT)["budget"]["joints"]
    assert said["reached"]
    assert said["R95_stated_um"] == pytest.approx(1e6 * seen.radius)


def test_a_plan_that_falls_short_says_so_first_and_sends_nobody_to_measure():
    made = short()
    seen = made.sufficiency
    assert 2 * made.u_mean <= 60e-6 < seen.radius
    said = promise(made)
    assert said.startswith("The target is missed if joints sag and wave, as those of most arms do")
    assert "over the goal, more than 60.0 µm" in said.split(". ")[0]
    assert next_step(made).startswith("Do not measure this plan")
    assert "stiff_joints = true" in next_step(made)
    text = terminal_text(made)
    assert "Verdict: The target is missed" in text
    assert "in order" not in text[text.index("To do") : text.index("Of note")]
    (row,) = [row for row in headline_rows(made) if row[0].startswith("R95 stated where")]
    assert row[2].endswith("the target allows 60.0")
    page = plan_report_html(made, ROBOT, versions=VERSIONS)
    assert page.index("The target is missed") < page.index("will locate")


@pytest.mark.parametrize(("over", "column"), [("mean", 1), ("worst", 2)])
def test_a_radius_that_most_rehearsals_keep_to(over, column):
    radii = np.sort(np.random.default_rng(2).uniform(1, 2, (10, 3)), axis=0)
    seen = Rehearsals(radii * 0, radii, 10)
    worst = over == "worst"
    assert seen.mostly(worst=worst) == radii[8, column]
    radii[3, column] = np.nan  # one does not reach the goal: all others must
    assert seen.mostly(worst=worst) == radii[9, column]
    assert Rehearsals(radii, radii[:8], 10).mostly(worst=worst) == np.inf
    assert Rehearsals(radii[:0], radii[:0], 0).mostly(worst=worst) == np.inf


def searched(radius, target=100e-6, poses=8, measured=0, worst=None):
    """What the search finds where the calibration of m poses will state `radius(m)` [m].

    Beside so many that were `measured` already; `worst` times as much at the worst point, if the
    target is of that.
    """
    made, tried = asked(300.0), []
    task = _task_of(made, target)
    before = task.blocks[:measured].reshape(-1, task.blocks.shape[2])
    task = replace(task, before=before)
    if worst is not None:
        task = replace(task, settings=task.settings.model_copy(update={"target_is": "worst"}))

    def rehearse(places):
        tried.append(len(places))
        joints = np.full((1, 3), radius(len(places)) / BESIDE)
        joints[:, 2] *= worst or 1.0
        return Rehearsals(np.zeros((1, 3)), joints, 1)

    found = for_joints(task, np.arange(poses), rehearse, np.random.default_rng(3))
    return found, tried


def _task_of(made, target):
    """The task of a plan with another target [m]."""
    bench = open_bench(made.scenario)
    blocks = bench.blocks(made.pool.q, made.parameters)
    from testbed.plan.plan import _goals
    from testbed.plan.task import DesignTask

    return DesignTask(
        blocks, np.zeros((*blocks.shape[:2], 0)), _goals(bench, made.goal, made.parameters),
        np.zeros((0, blocks.shape[2])),
        made.scenario.plan.model_copy(update={"target_um": 1e6 * target}),
        made.parameters.free_names,
    )  # fmt: skip


def test_the_search_finds_about_the_smallest_number_that_reaches_the_target():
    found, tried = searched(lambda m: 100e-6 * 47 / m)
    assert 47 <= len(found.places) <= NEAR * 47 + 1
    assert found.sufficiency.reached
    assert len(set(found.places.tolist())) == len(found.places)
    assert tried[:3] == [20, 40, 60]  # the whole pool


def test_a_target_of_the_worst_point_is_asked_of_that():
    found, _ = searched(lambda m: 100e-6 * 24 / m, worst=2.0)
    assert 48 <= len(found.places) <= NEAR * 48 + 1
    assert found.sufficiency.reached


def test_the_search_counts_what_was_measured_already():
    """Of 25 measured poses one more, then two more, hardly helped, and a plan was given up."""
    found, tried = searched(lambda m: 100e-6 * 47 / (m + 25), poses=1, measured=25)
    assert 47 <= len(found.places) + 25 <= NEAR * 47 + 1
    assert found.sufficiency.reached
    assert tried[:2] == [1, 27]


def test_the_search_ends_where_more_poses_hardly_help():
    found, tried = searched(lambda m: 130e-6 + 1e-6 / m)
    assert tried == [20, 40]
    assert len(found.places) == 20
    seen = found.sufficiency
    assert seen.most == 40
    assert [seen.radius, seen.least] == pytest.approx([130e-6 + 1e-6 / m for m in (20, 40)])
    assert not seen.reached
    found, tried = searched(lambda _: np.inf)
    assert (len(found.places), tried) == (20, [20, 40, 60])


def test_a_wide_margin_is_asked_by_a_larger_coverage_factor():
    """U = k u: at k = 4 a ball of half the target has to hold 95 %."""
    made = asked(300.0, 12, **{"plan.coverage": 4.0})
    assert made.sufficiency.allowed == pytest.approx(150e-6)


def test_a_plan_of_a_given_number_is_asked_for_nothing():
    made = quick_plan()
    assert made.sufficiency is None
    assert promise(made).startswith("8 poses will locate")
    assert promise(replace(made, sufficiency=Sufficiency(2e-4, 1e-4, 8, 2e-4))).startswith(
        "The target is missed"
    )
