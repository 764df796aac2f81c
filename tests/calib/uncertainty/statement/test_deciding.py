"""What would decide a tolerance: against the laws by which each part of a region shrinks."""

from dataclasses import replace

import numpy as np
import pytest

from calib.uncertainty.statement.believe import believe
from calib.uncertainty.statement.deciding import MOST, what_decides
from calib.uncertainty.statement.distance import distance_radius
from calib.uncertainty.statement.misfit import HiddenMisfit
from calib.uncertainty.statement.stated_point import widened
from tests.calib import kinds
from tests.calib.uncertainty.statement.test_belief import campaign

FINE = 2e-3
"""Twelve halvings of ln 100 leave 0.11 % of a factor."""


@pytest.fixture(scope="module")
def calibrated():
    """A belief about a rigid arm, and postures to decide at."""
    rng = np.random.default_rng(61)
    _, fit, train, held_out = campaign(rng, 0.0)
    return believe(fit, train, held_out), kinds.joints("tx60", rng, 12)


def hiding(belief, upper, best=0.0, ratio=0.0):
    """The belief with another misfit [m]; `ratio` makes its p-value."""
    return replace(belief, misfit=replace(belief.misfit, upper=upper, best=best, ratio=ratio))


def largest(belief, q):
    """Largest R95 over postures [m]."""
    return float(distance_radius(widened(belief.regions(q)), belief.probability).max())


def test_noise_alone_falls_with_the_root_of_the_poses_and_with_the_instrument(calibrated):
    belief, q = hiding(calibrated[0], 0.0), calibrated[1]
    radius = largest(belief, q)
    found = what_decides(belief, q, radius / 3)
    assert found.radius == pytest.approx(radius, rel=1e-9)
    assert found.poses == pytest.approx(9, rel=FINE)
    assert found.quieter == pytest.approx(3, rel=FINE)
    assert found.shared == found.staying == 0.0


def test_a_misfit_that_nobody_saw_falls_with_the_fourth_root_of_the_poses(calibrated):
    """Its limit is a detection limit, whose square falls as one over the root of the poses."""
    belief, q = calibrated
    belief = hiding(replace(belief, covariance=np.zeros_like(belief.covariance)), 20e-6)
    found = what_decides(belief, q, largest(belief, q) / 2)
    assert found.poses == pytest.approx(16, rel=FINE)
    assert found.quieter == pytest.approx(2, rel=FINE)
    assert found.staying == 0.0


def test_of_a_misfit_that_was_seen_the_most_likely_size_stays(calibrated):
    belief, q = calibrated
    belief = hiding(
        replace(belief, covariance=np.zeros_like(belief.covariance)), 20e-6, 10e-6, ratio=40.0
    )
    whole = largest(belief, q)
    found = what_decides(belief, q, whole / 4)
    assert found.staying == pytest.approx(whole / 2, rel=1e-6)
    assert found.poses == found.quieter == np.inf
    # variance 1/4 + 3/4 f^-1/2 of today's, and 1/4 + 3/4 f^-2
    near = what_decides(belief, q, whole * np.sqrt(1 / 4 + 3 / 4 / 3))
    assert near.poses == pytest.approx(9, rel=FINE)
    assert near.quieter == pytest.approx(np.sqrt(3), rel=FINE)


def test_a_likely_misfit_that_counted_errors_rule_out_does_not_stay(calibrated):
    belief, q = calibrated
    belief = hiding(belief, 0.0, 10e-6, ratio=40.0)
    assert what_decides(belief, q, largest(belief, q)).staying == 0.0


def test_what_all_readings_share_stays(calibrated):
    belief, q = hiding(calibrated[0], 0.0), calibrated[1]
    # as much again as the noise
    shared = belief.covariance
    both = replace(belief, covariance=2 * belief.covariance)
    found = what_decides(both, q, largest(both, q) / np.sqrt(2) * np.sqrt(1 + 1 / 5), shared=shared)
    assert found.shared == pytest.approx(largest(belief, q), rel=1e-6)
    assert found.staying == pytest.approx(found.shared, rel=1e-6)
    assert found.poses == pytest.approx(5, rel=FINE)
    assert found.quieter == pytest.approx(np.sqrt(5), rel=FINE)


def test_neither_is_proposed_beyond_a_hundred_times_nor_where_it_is_decided(calibrated):
    belief, q = hiding(calibrated[0], 0.0), calibrated[1]
    radius = largest(belief, q)
    assert what_decides(belief, q, 1.01 * radius).poses == 1.0
    far = what_decides(belief, q, radius / (0.9 * MOST))
    assert far.poses == np.inf
    assert far.quieter == pytest.approx(0.9 * MOST, rel=FINE)


def test_only_a_misfit_that_is_shown_has_a_size_that_stays(calibrated):
    """At p just above and just below the level by which readings show one."""
    belief, q = calibrated
    p = {ratio: hiding(belief, 2e-5, 1e-5, ratio).misfit.p_value for ratio in (5.3, 5.5)}
    assert isinstance(belief.misfit, HiddenMisfit)
    assert p[5.3] > 0.01 > p[5.5]
    stays = [what_decides(hiding(belief, 2e-5, 1e-5, r), q, 1e-5).staying for r in p]
    assert stays[0] == 0.0 < stays[1]
