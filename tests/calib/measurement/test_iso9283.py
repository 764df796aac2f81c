"""ISO 9283 figures: by hand, against simulation, and honest about what they are worth."""

import numpy as np
import pytest
from scipy import stats

from calib.errors import InputError
from calib.geometry.frames import exp_so3
from calib.measurement.cycles import mean_norm, mean_widest, repeatability_floor, sd_bias
from calib.measurement.iso9283 import (
    accuracy,
    approaches,
    distance_accuracy,
    distance_repeatability,
    repeatability,
)
from calib.measurement.iso_rotations import mean_rotation, rotation_accuracy, rotation_repeatability

FIXTURE = np.array([[0, 0, 0], [2, 0, 0], [1, 1, 0], [1, -1, 0], [1, 0, 0.0]])
"""Distances to the barycenter 1, 1, 1, 1, 0: mean 0.8, standard deviation sqrt(0.2)."""
N, CYCLES = 4000, 30


@pytest.fixture(scope="module")
def readings():
    """(N, 30, 3) with standard deviation 1."""
    return np.random.default_rng(2).standard_normal((N, CYCLES, 3))


def test_figures_of_five_points_as_by_hand():
    assert float(repeatability(FIXTURE).value) == pytest.approx(0.8 + 3 * 0.2**0.5, abs=1e-15)
    assert float(repeatability(FIXTURE).value) == pytest.approx(2.1416408, abs=5e-8)
    assert float(accuracy(FIXTURE, [1, 0, 0.5]).value) == 0.5
    # 300 mm apart; the second pose repeats the first but for one reading 1 mm too far
    second = FIXTURE + np.array([300.0, 0, 0])
    second[0, 0] += 1.0
    found = distance_accuracy(FIXTURE, second, 300.0)
    assert float(found.value) == pytest.approx(0.2)
    assert float(distance_repeatability(FIXTURE, second).value) == pytest.approx(3 * 0.2**0.5)
    assert float(found.uncertainty) == pytest.approx(0.2**0.5 / 5**0.5)
    groups = np.stack([FIXTURE, FIXTURE + np.array([0.3, 0, 0]), FIXTURE + np.array([0, 0.4, 0])])
    assert float(approaches(groups).value) == pytest.approx(0.5)


def test_equal_scatter_gives_the_known_multiples_of_its_standard_deviation():
    """n = 30: RP 3.534 (simulated), AP floor sqrt(8/(30 pi)), vAP 0.533 (simulated), RD 4.20."""
    one = np.eye(3)
    assert float(repeatability_floor(one, CYCLES)) == pytest.approx(3.534, rel=2e-3)
    assert float(mean_norm(one / CYCLES)) == pytest.approx(np.sqrt(8 / np.pi / CYCLES), rel=1e-12)
    # 400 000 draws: 0.53278 +- 0.00026; 2048 quasi-random points of nine dimensions leave 0.4 %
    assert float(mean_widest(one / CYCLES, 3)) == pytest.approx(0.5328, rel=6e-3)
    assert 3 * np.sqrt(2) * sd_bias(CYCLES) == pytest.approx(4.206, abs=5e-4)
    assert sd_bias(CYCLES) == pytest.approx(0.99142, abs=5e-6)  # tables of c4


@pytest.mark.slow
@pytest.mark.parametrize("sd", [(1.0, 1.0, 1.0), (1.0, 0.3, 0.1)])
def test_floors_are_what_readings_of_a_perfect_robot_show(readings, sd):
    x, noise = readings * sd, np.diag(np.square(sd))
    halves = x[: N // 2], x[N // 2 :] + np.array([500.0, 0, 0])
    for found, share in (
        (repeatability(x, noise=noise), 6e-3),
        (accuracy(x, np.zeros(3)), 0.02),
        (approaches(x[:900].reshape(-1, 3, CYCLES, 3)), 0.06),
        (distance_accuracy(*halves, 500.0), 0.05),
        (distance_repeatability(*halves, noise=2 * noise), 0.01),
    ):
        # standard error of the mean of the simulation, three times
        assert found.value.mean() == pytest.approx(found.floor.mean(), rel=share)


def test_a_mean_length_is_that_of_the_chi_distribution_in_one_two_and_three_directions():
    for k in (1, 2, 3):
        C = np.diag([1.0] * k + [0.0] * (3 - k))
        # the root of a flat covariance has a kink on the sphere: 1e-4 instead of 1e-12
        assert float(mean_norm(C)) == pytest.approx(
            stats.chi(k).mean(), rel=1e-12 if k > 2 else 2e-3
        )


def test_rp_scatters_as_its_uncertainty_says(readings):
    found = repeatability(readings)
    assert np.percentile(found.value, [5, 95]) == pytest.approx([3.00, 4.09], abs=0.05)
    root = float(np.sqrt((found.uncertainty**2).mean()))
    # the jackknife errs on the large side
    assert 1.0 < root / found.value.std() < 1.15


def test_ap_of_a_true_offset_lies_within_two_u_as_often_as_it_should(readings):
    offset = np.array([0.6, 0.5, -0.4])
    found = accuracy(readings + offset, np.zeros(3))
    covered = np.abs(found.value - np.linalg.norm(offset)) < stats.t(29).ppf(0.975) * (
        found.uncertainty
    )
    # 0.95 +- 0.011 is three standard errors; |mean| is longer than the offset by 2 %, as it must be
    assert covered.mean() == pytest.approx(0.95, abs=0.015)


def test_what_all_readings_share_adds_along_the_error_and_is_not_averaged(readings):
    common = np.diag([0.04, 0.09, 0.0])
    bare = accuracy(readings[:50] * 1e-6 + [2.0, 0, 0], np.zeros(3))
    full = accuracy(readings[:50] * 1e-6 + [2.0, 0, 0], np.zeros(3), common=common)
    assert full.uncertainty == pytest.approx(0.2, rel=1e-6)
    assert bare.uncertainty.max() < 1e-6
    far = distance_accuracy(FIXTURE, FIXTURE + np.array([300.0, 0, 0]), 300.0, common=0.07)
    assert float(far.uncertainty) == pytest.approx(0.07)


def test_figures_do_not_depend_on_the_axes(readings):
    x, R = readings[:5] + np.array([1.0, 2, 3]), exp_so3(np.array([0.4, -0.7, 1.1]))
    C = np.diag([1.0, 0.2, 0.1])
    for one, other in (
        (repeatability(x, noise=C), repeatability(x @ R.T, noise=R @ C @ R.T)),
        (accuracy(x, [1, 2, 2.5]), accuracy(x @ R.T, R @ [1, 2, 2.5])),
    ):
        for name in ("value", "uncertainty", "floor"):
            np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-9)


def test_orientation_figures_are_those_of_small_rotation_vectors(readings):
    small, command = readings[:40] * 1e-5, exp_so3(np.array([1.0, 2.0, -0.5]))
    offset = np.array([3e-5, -2e-5, 1e-5])
    R = exp_so3(small + offset) @ command
    found = rotation_accuracy(R, command)
    like = accuracy(small + offset, np.zeros(3))
    np.testing.assert_allclose(found.value, like.value, rtol=1e-4)  # angles of 1e-5, squared
    np.testing.assert_allclose(found.floor, like.floor, rtol=1e-4)
    spread = rotation_repeatability(R, noise=np.eye(3) * 1e-10)
    np.testing.assert_allclose(spread.value, 3 * small.std(axis=1, ddof=1), rtol=1e-4)
    assert spread.floor == pytest.approx(3e-5 * sd_bias(CYCLES))


@pytest.mark.parametrize("degrees", [3.0, 90.0, 179.999, 180.0])
def test_a_tool_that_is_turned_by_any_angle_is_off_by_that_angle(readings, degrees):
    """Half a turn: rotation vectors from the command would point to both sides, and cancel."""
    turned = exp_so3(np.radians(degrees) * np.array([0.6, 0.0, 0.8]))
    R = exp_so3(1e-4 * readings[:20]) @ turned
    angle = np.degrees(rotation_accuracy(R, np.eye(3)).value)
    # 1e-4 / sqrt(30) rad are 0.001 degrees
    np.testing.assert_allclose(angle, degrees, atol=5e-3)


def test_the_mean_rotation_is_free_of_the_axes_in_which_it_is_written():
    rng = np.random.default_rng(3)
    R = exp_so3(rng.normal(size=(12, 3)) * 0.5)
    left, right = exp_so3(np.array([2.0, 0.3, 1.0])), exp_so3(np.array([-1.0, 2.5, 0.2]))
    np.testing.assert_allclose(mean_rotation(left @ R @ right), left @ mean_rotation(R) @ right,
                               atol=1e-12)  # fmt: skip
    quaternion_like = R.mean(axis=0)
    U, _, Vt = np.linalg.svd(quaternion_like)
    # the chordal mean agrees to second order of the spread
    np.testing.assert_allclose(mean_rotation(R), U @ Vt, atol=0.1)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: accuracy(FIXTURE[:2], np.zeros(3)), "at least 3 cycles"),
        (lambda: accuracy(FIXTURE, np.zeros(2)), "command has shape"),
        (lambda: repeatability(np.where(FIXTURE == 2, np.nan, FIXTURE)), "is nan"),
        (lambda: repeatability(FIXTURE, noise=-np.eye(3)), "no negative eigenvalue"),
        (lambda: approaches(FIXTURE), "two directions"),
        (lambda: distance_accuracy(FIXTURE, FIXTURE[:4], 1.0), "the same cycles"),
        (lambda: rotation_repeatability(np.eye(3)), "at least 3 cycles"),
    ],
)
def test_bad_input_is_named(call, said):
    with pytest.raises(InputError, match=said):
        call()


def test_groups_of_many_cycles_tell_the_same_uncertainty_as_single_ones():
    x = np.random.default_rng(5).standard_normal((1500, 3))
    # delta method of RP for equal scatter: n u^2 = 3.27; 500 groups tell u to 4 %
    assert float(repeatability(x).uncertainty) == pytest.approx((3.27 / 1500) ** 0.5, rel=0.15)


def test_the_floor_of_ad_is_what_scatter_alone_reads_whatever_the_instrument_shares():
    rng = np.random.default_rng(12)
    ends = np.array([[[0, 0, 0]], [[0.5, 0, 0]]])
    first, second = rng.normal(scale=1e-5, size=(2, 30, 3)) + ends
    alone = distance_accuracy(first, second, 0.5)
    both = distance_accuracy(first, second, 0.5, common=2e-5)
    assert both.floor == alone.floor
    assert both.uncertainty == pytest.approx(np.hypot(alone.uncertainty, 2e-5), rel=1e-12)
    # mean |x| of a normal number of that standard deviation
    assert alone.floor == pytest.approx(alone.uncertainty * np.sqrt(2 / np.pi), rel=1e-12)
