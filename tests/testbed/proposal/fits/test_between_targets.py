"""Noise by the distances of targets on one tool."""

import numpy as np
import pytest

from calib.geometry.frames import target_points
from calib.measurement import tables
from calib.measurement.observations import joined
from testbed.proposal.fits.between_targets import noise_between
from tests.testbed.files.made import made

PLACES = np.array([[-0.1, -0.03, 0.1], [-0.1, 0.03, 0.05], [0.1, 0.0, 0.08], [0.05, 0.1, 0.02]])
NOISE = 1e-4


def seen(count, sd, m=60, **own):
    """Rows of some targets at the same poses, each with noise `sd` [m] of its own."""
    rng, data = np.random.default_rng(3), made(6, m)
    rows = []
    for k in range(count):
        p = target_points(data.T, PLACES[k]) + sd[k] * rng.standard_normal((m, 3))
        about = {name: value[k] for name, value in own.items()}
        rows.append(tables.points(data.q, p, sd=3e-5, reflector=k, **about))
    return joined(rows)


@pytest.mark.parametrize("count", [2, 3, 4])
def test_targets_tell_the_noise_of_each(count):
    # medians of 60 poses: 15 %, and the lower quarter of six pairs is below their middle
    assert noise_between(seen(count, [NOISE] * 4)) == pytest.approx(NOISE, rel=0.35)


@pytest.mark.parametrize("count", [3, 4])
def test_one_target_that_wobbles_is_not_the_noise_of_all(count):
    """The middle of all pairs was that of the loose one, which is in two of three."""
    assert noise_between(seen(count, [1e-3, NOISE, NOISE, NOISE])) < 1.4 * NOISE


def test_two_tools_two_stations_and_few_poses_tell_none():
    loud = [1e-3] * 2
    assert noise_between(seen(2, loud)) > 5e-4
    assert noise_between(seen(2, loud, station=[0, 1])) == 0
    assert noise_between(seen(2, loud, tool=[0, 1])) == 0
    assert noise_between(seen(2, loud, m=7)) == 0
    assert noise_between(seen(1, loud)) == 0
