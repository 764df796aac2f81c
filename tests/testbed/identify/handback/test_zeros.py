"""Zeros of joints that two numbers share, because they turn about parallel axes."""

import numpy as np
import pytest

from calib.geometry.chain import Chain
from testbed.identify.handback.states import MEASURED, HandedNumber, zero_words
from testbed.robots.write.dh_table import DhRow


def numbers(theta, beta, tolerance=0.1):
    """The two of the second of two joints [deg]."""
    return tuple(
        HandedNumber(DhRow(name, "deg", 0.0, off, off, 0.02), tolerance, MEASURED)
        for name, off in (("theta2", theta), ("beta2", beta))
    )


def chain(alpha):
    """Two joints, of which the second has this alpha [deg]."""
    return Chain(np.array([[0, 0.1, 0, 0, 0], [0, 0, 0, np.radians(alpha), 0]]))


def known(U, together=0.0):
    """Covariance of all numbers with this U of both [deg], and how they are correlated."""
    covariance = np.zeros((22, 22))
    at = np.array([11, 15])
    covariance[np.ix_(at, at)] = np.radians(U / 2) ** 2 * np.array([[1, together], [together, 1]])
    return covariance


@pytest.mark.parametrize(("alpha", "beta"), [(90, 0.27), (-90, -0.27)])
def test_what_theta_and_beta_share_is_said_as_the_zero_of_the_joint(alpha, beta):
    """A joint mastered 0.54 deg wrong was "theta4 by 0.27 deg ... beta4 by 0.27 deg"."""
    (said,) = zero_words(numbers(0.27, beta), chain(alpha), known(0.02))
    assert said.endswith("together the zero of joint 2 is 0.54 deg off")


@pytest.mark.parametrize(
    ("theta", "beta", "alpha"),
    [(0.27, 0.27, 0), (0.27, 0.27, 45), (0.27, -0.27, 90), (0.54, 0.01, 90), (0.04, 0.04, 90)],
    ids=["another axis", "half another", "cancels", "one alone", "within its tolerance"],
)
def test_nothing_is_said_where_one_number_says_it(theta, beta, alpha):
    assert zero_words(numbers(theta, beta), chain(alpha), known(0.02)) == ()


def test_nothing_is_said_of_a_sum_that_is_not_known_to_be_off():
    """Of arms read to 150 um it was said that a zero is 0.12 deg off, which U of 0.23 deg held.

    Both numbers may be known badly and their sum well, where they stand for each other.
    """
    parts = numbers(0.27, 0.27)
    assert zero_words(parts, chain(90), known(0.4)) == ()  # U of the sum is 0.4 sqrt(2)
    assert zero_words(parts, chain(90), known(0.4, together=-0.999))
