"""What is believed of the tip of another tool, against brute force and closed forms."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib.geometry.frames import step_transform
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.handback.in_use import carried
from testbed.robots.tolerances import usual_tolerances
from testbed.scenario.tool_in_use import ToolInUse
from tests.calibrated import robot, session_of, table_of, true_model
from tests.reference import pool_r

TOOL = ToolInUse("gripper", (0.02, -0.01, 0.12), (0.0, 0.0, 0.0), 0.0)
SD = usual_tolerances(6)


@cache
def calibrated(tool=TOOL):
    session = session_of(table_of(true_model(), pool_r(80)), in_use=tool)
    return calibrate(robot(), session, Options(seed=1))


def test_the_flange_is_as_uncertain_as_its_tolerance_behind_a_target_on_it():
    """Full poses of a target on the flange: the flange itself is known by tolerance alone.

    Last link: theta, d, a, alpha, beta of its prior, and the shift along y that none of them is.
    """
    found = calibrated()
    assert found.handback.why == "another tool will be used, whose position depends on the links"
    belief = found.proof.belief
    point = np.array(TOOL.point)
    there = carried(belief, TOOL, point, SD)
    S = there.regions(found.stated_q, growth=1.0).covariance
    alpha = robot().model.chain.links[5, 3]
    assert alpha == 0.0  # then the flange's own axes are those of the numbers
    x, y, z = point
    of_d, of_angle = SD[5, 1] ** 2, SD[5, 0] ** 2
    lengths = 3 * of_d
    turns = of_angle * ((x**2 + y**2) + (y**2 + z**2) + (x**2 + z**2))
    # what the target's own uncertainty adds is below a hundredth of it
    np.testing.assert_allclose(np.trace(S, axis1=1, axis2=2), lengths + turns, rtol=0.02)


def test_predicted_tips_scatter_by_the_stated_covariance():
    """Draws of all numbers, moved through the kinematics, with the flange's shift along y."""
    found = calibrated()
    belief = replace(found.proof.belief, misfit_covariance=0 * found.proof.belief.misfit_covariance)
    point = np.array(TOOL.point)
    tool = replace(TOOL, sd=2e-4)
    there = carried(belief, tool, point, SD)
    q = found.stated_q[:3]
    rng, model = np.random.default_rng(2), belief.model
    steps = rng.multivariate_normal(np.zeros(model.n_numbers), belief.covariance, 1000)
    tips = np.zeros((len(steps), len(q), 3))
    for k, step in enumerate(steps):
        moved = model.moved(step)
        moved = replace(moved, chain=replace(moved.chain, T_flange_tool=np.eye(4)))
        mount = point + tool.sd * rng.normal(size=3) + [0, SD[5, 1] * rng.normal(), 0]
        tips[k] = (moved.poses(q) @ np.append(mount, 1.0))[:, :3]
    seen = tips - tips.mean(axis=0)
    S = np.einsum("kni,knj->nij", seen, seen) / len(steps)
    own = there.misfit.shape.rows(there.model.poses_and_jacobian(q)[1][:, :3])
    hidden = there.misfit.upper**2 * own @ np.swapaxes(own, 1, 2)
    stated = there.regions(q, growth=1.0).covariance - hidden
    # 1000 draws: variances to 4.5 %, five times that
    np.testing.assert_allclose(S, stated, atol=0.23 * np.abs(stated).max())


def test_a_box_is_judged_at_its_worst_corner_and_no_point_inside_is_worse():
    box = ToolInUse("gripper", (0.0, 0.0, 0.1), (0.1, 0.0, 0.1), 0.0)
    assert box.points.shape == (4, 3)
    found = calibrated(box)
    worst = found.handback.in_use
    assert worst.worst == pytest.approx((0.05, 0.0, 0.15), abs=1e-12) or worst.worst == (
        pytest.approx((-0.05, 0.0, 0.15), abs=1e-12)
    )
    rng = np.random.default_rng(3)
    for point in rng.uniform([-0.05, 0, 0.05], [0.05, 0, 0.15], (10, 3)):
        inside = carried(found.proof.belief, box, point, SD).regions(found.stated_q)
        assert np.sqrt(np.trace(inside.covariance, axis1=1, axis2=2).mean()) <= 1.0001 * (
            rms(carried(found.proof.belief, box, np.array(worst.worst), SD), found.stated_q)
        )


def rms(belief, q):
    return np.sqrt(np.trace(belief.regions(q).covariance, axis1=1, axis2=2).mean())


def test_a_point_of_the_measured_tool_stays_as_well_known_as_it_was():
    """The tip of another tool does not move with what the target's own place is known by."""
    found = calibrated()
    model = found.fit.identification.model
    turned = replace(
        model.chain, T_flange_tool=model.chain.T_flange_tool @ step_transform(np.full(6, 0.1))
    )
    belief = found.proof.belief
    other = replace(belief, model=replace(belief.model, chain=turned))
    one, two = (
        carried(each, TOOL, np.array(TOOL.point), SD).regions(found.stated_q, growth=1.0)
        for each in (belief, other)
    )
    np.testing.assert_allclose(one.covariance, two.covariance, rtol=1e-12)
    np.testing.assert_allclose(one.position, two.position, atol=1e-15)


def test_what_is_stated_of_the_tool_itself_adds_to_it():
    found = calibrated()
    q, point = found.stated_q, np.array(TOOL.point)
    plain, known = (
        carried(found.proof.belief, replace(TOOL, sd=sd), point, SD).regions(q, growth=1.0)
        for sd in (0.0, 2e-4)
    )
    more = known.covariance - plain.covariance
    np.testing.assert_allclose(more, np.broadcast_to(4e-8 * np.eye(3), more.shape), atol=1e-18)


def test_a_point_stated_at_a_tip_is_that_point_of_the_flange():
    """The tip of a URDF may stand aside of the frame in which its chain ends."""
    found = calibrated()
    tip = step_transform(np.array([0.05, -0.02, 0.11, 0.4, -0.9, 1.3]))
    belief, point = found.proof.belief, np.array(TOOL.point)
    aside = replace(TOOL, frame=tuple(tip[:3].ravel()))
    there = carried(belief, aside, point, SD).regions(found.stated_q[:3])
    same = carried(belief, TOOL, (tip @ [*point, 1.0])[:3], SD).regions(found.stated_q[:3])
    np.testing.assert_allclose(there.covariance, same.covariance, rtol=1e-9)
    plain = carried(belief, TOOL, point, SD).regions(found.stated_q[:3])
    assert np.abs(plain.covariance / same.covariance - 1).max() > 0.01  # or this shows nothing
