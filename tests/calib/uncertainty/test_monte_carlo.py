"""Monte Carlo of the tool point: the fast propagation, the paper's form and the correlated form."""

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.chain import Chain
from calib.geometry.frames import exp_so3, transform
from calib.geometry.joint_errors import JointErrors, gravity_terms, harmonic_terms
from calib.geometry.model import RobotModel
from calib.information.propagation import distance_uncertainty, point_uncertainty, tool_covariance
from calib.kernels import loops
from calib.kernels.loops import NUMBA
from calib.uncertainty import monte_carlo, point_loops
from calib.uncertainty import tool_point as tool_points
from calib.uncertainty.monte_carlo import (
    correlated_draws,
    distance_spread,
    independent_draws,
    numerical_tolerance,
    point_spread,
    propagate,
)
from calib.uncertainty.regions import inside
from tests.reference import DEG, SIGMA_POSITION, SIGMA_ROTATION, WEN24, pool_r, tx60
from tests.sandwich import sandwich

FREE = [tx60().names.index(name) for name in WEN24]


def random_model(rng, n, kinds=(), terms=()):
    """A chain of random geometry in metres and radians, base and tool included."""
    frames = [transform(exp_so3(rng.normal(size=3)), rng.normal(size=3)) for _ in range(2)]
    chain = Chain(rng.normal(size=(n, 5)), kinds, frames[0], frames[1])
    return RobotModel(chain, JointErrors(terms, rng.normal(size=len(terms)) * 0.01))


def calibration_covariance(m=29, scale=1.0):
    """Full covariance (42, 42) of a 24-number calibration from m random poses, times scale^2."""
    model = tx60()
    J = model.poses_and_jacobian(pool_r()[:m])[1][:, :, FREE]
    sigma = np.diag([SIGMA_POSITION**2] * 3 + [SIGMA_ROTATION**2] * 3)
    weight = np.diag(1 / np.diag(sigma))
    C = np.zeros((42, 42))
    C[np.ix_(FREE, FREE)] = sandwich(
        J, np.broadcast_to(weight, (m, 6, 6)), np.broadcast_to(sigma, (m, 6, 6))
    )
    return C * scale**2


def free_standard(length=5e-5, angle=0.005 * DEG):
    model = tx60()
    u = np.zeros(model.n_numbers)
    u[FREE] = np.where(np.array(model.is_length)[FREE], length, angle)
    return u


MODELS = {
    "tx60": lambda _: tx60(),
    "six axes, everything crooked": lambda rng: random_model(rng, 6),
    "seven axes": lambda rng: random_model(rng, 7),
    "sliding second and fifth joint": lambda rng: random_model(
        rng, 5, ("revolute", "prismatic", "revolute", "revolute", "prismatic"), harmonic_terms(5)
    ),
    "gravity and harmonics": lambda rng: random_model(
        rng, 6, (), gravity_terms(6) + harmonic_terms(6)
    ),
    "one joint": lambda rng: random_model(rng, 1),
}


COMPILED = pytest.mark.skipif(not NUMBA, reason="numba is not installed: nothing is compiled")
LOOPS = pytest.mark.parametrize(
    "many", [pytest.param(0, id="compiled", marks=COMPILED), pytest.param(np.inf, id="numpy")]
)


@LOOPS
@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("which", ["all", "links", "one", "none", "terms", "far"])
def test_loops_over_draws_give_points_and_sums_of_models_moved_one_by_one(
    name, which, many, monkeypatch
):
    monkeypatch.setattr(point_loops, "MANY_POINTS", many)
    monkeypatch.setattr(point_loops, "PASS", 7)
    rng = np.random.default_rng(7)
    model = MODELS[name](rng)
    n, P = model.chain.n_joints, model.n_numbers
    q, steps, mask = rng.uniform(-np.pi, np.pi, (13, n)), rng.normal(size=(25, P)), np.zeros(P)
    mask[
        {
            "links": slice(6, 6 + 5 * n),
            "one": slice(9, 10),
            "none": slice(0, 0),
            "terms": slice(12 + 5 * n, None),
        }.get(which, slice(None))
    ] = 1.0
    # normal steps reach 4 sd, terms of a joint come together: within the series, or far beyond it
    steps *= mask * (0.1 if which == "far" else 2e-3)
    nominal = model.poses(q)[:, :3, 3]
    loop = point_loops.PointLoop.of(model, q, nominal, 25)
    assert loop.compiled == (many == 0)
    found = np.concatenate([part for _, part in loop.deviations(steps)], axis=1)
    expected = np.stack([model.moved(step).poses(q)[:, :3, 3] for step in steps]) - nominal
    # a few dozen products of lengths up to 10 m: 1e-15 each
    np.testing.assert_allclose(np.moveaxis(found, 0, 2), expected, rtol=0, atol=1e-12)
    mean, covariance = loop.moments(25)
    np.testing.assert_allclose(mean, expected.mean(axis=0), rtol=0, atol=1e-12)
    each = np.stack([np.cov(expected[:, k].T) for k in range(13)])
    # of points off by lengths up to 1 m, squared
    np.testing.assert_allclose(covariance, each, rtol=0, atol=1e-12 * max(1, each.max()))


def test_few_draws_and_machines_without_numba_compile_nothing(monkeypatch):
    model, q = tx60(), pool_r(50)
    nominal = model.poses(q)[:, :3, 3]
    few = point_loops.MANY_POINTS // 50 - 1
    assert not point_loops.PointLoop.of(model, q, nominal, few).compiled
    assert point_loops.PointLoop.of(model, q, nominal, few + 1).compiled == NUMBA
    monkeypatch.setattr(loops, "NUMBA", False)
    assert not point_loops.PointLoop.of(model, q, nominal, 10 * few).compiled


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("which", ["all", "links", "one", "none", "terms"])
def test_fast_propagation_equals_moving_the_model_draw_by_draw(name, which):
    rng = np.random.default_rng(7)
    model = MODELS[name](rng)
    n, P = model.chain.n_joints, model.n_numbers
    q = rng.uniform(-np.pi, np.pi, (13, n))
    steps = rng.normal(size=(25, P)) * 0.1
    keep = {
        "all": slice(None),
        "links": slice(6, 6 + 5 * n),
        "one": slice(9, 10),  # alpha1 alone: everything else takes the short path
        "none": slice(0, 0),
        "terms": slice(12 + 5 * n, None),
    }[which]
    mask = np.zeros(P)
    mask[keep] = 1.0
    steps = steps * mask
    found = propagate(model, q, steps)
    expected = np.stack([model.moved(step).poses(q)[:, :3, 3] for step in steps])
    # a few dozen products of lengths up to 10 m: 1e-15 each
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


def test_the_size_of_a_pass_does_not_change_a_single_bit(monkeypatch):
    rng = np.random.default_rng(3)
    model, q = tx60(), pool_r(40)
    steps = correlated_draws(calibration_covariance(), 500, rng)
    whole = propagate(model, q, steps)
    monkeypatch.setattr(tool_points, "BATCH_POINTS", 333)
    np.testing.assert_array_equal(propagate(model, q, steps), whole)


def test_the_same_stream_gives_the_same_bits():
    model, q, C = tx60(), pool_r(10), calibration_covariance()
    first, second = (
        point_spread(model, q, C, np.random.default_rng(5), draws=2000) for _ in range(2)
    )
    np.testing.assert_array_equal(first.covariance, second.covariance)
    np.testing.assert_array_equal(first.shift, second.shift)


@LOOPS
def test_streamed_moments_equal_those_of_all_points_at_once(many, monkeypatch):
    monkeypatch.setattr(point_loops, "MANY_POINTS", many)
    model, q, C = tx60(), pool_r(30), calibration_covariance()
    spread = point_spread(model, q, C, np.random.default_rng(5), draws=2000)
    steps = correlated_draws(C, 2000, np.random.default_rng(5))
    points = propagate(model, q, steps)
    expected = np.stack([np.cov(points[:, k].T) for k in range(30)])
    # numpy subtracts positions of 0.5 m from each other: 1e-16 / 2e-5 relative per point
    np.testing.assert_allclose(spread.covariance, expected, atol=1e-9 * expected.max())
    straight = np.einsum("ncp,kp->knc", model.poses_and_jacobian(q)[1][:, :3], steps)
    remainder = points - spread.nominal - straight
    np.testing.assert_allclose(spread.shift, remainder.mean(axis=0), atol=1e-15)
    np.testing.assert_allclose(
        spread.worst_remainder * spread.linear_point,
        np.linalg.norm(remainder, axis=2).max(axis=0),
        atol=1e-15,
    )


def test_at_calibration_accuracy_linear_propagation_is_all_there_is():
    spread = point_spread(tx60(), pool_r(51), calibration_covariance(), np.random.default_rng(0))
    # 24 numbers of about 30 um and 0.005 deg: second order is u / reach = 1e-4
    assert spread.largest_difference < 1e-4
    assert spread.worst_remainder.max() < 1e-3
    # and the plain sample agrees as 10 000 draws can: 1 / sqrt(2 M) = .7 %, 51 poses, 4 sd
    np.testing.assert_allclose(
        point_uncertainty(spread.covariance), spread.linear_point, rtol=0.028
    )


def test_a_robot_known_exactly_has_no_spread():
    model, q, rng = tx60(), pool_r(3), np.random.default_rng(0)
    spread = point_spread(model, q, np.zeros((42, 42)), rng, draws=10)
    assert not spread.covariance.any()
    assert not spread.controlled.any()
    assert spread.largest_difference == 0.0
    # |P| of half a metre is rounded to 1e-16
    assert (distance_spread(model, q, np.zeros(42), rng, draws=10).standard < 1e-15).all()


def test_the_control_variate_gives_with_a_thousand_draws_what_plain_sampling_never_reaches():
    # errors a hundred times too large, so that there is a nonlinearity to find
    model, q, C = tx60(), pool_r(20), calibration_covariance(scale=100.0)
    long = point_spread(model, q, C, np.random.default_rng(1), draws=200_000)
    plain, controlled = [], []
    for seed in range(10):
        short = point_spread(model, q, C, np.random.default_rng(100 + seed), draws=1000)
        plain.append(point_uncertainty(short.covariance) / long.point - 1)
        controlled.append(short.point / long.point - 1)
    plain_rms, controlled_rms = (np.sqrt(np.mean(np.square(v))) for v in (plain, controlled))
    assert plain_rms == pytest.approx(1 / np.sqrt(2000), rel=0.5)  # 3 axes share the variance
    assert controlled_rms < plain_rms / 20


def test_nonlinearity_is_found_where_it_exists():
    # one turn about z, sd s = .3 rad, radius 1 m: mean x = exp(-s^2 / 2), var y = (1 - e^-2s^2) / 2
    model = RobotModel(Chain([[0, 0, 1.0, 0, 0]]))
    C = np.zeros((17, 17))
    C[6, 6] = 0.09
    spread = point_spread(model, [[0.0]], C, np.random.default_rng(2), draws=100_000)
    # sd of x is .06, of the variance of y .0004
    assert spread.shift[0, 0] == pytest.approx(np.exp(-0.045) - 1, abs=8e-4)
    assert spread.covariance[0, 1, 1] == pytest.approx((1 - np.exp(-0.18)) / 2, abs=1.5e-3)
    assert spread.linear[0, 1, 1] == pytest.approx(0.09, rel=1e-12)
    assert spread.largest_difference > 0.1


def test_the_95_percent_ellipsoid_of_the_linear_covariance_holds_95_percent_of_the_draws():
    model, q, C = tx60(), pool_r(4), calibration_covariance()
    draws = 20_000
    points = propagate(model, q, correlated_draws(C, draws, np.random.default_rng(3)))
    error = points - model.poses(q)[:, :3, 3]
    sigma = np.broadcast_to(tool_covariance(model, q, C)[:, :3, :3], (draws, 4, 3, 3))
    # binomial sd .0015, band 4 sd
    np.testing.assert_allclose(inside(error, sigma).mean(axis=0), 0.95, atol=0.0062)


def test_draws_have_the_covariance_asked_for_and_leave_fixed_numbers_alone():
    C = calibration_covariance()
    steps = correlated_draws(C, 50_000, np.random.default_rng(4))
    fixed = np.setdiff1d(np.arange(42), FREE)
    assert not steps[:, fixed].any()
    u = np.sqrt(np.diag(C))[FREE]
    found = np.cov(steps[:, FREE].T) / np.outer(u, u)
    # each entry scatters by at most sqrt(2 / 50 000) = .0063; 300 entries, 4.5 sd
    np.testing.assert_allclose(found, C[np.ix_(FREE, FREE)] / np.outer(u, u), atol=0.029)
    independent = independent_draws(np.sqrt(np.diag(C)), 50_000, np.random.default_rng(4))
    np.testing.assert_allclose(independent[:, FREE].std(axis=0), u, rtol=0.015)  # 4.7 sd
    assert not independent[:, fixed].any()


@LOOPS
@pytest.mark.parametrize("values", [4_000_000, 30_000], ids=["64 postures", "10 postures"])
def test_the_paper_form_is_the_scatter_of_the_distance(many, values, monkeypatch):
    monkeypatch.setattr(point_loops, "MANY_POINTS", many)
    monkeypatch.setattr(monte_carlo, "VALUES", values)
    model, q, u = tx60(), pool_r(70), free_standard()  # more poses than one block holds
    spread = distance_spread(model, q, u, np.random.default_rng(6), draws=3000)
    points = propagate(model, q, independent_draws(u, 3000, np.random.default_rng(6)))
    g = np.linalg.norm(points, axis=2)
    nominal = model.poses(q)[:, :3, 3]
    np.testing.assert_allclose(spread.mean, g.mean(axis=0), atol=1e-14)
    np.testing.assert_allclose(spread.standard, g.std(axis=0, ddof=1), rtol=1e-9)
    np.testing.assert_allclose(
        spread.interval, np.quantile(g, [0.025, 0.975], axis=0).T, atol=1e-14
    )
    np.testing.assert_allclose(spread.extremes, np.stack([g.min(0), g.max(0)], 1), atol=1e-14)
    np.testing.assert_allclose(spread.axis_standard, points.std(axis=0, ddof=1), rtol=1e-9)
    np.testing.assert_allclose(
        spread.axis_extremes,
        np.stack([(points - nominal).min(0), (points - nominal).max(0)], 2),
        atol=1e-14,
    )
    sigma = tool_covariance(model, q, np.diag(u**2))
    np.testing.assert_allclose(spread.linear, distance_uncertainty(sigma, nominal), rtol=1e-12)
    # sd of a sample sd 1.3 %, 70 poses, 4 sd
    np.testing.assert_allclose(spread.standard, spread.linear, rtol=0.052)
    assert (spread.standard < spread.point).all()


def test_paired_quantiles_show_the_nonlinearity_without_the_sampling_error():
    model, q, u = tx60(), pool_r(10), free_standard()
    spread = distance_spread(model, q, u, np.random.default_rng(8), draws=2000)
    # the ends themselves scatter by 6 % of u; the gap to the linear ends is second order
    assert (spread.nonlinearity < 2e-3 * spread.standard).all()
    tolerances = [numerical_tolerance(s) for s in spread.standard]
    assert (spread.nonlinearity < tolerances).all()


def test_the_tolerance_is_half_a_unit_of_the_last_digit():
    assert numerical_tolerance(0.00296, 1) == pytest.approx(0.0005)
    assert numerical_tolerance(0.00296, 2) == pytest.approx(0.00005)
    assert numerical_tolerance(35.8, 2) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda rng: independent_draws([-1.0, 1.0], 10, rng), r"standard\[0\] is negative"),
        (lambda rng: independent_draws([1.0], 1, rng), "draws is 1"),
        (lambda rng: correlated_draws([[1.0, 2.0], [2.0, 1.0]], 10, rng), "eigenvalue"),
        (lambda _: propagate(tx60(), pool_r(2), np.zeros((3, 24))), "steps"),
        (lambda rng: distance_spread(tx60(), pool_r(2), np.ones(24), rng), "standard"),
        (lambda _: numerical_tolerance(0.0), "above zero"),
        (
            lambda rng: distance_spread(
                RobotModel(Chain([[0, 0, 0, 0, 0]])), [[0.0]], np.ones(17), rng
            ),
            "origin",
        ),
    ],
)
def test_bad_input_is_refused_with_the_reason(call, message):
    with pytest.raises(InputError, match=message):
        call(np.random.default_rng(0))
