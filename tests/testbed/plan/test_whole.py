"""What a plan counts beside noise, what it says of its reach, and in which order it measures."""

import csv
import io
import json
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib.identification.identify import identify
from calib.uncertainty.statement import believe, distance_radius, proven_at
from calib.uncertainty.statement.applicability import Applicability
from testbed.laboratory.bench import open_bench
from testbed.laboratory.tracker.of_scenario import bias_size
from testbed.plan.foresight import planned_rows
from testbed.plan.plan import plan
from testbed.plan.promises import factor_words, order_words, promise, reach_words
from testbed.plan.report import plan_report_html
from testbed.plan.report_goal import source_blocks
from testbed.plan.results import goal_csv, plan_numbers
from testbed.plan.words import terminal_text
from testbed.report.page import Table
from testbed.robots.catalog import load_robot
from testbed.scenario.read import changed
from testbed.studies import load_scenario
from testbed.units import NARROW
from tests.calib.slopes import slopes
from tests.planned import QUICK, ROBOT, few_rehearsals, legs, quick_plan, scenario
from tests.reported import VERSIONS, read
from tests.testbed.robots.described_cases import ARMS

WHOLE = {"tracker.systematic": True, "plan.method": "exchange", "plan.held_out": 20}


@cache
def whole_plan():
    """Eight poses by a tracker that states systematic errors."""
    with few_rehearsals():
        return plan(scenario(QUICK, **WHOLE))


def bench_of(made):
    """The laboratory at the station of a plan."""
    return open_bench(made.scenario).standing_at(np.array(made.station_mm) / 1e3)


def fit_of(made):
    """A calibration from the planned poses, without noise: its gain and covariance are linear."""
    bench = bench_of(made)
    train = planned_rows(bench, made.pool.q[made.places])
    return identify(ROBOT.model, train, made.parameters), train


def at_goal(made):
    """Derivative (g, 3, p) of the tool point by the numbers, by central differences."""
    point = np.append(made.goal.point, 1.0)
    return slopes(
        lambda step: (ROBOT.model.moved(step).poses(made.goal.q) @ point)[:, :3],
        np.zeros(ROBOT.model.n_numbers), by=np.flatnonzero(made.parameters.free),
    )  # fmt: skip


def shared_u(made, plan_of):
    """Systematic part (g,) at the goal after the poses of a plan, by its estimator F = C A'W."""
    bench, (fit, train) = bench_of(made), fit_of(plan_of)
    q, size = plan_of.pool.q[plan_of.places], bias_size(made.scenario.tracker)
    T, A = ROBOT.model.poses_and_jacobian(q)
    B = size.sensitivity(bench.tracker.targets(T), T[:, :3, :3], made.T_world_tracker)
    W = np.linalg.inv(train.covariance)
    F = fit.covariance @ np.swapaxes(A[:, :, made.parameters.free], 1, 2) @ W
    moved = at_goal(made) @ (F @ (B * np.sqrt(size.variance))).sum(axis=0)
    return np.sqrt((moved**2).sum(axis=(1, 2)))


@pytest.mark.slow
def test_both_parts_and_the_radii_are_those_of_an_identification():
    made = whole_plan()
    seen, (fit, _) = made.foresight, fit_of(made)
    # at the held-out poses by source, at the goal all together: two codes, one place
    free = made.parameters.free_index
    assert seen.sources.covariance[np.ix_(free, free)] == pytest.approx(
        seen.covariance - fit.covariance, rel=1e-5, abs=1e-9 * seen.covariance.max()
    )
    J = at_goal(made)
    noise = np.einsum("gip,pq,giq->g", J, fit.covariance, J)
    assert seen.noise == pytest.approx(np.sqrt(noise), rel=1e-6)
    assert seen.shared == pytest.approx(shared_u(made, made), rel=1e-6)
    sigma = J @ seen.covariance @ np.swapaxes(J, 1, 2)
    assert made.u == pytest.approx(np.sqrt(np.trace(sigma, axis1=1, axis2=2)), rel=1e-6)
    assert seen.R95_worst == pytest.approx(distance_radius(sigma).max(), rel=1e-5)
    rng, draws = np.random.default_rng(1), 4000
    root = np.linalg.cholesky(sigma)
    e = np.linalg.norm(root[:, None] @ rng.normal(size=(len(J), draws, 3, 1)), axis=2)[..., 0]
    inside = float((made.goal.weights @ (e <= seen.R95_over)).mean())
    # 80,000 draws: sd of the share .0008
    assert inside == pytest.approx(0.95, abs=0.004)


def test_the_search_for_the_whole_is_no_worse_than_the_search_for_the_noise():
    made = whole_plan()
    noise_only = plan(scenario(QUICK, **WHOLE | {"tracker.systematic": False, "plan.held_out": 0}))
    assert not noise_only.foresight.shared.any()
    counted = np.sqrt((noise_only.u**2 + shared_u(made, noise_only) ** 2).mean())
    assert made.u_mean <= counted * (1 + 1e-9)
    assert made.proof.bound < made.u_mean
    assert "even if its estimate found the tracker's systematic errors as well" in (
        made.proof.sentence
    )


def test_parts_and_whole_are_everywhere():
    made = whole_plan()
    noise, shared = (1e6 * made.over_goal(u) for u in (made.foresight.noise, made.foresight.shared))
    assert 1e6 * made.u_mean == pytest.approx(np.hypot(noise, shared), rel=1e-12)
    parts = f"noise {noise:#.3g}, systematic errors {shared:#.3g}"
    page = " ".join(read(plan_report_html(made, ROBOT, versions=VERSIONS)).text)
    for said in (" ".join(terminal_text(made).split()), page):
        assert parts in said
        assert "This counts noise and the tracker's systematic errors, over all postures" in said
    assert "of systematic errors" in page
    document = json.loads(json.dumps(plan_numbers(made, ROBOT), allow_nan=False))
    predicted, budget = document["predicted"], document["budget"]
    assert predicted["u_noise_mean_um"] == pytest.approx(noise, rel=1e-12)
    assert predicted["u_systematic_mean_um"] == pytest.approx(shared, rel=1e-12)
    assert predicted["R95_over_goal_um"] == pytest.approx(1e6 * made.foresight.R95_over, rel=1e-12)
    assert predicted["sentence"] == promise(made)
    each = {name: one["u_at_tool_um"] for name, one in predicted["systematic"].items()}
    assert each == pytest.approx(
        dict(zip(made.foresight.sources.names, 1e6 * made.foresight.sources.at_tool, strict=True))
    )
    assert "target's place" in made.foresight.sources.hidden
    assert "Held-out poses measured by the same tracker cannot reveal some of its errors" in page
    (table,) = [block for block in source_blocks(made) if isinstance(block, Table)]
    assert all(table.head)
    words = dict(zip(made.foresight.sources.names, [row[-1] for row in table.rows], strict=True))
    assert {name for name, word in words.items() if word == "no"} == set(
        made.foresight.sources.hidden
    )
    assert set(words.values()) <= {"yes", "no", "negligible"}
    assert page.count("held-out poses of this instrument show") == 1
    at = budget["poses"].index(len(made.places))
    assert budget["U_systematic_um"][at] == pytest.approx(2 * shared, rel=1e-9)
    assert predicted["U_is"] == factor_words(2.0) == "k = 2, 3-D, at least 95\u202f%"


def test_the_misfit_that_would_be_seen_and_the_reach_are_those_after_such_a_calibration():
    made, bench = whole_plan(), bench_of(whole_plan())
    fit, train = fit_of(made)
    held = planned_rows(bench, made.tour.q[[role == "test" for role in made.tour.roles]])
    belief = believe(fit, train, held)
    assert made.foresight.misfit_seen == pytest.approx(belief.misfit.detectable, rel=1e-6)
    after = proven_at(fit, train, held.q, target=made.goal.point).applies(made.goal.q)
    assert made.foresight.applies.transfer == pytest.approx(after.transfer, rel=1e-5)
    assert made.foresight.applies.leverage == pytest.approx(after.leverage, rel=1e-5)
    assert np.array_equal(made.foresight.applies.beyond, after.beyond)


@pytest.mark.slow
def test_a_goal_that_the_statement_will_not_reach_is_warned_of():
    """The arm turned away from the tracker: no held-out pose can stand there."""
    around = np.array([160.0, 70.0, -110.0, 60.0, -100.0, 0.0])
    away = (around + np.random.default_rng(1).uniform(-10, 10, (8, 6))).tolist()
    here = np.array([40.0, 20.0, 90.0, 0.0, 0.0, 0.0])
    narrow = {
        "plan.goal": {"kind": "list", "joints_deg": away},
        "pool.joint_ranges_deg": np.stack([here - 30, here + 30], axis=1).tolist(),
        "pool.box_size_mm": [3000.0] * 3,
    }
    changes = {key: value for key, value in QUICK.items() if key != "plan.goal.poses"}
    with few_rehearsals():
        made = plan(scenario(changes | narrow))
    assert not made.foresight.applies.reaches
    page = " ".join(read(plan_report_html(made, ROBOT, versions=VERSIONS)).text)
    document = plan_numbers(made, ROBOT)["applies"]
    share = f"{100 * document['share_outside']:.0f} %"
    for said in (" ".join(terminal_text(made).split()), page, *document["sentences"][:1]):
        words = said.replace(NARROW, " ")
        assert f"Warning: the statement will not reach {share} of the goal's postures" in words
    assert document["reaches"] is False
    assert document["share_outside"] > 0.25


def _placed(transfer, beyond):
    """A reach made by hand: transfer g of each posture, and the joints that leave their range."""
    g = np.array(transfer)
    return Applicability(g, np.ones(len(g)), np.array(beyond, bool))


def test_what_the_tracker_does_and_the_promise_leaves_out_is_warned_of():
    """Played with this drift, 85 of 100 points lie within the R95 promised for the noise alone."""
    made = quick_plan()
    assert plan_numbers(made, ROBOT)["uncounted"] == []
    changes = {"drift_um_per_sqrt_h": 20.0, "outliers": 2, "missed": 1}
    tracker = made.scenario.tracker.model_copy(update=changes)
    drifting = replace(made, scenario=made.scenario.model_copy(update={"tracker": tracker}))
    for said in (
        " ".join(terminal_text(drifting).split()),
        " ".join(read(plan_report_html(drifting, ROBOT, versions=VERSIONS)).text),
        " ".join(plan_numbers(drifting, ROBOT)["uncounted"]),
    ):
        assert "the promise counts no drift, and [tracker] drift_um_per_sqrt_h is 20" in said
        assert "outliers is 2 and missed is 1; plan 3 poses more" in said


def test_what_is_assumed_of_a_robot_is_said_with_the_promise_that_rests_on_it(tmp_path):
    """A URDF says nothing of how well joints return; R95 goes with it."""
    (tmp_path / "scara.urdf").write_text(ARMS["scara"])
    small = {
        "robot": str(tmp_path / "scara.urdf"), "plan.poses": 8, "plan.held_out": 0,
        "plan.goal.poses": 5, "pool.size": 30, "identification.estimators": ["whitened"],
        "truth.joint_repeatability_mdeg": "robot",
    }  # fmt: skip
    made = plan(changed(load_scenario("quick"), small))
    robot = load_robot(tmp_path / "scara.urdf")
    told = "leaves open, and the plan assumes: the repeatability of the joints is assumed"
    for said in (
        " ".join(terminal_text(made).split()),
        " ".join(read(plan_report_html(made, robot, versions=VERSIONS)).text),
    ):
        assert told in said
        assert "mass" not in said.partition(told)[2][:60]
    (note,) = plan_numbers(made, robot)["assumed"]
    assert "14.5 urad" in note
    stated = small | {"truth.joint_repeatability_mdeg": 10 * np.degrees(14.5e-6) * 1e3}
    loose = plan(changed(load_scenario("quick"), stated))
    assert loose.assumed == quick_plan().assumed == ()
    assert loose.foresight.R95_over > 1.2 * made.foresight.R95_over


PLACED = _placed(
    [1.0, 5.0, 5.0, 2.0, 2.0, 12.0, 1.0, 1.0],
    [[0, 0], [0, 0], [0, 1], [0, 1], [1, 1], [1, 0], [0, 0], [0, 0]],
)
"""Three postures inside; at the edge one by g, one by g and joint 2, two by joints; one outside."""


@pytest.mark.parametrize("hand_made", [False, True])
def test_the_places_of_the_goal_are_a_partition_and_those_of_the_table(hand_made):
    made = quick_plan()
    if hand_made:
        goal = replace(made.goal, q=made.goal.q[:8], weights=np.full(8, 1 / 8))
        seen = replace(
            made.foresight, applies=PLACED, why=("",) * 8, noise=made.foresight.noise[:8],
            shared=made.foresight.shared[:8],
        )  # fmt: skip
        made = replace(made, goal=goal, foresight=seen)
    table = [row["place"] for row in csv.DictReader(io.StringIO(goal_csv(made)))]
    counts = {word: table.count(word) for word in ("inside", "edge", "outside")}
    document = plan_numbers(made, ROBOT)["applies"]
    shares = [document[f"share_{word}"] for word in counts]
    assert shares == pytest.approx([count / len(table) for count in counts.values()], rel=1e-12)
    assert sum(shares) == pytest.approx(1.0, abs=1e-12)
    # the words have the same numbers, and no posture is missing from them or counted twice
    words = reach_words(made)[0].replace("\u202f", " ")
    said = {
        "inside": rf"^(\d+) \([^)]*%\) of the goal's {len(table)} postures lies? inside",
        "edge": r"; (\d+) \([^)]*%\) at the edge: ",
        "outside": r"; (\d+) \([^)]*%\) outside, where",
    }
    found = {word: re.search(pattern, words) for word, pattern in said.items()}
    assert {word: int(hit[1]) if hit else 0 for word, hit in found.items()} == counts
    if hand_made:
        assert counts == {"inside": 3, "edge": 4, "outside": 1}
        assert "3 (38 %) of the goal's 8 postures lie inside" in words
        assert "; 4 (50 %) at the edge: 2 because the region grows (unmodelled" in words
        assert ", 3 because a joint is more than 10 deg beyond" in words
        assert "(joint 2 at 3 and joint 1 at 1), 1 of them for both; 1 (12 %)" in words


@pytest.mark.parametrize(
    ("slides", "said"),
    [((), "10 deg"), ((0, 1), "50 mm"), ((1,), "10 deg (turning) or 50 mm (sliding)")],
)
def test_a_joint_beyond_its_range_is_told_in_the_unit_of_its_kind(slides, said):
    """Joints 1 and 2 are beyond; the others say nothing of what their limit is."""
    made = quick_plan()
    links = made.nominal.chain.links
    kinds = tuple("prismatic" if j in slides else "revolute" for j in range(len(links)))
    model = replace(made.nominal, chain=replace(made.nominal.chain, kinds=kinds))
    seen = replace(made.foresight, applies=PLACED)
    (words, *_) = reach_words(replace(made, nominal=model, foresight=seen))
    assert f"because a joint is more than {said} beyond its range over" in words


def test_without_held_out_poses_that_is_said():
    made = quick_plan()
    alone = replace(made, foresight=replace(made.foresight, applies=None))
    assert "No pose is held out" in reach_words(alone)[0]
    assert plan_numbers(alone, ROBOT)["applies"].keys() == {"sentences"}


def test_in_random_order_poses_of_both_kinds_are_mixed_and_moves_are_free():
    tour = quick_plan()
    with few_rehearsals():
        made = plan(scenario(QUICK, **{"plan.order": "random"}))
    assert sorted(made.tour.pool_place) == sorted(tour.tour.pool_place)
    assert made.tour.blocked == ()
    assert not np.array_equal(made.tour.q, tour.tour.q)
    # each says what the other would take
    assert made.tour.other == pytest.approx(tour.tour.move.sum())
    assert tour.tour.other == pytest.approx(made.tour.move.sum())
    assert tour.tour.other_duration > tour.tour.duration
    for one, word in ((made, "random order"), (tour, "in a tour")):
        assert word in order_words(one)
    few = replace(tour, tour=replace(tour.tour, pool_place=tour.tour.pool_place[:9]))
    assert "the first 9 poses once more" in order_words(few)  # no plan of 9 has the first 12
    seconds = np.abs(np.diff(legs(made), axis=1)[:, 0]) / (0.3 * ROBOT.speeds)
    assert made.tour.move.sum() == pytest.approx(seconds.max(axis=1).sum(), rel=1e-12)
