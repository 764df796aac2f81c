"""The believed region: it holds true points of robots that no geometric number describes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from calib.calibration import calibrate
from calib.geometry.joint_errors import JointErrors, gravity_terms, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.identification.joint_models import extended_model
from calib.measurement.observations import joined
from calib.measurement.prediction import predict
from calib.measurement.tables import points
from calib.uncertainty.judgement import Circumstances, judge
from calib.uncertainty.statement.believe import APART, adding, believe, drawn_rows
from calib.uncertainty.statement.distance import distance_radius
from calib.uncertainty.statement.repeats import scatter_chance
from calib.uncertainty.tool_point import tool_statement
from tests.calib import kinds

TX60 = RobotModel(kinds.ARMS["tx60"])
K3 = np.sqrt(chi2.ppf(0.95, 3))
ROBOTS, TARGETS = 16, 50


def bent(rng, size):
    """The TX60 with sag and waves that move its tool by about `size` [m]."""
    terms = (*gravity_terms(6), *harmonic_terms(6))
    draw = rng.normal(size=len(terms)) * size
    return RobotModel(TX60.chain, JointErrors(terms, draw))


def visit(true, rng, m, first=0):
    """Full poses (m) of a robot, numbered from `first`."""
    table = kinds.poses(true, kinds.joints("tx60", rng, m), rng)
    return replace(table, pose_id=first + np.arange(m))


def campaign(rng, size, m=40, n=20):
    """True robot, identification, training and held-out tables."""
    true = bent(rng, size)
    train, held_out = visit(true, rng, m), visit(true, rng, n, first=m)
    return true, identify(TX60, train, parameters_of(TX60)), train, held_out


def covered(size):
    """Shares of robots' true points (robots,) in the believed region and in that of parameters."""
    shares = []
    for robot in range(ROBOTS):
        rng = np.random.default_rng([robot, 31])
        true, fit, train, held_out = campaign(rng, size)
        q = kinds.joints("tx60", rng, TARGETS)
        points = true.poses(q)[:, :3, 3]
        alone = tool_statement(fit.model, q, fit.full_covariance)
        shares.append(
            (believe(fit, train, held_out).regions(q).holds(points).mean(),
             alone.holds(points).mean())
        )  # fmt: skip
    return np.array(shares).T


def test_a_coupling_that_looks_like_noise_is_in_the_region():
    """Joint 3 follows joint 2 a little, which no term describes: its errors look like more noise.

    As long as more noise was taken for an explanation, regions held .87 of the true points.
    """
    tip, model, shares = np.array([0.05, 0.02, 0.1, 1.0]), extended_model(TX60), []
    for robot in range(ROBOTS):
        rng = np.random.default_rng([robot, 77])

        def true(q):
            return (TX60.poses(q + 3e-4 * q[:, 1:2] * (np.arange(6) == 2)) @ tip)[:, :3]

        q = rng.uniform(-1.8, 1.8, (150, 6))
        read = points(q, true(q) + rng.normal(scale=15e-6, size=(150, 3)), sd=15e-6)
        train, held_out = read.split(held_out=50, seed=0)
        new = rng.uniform(-1.8, 1.8, (200, 6))
        judged = calibrate(model, train).judge(held_out)
        assert judged.belief is not None
        shares.append(judged.belief.regions(new).holds(true(new)).mean())
    # .970 over these robots, which differ by .03: .008 for their mean
    assert np.mean(shares) > 0.94


@pytest.mark.slow
@pytest.mark.parametrize("size", [0.0, 15e-6, 100e-6])
def test_the_believed_region_holds_the_truth(size):
    """Misfit of none, of about half the noise, of several times the noise; robots are the unit."""
    believed, alone = covered(size)
    # 16 robots: the mean must not lie below 95 % by more than its own standard error allows
    assert believed.mean() >= 0.95 - 3 * believed.std(ddof=1) / np.sqrt(ROBOTS)
    assert believed.mean() >= 0.94
    if size:
        assert alone.mean() < 0.85
    else:
        # parameters alone are right for a rigid arm: 95 % within three standard errors
        spread = alone.std(ddof=1) / np.sqrt(ROBOTS)
        assert abs(alone.mean() - 0.95) < 3 * spread


def test_regions_of_rows_are_those_of_their_joints_seen_by_the_first_station():
    rng = np.random.default_rng(8)
    _, fit, train, held_out = campaign(rng, 20e-6)
    belief = believe(fit, train, held_out)
    seen, plain = belief.seen_regions(held_out), belief.regions(held_out.q)
    # the same products in another order
    np.testing.assert_allclose(seen.covariance, plain.covariance, rtol=1e-9, atol=1e-20)
    np.testing.assert_allclose(seen.position, plain.position, atol=1e-13)


def test_the_region_is_parameters_and_the_largest_misfit():
    """Put together again from its parts, at a target off the flange, with growth."""
    rng = np.random.default_rng(1)
    _, fit, train, held_out = campaign(rng, 20e-6)
    belief = believe(fit, train, held_out)
    q, target, growth = kinds.joints("tx60", rng, 5), np.array([0.1, 0.0, 0.05]), np.arange(5.0)
    region = belief.regions(q, target=target, growth=growth)
    alone = tool_statement(fit.model, q, fit.full_covariance, target=target)
    np.testing.assert_allclose(region.position, alone.position, rtol=0, atol=1e-15)
    step = 1e-6
    T = fit.model.poses(q)
    tip = T[:, :3, 3] + T[:, :3, :3] @ target

    def slopes(number):
        """Derivative (5, 3) of the target by one number of the model."""
        moved = np.zeros(fit.model.n_numbers)
        moved[number] = step
        there = fit.model.moved(moved).poses(q)
        return (there[:, :3, 3] + there[:, :3, :3] @ target - tip) / step

    J = np.stack([slopes(k) for k in range(fit.model.n_numbers)], axis=-1)
    own = J[..., belief.misfit.shape.columns] * belief.misfit.shape.sd
    spread = J @ belief.misfit_covariance @ np.swapaxes(J, 1, 2) + own @ np.swapaxes(own, 1, 2)
    size = belief.misfit.upper**2 * np.maximum(growth, 1)
    expected = alone.covariance + size[:, None, None] * spread
    # forward differences of 1e-6 rad: five digits
    np.testing.assert_allclose(region.covariance, expected, rtol=0, atol=3e-5 * expected.max())


def test_one_move_ends_in_its_region_and_not_in_that_of_the_mean():
    """Joints that come back within 60 urad: 3 times the noise; robots are the unit."""
    sd, shares = np.full(6, 60e-6), []
    for robot in range(12):
        rng = np.random.default_rng([robot, 32])
        true, fit, train, held_out = campaign(rng, 15e-6)
        belief = believe(fit, train, held_out)
        q = kinds.joints("tx60", rng, TARGETS)
        ends = true.poses(q + sd * rng.normal(size=q.shape))[:, :3, 3]
        shares.append(
            (belief.regions(q, repeatability=sd).holds(ends).mean(),
             belief.regions(q).holds(ends).mean())
        )  # fmt: skip
    move, mean = np.array(shares).T
    # bar: 95 to 99 %; 600 moves of 12 robots
    error = 3 * move.std(ddof=1) / np.sqrt(12)
    assert 0.95 - error <= move.mean() <= 0.99 + error
    assert mean.mean() < 0.9


def test_held_out_errors_guard_the_factor():
    """One pose in fifteen is grossly off: the factor follows the rank that conformal asks for."""
    rng = np.random.default_rng(2)
    _, fit, train, held_out = campaign(rng, 0.0)
    off = held_out.position.copy()
    off[[3, 8]] += 500e-6
    held_out = replace(held_out, position=off)
    belief = believe(fit, train, held_out)
    assert belief.n_guards == 20
    seen = predict(fit.model, held_out)
    S = belief.regions(held_out.q).covariance + held_out.covariance[:, :3, :3]
    e = seen.residual[:, :3]
    scores = np.sort(np.einsum("ni,ni->n", e, np.linalg.solve(S, e[..., None])[..., 0]))
    assert belief.factor == pytest.approx(np.sqrt(scores[19]), rel=1e-9)  # rank ceil(.95 * 21)
    assert belief.factor > K3


def test_held_out_errors_count_with_their_noise_where_nobody_states_it():
    """Ten times the noise is assumed that there is, and what no number describes hides in it.

    The worst of 12 robots had 88 % of its points in the region, and the mean was 95 %.
    """
    shares, radii = [], []
    for robot in range(12):
        rng = np.random.default_rng([robot, 77])
        true, _, train, held_out = campaign(rng, 2e-4)
        train, held_out = (
            replace(one, covariance=100 * one.covariance) for one in (train, held_out)
        )
        fit = identify(TX60, train, parameters_of(TX60))
        q = kinds.joints("tx60", rng, TARGETS)
        both = [
            judge(fit, held_out, train=train, circumstances=Circumstances(unstated=one))
            for one in (False, True)
        ]
        points = true.poses(q)[:, :3, 3]
        shares.append([one.belief.regions(q).holds(points).mean() for one in both])
        assert both[1].belief.misfit.upper == both[0].belief.misfit.upper
        radii.append([one.point.radius_mean for one in both])
    shares, radii = np.array(shares), np.array(radii)
    # what is promised, of a mean; and none is worse for it
    assert shares[:, 1].mean() >= 0.95
    assert (shares[:, 1] >= shares[:, 0]).all()
    assert shares[:, 0].min() < 0.9 < shares[:, 1].min()
    assert (radii[:, 1] >= radii[:, 0]).all()


@pytest.mark.slow
def test_the_guarded_factor_makes_the_radius_hold_what_it_promises_too():
    """Errors along the longest axis alone: within every ellipsoid, and half as often in a ball."""
    rng = np.random.default_rng(5)
    _, fit, train, held_out = campaign(rng, 0.0)
    plain = believe(fit, train, held_out)
    T, N = fit.model.poses(held_out.q), held_out.covariance[:, :3, :3]
    # noise that is long and thin, and errors of 2.7 standard deviations along it: not 2.7955
    long = N + 0.25e-6 * np.einsum("i,j->ij", [0.6, 0.0, 0.8], [0.6, 0.0, 0.8])
    covariance = held_out.covariance.copy()
    covariance[:, :3, :3] = long
    S = plain.regions(held_out.q).covariance + long
    values, axes = np.linalg.eigh(S)
    off = T[:, :3, 3] + 2.7 * np.sqrt(values[:, 2:]) * axes[:, :, 2]
    loud = replace(held_out, position=off, covariance=covariance)
    belief = adding(plain, np.zeros_like(plain.covariance), loud)
    # the radius by drawn points, not by quadrature
    drawn = np.linalg.cholesky(S) @ np.random.default_rng(6).standard_normal((3, 200_000))
    R = np.quantile(np.linalg.norm(drawn, axis=1), 0.95, axis=1)
    asked = np.sort(K3 * np.linalg.norm(off - T[:, :3, 3], axis=1) / R)[19]
    # 200,000 draws leave 0.2 % in a quantile of a nearly one-dimensional distance
    assert belief.factor == pytest.approx(asked, rel=0.01)
    assert belief.factor > 1.3 * K3


def test_every_row_of_a_pose_counts_in_the_guard_by_the_worst():
    rng = np.random.default_rng(3)
    _, fit, train, held_out = campaign(rng, 0.0)
    again = replace(visit(fit.model, rng, 20), q=held_out.q, pose_id=held_out.pose_id)
    again = replace(
        again, position=held_out.position, rotation=held_out.rotation, repeat=np.ones(20, int)
    )
    off = held_out.position.copy()
    off[5] += 400e-6
    first = replace(held_out, position=off)
    factors = [
        believe(fit, train, joined(order)).factor for order in ([first, again], [again, first])
    ]
    assert factors[0] == pytest.approx(factors[1], rel=1e-9)
    # believed size and guard both know of it: with the good row alone the factor is smaller
    assert factors[0] > believe(fit, train, held_out).factor


def visited(model, held_out, rng, visits, sides=0.0):
    """Visits of held-out poses, fresh noise in each; every other one is `sides` away [m]."""
    there = model.poses(held_out.q)[:, :3, 3]
    off = rng.normal(size=(visits, *there.shape)) * kinds.NOISE
    off[1::2, :, 0] += sides
    return joined(
        [
            replace(held_out, position=there + each, repeat=np.full(len(there), k))
            for k, each in enumerate(off)
        ]
    )


def squares_of(belief, many, visits):
    """(visits, n) e'inv(S + N)e of the visits of each pose, of tables as `visited` has."""
    S = belief.regions(many.q).covariance + many.covariance[:, :3, :3]
    e = predict(belief.model, many).residual[:, :3]
    squares = np.einsum("ni,ni->n", e, np.linalg.solve(S, e[..., None])[..., 0])
    return squares.reshape(visits, -1)


def in_balls(belief, many, visits):
    """(visits, n) squares of the factors at which the same visits are within their radii."""
    S = belief.regions(many.q).covariance + many.covariance[:, :3, :3]
    far = np.linalg.norm(predict(belief.model, many).residual[:, :3], axis=1)
    return ((K3 * far / distance_radius(S)) ** 2).reshape(visits, -1)


def worst_squares(belief, many, visits):
    """(n,) the largest over the visits of each pose."""
    return squares_of(belief, many, visits).max(axis=0)


@pytest.mark.slow
def test_a_pose_that_is_visited_often_is_not_worse_by_chance():
    """By scipy: the worst of eight visits counts as what one visit exceeds as rarely."""
    found, worst, governed = [], [], []
    for robot in range(6):
        rng = np.random.default_rng([robot, 33])
        _, fit, train, held_out = campaign(rng, 0.0)
        many = visited(fit.model, held_out, rng, 8)
        belief = believe(fit, train, many)
        squares = worst_squares(belief, many, 8)
        # of 20 poses the largest score: of the visits drawn, and of the worst of each as one visit
        both = np.stack([squares_of(belief, many, 8), in_balls(belief, many, 8)])
        of_drawn = both.reshape(2, -1)[:, drawn_rows(many, np.full(20, 8))].max()
        as_one = chi2.isf(1 - chi2.cdf(both.max(), 3) ** 8, 3)
        # rounding: 1e-16 of a probability near one leaves 1e-9 of a square
        apart = scatter_chance(belief.model, many, 1.0) < APART  # of good visits one set in twenty
        expected = both.max() if apart else max(K3**2, of_drawn, as_one)
        assert belief.factor == pytest.approx(np.sqrt(expected), rel=1e-6)
        governed.append(as_one == expected)
        found.append(belief.factor)
        worst.append(max(K3, np.sqrt(squares.max())))
        mixed = many.rows(rng.permutation(len(many)))
        assert believe(fit, train, mixed).factor == pytest.approx(belief.factor, rel=1e-9)
    assert any(governed)
    # the largest of 160 draws of chi is 3.6, of 20 it is 3.0: ten or six leave 0.1 in a mean
    assert np.mean(found) < np.mean(worst) - 0.3


def test_visits_that_stand_further_apart_than_their_noise_count_by_the_worst():
    """Play: every other visit comes from the other side, 2.5 times the noise away."""
    rng = np.random.default_rng(34)
    _, fit, train, held_out = campaign(rng, 0.0)
    belief = believe(fit, train, visited(fit.model, held_out, rng, 4))
    sides = visited(fit.model, held_out, rng, 4, 50e-6)
    guarded = adding(belief, np.zeros_like(belief.covariance), sides)
    # the ellipsoid of the worst row, or more where the ball asks for it
    assert guarded.factor >= np.sqrt(worst_squares(belief, sides, 4).max()) * (1 - 1e-9)


def test_the_row_of_each_pose_that_guards_is_drawn_without_looking_at_it():
    """Each of three visits as often as the others, whatever the readings and the order of rows."""
    rng = np.random.default_rng(35)
    table = visit(TX60, rng, 300)
    many = joined([replace(table, repeat=np.full(300, k)) for k in range(3)])
    drawn = drawn_rows(many, np.full(300, 3))
    np.testing.assert_array_equal(many.pose_id[drawn], np.arange(300))
    # binomial of 300 poses: a standard deviation is 8.2
    assert np.bincount(many.repeat[drawn], minlength=3) == pytest.approx(100, abs=30)
    order = rng.permutation(900)
    moved = replace(many.rows(order), position=many.position)
    again = drawn_rows(moved, np.full(300, 3))
    np.testing.assert_array_equal(moved.repeat[again], many.repeat[drawn])
    np.testing.assert_array_equal(moved.pose_id[again], many.pose_id[drawn])


def test_without_guards_the_limit_of_the_misfit_is_stricter():
    rng = np.random.default_rng(4)
    _, fit, train, held_out = campaign(rng, 0.0)
    few = held_out.rows(np.arange(18))
    unguarded = believe(fit, train, few)
    assert unguarded.n_guards == 0
    assert unguarded.factor == pytest.approx(K3)
    nineteen = believe(fit, train, held_out.rows(np.arange(19)))
    assert nineteen.n_guards == 19
    assert unguarded.misfit.upper > believe(fit, train, held_out).misfit.upper
    alone = believe(fit, train)
    assert alone.n_guards == 0
    assert np.isfinite(alone.misfit.upper)


def test_what_all_readings_share_is_added():
    rng = np.random.default_rng(5)
    _, fit, train, held_out = campaign(rng, 0.0)
    shared = np.zeros((fit.model.n_numbers,) * 2)
    shared[0, 0] = (50e-6) ** 2  # of the base along its x axis, here the world's
    q = kinds.joints("tx60", rng, 4)
    plain = believe(fit, train, held_out)
    with_it = believe(fit, train, held_out, shared=shared)
    grown = with_it.regions(q).covariance - plain.regions(q).covariance
    expected = np.zeros((4, 3, 3))
    axis = fit.model.chain.T_world_base[:3, 0]
    expected[:] = np.outer(axis, axis) * (50e-6) ** 2
    np.testing.assert_allclose(grown, expected, rtol=0, atol=1e-15)
    assert with_it.factor <= plain.factor
    assert "guards" in repr(plain)


def test_adding_what_is_shared_later_is_as_if_it_had_been_known():
    rng = np.random.default_rng(12)
    _, fit, train, held_out = campaign(rng, 60e-6)
    root = 1e-5 * rng.standard_normal((fit.model.n_numbers, 3))
    known = believe(fit, train, held_out, shared=root @ root.T)
    later = adding(believe(fit, train, held_out), root @ root.T, held_out)
    np.testing.assert_array_equal(later.covariance, known.covariance)
    assert (later.factor, later.n_guards) == (known.factor, known.n_guards)
    # without the poses there is nothing to guard it
    assert adding(known, np.zeros_like(known.covariance)).factor == pytest.approx(K3)
