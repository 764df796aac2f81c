"""Robots of one kind measured over the robot axis: each as it is measured alone, by MuJoCo."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from testbed.laboratory.truth.laboratory import Laboratory, open_laboratory
from testbed.laboratory.truth.many import ManyTrueRobots
from testbed.laboratory.truth.setting import make_setting
from testbed.scenario.read import changed
from testbed.studies import load_scenario
from testbed.studies.coverage.visits import measure_robot, measure_robots, poses_of

CHOSEN, ROBOTS = np.arange(12), range(2)


@cache
def bench(tracker: str) -> Laboratory:
    """The coverage scene, smaller; with an AT960 joints scatter, with the paper's tracker not."""
    small = {"pool.size": 40, "test.poses": 20, "coverage.validation_poses": 20}
    scenario = changed(load_scenario("coverage"), {"tracker": {"preset": tracker}, **small})
    return open_laboratory(scenario, make_setting(scenario))


@pytest.mark.parametrize("tracker", ["paper", "at960"])
@pytest.mark.parametrize("kind", ["rigid", "wen2022", "soft", "unmodelled", "elastic"])
def test_each_robot_is_the_one_measured_alone(kind, tracker):
    """To the rounding of a few meters; what needs no kinematics is the same bit for bit."""
    of = bench(tracker)
    alone = [measure_robot(of, kind, CHOSEN, k) for k in ROBOTS]
    together = measure_robots(of, kind, CHOSEN, ROBOTS, [poses_of(of, k) for k in ROBOTS])
    arms = ManyTrueRobots.of([one.laboratory.truth for one in alone])
    assert arms is not None
    assert of.tracker.steady
    assert alone[0].laboratory.sigma_q.any() == (tracker == "at960")
    for one, other in zip(alone, together, strict=True):
        assert np.array_equal(one.judge_q, other.judge_q)
        assert one.true == pytest.approx(other.true, abs=1e-12)
        for a, b in ((one.seen, other.seen), (one.validation, other.validation)):
            for name in ("q", "covariance", "pose_id", "repeat", "kind", "offset"):
                np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
            assert a.position == pytest.approx(b.position, abs=1e-12)
            assert a.rotation == pytest.approx(b.rotation, abs=1e-12)
            assert np.array_equal(a.conditions.approach, b.conditions.approach)


def test_arrays_that_stand_elsewhere_than_the_body_tree_are_found_out():
    alone = [measure_robot(bench("paper"), "unmodelled", CHOSEN, k) for k in ROBOTS]
    robots, q = [one.laboratory.truth for one in alone], alone[0].seen.q
    arms = ManyTrueRobots.of(robots)
    arms.require_same(robots[0], q)
    arms.require_same(robots[1], q, 1)
    with pytest.raises(RuntimeError, match="differ by"):
        arms.require_same(robots[1], q)
    with pytest.raises(RuntimeError, match="differ by"):
        replace(arms, backlash=None).require_same(robots[0], q)


def test_robots_that_are_not_alike_are_not_taken_for_one_kind():
    one, other = (
        measure_robot(bench("paper"), kind, CHOSEN, 0).laboratory.truth
        for kind in ("wen2022", "unmodelled")
    )
    assert ManyTrueRobots.of([one, other]) is None


def test_poses_are_those_that_a_whole_block_of_candidates_gives(monkeypatch):
    """Candidates are tested in parts and in order: none behind the last one matters."""
    from testbed.laboratory import pool

    of = bench("paper")
    found = [of.candidates().draw(np.random.default_rng(3), size=size) for size in (3, 50)]
    monkeypatch.setattr(pool, "PARTS", 1)
    for one, size in zip(found, (3, 50), strict=True):
        whole = of.candidates().draw(np.random.default_rng(3), size=size)
        for name in ("q", "T", "rejected_q", "rejection_counts", "n_drawn"):
            np.testing.assert_array_equal(getattr(one, name), getattr(whole, name))
        assert one.rejected_reason == whole.rejected_reason
