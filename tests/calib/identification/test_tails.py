"""Long tails are told from normal residuals, and by visits the noise from a misfit."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.stats import chi2, multivariate_t

from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.identification.outliers.tails import DEGREES, LEVEL, long_tails, student
from calib.measurement.observations import joined
from tests.calib import kinds

TX60 = RobotModel(kinds.ARMS["tx60"])


def test_the_likelihood_ratio_is_that_of_scipy():
    rng = np.random.default_rng(1)
    r = 20e-6 * rng.normal(size=(60, 3)) * np.where(rng.random((60, 1)) < 0.1, 5.0, 1.0)
    degrees, p = student((r**2).sum(axis=1), np.full(60, 3.0), np.ones(60))

    def best(nu):
        """Largest log-likelihood over the scale of a t, of the normal distribution if infinite."""

        def less(log_scale):
            shape = np.exp(log_scale) * np.eye(3)
            return -multivariate_t.logpdf(r, shape=shape, df=nu).sum()

        return -minimize_scalar(less, bounds=(-25, -15), method="bounded").fun

    values = [best(nu) for nu in DEGREES]
    assert degrees == DEGREES[int(np.argmax(values))]
    ratio = 2 * (max(values) - best(np.inf))
    # the search for the scale ends 1e-5 from the best one, where the likelihood is flat
    assert p == pytest.approx(chi2.sf(ratio, 1) / 2, rel=1e-3)
    assert p < LEVEL


def test_normal_residuals_of_any_size_have_no_long_tails():
    rng = np.random.default_rng(2)
    p = [
        student(7.0 * rng.chisquare(freedom := np.full(60, 3.0)), freedom, np.ones(60))[1]
        for _ in range(200)
    ]
    # 2 of 200 at 1 %; seven or more have a chance of 0.5 %
    assert (np.array(p) < 0.01).sum() < 7


def table(rng, q, first, off, repeat=0):
    """Full poses of the TX60 at joints q, their readings `off` (m, 3) beside it [m]."""
    seen = kinds.poses(TX60, q, rng)
    place = TX60.poses(q)[:, :3, 3] + off
    return replace(
        seen, position=place, pose_id=first + np.arange(len(q)), repeat=np.full(len(q), repeat)
    )


@pytest.mark.parametrize(
    ("tail", "visits", "source"),
    [(None, 2, None), ("noise", 1, ""), ("noise", 2, "noise"), ("misfit", 2, "misfit")],
)
def test_visits_tell_noise_with_long_tails_from_a_misfit_in_a_few_places(tail, visits, source):
    """A tenth of the readings, or of the poses, is off by five times the noise."""
    rng = np.random.default_rng(3)
    q = kinds.joints("tx60", rng, 60)
    of_poses = kinds.NOISE * 5 * rng.normal(size=(60, 3)) * (np.arange(60) % 10 == 0)[:, None]
    parts = []
    for _ in range(visits):
        off = kinds.NOISE * rng.normal(size=(60, 3))
        if tail == "noise":
            off *= np.where(rng.random((60, 1)) < 0.1, 5.0, 1.0)
        parts.append(off + of_poses * (tail == "misfit"))
    train, held_out = (
        joined([table(rng, q[at], first, off[at], k) for k, off in enumerate(parts)])
        for at, first in ((slice(40), 0), (slice(40, 60), 40))
    )
    found = long_tails(identify(TX60, train, parameters_of(TX60)), train, held_out)
    assert (None if found is None else found.source) == source
    if found is not None:
        assert found.rows == 60 * visits
        assert found.few < 0.6 * found.usual
        assert (len(found.poses) > 0) == (found.few <= 3)
        assert f"hold half of all squares, where normal noise needs {found.usual}" in found.sentence
        assert ("second visit of every pose" in found.sentence) == (source == "")


def test_half_of_all_squares_of_normal_noise_is_in_the_worst_rows_that_are_named():
    """By a hundred thousand draws: 22.6 of 100 rows."""
    rng = np.random.default_rng(4)
    square = np.sort(rng.chisquare(3, 100_000))[::-1]
    few = np.searchsorted(np.cumsum(square), square.sum() / 2)
    # a share of so many draws: standard error 0.1 %
    assert few / 100_000 == pytest.approx(chi2.sf(chi2.isf(0.5, 5), 3), abs=0.005)
