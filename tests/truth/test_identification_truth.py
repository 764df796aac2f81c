"""Does an identification know how good it is? Replications against known truth."""

from functools import cache

import numpy as np
import pytest
from scipy.stats import t

from calib.arrays import Array
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import Mode, identify
from tests.reference import BASE6, DEG, TOOL6, WEN24, pool_r, rigid_truth, tx60
from tests.truth.judge import coverage_band, judge, nees_band
from tests.truth.measuring import measured

pytestmark = pytest.mark.truth
POSES = 29
POOL = pool_r()


@pytest.fixture(scope="module", params=[200, pytest.param(4000, marks=pytest.mark.study)])
def count(request: pytest.FixtureRequest) -> int:
    """Of how many replications."""
    return int(request.param)


@cache
def replicate(mode: Mode, count: int) -> tuple[Array, Array, Array]:
    """Errors (n, 24), covariances (n, 24, 24), chi-squares (n,): a new `rigid` robot each time."""
    rng, nominal = np.random.default_rng(7), tx60()
    parameters = parameters_of(nominal, WEN24)
    errors, covariances, chi_squares = [], [], []
    for _ in range(count):
        truth = rigid_truth(rng)
        result = identify(nominal, measured(truth, POOL[:POSES], rng), parameters, mode=mode)
        errors.append(result.step - nominal.step_to(truth)[parameters.free_index])
        covariances.append(result.covariance)
        chi_squares.append(result.chi_square)
    return np.array(errors), np.array(covariances), np.array(chi_squares)


def test_the_default_estimator_knows_how_good_it_is(count: int):
    """NEES, bias and every parameter's 95 % intervals lie where chance allows."""
    errors, covariances, chi_squares = replicate("whitened", count)
    verdict = judge(errors, covariances)
    assert verdict.nees in verdict.nees_band
    assert verdict.bias <= verdict.bias_limit
    assert [float(share) in verdict.coverage_band for share in verdict.coverage] == [True] * 24
    # intervals of one fit are not independent: their mean scatters less than one parameter's band
    assert abs(verdict.coverage.mean() - 0.95) < 0.2 / np.sqrt(count)
    dof = 6 * POSES - 24
    assert float(chi_squares.mean()) in nees_band(dof, count)


def test_the_papers_estimator_does_not(count: int):
    """Its 95 % intervals hold 71.5 % of the truth, 57 to 100 % by parameter (+-5)."""
    errors, covariances, _ = replicate("paper", count)
    verdict = judge(errors, covariances, quantile=float(t.ppf(0.975, 12 * POSES - 24)))
    assert not verdict.sound
    assert verdict.nees > 2 * verdict.nees_band.high
    assert verdict.coverage.mean() == pytest.approx(0.715, abs=0.05)
    assert verdict.coverage.min() < coverage_band(count).low - 0.2
    assert verdict.coverage.max() > coverage_band(count).high


def test_unweighted_rows_waste_what_whitened_ones_use(count: int):
    """Same measurements: no parameter may be better off without weights (Gauss-Markov)."""
    whitened, paper = replicate("whitened", count)[0], replicate("paper", count)[0]
    ratio = paper.std(0) / whitened.std(0)
    # sd of a ratio of two sds from n replications is at most 1 / sqrt(n)
    assert ratio.min() > 1 - 3 / np.sqrt(count)
    assert np.median(ratio) > 1.2


def mounted_askew(truth: RobotModel, rng: np.random.Generator) -> RobotModel:
    """The robot with base and tool off by 0.1 mm and 0.01 deg per axis."""
    step = np.zeros(truth.n_numbers)
    for name in (*BASE6, *TOOL6):
        k = truth.names.index(name)
        step[k] = rng.normal() * (1e-4 if truth.is_length[k] else 0.01 * DEG)
    return truth.moved(step)


def test_frames_a_little_off_spoil_the_papers_24_and_not_the_readable_30():
    """m = 61: test error .157 against .0103 mm, chi2 per dof 17 against .99, +-20 %."""
    rng, nominal, goals = np.random.default_rng(8), tx60(), pool_r(300, seed=99)
    found = []
    for _ in range(40):
        truth = mounted_askew(rigid_truth(rng), rng)
        table = measured(truth, POOL[100:161], rng)
        row = []
        for free in (WEN24, None):
            result = identify(nominal, table, parameters_of(nominal, free))
            off = result.model.poses(goals)[:, :3, 3] - truth.poses(goals)[:, :3, 3]
            row += [1e3 * np.linalg.norm(off, axis=1).mean(), result.chi_square / result.dof]
        found.append(row)
    median = np.median(found, axis=0)
    np.testing.assert_allclose(median, [0.157, 17, 0.0103, 0.99], rtol=0.2)
