"""The radius that a plan foretells for its statement is the one that calibrations state."""

from dataclasses import replace

import numpy as np
import pytest

from calib.identification.identify import identify
from calib.uncertainty.circumstances import Circumstances
from calib.uncertainty.judgement import judge
from calib.uncertainty.statement.distance import radius_over
from calib.uncertainty.statement.stated_point import widened
from testbed.laboratory.bench import open_bench
from testbed.plan.foresight import planned_rows
from testbed.plan.plan import plan
from testbed.plan.promises import promise
from testbed.plan.results import plan_numbers
from testbed.plan.words import headline_rows, terminal_text
from tests.planned import QUICK, ROBOT, quick_plan, scenario
from tests.reference import rigid_truth
from tests.truth.measuring import measured

CALIBRATIONS = 12


def stated_by_others(made):
    """Radii (k,) of calibrations of other robots, read at the plan's poses [m]."""
    bench = open_bench(made.scenario)
    rng, radii = np.random.default_rng(11), []
    test = np.array([role == "test" for role in made.tour.roles])
    for _ in range(CALIBRATIONS):
        truth, tables, doubted = rigid_truth(rng), [], []
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
        found = identify(ROBOT.model, train, made.parameters)
        known = Circumstances(doubted=(doubted[0], doubted[1]))
        belief = judge(found, apart, train=train, circumstances=known).belief
        region = belief.regions(made.goal.q)
        radii.append(radius_over(widened(region), made.goal.weights))
    return np.array(radii)


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


def test_the_radius_foretold_is_that_which_calibrations_of_other_robots_state():
    made = quick_plan()
    own, theirs = made.foresight.stated, stated_by_others(made)
    assert len(own) == 20
    assert (np.diff(own) >= 0).all()
    # two medians of 20 and of 12 radii whose sd is a tenth of them: 4 standard errors of the pair
    spread = 1.25 * np.std(theirs) * np.hypot(20**-0.5, CALIBRATIONS**-0.5)
    assert np.median(theirs) == pytest.approx(made.foresight.radius_stated, abs=4 * spread)
    # and not that within which the tool point will lie
    assert np.median(theirs) > 1.2 * made.foresight.R95_over


def test_the_stated_scatter_of_joints_widens_what_is_stated():
    """As misfit it is in the region, for nothing measured tells it."""
    still = plan(scenario(QUICK, **{"truth.joint_repeatability_mdeg": 0.0})).foresight
    loose = quick_plan().foresight
    assert loose.radius_stated / still.radius_stated > 1.1 * loose.R95_over / still.R95_over


def test_it_is_in_the_promise_the_table_and_the_numbers():
    made = quick_plan()
    radius = 1e6 * made.foresight.radius_stated
    assert f"will allow for it and state about {radius:.2g} µm." in promise(made)
    row = {what: (value, unit) for what, value, unit in headline_rows(made)}
    value, unit = row["R95 that the calibration will state"]
    assert float(value) == pytest.approx(radius, rel=0.05)
    assert "in 8 of 10 rehearsals without misfit" in unit
    numbers = plan_numbers(made, ROBOT)["predicted"]
    assert numbers["R95_stated_um"] == pytest.approx(radius)
    assert numbers["R95_stated_rehearsals_um"] == pytest.approx(1e6 * made.foresight.stated)


def test_without_held_out_poses_nothing_is_foretold():
    made = plan(scenario(QUICK, **{"plan.held_out": 0}))
    assert not len(made.foresight.stated)
    assert "state about" not in promise(made)
    assert "nothing will be stated" in " ".join(terminal_text(made).split())
    assert np.isnan(plan_numbers(made, ROBOT)["predicted"]["R95_stated_um"])  # null in the file
