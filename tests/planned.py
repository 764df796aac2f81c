"""A small plan with a target, made once per process, and how to read its table back."""

import csv
import io
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from typing import Any
from unittest.mock import patch

import numpy as np

from testbed.plan import design, rehearsal
from testbed.plan.plan import plan
from testbed.plan.results import plan_csv
from testbed.robots.catalog import load_robot
from testbed.scenario.read import changed
from testbed.studies import load_scenario

ROBOT = load_robot("staubli_tx60")
SMALL: dict[str, Any] = {
    "tracker.systematic": False,
    "pool.size": 200,
    "plan.goal.poses": 60,
    "plan.held_out": 6,
    "plan.target_um": 20.0,
    "plan.stations.list_mm": [[2600.0, 0.0, 300.0], [1800.0, 1500.0, 300.0], [-2500.0, 0.0, 300.0]],
    # a post in the middle of the work: some straight moves are blocked
    "cell.obstacle": [
        {"kind": "box", "size_mm": [60.0, 60.0, 1000.0], "position_mm": [350.0, -150.0, 0.0]}
    ],
}
QUICK: dict[str, Any] = {
    **SMALL,
    "plan.target_um": 0.0,
    "plan.stiff_joints": False,
    "plan.poses": 8,
    "plan.method": "greedy",
    "plan.stations.list_mm": [],
    "plan.goal.poses": 20,
    "pool.size": 60,
    "cell.obstacle": [],
}
"""Changes for a plan that is made in a second."""
BARE: dict[str, Any] = QUICK | {"plan.held_out": 0}
"""The same without the calibrations that tell what `identify` will state, a third of that time."""


def scenario(changes=None, **more):
    """The scene plan_tx60, made small, with further changes."""
    return changed(load_scenario("plan_tx60"), (SMALL if changes is None else changes) | more)


@contextmanager
def few_points():
    """Three numbers of poses on the curves of plans made within, and few random sets behind them.

    A search and a bound at each of the nine are most of the time of a small plan.
    """
    with patch.object(design, "CURVE_POINTS", 3), patch.object(design, "RANDOM_SETS", 5):
        yield


@contextmanager
def few_rehearsals():
    """Two of each kind, and few points: for files, which do not depend on how many."""
    with patch.object(rehearsal, "DRAWS", 2), few_points():
        yield


@cache
def small_plan():
    """A plan with a target, three stations and a post in the way."""
    return plan(scenario())


@cache
def quick_plan():
    """Eight poses without target, station or obstacle."""
    with few_points():
        return plan(scenario(QUICK))


def rows_of(made):
    """The rows of plan.csv, by column."""
    return list(csv.DictReader(io.StringIO(plan_csv(made))))


def joints(rows):
    """Joint targets (s, 6) of rows [rad]."""
    return np.radians([[float(row[f"q{j}_deg"]) for j in range(1, 7)] for row in rows])


@cache
def with_blocked_move():
    """The quick plan, as if no way had been found to the third pose of its order."""
    made = quick_plan()
    sentence = "No free way was found to pose 3 of the order."
    return replace(made, tour=replace(made.tour, blocked=(2,), sentence=sentence))


def legs(made):
    """Ends (l, 2, n) of every straight joint move, stops on the way included."""
    stops = [made.tour.start]
    for q, via in zip(made.tour.q, made.tour.vias, strict=True):
        stops += [*via, q]
    return np.stack([stops[:-1], stops[1:]], axis=1)
