"""Speed of the laboratory per 1000 poses, beside own kinematics; run by hand, one thread.

``pytest tests/bench/bench_laboratory.py --benchmark-only``. Bars: a pose 5 us, collision test and
line of sight 30 us each, the pool of the paper within 0.2 s, readings of 1000 poses within 5 ms.
"""

import numpy as np
import pytest

from testbed.laboratory.pool import Candidates
from testbed.laboratory.simulator import Simulator
from testbed.laboratory.tracker.of_scenario import tracker_from
from testbed.robots.catalog import load_robot
from testbed.scenario.laboratory import At960Tracker
from testbed.scenario.tables import PoolSettings
from tests.reference import pool_r, tx60

ROBOT, Q = load_robot("staubli_tx60"), pool_r()
SIMULATOR = Simulator(ROBOT, ROBOT.model.chain)
TRACKER = tracker_from(At960Tracker(), ROBOT.model.chain)


@pytest.mark.benchmark(group="poses of 1000")
def test_poses_by_mujoco(benchmark):
    benchmark(SIMULATOR.poses, Q)


@pytest.mark.benchmark(group="poses of 1000")
def test_poses_by_own_kinematics(benchmark):
    benchmark(tx60().poses, Q)


@pytest.mark.benchmark(group="feasibility of 1000")
def test_contacts(benchmark):
    benchmark(SIMULATOR.contacts, Q)


@pytest.mark.benchmark(group="feasibility of 1000")
def test_sight(benchmark):
    benchmark(SIMULATOR.sees, Q, TRACKER.station, TRACKER.aim(ROBOT.model.chain))


@pytest.mark.benchmark(group="build")
def test_build_bare(benchmark):
    benchmark(Simulator, None, ROBOT.model.chain)


@pytest.mark.benchmark(group="build")
def test_build_with_meshes(benchmark):
    benchmark(Simulator, ROBOT, ROBOT.model.chain)


@pytest.mark.benchmark(group="pool of 1000")
def test_pool(benchmark):
    candidates = Candidates(ROBOT, SIMULATOR, PoolSettings(), TRACKER.station)
    benchmark(lambda: candidates.draw(np.random.default_rng(5)))


@pytest.mark.benchmark(group="tracker, 1000 poses")
def test_stated_covariance(benchmark):
    benchmark(TRACKER.covariance, ROBOT.model, Q, ROBOT.repeatability)


@pytest.mark.benchmark(group="tracker, 1000 poses")
def test_readings(benchmark):
    T, ids = ROBOT.model.poses(Q), np.arange(len(Q))
    covariance = TRACKER.covariance(ROBOT.model, Q, ROBOT.repeatability)
    benchmark(lambda: TRACKER.measure(T, Q, ids, 0, covariance, np.random.default_rng(0)))
