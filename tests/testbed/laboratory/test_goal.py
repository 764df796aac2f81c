"""Paths of [plan.goal]: where their postures are, and how much each counts."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation, Slerp

from calib.errors import InputError
from testbed.laboratory.bench import open_bench
from testbed.laboratory.goal import goal_of
from tests.planned import QUICK, scenario
from tests.reference import DEG

CORNERS = [
    [0.0, 10.0, 60.0, 0.0, 40.0, 0.0],
    [35.0, 25.0, 70.0, 20.0, 50.0, -30.0],
    [60.0, 5.0, 90.0, 0.0, 60.0, 10.0],
]
PLACES = [
    [350.0, -150.0, 150.0, 0.0, 150.0, 0.0],
    [380.0, 120.0, 150.0, 0.0, 165.0, 30.0],
    [380.0, 120.0, 250.0, 0.0, 165.0, 30.0],
]


def along(**goal):
    bench = open_bench(scenario(QUICK, **{"plan.goal": {"kind": "path", **goal}}))
    return bench, goal_of(bench)


def test_a_path_straight_in_the_joints_counts_each_meter_of_the_tool_the_same():
    step, weights = 8.0, (1.0, 3.0)
    bench, goal = along(joints_deg=CORNERS, step_mm=step, weights=weights)
    model, q = bench.robot.model, np.array(CORNERS) * DEG

    def speed(part, line):  # of the tool along a line, by differences
        at = q[line] + (part + np.array([-1e-5, 1e-5]))[:, None] * (q[line + 1] - q[line])
        return float(np.linalg.norm(np.diff(model.poses(at)[:, :3, 3], axis=0)) / 2e-5)

    length = [quad(speed, 0.0, 1.0, args=(line,))[0] for line in range(2)]
    # chords of a hundredth of each line are shorter than its arc by less than 1e-4 of it
    pieces = [int(np.ceil(1e3 * own * (1 - 5e-5) / step)) for own in length]
    assert len(goal.q) == sum(pieces)
    of_line = np.repeat([0, 1], pieces)
    counts = np.array(weights) * length
    shares = np.bincount(of_line, goal.weights)
    np.testing.assert_allclose(shares, counts / counts.sum(), rtol=1e-4)
    for line in range(2):
        own = goal.q[of_line == line]
        part = (np.arange(len(own)) + 0.5) / len(own)
        np.testing.assert_allclose(own, q[line] + part[:, None] * (q[line + 1] - q[line]))
    assert goal.sentence == (
        f"a path of {1e3 * sum(length):.0f} mm in {sum(pieces)} postures, each meter counting the "
        "same"
    )


def test_a_path_straight_in_space_turns_evenly_and_keeps_to_one_posture():
    bench, goal = along(tool_mm_deg=PLACES, step_mm=40.0)
    T = bench.robot.model.poses(goal.q)
    whole = np.array(PLACES)
    # 271.7 and 100 mm in steps of at most 40
    at = [*((k, (i + 0.5) / n) for k, n in enumerate((7, 3)) for i in range(n))]
    turns = Rotation.from_rotvec(whole[:, 3:] * DEG)
    for (line, part), seen in zip(at, T, strict=True):
        place = whole[line, :3] + part * (whole[line + 1, :3] - whole[line, :3])
        turn = Slerp([0, 1], turns[line : line + 2])(part).as_matrix()
        np.testing.assert_allclose(seen[:3, 3], place / 1e3, atol=1e-9)
        np.testing.assert_allclose(seen[:3, :3], turn, atol=1e-8)
    length = np.linalg.norm(np.diff(whole[:, :3], axis=0), axis=1)
    shares = np.bincount([line for line, _ in at], goal.weights)
    np.testing.assert_allclose(shares, length / length.sum(), rtol=1e-12)
    # no other elbow or wrist between two neighbors
    assert np.abs(np.diff(goal.q, axis=0)).max() < 45 * DEG


def test_a_turn_of_the_tool_on_the_spot_counts_at_its_middle():
    _, goal = along(tool_mm_deg=[PLACES[1], [*PLACES[1][:5], 90.0]])
    assert len(goal.q) == 1
    assert goal.weights.tolist() == [1.0]


def test_a_path_that_hits_something_between_its_corners_or_is_cut_too_fine_is_refused():
    over = [[-50.0, 70.0, 110.0, 0.0, -30.0, 0.0], [-70.0, 100.0, 30.0, 0.0, -10.0, 0.0]]
    hit = "the line from corner 1 to 2 makes the robot hit the floor"
    with pytest.raises(InputError, match=hit) as caught:
        along(joints_deg=over)
    assert caught.value.code == "S37"
    with pytest.raises(
        InputError, match=r"step_mm is 0\.05, which cuts the path into more"
    ) as caught:
        along(joints_deg=CORNERS, step_mm=0.05)
    assert caught.value.code == "S37"
