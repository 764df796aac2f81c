"""Which nest was unseated, by where the others have it: named where the readings tell, or not."""

import numpy as np
import pytest

from calib.geometry.frames import exp_so3
from testbed.files.nests.unseated import unseated

NOISE = 5e-6
ELSEWHERE = exp_so3(np.array([0.1, 0.2, 0.4]))


def shares(count, moved, size, *, rounds=6, campaigns=100, carried=False):
    """Shares of campaigns of which the very shots `moved` are found, and of which another is.

    Nests anywhere in a room, seen by a station that creeps, and is `carried` elsewhere after half
    of the rounds; shots (round, nest) that stood `size` [m] elsewhere, some way.
    """
    rng = np.random.default_rng(1)
    right = wrong = 0
    for _ in range(campaigns):
        nests = rng.uniform(-2.5, 2.5, (count, 3))
        share = np.arange(rounds) / max(rounds - 1, 1)
        T = [exp_so3(one * np.array([60e-6, -30e-6, 45e-6])) for one in share]
        place = np.stack([nests @ R.T + one * 1e-4 for R, one in zip(T, share, strict=True)])
        place += rng.normal(0.0, NOISE, place.shape)
        if carried:
            place[rounds // 2 :] = place[rounds // 2 :] @ ELSEWHERE.T + [0.5, -1.0, 0.2]
        true = np.zeros(place.shape[:2], dtype=bool)
        for shot in moved:
            way = rng.normal(size=3)
            place[shot] += size * way / np.linalg.norm(way)
            true[shot] = True
        found = unseated(place, NOISE)
        right += (found == true).all()
        wrong += (found & ~true).any()
    return right / campaigns, wrong / campaigns


@pytest.mark.parametrize("count", [3, 4, 5, 8])
def test_of_good_nests_none_is_named(count):
    """By chance one campaign in a thousand; three nests never tell which."""
    assert shares(count, [], 0.0) == (1.0, 0.0)


@pytest.mark.parametrize("count", [4, 5, 8])
def test_the_nest_that_stood_elsewhere_is_the_one_that_is_named(count):
    """Of four, another was in 3 campaigns of 100: the medians of the others had no noise."""
    right, wrong = shares(count, [(2, 1)], 0.2e-3)
    assert right > 0.9
    assert wrong == 0


def test_a_nest_is_named_only_where_it_is_far_likelier_than_another():
    """Named whichever fits best, another was in four campaigns of 100."""
    right, wrong = shares(4, [(2, 1)], 0.06e-3, campaigns=300)
    assert right > 0.5
    assert wrong <= 0.02


@pytest.mark.parametrize("count", [4, 5])
def test_a_station_that_was_carried_elsewhere_hides_no_nest_that_was(count):
    right, wrong = shares(count, [(2, 1)], 0.2e-3, carried=True)
    assert right > 0.9
    assert wrong <= 0.01


@pytest.mark.parametrize("rounds", [1, 2])
def test_of_one_or_two_rounds_nobody_knows_where_a_nest_was_right(rounds):
    assert shares(5, [(0, 1)], 0.2e-3, rounds=rounds) == (0.0, 0.0)


@pytest.mark.parametrize("count", [4, 5, 6])
def test_of_two_that_stood_elsewhere_at_once_no_other_is_named(count):
    """Of four and five it was in 26 and 15 of 100, and what was left did not agree, either.

    Two ways may be near enough to a motion of the whole that the rest agrees: in two of a hundred.
    """
    right, wrong = shares(count, [(2, 1), (2, 2)], 0.2e-3)
    assert wrong <= 0.03
    assert count == 4 or right > 0.75  # of four, the two others tell nothing
