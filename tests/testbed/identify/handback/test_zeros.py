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


@pytest.mark.parametrize(("alpha", "beta"), [(90, 0.27), (-90, -0.27)])
def test_what_theta_and_beta_share_is_said_as_the_zero_of_the_joint(alpha, beta):
    """A joint mastered 0.54 deg wrong was "theta4 by 0.27 deg ... beta4 by 0.27 deg"."""
    (said,) = zero_words(numbers(0.27, beta), chain(alpha))
    assert said.endswith("together the zero of joint 2 is 0.54 deg off")


@pytest.mark.parametrize(
    ("theta", "beta", "alpha"),
    [(0.27, 0.27, 0), (0.27, 0.27, 45), (0.27, -0.27, 90), (0.54, 0.01, 90), (0.04, 0.04, 90)],
    ids=["another axis", "half another", "cancels", "one alone", "within its tolerance"],
)
def test_nothing_is_said_where_one_number_says_it(theta, beta, alpha):
    assert zero_words(numbers(theta, beta), chain(alpha)) == ()
