"""What is said of slides that travel too far."""

import re

import numpy as np

from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.identification.model_choice import extended_by
from calib.identification.prior import weak_prior
from calib.measurement.tables import points
from testbed.identify.applies.travel import travel_words
from tests.calib.identification.test_offers import RAILS, travel_offered, travelled


def test_scales_are_told_in_um_per_meter_and_not_as_the_amplitude_of_a_wave():
    q, xyz = travelled()
    table, free = points(q, xyz, sd=5e-6), parameters_of(RAILS)
    prior = weak_prior(free, RAILS)
    _, found = extended_by(RAILS, table, free, travel_offered(q, xyz).levels[1:], prior=prior)
    (text,) = travel_words(found, found.covariance)
    # the scales that were put in, +90, -60 and +30 um/m; U of 40 poses of 5 um over some meters
    assert text.startswith(
        "slides move by another distance than commanded: joint 1 90 um/m further"
    )
    assert "joint 2 60 um/m less (U = " in text
    assert "joint 3 30 um/m further (U = " in text
    plain = identify(RAILS, table, free, prior=prior)
    assert travel_words(plain, plain.covariance) == ()
    # U is that of the table of numbers, whose covariance is not always that of the stated noise
    (wide,) = travel_words(found, 4 * found.covariance)
    one, other = (
        [float(x) for x in re.findall(r"U = ([\d.]+) um/m", said)] for said in (text, wide)
    )
    np.testing.assert_allclose(other, 2 * np.array(one), rtol=0.1)  # of two digits each


def test_a_scale_that_readings_do_not_tell_from_none_is_not_told():
    """A slide that moved by 1 mm was said to move 1.4 um/m further (U = 200 um/m)."""
    q, xyz = travelled()
    table, free = points(q, xyz, sd=5e-6), parameters_of(RAILS)
    prior = weak_prior(free, RAILS)
    _, found = extended_by(RAILS, table, free, travel_offered(q, xyz).levels[1:], prior=prior)
    wide = np.array(found.covariance)
    third = found.names.index("scale3")
    wide[third] *= 100
    wide[:, third] *= 100
    (text,) = travel_words(found, wide)
    assert "joint 2 60 um/m less" in text
    assert "joint 3" not in text
    assert travel_words(found, 1e6 * found.covariance) == ()
