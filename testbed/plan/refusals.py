"""What a plan refuses before it is made: an untested cell, a tracker where it cannot stand."""

from itertools import combinations

import numpy as np

from calib.arrays import Array
from calib.errors import InputError, refuse
from calib.geometry.chain import Chain
from testbed.laboratory.bench import Bench
from testbed.laboratory.tracker.stations import place_word, station_grid
from testbed.robots.placements import placements
from testbed.scenario.scenario import Scenario

BESIDE = 0.5
"""A tracker stands at least so far outside the robot's reach [m]."""
NEAREST = 0.8
"""Nearest target a tracker is asked to measure [m]."""
EQUAL = 1e-3
"""Stations nearer than this are the same one [m]."""


def check_tested(scenario: Scenario) -> None:
    """Refuse a scenario whose pool is not tested for collisions: a plan moves a real robot."""
    if not scenario.pool.self_collision:
        raise refuse(
            "pool.self_collision", False, code="S37", fix="remove that key",
            message="[pool] self_collision is false, and a plan is for a real robot: its poses and "
            "moves must be tested",
        )  # fmt: skip


def check_stations(bench: Bench) -> None:
    """Refuse stations below the floor, in the robot's work space, or given twice."""
    settings = bench.scenario.plan.stations
    if not settings.given:
        x, y, z = bench.scenario.tracker.station_mm
        name = f"[tracker] station_mm at ({x:g}, {y:g}, {z:g}) mm"
        _check_station(bench, np.array([x, y, z]) / 1e3, name, "tracker.station_mm")
        return
    stations = station_grid(settings)
    for k, station in enumerate(stations):
        name = f"[plan.stations] {place_word(k, station)}"
        _check_station(bench, station, name, "plan.stations")
    for a, b in combinations(range(len(stations)), 2):
        if np.linalg.norm(stations[a] - stations[b]) < EQUAL:
            message = f"[plan.stations] {place_word(b, stations[b])} is the same as station {a + 1}"
            raise refuse("plan.stations", code="S37", message=message, fix="remove one of them")


def _check_station(bench: Bench, station: Array, name: str, field: str) -> None:
    """Refuse one station (3,) in the base frame [m] where no tracker can stand."""
    chain = bench.robot.model.chain

    def refusal(message: str, allowed: str, fix: str) -> InputError:
        mm = (station * 1e3).tolist()
        return refuse(field, mm, allowed, code="S37", message=f"{name} {message}", fix=fix)

    below = -bench.simulator.above_floor((chain.T_world_base @ [*station, 1.0])[:3])
    if below > 0:
        message = f"lies {below * 1e3:.0f} mm below the floor"
        raise refusal(message, "", "put the tracker above the floor")
    needed = reach(chain, bench.robot.limits) + BESIDE
    if np.linalg.norm(station) < needed:
        raise refusal(
            f"is {np.linalg.norm(station):.2f} m from the base: the tracker would stand in the "
            "robot's work space",
            f"it needs {needed:.2f} m or more, the arm's length and {BESIDE:g} m",
            "move the tracker away from the robot",
        )


def check_ranges(bench: Bench, q: Array) -> None:
    """Refuse a station that poses q (m, n) bring the target too near to."""
    chain = bench.robot.model.chain
    T = bench.robot.model.poses(q)
    targets = T[:, :3, 3] + T[:, :3, :3] @ bench.tracker.aim(chain)
    nearest = float(np.linalg.norm(targets - bench.tracker.station, axis=1).min())
    if nearest < NEAREST:
        raise refuse(
            "tracker.station_mm", nearest,
            f"it needs {NEAREST:g} m or more, or the tracker stands in the robot's work space",
            code="S37", fix="move the tracker away from the robot",
            message=f"a pose of the plan brings the target to {nearest:.2f} m from the tracker",
        )  # fmt: skip


def reach(chain: Chain, limits: Array) -> float:
    """Length of the stretched arm, base to tool, sliding joints at their farthest [m]."""
    frames, _, tool = placements(chain)
    # the first frame stands in the world: where the base is, not how long the arm is
    lengths = sum(float(np.linalg.norm(frame[:3, 3])) for frame in (*frames[1:], tool))
    slides = chain.prismatic.astype(bool)
    return lengths + float(np.abs(limits[slides]).max(axis=1, initial=0.0).sum())
