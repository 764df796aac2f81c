"""A tip in two sockets at a known distance, as cobots without any instrument are calibrated.

The line through both does not tell how the arm is turned about it: fits moved along that turn until
their steps were up, and no statement was believed.
"""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np

from calib.identification.identify import Status
from calib.identification.prior import weak_prior
from calib.measurement import tables
from testbed.identify.fit import fit
from testbed.identify.frames import _without_untold, frames_of
from testbed.identify.outliers import _alike, _elsewhere
from tests.calibrated import robot, session_of
from tests.testbed.files.rows.test_touched import touching

SOCKETS = np.array([[0.35, 0.0, 0.25], [0.35, 0.05, 0.25]])
"""In the base of the robot [m]; they are stated in a frame of their own."""
PLAY = 0.1 / 57.3 / 10
"""Of each joint while the tip is in its socket: 0.01 deg [rad]."""
SD = 1e-4


@cache
def touches(m=20):
    """Rows of both sockets."""
    rng = np.random.default_rng(5)
    q = np.vstack([touching(place, m, rng) for place in SOCKETS])
    q += PLAY * rng.standard_normal(q.shape)
    return tables.points(q, np.repeat([[0.0, 0, 0], [0.05, 0, 0]], m, axis=0), sd=SD)


def test_the_fit_of_two_sockets_converges_with_the_turn_about_them_held():
    arm, rows = robot(), touches()
    frames = frames_of(arm, session_of(rows), rows)
    turns = [f"base.r{axis}" for axis in "xyz"]
    held = set(turns).difference(frames.parameters.free_names)
    assert len(held) == 1
    (said,) = frames.untold
    assert said.startswith(f"{held.pop()} is held: readings at one place or along one line")
    links = [name for name in frames.parameters.free_names if "." not in name]
    ((_, _, found),), _ = fit(
        frames.start, rows, frames.parameters, model="geometric", loss="squared", seed=0,
        links=weak_prior(frames.parameters.freeing(links), frames.start), held=True,
    )  # fmt: skip
    assert found.status is Status.CONVERGED


def test_three_places_hold_no_turn():
    rows = touches()
    other = rows.position.copy()
    other[::3] += [0, 0.05, 0]
    rows = tables.points(rows.q, other, sd=SD)
    frames = frames_of(robot(), session_of(rows), rows)
    assert not frames.untold
    assert {f"base.r{axis}" for axis in "xyz"} <= set(frames.parameters.free_names)


def test_joints_of_the_same_place_are_no_swapped_ones():
    rows = touches()
    assert _alike(rows, 3).tolist() == [True] * 20 + [False] * 20
    station = np.arange(40) % 2
    assert _alike(replace(rows, station=station), 3).tolist() == [False, True] * 10 + [False] * 20
    assert not _alike(replace(rows, kind=np.full(40, "pose")), 3).any()
    # whose reading fits 19 other joints, and must: it is no more than far off itself
    start = frames_of(robot(), session_of(rows), rows).start
    shots = SimpleNamespace(judge=SimpleNamespace(model=start), misses=np.full(40, 5e-3))
    assert _elsewhere(shots, rows, 3, [str(k) for k in range(40)], None) == "; measure it again"


def test_a_turn_that_is_not_free_is_not_said_to_be_held():
    arm, rows = robot(), touches()
    frames = frames_of(arm, session_of(rows), rows)
    links = [name for name in frames.parameters.free_names if "." not in name]
    parameters = frames.parameters.freeing(links)
    same, said = _without_untold(parameters, frames.start, rows)
    assert (same, said) == (parameters, ())
