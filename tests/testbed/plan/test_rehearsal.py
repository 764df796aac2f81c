"""The radius that a plan foretells for its statement is the one that calibrations state."""

from dataclasses import replace

import numpy as np
import pytest

from calib.identification.identify import identify
from calib.identification.levels import asked_of
from calib.identification.model_choice import extended_by
from calib.uncertainty.circumstances import Circumstances
from calib.uncertainty.judgement import judge
from calib.uncertainty.statement.distance import distance_radius, radius_over
from calib.uncertainty.statement.stated_point import widened
from testbed.laboratory.bench import open_bench
from testbed.plan.foresight import planned_rows
from testbed.plan.plan import plan
from testbed.plan.promises import promise
from testbed.plan.rehearsal import DRAWS, links_prior, usual_levels
from testbed.plan.results import plan_numbers
from testbed.plan.target import joint_words
from testbed.plan.words import headline_rows, terminal_text
from testbed.units import micrometres
from tests.calib.identification.test_offers import RAILS, travelled
from tests.planned import QUICK, ROBOT, quick_plan, scenario
from tests.reference import rigid_truth
from tests.truth.measuring import measured

CALIBRATIONS = 8
TRACK = ("prismatic", *["revolute"] * 5)


def stated_by_others(made, levels):
    """Radii (k, 3) of calibrations of other robots, read at the plan's poses [m].

    At the held-out poses, over the goal and at its worst; joint errors of some levels are drawn
    and identified.
    """
    bench = open_bench(made.scenario)
    rng, radii = np.random.default_rng(11), []
    test = np.array([role == "test" for role in made.tour.roles])
    for _ in range(CALIBRATIONS):
        truth, tables, doubted = bent(rigid_truth(rng), levels, rng), [], []
        for q in (made.tour.q[~test], made.tour.q[test]):
            stated = planned_rows(bench, q)
            noise = np.linalg.cholesky(stated.covariance) @ rng.normal(size=(len(q), 6, 1))
            exact = measured(truth, q)
            tables.append(
                replace(
                    exact,
                    position=exact.position + noise[:, :3, 0],
                    rotation=turns(noise[:, 3:, 0]) @ exact.rotation,
                    covariance=stated.covariance,
                    pose_id=exact.pose_id + len(tables) * 1000,
                )
            )
            # the stated scatter of the joints, by differences
            J = by_joints(q)
            doubted.append(J @ np.diag(bench.sigma_q**2) @ np.swapaxes(J, 1, 2))
        train, apart = tables
        if levels:
            prior = links_prior(ROBOT.model, made.parameters)
            found = extended_by(ROBOT.model, train, made.parameters, levels, prior=prior)[1]
        else:
            found = identify(ROBOT.model, train, made.parameters)
        known = Circumstances(doubted=(doubted[0], doubted[1]))
        judged = judge(found, apart, train=train, circumstances=known)
        region = widened(judged.belief.regions(made.goal.q))
        over, worst = radius_over(region, made.goal.weights), distance_radius(region).max()
        radii.append((judged.point.radius_mean, over, worst))
    return np.array(radii)


def bent(model, levels, rng):
    """A model with joint errors of some levels, half as large as their prior has them."""
    if not levels:
        return model
    errors, sd, _ = asked_of(levels)
    drawn = sd * rng.normal(size=len(sd)) / 2
    return replace(model, joint_errors=replace(errors, coefficients=drawn))


def turns(v):
    """Rotations (m, 3, 3) of small vectors (m, 3): second order is enough for 100 urad."""
    K = np.cross(v[:, None], np.eye(3))
    return np.eye(3) - K + K @ K / 2


def by_joints(q, step=1e-6):
    """Change of the tool's place and turn (m, 6, n) per joint, by central differences."""
    columns = []
    for e in step * np.eye(q.shape[1]):
        plus, minus = ROBOT.model.poses(q + e), ROBOT.model.poses(q - e)
        W = plus[:, :3, :3] @ np.swapaxes(minus[:, :3, :3], 1, 2)
        turn = np.stack([W[:, 2, 1] - W[:, 1, 2], W[:, 0, 2] - W[:, 2, 0], W[:, 1, 0] - W[:, 0, 1]])
        columns.append(np.hstack([plus[:, :3, 3] - minus[:, :3, 3], turn.T / 2]) / (2 * step))
    return np.stack(columns, axis=2)


@pytest.mark.parametrize("arm", ["links", "joints"])
def test_the_radius_foretold_is_that_which_calibrations_of_other_robots_state(arm):
    made = quick_plan()
    levels = usual_levels(ROBOT.model, made.tour.q) if arm == "joints" else ()
    own, theirs = getattr(made.foresight.stated, arm), stated_by_others(made, levels)
    assert len(own) == DRAWS
    assert (np.diff(own[:, 0]) >= 0).all()
    # two medians of 10 and of 8 radii whose sd is a tenth of them: 4 standard errors of the pair
    spread = 1.25 * np.std(theirs, axis=0) * np.hypot(DRAWS**-0.5, CALIBRATIONS**-0.5)
    assert (np.abs(np.median(theirs, axis=0) - np.median(own, axis=0)) < 4 * spread).all()
    # and not that within which the tool point will lie
    assert (np.median(theirs, axis=0) > 1.2 * made.foresight.R95_over).all()


def test_joint_errors_that_are_identified_as_well_widen_what_is_stated():
    links, joints = quick_plan().foresight.stated.medians
    assert (joints > 1.1 * links).all()


def test_slides_are_rehearsed_with_their_scales():
    q, _ = travelled()
    *_, travel = usual_levels(RAILS, q)
    assert travel.names == ("scale1", "scale2", "scale3")
    *_, travel = usual_levels(RAILS, q * [1, 0, 1])
    assert travel.names == ("scale1", "scale3")
    *_, travel = mixed = usual_levels(with_kinds(TRACK), q=np.eye(6))
    assert travel.names == ("scale1",)
    assert len(mixed) == 1 + len(usual_levels(ROBOT.model, np.eye(6)))


@pytest.mark.parametrize(
    ("kinds", "said"),
    [
        (("revolute",) * 6, "joints sag and wave"),
        (TRACK, "joints sag and wave and slides travel too far"),
        (("prismatic",) * 6, "slides travel too far"),
    ],
)
def test_it_says_which_joint_errors_it_rehearsed(kinds, said):
    made = replace(quick_plan(), nominal=with_kinds(kinds))
    assert joint_words(made) == said
    assert f" µm if {said}. All 14 poses" in promise(made)
    assert f"the same where {said}" in [what for what, *_ in headline_rows(made)]


def with_kinds(kinds):
    """The TX60 with some joints that slide."""
    return replace(ROBOT.model, chain=replace(ROBOT.model.chain, kinds=kinds))


def test_the_stated_scatter_of_joints_widens_what_is_stated():
    """As misfit it is in the region, for nothing measured tells it."""
    still = plan(scenario(QUICK, **{"truth.joint_repeatability_mdeg": 0.0})).foresight
    loose = quick_plan().foresight
    wider = loose.stated.medians[0, :2] / still.stated.medians[0, :2]
    assert (wider > 1.1 * loose.R95_over / still.R95_over).all()


def test_it_is_in_the_promise_the_table_and_the_numbers():
    made = quick_plan()
    (links, goal, _), (joints, bent_goal, _) = 1e6 * made.foresight.stated.medians
    said = [micrometres(radius / 1e6, 2) for radius in (links, joints)]
    stated = "will allow for it and state about {} µm, or {} µm if joints sag and wave. "
    assert stated.format(*said) in promise(made)
    row = {what: (value, unit) for what, value, unit in headline_rows(made)}
    numbers = plan_numbers(made, ROBOT)["predicted"]
    for what, key, radius, over, radii in (
        ("R95 that the calibration will state", "R95_stated", links, goal, "links"),
        ("the same where joints sag and wave", "R95_stated_joints", joints, bent_goal, "joints"),
    ):
        value, unit = row[what]
        assert float(value) == pytest.approx(radius, rel=0.05)
        rehearsals = 1e6 * getattr(made.foresight.stated, radii)[:, 0]
        least, most = (micrometres(end(rehearsals) / 1e6, 2) for end in (min, max))
        assert f"{least} to {most} in 10 rehearsals of an arm whose" in unit
        assert unit.endswith(f"; at the goal {micrometres(over / 1e6, 2)}")
        assert numbers[f"{key}_um"] == pytest.approx(radius)
        assert numbers[f"{key}_over_goal_um"] == pytest.approx(over)
        assert numbers[f"{key}_rehearsals_um"] == pytest.approx(rehearsals)


def test_without_held_out_poses_nothing_is_foretold():
    made = plan(scenario(QUICK, **{"plan.held_out": 0}))
    assert not len(made.foresight.stated.links) + len(made.foresight.stated.joints)
    assert "state about" not in promise(made)
    assert "nothing will be stated" in " ".join(terminal_text(made).split())
    assert np.isnan(plan_numbers(made, ROBOT)["predicted"]["R95_stated_um"])  # null in the file
