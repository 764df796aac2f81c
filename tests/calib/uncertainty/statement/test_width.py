"""How wide the stated radius is and what of it is needed: one visit, two, the conformal radius.

In variance, of what a misfit of 3.4 times the noise makes true: its limit is 1.2 times its most
likely size, growth 1.3 over poses like the held-out ones, its shape (half in the joints, which wave
with the pose) the rest. Each is needed elsewhere: below detection, at other places, with 500 poses.
"""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.measurement.observations import joined
from calib.uncertainty.conformal import conformal
from calib.uncertainty.held_out import errors_of_poses
from calib.uncertainty.statement.believe import believe
from calib.uncertainty.statement.repeats import noise_repeats
from calib.uncertainty.statement.stated_point import common_radius
from tests.calib import kinds
from tests.calib.uncertainty.drift.test_drifting import gears, missed, sag

M, N, MORE = 40, 20, 100
LARGER = 3.5
"""Noise over what is stated of it."""
WHITE = kinds.NOISE * np.sqrt(LARGER**2 - 1)
"""A misfit anew at each pose that makes the same of the readings [m]."""


def white(q, rng):
    """Errors of no joint: `missed` draws them at the target."""
    return rng.normal(size=(len(q), 3))


def campaign(seed, arm="tx60", *, kind=white, size=0.0, gain=1.0, tails=False, visits=1):
    """Radius stated and conformal radius, and how far true points lie off, with the misfit and
    without it (`MORE` each) [m]."""
    rng, model = np.random.default_rng([seed, visits, 71]), RobotModel(kinds.ARMS[arm])
    q = kinds.joints(arm, rng, M + N + MORE)
    off = size * kinds.NOISE * white(q, rng) if kind is white else missed(kind, q, size, rng, model)
    row = np.tile(np.arange(M + N), visits)
    table = kinds.poses(model, q[row], rng)
    exact = model.poses(q)[:, :3, 3]
    noise = table.position - exact[row]
    if tails:
        noise = kinds.NOISE * rng.standard_t(3, size=noise.shape) / np.sqrt(3)
    repeat = np.repeat(np.arange(visits), M + N)
    position = (exact + off)[row] + gain * noise
    table = replace(table, position=position, pose_id=row, repeat=repeat)
    train, test = table.rows(row < M), table.rows(row >= M)
    fit = identify(model, train, parameters_of(model))
    both = joined([train, replace(test, pose_id=-1 - test.pose_id)])
    repeats = noise_repeats(fit.model, both, in_evidence=True)
    stated = believe(fit, train, test, repeats=repeats).regions(q[M : M + N])
    free = conformal(errors_of_poses(fit.model, test)).radius
    there = (exact - fit.model.poses(q)[:, :3, 3])[M + N :]
    apart = (np.linalg.norm(there + d, axis=1) for d in (off[M + N :], 0.0))
    return common_radius(stated), free, *apart


@pytest.mark.slow
def test_one_visit_makes_of_small_stated_noise_the_misfit_that_it_may_be():
    """Noise of 3.5 times what is stated and a misfit beside it make readings of one distribution.

    The radius is four times what the first needs and 1.6 times what the second does: a statement
    narrower by more than that would be wrong of the second.
    """
    over = []
    for seed in range(20):
        radius, _, misfit, plain = campaign(seed, size=WHITE / kinds.NOISE)
        assert (misfit <= radius).mean() >= 0.95
        over.append([radius / np.quantile(apart, 0.95) for apart in (misfit, plain)])
    needed, seeming = np.median(over, axis=0)
    assert 1.0 <= needed <= 1.8
    assert seeming >= 3.0
    again = [campaign(seed, gain=LARGER) for seed in range(20)]
    median = np.median([radius / np.quantile(apart, 0.95) for radius, _, apart, _ in again])
    # 20 of each: medians of ratios that scatter by a third
    assert median == pytest.approx(seeming, rel=0.25)


@pytest.mark.slow
def test_two_visits_tell_small_stated_noise_from_a_misfit():
    found = [campaign(seed, gain=LARGER, visits=2) for seed in range(12)]
    assert np.median([radius / np.quantile(apart, 0.95) for radius, _, apart, _ in found]) <= 2.5
    assert np.mean([(apart <= radius).mean() for radius, _, apart, _ in found]) >= 0.97


CELLS = {
    "right": {},
    "noise stated too small": {"gain": LARGER},
    "long tails": {"tails": True},
    "white": {"size": WHITE / kinds.NOISE},
    "sag of half the noise": {"kind": sag, "size": 0.5},
    "sag of twice the noise": {"kind": sag, "size": 2.0},
    "gears as large as the noise": {"kind": gears, "size": 1.0},
    "gears of 3.4 times the noise": {"kind": gears, "size": 3.4},
}


@pytest.mark.study
@pytest.mark.parametrize("arm", ["tx60", "ur10"])
@pytest.mark.parametrize("cell", CELLS)
def test_the_radius_holds_where_the_conformal_one_of_each_arm_may_not(arm, cell):
    """Five seeds of 40 arms in each cell, 3200 in all; the radius is that of 20 held-out poses.

    It held 98.5 to 100 % of true points in each cell, 98.1 % or more at each seed, and was 1.3
    times what was needed beside a large misfit, 1.5 to 1.7 beside a small one, 1.9 beside none and
    4.0 where the noise is stated too small. The conformal one and the smaller of both held 95.7 %
    or more in each cell, but 94.5 % at a seed, and less than 90 % for one arm in ten beside a large
    misfit: of 20 errors the largest is exceeded by a tenth of all in .9^20 = 12 % of campaigns.
    """
    of_seeds, few, over = [], [], []
    for first in range(0, 5000, 1000):
        found = [campaign(first + k, arm, **CELLS[cell]) for k in range(40)]
        shares = np.array(
            [[(d <= r).mean() for r in (R, C, min(R, C))] for R, C, d, _ in found]
        )  # of the radius, the conformal one, and the smaller of both
        of_seeds.append(shares.mean(axis=0))
        few.append((shares < 0.9).mean(axis=0))
        over.append(
            np.median([[r / np.quantile(d, 0.95) for r in (R, C)] for R, C, d, _ in found], 0)
        )
    of_seeds, few = np.array(of_seeds), np.mean(few, axis=0)
    said = [f"{100 * a:.1f} ({100 * b:.1f} to {100 * c:.1f})" for a, b, c in
            zip(of_seeds.mean(0), of_seeds.min(0), of_seeds.max(0), strict=True)]  # fmt: skip
    print(f"\n{arm}, {cell}: {said}, arms below 90 %: {100 * few}, over: {np.mean(over, 0)}")  # noqa: T201  # figures of a study
    assert of_seeds[:, 0].min() >= 0.97
    assert few[0] <= 0.01
