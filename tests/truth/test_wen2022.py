"""What Wen et al. 2022 print, against what their own Table 3 and the nominal chain give."""

from functools import cache

import numpy as np
import pytest

from calib.information.propagation import (
    axis_uncertainty,
    distance_uncertainty,
    point_uncertainty,
    tool_covariance,
)
from calib.uncertainty.monte_carlo import (
    distance_spread,
    independent_draws,
    numerical_tolerance,
    point_spread,
    propagate,
)
from calib.uncertainty.type_a import root_sum_square
from testbed.studies.wen2022 import paper
from testbed.studies.wen2022.claims import CLAIMS
from testbed.studies.wen2022.paper import printed
from tests.reference import WEN24, pool_r, tx60

MODEL = tx60()
ZERO = np.zeros((1, 6))
MM = 1e3

pytestmark = pytest.mark.truth


def standard(column):
    """Full vector (42,) of standard uncertainties from a column of Table 3 [m, rad]."""
    u = np.zeros(MODEL.n_numbers)
    u[[MODEL.names.index(name) for name in paper.PARAMETERS]] = paper.table3(column)
    return u


def recombined():
    """u_random (24,) from its printed components [deg, mm]."""
    return root_sum_square(*(printed(f"u_{k}_random") for k in "rpw"))


@cache
def spread_at_zero(column, draws=200_000, seed=0):
    return distance_spread(MODEL, ZERO, standard(column), np.random.default_rng(seed), draws=draws)


def test_the_table_lists_the_24_parameters_in_chain_order():
    assert paper.PARAMETERS == WEN24
    nominal = dict(zip(MODEL.names[6:36], MODEL.chain.links.ravel(), strict=True))
    for name, value in zip(paper.PARAMETERS, printed("nominal"), strict=True):
        unit = 1e-3 if name[:-1] in {"d", "a"} else np.pi / 180
        assert nominal[name] == pytest.approx(value * unit, abs=1e-15)


def test_the_claims_are_numbered_through_and_complete():
    assert list(CLAIMS) == list(range(1, 18))
    assert all(c.statement.endswith(".") and c.printed for c in CLAIMS.values())


def test_claim_1_the_zero_pose():
    T = MODEL.poses(ZERO)[0]
    np.testing.assert_allclose(T[:3, 3] * MM, paper.ZERO_POSE_MM, atol=1e-12)
    np.testing.assert_allclose(T[:3, :3], np.eye(3), atol=1e-15)


# 200 000 draws leave .16 % in a standard deviation; 2 % is the agreement asked for
@pytest.mark.parametrize(("column", "u_mm"), [("u_best", 0.00296), ("u_random", 0.03133)])
def test_claim_2_uncertainty_of_the_distance_at_the_zero_pose(column, u_mm):
    assert spread_at_zero(column).standard[0] * MM == pytest.approx(u_mm, rel=0.02)


def test_claim_2_the_printed_random_figure_is_reached_and_the_printed_best_figure_is_not():
    best, random = (spread_at_zero(c).standard[0] * MM for c in ("u_best", "u_random"))
    assert random == pytest.approx(paper.U_ZERO_RANDOM_MM, rel=0.02)
    # even if every entry of Table 3 were half a unit of its last digit larger
    rounded = standard("u_best")
    half = np.where(MODEL.is_length, 0.5e-7, np.deg2rad(0.5e-4)) * (rounded > 0)
    sigma = tool_covariance(MODEL, ZERO, np.diag((rounded + half) ** 2))
    most = distance_uncertainty(sigma, MODEL.poses(ZERO)[:, :3, 3])[0] * MM
    assert best < most < 0.0031 < paper.U_ZERO_BEST_MM


@pytest.mark.parametrize(
    ("column", "axes_mm"),
    [("u_best", (0.01286, 0.01124, 0.00296)), ("u_random", (0.11625, 0.10042, 0.03133))],
)
def test_claim_2_linear_axis_uncertainties_at_the_zero_pose(column, axes_mm):
    sigma = tool_covariance(MODEL, ZERO, np.diag(standard(column) ** 2))
    # half a unit of the last of the five decimals
    np.testing.assert_allclose(axis_uncertainty(sigma)[0] * MM, axes_mm, atol=5.1e-6)


def test_claim_2_the_zero_pose_by_hand():
    # candle: z is the sum of d1, a2, d4 and d6; alpha1 tilts the 20 mm side step of d3 into z
    rows = dict(zip(paper.PARAMETERS, printed("u_best"), strict=True))
    along = [rows[name] for name in ("d1", "a2", "d4", "d6")]
    tilt = [20.0 * np.deg2rad(rows["alpha1"])]
    assert root_sum_square(*along, *tilt) == pytest.approx(0.00296, abs=5.1e-6)


def test_claim_3_ten_thousand_draws_reach_3_85_standard_deviations_each_way():
    halves = []
    for seed in range(20):
        spread = spread_at_zero("u_best", draws=paper.DRAWS, seed=seed)
        width = spread.axis_extremes[0, :, 1] - spread.axis_extremes[0, :, 0]
        halves.append(width / 2 / spread.axis_standard[0])
    # the half width scatters by .2 (extreme values of 10 000 draws, longer tail upward): 15 % is
    # nearly three of it, and one in twenty may lie outside
    assert np.mean(np.abs(np.array(halves) / 3.85 - 1) < 0.15) > 0.9
    assert np.mean(halves) == pytest.approx(3.85, rel=0.02)
    low, high = paper.X_RANGE_ZERO_BEST_MM
    u_x = axis_uncertainty(tool_covariance(MODEL, ZERO, np.diag(standard("u_best") ** 2)))[0, 0]
    assert (high - low) / 2 == pytest.approx(3.85 * u_x * MM, rel=0.15)


@pytest.mark.parametrize(
    ("column", "mean_mm", "printed_mm"),
    [("u_best", 0.0069, paper.U_MEAN_BEST_MM), ("u_random", 0.0647, paper.U_MEAN_RANDOM_MM)],
)
def test_claim_4_mean_over_fifty_poses(column, mean_mm, printed_mm):
    u = standard(column)
    few = distance_spread(MODEL, pool_r(50, 17), u, np.random.default_rng(1))
    # fifty poses of our own choice: their mean scatters by 5 %
    assert few.standard.mean() * MM == pytest.approx(mean_mm, rel=0.12)
    assert few.standard.mean() * MM == pytest.approx(printed_mm, rel=0.12)
    goals = pool_r(2000, 99)
    sigma = tool_covariance(MODEL, goals, np.diag(u**2))
    many = distance_uncertainty(sigma, MODEL.poses(goals)[:, :3, 3]).mean() * MM
    assert many == pytest.approx(mean_mm, rel=0.02)


def test_claim_5_the_ratio_follows_from_the_table_whatever_the_points():
    for seed in range(3):
        q = pool_r(50, 17 + seed)
        best, random = (
            distance_spread(MODEL, q, standard(c), np.random.default_rng(2)).standard.mean()
            for c in ("u_best", "u_random")
        )
        assert best / random == pytest.approx(0.1065, abs=0.003)
        assert best / random == pytest.approx(paper.TOOL_RATIO, abs=0.004)


@pytest.mark.parametrize(
    ("column", "zero_mm", "mean_mm"), [("u_best", 0.0173, 0.0154), ("u_random", 0.1568, 0.1457)]
)
def test_claim_5_the_point_itself_is_several_times_less_certain_than_its_distance(
    column, zero_mm, mean_mm
):
    C = np.diag(standard(column) ** 2)
    rng = np.random.default_rng(3)
    at_zero = point_spread(MODEL, ZERO, C, rng, draws=2000)
    assert at_zero.point[0] * MM == pytest.approx(zero_mm, rel=0.003)
    assert at_zero.point[0] > 4.9 * spread_at_zero(column).standard[0]
    goals = pool_r(2000, 99)
    # the project's own reference figure is over another draw of poses: 1 %
    linear = point_uncertainty(tool_covariance(MODEL, goals, C)).mean() * MM
    assert linear == pytest.approx(mean_mm, rel=0.01)


def test_claim_6_every_row_but_beta2_is_the_root_sum_of_its_components():
    gap = np.abs(recombined() - printed("u_random"))
    wrong = [name for name, g in zip(paper.PARAMETERS, gap, strict=True) if g > 1.0e-4]
    assert wrong == ["beta2"]
    assert recombined()[paper.PARAMETERS.index("beta2")] == pytest.approx(0.0025, abs=5e-5)
    # the environment is counted as nothing, so the optimal set has its repeatability only
    np.testing.assert_array_equal(printed("u_best"), printed("u_r_best"))
    assert printed("ratio").mean() == pytest.approx(0.1113, abs=5.1e-5)
    assert (printed("u_best") / printed("u_random")).mean() == pytest.approx(0.1120, abs=5.1e-5)


def test_claim_6_three_columns_contradict_independent_parameters():
    # 310 mm u(theta3) = u(a3): one direction, seen twice
    for column in ("u_best", "u_r_random", "u_random"):
        rows = dict(zip(paper.PARAMETERS, printed(column), strict=True))
        arc = 310.0 * np.deg2rad(rows["theta3"])
        # theta3 is printed with two or three digits
        assert arc == pytest.approx(rows["a3"], rel=0.07)


@pytest.mark.parametrize(
    ("column", "u_mm"), [("u_best", paper.U_ZERO_BEST_MM), ("u_random", paper.U_ZERO_RANDOM_MM)]
)
def test_claim_7_the_square_root_of_the_plain_sum_gives_a_tenth_of_the_printed_figure(column, u_mm):
    steps = independent_draws(standard(column), 10_000, np.random.default_rng(4))
    literal = np.sqrt((propagate(MODEL, ZERO, steps)[:, 0] * MM).sum(axis=1))  # sqrt(mm)
    found = literal.std(ddof=1)
    assert found == pytest.approx(0.0003 if column == "u_best" else 0.003, rel=0.15)
    assert found < u_mm / 8


def test_claim_14_the_ratio_is_mostly_a_matter_of_what_is_counted():
    like_for_like = (printed("u_r_best") / printed("u_r_random")).mean()
    counted = (printed("u_r_random") / printed("u_random")).mean()
    assert like_for_like == pytest.approx(0.37, abs=0.005)
    assert counted == pytest.approx(0.33, abs=0.005)
    shares = [(printed(f"u_{k}_random") ** 2 / recombined() ** 2).mean() for k in ("r", "p", "w")]
    np.testing.assert_allclose(shares, [0.13, 0.34, 0.53], atol=0.006)
    against_repeats = [
        (printed(f"u_{k}_random") / printed("u_r_random")).mean() for k in ("p", "w")
    ]
    np.testing.assert_allclose(against_repeats, [1.97, 2.50], atol=0.006)


@pytest.mark.parametrize("column", ["u_best", "u_random"])
def test_claim_17_linear_propagation_is_validated_at_two_digits(column):
    spread = spread_at_zero(column, draws=20_000)
    delta = numerical_tolerance(spread.standard[0], 2)
    assert spread.nonlinearity[0] < delta
    C = np.diag(standard(column) ** 2)
    drawn = point_spread(MODEL, pool_r(50, 17), C, np.random.default_rng(5))
    # no draw at any pose leaves the straight line by more than 3 nm (best), 3e-4 of u
    if column == "u_best":
        assert (drawn.worst_remainder * drawn.linear_point).max() < 5e-9
    assert drawn.largest_difference < 1e-3
