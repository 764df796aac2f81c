"""Which spans of rows are tried for what moved, and whether the poses on either side differ."""

from dataclasses import replace

import numpy as np
import pytest

from calib.identification.outliers.sides import at_one_place, elsewhere
from calib.identification.outliers.spans import ENDS, intervals_of, steps_of
from calib.measurement import tables


def rows_of(visits):
    """Rows in time of so many shots at each stop."""
    pose = np.repeat(np.arange(len(visits)), visits)
    rows = tables.points(np.zeros((len(pose), 6)), np.zeros((len(pose), 3)), sd=1e-5)
    return replace(rows, pose_id=pose), pose


@pytest.mark.parametrize("stops", [15, 16, 30])
def test_a_step_has_enough_stops_before_and_behind_it(stops):
    """Eight on either side."""
    rows, pose = rows_of(np.arange(stops) % 3 + 1)
    expected = [
        row for row in range(1, len(pose))
        if pose[row] != pose[row - 1] and min(pose[row], stops - pose[row]) >= 8
    ]  # fmt: skip
    spans = steps_of(rows)
    assert spans.first.tolist() == expected
    assert spans.tried == len(expected) == max(0, stops - 15)
    assert (spans.end == len(rows)).all()
    assert not spans.back


@pytest.mark.parametrize("stops", [11, 12, 30])
def test_a_span_has_enough_stops_in_it_and_around_it(stops):
    """Four in it; two on either side, and eight around it in all."""
    rows, pose = rows_of(np.arange(stops) % 2 + 1)
    first = {k: int(np.flatnonzero(pose == k)[0]) for k in range(stops)}
    expected = [
        (first[a], first[b]) for a in range(stops) for b in range(a, stops)
        if a >= 2 and stops - b >= 2 and b - a >= 4 and stops - (b - a) >= 8
    ]  # fmt: skip
    spans = intervals_of(rows)
    assert sorted(zip(spans.first.tolist(), spans.end.tolist(), strict=True)) == expected
    assert bool(expected) == (stops > 11)
    # the chance is of all pairs of ends, whether or not a span is long enough
    ends = stops - 3
    assert spans.tried == ends * (ends - 1) // 2
    assert spans.back


def test_of_many_poses_not_every_pair_is_tried():
    """The square of thousands of stops would take minutes and gigabytes."""
    spans = intervals_of(rows_of(np.ones(3000, dtype=int))[0])
    assert len(spans.first) <= ENDS**2 / 2
    assert spans.tried > 4_000_000  # the chance is of all of them


def test_poses_are_elsewhere_by_their_mean_and_if_asked_by_their_spread():
    """A joint that goes three times as far from the same mean: misfit of waves follows that."""
    rng = np.random.default_rng(0)
    q = rng.uniform(-1.0, 1.0, (60, 6))
    rows, side = tables.points(q, np.zeros((60, 3)), sd=1e-5), np.arange(60) >= 30
    assert not elsewhere(rows, side)
    assert not elsewhere(rows, side, spread=True)
    wider = replace(rows, q=np.where(side[:, None] & (np.arange(6) == 2), 3 * q, q))
    assert not elsewhere(wider, side)
    assert elsewhere(wider, side, spread=True)
    shifted = replace(rows, q=np.where(side[:, None] & (np.arange(6) == 2), q + 1.0, q))
    assert elsewhere(shifted, side)


def test_poses_at_one_place_tell_a_step_by_their_turns():
    """Points there do not."""
    q, place = np.zeros((20, 6)), np.zeros((20, 3))
    side = np.arange(20) >= 10
    assert at_one_place(tables.points(q, place, sd=1e-5), side)
    T = np.tile(np.eye(4), (20, 1, 1))
    assert not at_one_place(tables.poses(q, T, sd=(1e-5, 1e-5)), side)
