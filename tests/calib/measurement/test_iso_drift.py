"""Drift after ISO 9283: known shifts are read, and chance is not taken for one."""

import numpy as np
import pytest

from calib.errors import InputError
from calib.measurement.iso9283 import accuracy, repeatability
from calib.measurement.iso_drift import drift

COMMAND = np.array([1e-3, 0, 0])


def test_a_known_shift_between_blocks_is_read_and_called_no_chance():
    x = 5e-6 * np.random.default_rng(1).standard_normal((3, 30, 3)) + COMMAND
    x[1, 20:] += [80e-6, 0, 0]
    found = drift(x, np.zeros((3, 3)))
    assert found.values[1, 0] == pytest.approx(80e-6, abs=3 * 5e-6 * np.sqrt(2 / 10))
    assert found.p_values[1, 0] == 0.001
    assert found.p_value == 0.001
    assert found.chance[1, 0] < found.values[1, 0]
    assert found.p_values[[0, 2]].min() > 0.005
    for e, k in np.ndindex(3, 3):
        block = x[e, 10 * k : 10 * k + 10]
        assert found.accuracy[e, k] == pytest.approx(float(accuracy(block, np.zeros(3)).value))
        assert found.repeatability[e, k] == pytest.approx(float(repeatability(block).value))


def test_what_is_left_over_belongs_to_the_last_block():
    x = np.random.default_rng(2).standard_normal((1, 27, 3))
    found = drift(x, np.zeros((1, 3)))
    assert found.accuracy.shape == (1, 2)
    assert found.accuracy[0, 1] == pytest.approx(float(accuracy(x[0, 10:], np.zeros(3)).value))


def test_chance_is_called_drift_as_often_as_its_p_value_says():
    """Three poses whose errors are common to a cycle, as those of a robot's temper are."""
    rng = np.random.default_rng(3)
    p = []
    for _ in range(60):
        x = 1e-5 * (rng.standard_normal((3, 20, 3)) + rng.standard_normal((1, 20, 3)))
        p.append(drift(x + COMMAND, np.zeros((3, 3))).p_value)
    # uniform: a share of 60 around 0.2 has a standard error of 0.052
    assert np.mean(np.array(p) < 0.2) == pytest.approx(0.2, abs=0.155)
    assert np.mean(np.array(p) < 0.5) == pytest.approx(0.5, abs=0.19)
    assert min(p) > 0


@pytest.mark.parametrize(("n", "block"), [(19, 10), (30, 2)])
def test_fewer_than_two_blocks_are_refused(n, block):
    with pytest.raises(InputError, match="two blocks"):
        drift(np.zeros((1, n, 3)), COMMAND[None], block=block)


def test_what_chance_stays_below_holds_95_percent_of_random_orders():
    """Against orders of its own: 999 and 2000 of them leave a standard deviation of 0.0085."""
    rng = np.random.default_rng(23)
    x = rng.normal(scale=1e-5, size=(1, 20, 3)) + np.array([1e-4, 0, 0])
    chance = drift(x, np.zeros((1, 3))).chance[0]
    below = []
    for _ in range(2000):
        blocks = x[0, rng.permutation(20)].reshape(2, 10, 3)
        center = blocks.mean(axis=1, keepdims=True)
        away = np.linalg.norm(blocks - center, axis=2)
        AP = np.linalg.norm(center[:, 0], axis=1)
        RP = away.mean(axis=1) + 3 * away.std(axis=1, ddof=1)
        below.append([abs(AP[1] - AP[0]) <= chance[0], abs(RP[1] - RP[0]) <= chance[1]])
    np.testing.assert_allclose(np.mean(below, axis=0), 0.95, atol=0.03)
