"""The difference of two clocks from the stops in a log of joints."""

import numpy as np
import pytest

from testbed.proposal.rows.dwells import clock_offset

RATE, STOPS = 125.0, 12


def log(*, slow=1.0, seed=0):
    """Times [s] and joints (m, 3) [rad] of stops of 3 to 5 s, and when each began.

    The arm moves by a cosine in 2 s times `slow`; encoders scatter by 4 urad.
    """
    rng = np.random.default_rng(seed)
    places = rng.uniform(-1.5, 1.5, (STOPS, 3))
    rows, begun = [], []
    for k in range(STOPS):
        count = int(RATE * 2 * slow)
        share = (1 - np.cos(np.pi * (np.arange(count) + 1) / count))[:, None] / 2
        rows.append(places[k - 1] + share * (places[k] - places[k - 1]))
        begun.append(sum(map(len, rows)) / RATE)
        rows.append(np.repeat(places[k : k + 1], int(RATE * rng.uniform(3, 5)), axis=0))
    q = np.vstack(rows)
    return np.arange(len(q)) / RATE, q + rng.normal(0, 4e-6, q.shape), np.array(begun)


@pytest.mark.parametrize("slow", [1.0, 10.0])
def test_readings_fall_into_stops_at_the_difference_of_the_clocks(slow):
    times, q, begun = log(slow=slow)
    found = clock_offset(times, q, begun + 1.5 - 347.231)
    # a reading 1.5 s into a stop of 3 s or more: its clock may be 1.5 s off either way; an arm that
    # comes to rest within 1e-4 of the range stands before it stops, by a cosine 1.3 % of the move
    assert found is not None
    assert found.least == pytest.approx(345.731, abs=0.03 * slow + 0.01)
    assert found.least < 347.231 < found.most
    assert abs(found.middle - (found.least + found.most) / 2) <= 0.05


def test_nothing_is_said_where_stops_and_readings_are_not_as_many_or_of_another_rhythm():
    times, q, begun = log()
    assert clock_offset(times, q, begun[1:] + 1.5) is None
    assert clock_offset(times, q, np.append(begun, begun[-1] + 9.0)) is None
    rhythm = begun.copy()
    rhythm[6:] += 6.0  # the pause was elsewhere
    assert clock_offset(times, q, rhythm) is None
    assert clock_offset(times[:300], q[:300], begun[:1]) is None


def test_nothing_is_said_where_the_arm_rests_on_its_way_nearly_as_long_as_it_was_measured():
    """Which of the stops were measured is then a guess; a rest of a tenth is none of them."""
    places = np.random.default_rng(2).uniform(-1.5, 1.5, (STOPS + 1, 3))
    way = np.linspace(0, 1, int(2 * RATE))[:, None]

    def found(rest):
        """The difference of the clocks, where the arm rests for so long [s] before the seventh."""
        rows, begun = [], []
        for k, seconds in enumerate([4.0] * 6 + [rest] + [4.0] * 6):
            if k != 6:
                begun.append(sum(map(len, rows)) / RATE)
            rows.append(np.repeat(places[k : k + 1], int(seconds * RATE), axis=0))
            if k < STOPS:
                rows.append(places[k] + way * (places[k + 1] - places[k]))
        q = np.vstack(rows)
        return clock_offset(np.arange(len(q)) / RATE, q, np.array(begun) + 1.5 - 50.0)

    assert found(0.4).least < 50.0 < found(0.4).most
    assert found(2.0) is None


def test_nothing_is_said_where_a_rest_at_home_and_a_last_stop_cut_short_leave_two_choices():
    """Each reading falls into the stop before its own, too: a difference 6 s off was proposed."""
    places = np.random.default_rng(1).uniform(-1.5, 1.5, (STOPS + 1, 3))
    counts = [int(30 * RATE), *[int(4 * RATE)] * (STOPS - 1), int(0.7 * RATE)]
    way = np.linspace(0, 1, int(2 * RATE))[:, None]
    rows, begun = [], []
    for k, count in enumerate(counts):
        begun.append(sum(map(len, rows)) / RATE)
        rows.append(np.repeat(places[k : k + 1], count, axis=0))
        if k < STOPS:
            rows.append(places[k] + way * (places[k + 1] - places[k]))
    q = np.vstack(rows)
    times = np.arange(len(q)) / RATE
    assert clock_offset(times, q, np.array(begun[1:]) + 0.5 - 50.0) is None
