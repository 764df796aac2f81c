"""Limits of cycles that follow their neighbors, and cycles that stray, by truths drawn here."""

import numpy as np
import pytest

from calib.measurement.iso9283 import accuracy, repeatability
from calib.measurement.iso_limits import mean_limits, repeatability_limits, spread_limits
from calib.measurement.iso_memory import CycleMemory, cycle_memory
from calib.measurement.iso_straying import long_tails, straying_cycle

SD = np.array([8.0, 5.0, 3.0]) * 1e-6
CYCLES, POSES = 30, 5


def remembering(rng, kept, poses=POSES, together=False, noise=0.0):
    """Scatter (poses, n, 3) of AR(1) cycles, each pose with its own or all with the same [m].

    Noise of each reading, in parts of that scatter, is its own always.
    """
    e = rng.standard_normal((1 if together else poses, CYCLES, 3))
    for k in range(1, CYCLES):
        e[:, k] = kept * e[:, k - 1] + np.sqrt(1 - kept**2) * e[:, k]
    e = np.broadcast_to(e, (poses, CYCLES, 3))
    return SD * (e + noise * rng.standard_normal(e.shape) if noise else e)


def held(kept, campaigns, together=False, seed=4, noise=0.0):
    """How often limits hold AP and RP, as they are and of independent cycles; robots as one."""
    rng, found = np.random.default_rng(seed), []
    away = np.linalg.norm(rng.standard_normal((400_000, 3)) * SD, axis=1)
    RP = np.sqrt(1 + noise**2) * (away.mean() + 3 * away.std())
    for _ in range(campaigns):
        bias = 60e-6 * rng.standard_normal((POSES, 3))
        x = bias[:, None] + remembering(rng, kept, together=together, noise=noise)
        memory, plain = cycle_memory(x), accuracy(x, np.zeros((POSES, 3)))
        true = np.linalg.norm(bias, axis=1)
        of_mean = mean_limits(memory.of_mean(plain), memory.freedom_of_mean)
        naive = mean_limits(plain, CYCLES - 1)
        scatter = repeatability_limits(x, memory=memory)
        found.append(
            [
                ((one.lower <= value) & (value <= one.upper)).mean()
                for one, value in ((of_mean, true), (scatter, RP), (naive, true))
            ]
        )
    return np.mean(found, axis=0)


@pytest.mark.parametrize("together", [False, True])
def test_limits_of_cycles_that_follow_their_neighbors_hold_the_truth(together):
    """AP of a robot whose cycles keep eight tenths of their deviation: plain limits hold half."""
    of_mean, of_scatter, naive = held(0.8, 60, together)
    # 300 poses, or 60 where all share their cycles: 0.95 +- 0.013, +- 0.028, three of them
    room = 3 * (0.028 if together else 0.013)
    assert of_mean > 0.95 - room
    assert of_scatter > 0.95 - room
    assert naive < 0.65


def test_a_slow_way_below_the_noise_of_single_readings_widens_limits_of_means():
    """As of warming up. The lag-one correlation alone tells a fifth of what the means scatter."""
    of_mean, _, naive = held(0.95, 40, noise=0.5)
    # 2000 campaigns hold 0.86, half of which AR(1) would: thirty cycles see little of so slow a way
    assert of_mean > 0.78
    assert naive < 0.4


def test_independent_cycles_keep_their_limits():
    rng = np.random.default_rng(1)
    asked = [cycle_memory(SD * rng.standard_normal((POSES, CYCLES, 3))) for _ in range(200)]
    # one in a hundred each: more than 8 of 200 come up once in 3000
    assert sum(one.kept > 0 for one in asked) <= 8
    x = SD * rng.standard_normal((POSES, CYCLES, 3))
    free = CycleMemory(0.0, 0.5, CYCLES)
    figure, spread = accuracy(x, np.zeros(3)), repeatability(x)
    assert free.of_mean(figure) is figure
    assert free.of_scatter(spread) is spread
    assert free.freedom(CYCLES - 1) == free.freedom_of_mean == CYCLES - 1
    for memory in (free, None):
        again = repeatability_limits(x, memory=memory)
        np.testing.assert_array_equal(again.upper, repeatability_limits(x).upper)
        of_one = spread_limits(1.0, CYCLES, memory=memory)
        assert of_one.upper == spread_limits(1.0, CYCLES).upper


def test_what_cycles_keep_is_found_without_bias():
    rng = np.random.default_rng(2)
    kept = [cycle_memory(remembering(rng, 0.6)).kept for _ in range(60)]
    # lag-one correlations of 30 cycles, 15 series: sd 0.04 each
    assert np.mean(kept) == pytest.approx(0.6, abs=0.03)


def test_the_mean_of_cycles_that_follow_each_other_scatters_as_is_said():
    rng, memory = np.random.default_rng(3), CycleMemory(0.8, 0.001, CYCLES)
    x = remembering(rng, 0.8, poses=4000)
    # 12000 variances of one number each: 1.3 %, of s^2 less
    spread = (x.mean(axis=1) / SD).var()
    assert spread == pytest.approx(1 / memory.worth, rel=0.05)
    assert (x.var(axis=1, ddof=1) / SD**2).mean() == pytest.approx(memory.shrunk, rel=0.03)
    # where there is nothing to see these are read: floors of 30 independent cycles are a third
    floor = memory.of_mean(accuracy(x[:400], np.zeros(3))).floor
    assert np.linalg.norm(x.mean(axis=1), axis=1).mean() == pytest.approx(floor.mean(), rel=0.05)


def test_cycles_that_alternate_between_two_places_are_not_fewer():
    side = np.where(np.arange(CYCLES) % 2, 1.0, -1.0)[None, :, None]
    x = 2e-6 * np.random.default_rng(5).standard_normal((POSES, CYCLES, 3)) + 12e-6 * side
    assert cycle_memory(x).kept == 0


def test_what_the_instrument_shares_is_not_widened():
    memory, rng = CycleMemory(0.8, 0.001, CYCLES), np.random.default_rng(6)
    x, common = SD * rng.standard_normal((1, CYCLES, 3)), 1e-8 * np.eye(3)
    alone, whole = accuracy(x, np.ones(3)), accuracy(x, np.ones(3), common=common)
    wide = memory.of_mean(whole, np.sqrt(whole.uncertainty**2 - alone.uncertainty**2))
    own = memory.of_mean(alone).uncertainty
    np.testing.assert_allclose(wide.uncertainty**2, own**2 + 1e-8, rtol=1e-9)


def test_few_cycles_or_none_that_scatter_tell_nothing():
    few = np.random.default_rng(7).standard_normal((2, 5, 3))
    assert np.isnan(cycle_memory(few).p_value)
    assert np.isnan(straying_cycle(few).p_value)
    still = np.zeros((2, CYCLES, 3))
    assert cycle_memory(still).kept == 0
    assert not straying_cycle(still).strays


def test_a_cycle_that_strays_is_found_and_normal_ones_are_not():
    rng = np.random.default_rng(8)
    x = SD * rng.standard_normal((POSES, CYCLES, 3))
    alarms = [straying_cycle(SD * rng.standard_normal(x.shape)).strays for _ in range(500)]
    # one in a thousand: five of 500 come up once in 5000
    assert sum(alarms) < 5
    x[3, 11] += [60e-6, 0, 0]
    far = straying_cycle(x)
    assert (far.pose, far.cycle) == (3, 11)
    assert far.strays


def test_of_normal_cycles_one_set_in_twenty_has_one_that_strays_so_far():
    """Bonferroni over ten cycles is nearly exact; 0.005 is a standard deviation of 2000 sets."""
    rng = np.random.default_rng(17)
    far = [straying_cycle(rng.normal(size=(1, 10, 3))).p_value < 0.05 for _ in range(2000)]
    assert np.mean(far) == pytest.approx(0.049, abs=0.015)


def test_long_tails_are_found_in_all_poses_together_and_normal_scatter_has_none():
    """Also where cycles follow each other, and where poses scatter together."""
    rng, normal, together, few = np.random.default_rng(3), [], [], []
    for _ in range(100):
        normal.append(long_tails(rng.standard_normal((6, 30, 3)) * (1.0, 0.2, 0.1)).p_value)
        own, all_of_them = rng.standard_normal((8, 30, 3)), rng.standard_normal((30, 3))
        together.append(long_tails(0.3 * own + all_of_them).p_value)
        few.append(long_tails(rng.standard_normal((5, 8, 3))).p_value)
    for p in (normal, together, few):
        # 0.05 of 100: more than 12 come up once in 700
        assert np.less(p, 0.05).sum() <= 12
        assert min(p) > 0.001
    assert np.less(normal, 0.05).sum() >= 2
    assert sum(long_tails(rng.standard_t(4, (6, 30, 3))).long for _ in range(20)) >= 13
    assert np.isnan(long_tails(rng.standard_normal((3, 7, 3))).p_value)
