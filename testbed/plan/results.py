"""plan.json: every headline number of a plan, in the unit that its name ends in."""

from collections.abc import Iterator
from itertools import chain
from typing import Any

import numpy as np

from calib.arrays import Array
from testbed.plan.records import Plan
from testbed.plan.table import joint_units, pose_ids
from testbed.plan.words import station_words, untested
from testbed.report.page import SIMULATED
from testbed.robots.catalog import Robot
from testbed.scenario.read import scenario_hash
from testbed.store.quantities import AS_NAMED, METRE, SECOND, Quantity, as_json
from testbed.units import MM, UM
from testbed.versions import number_versions

FORMAT = 1


def plan_numbers(plan: Plan, robot: Robot) -> dict[str, Any]:
    """The document."""
    parts = (_task(plan, robot), _promise(plan), _poses(plan), _stations(plan))
    return as_json(chain.from_iterable(parts))


def _task(plan: Plan, robot: Robot) -> Iterator[Quantity]:
    """What was asked for, of whom, from where."""
    scenario = plan.scenario
    yield Quantity("format", FORMAT)
    yield Quantity("notice", SIMULATED)
    yield Quantity("scenario", scenario.name)
    yield Quantity("title", scenario.title)
    yield Quantity("robot", robot.name)
    yield Quantity("seed", scenario.seed)
    yield Quantity("scenario_sha256", scenario_hash(scenario, robot))
    yield Quantity("versions", number_versions())
    yield Quantity("goal", plan.goal.sentence)
    yield Quantity("criterion", scenario.plan.criterion)
    yield Quantity("method", plan.method)
    yield Quantity("station_mm", plan.station_mm, AS_NAMED)
    yield Quantity("start_joints_deg", plan.tour.start * joint_units(plan), AS_NAMED)
    yield Quantity("poses", len(plan.places))
    yield Quantity("poses_measured_already", len(plan.measured_q))
    yield Quantity("held_out_poses", plan.tour.roles.count("test"))
    yield Quantity("parameters", plan.parameters.free_names)


def _promise(plan: Plan) -> Iterator[Quantity]:
    """What will come out, and what is proven about it."""
    settings, curve, k = plan.scenario.plan, plan.curve, plan.coverage
    yield Quantity("predicted/u_mean_um", plan.u_mean, METRE)
    yield Quantity("predicted/u_worst_um", plan.u_worst, METRE)
    yield Quantity("predicted/coverage_factor", k)
    yield Quantity("predicted/U_mean_um", k * plan.u_mean, METRE)
    yield Quantity("predicted/U_worst_um", k * plan.u_worst, METRE)
    yield Quantity("certificate/efficiency", plan.proof.efficiency)
    yield Quantity("certificate/sentence", plan.proof.sentence)
    yield Quantity("budget/target_U_um", settings.target_um or None, AS_NAMED)
    yield Quantity("budget/target_is", settings.target_is)
    yield Quantity("budget/poses", curve.counts)
    yield Quantity("budget/U_um", k * curve.u, METRE)
    yield Quantity("budget/U_bound_um", _or_nan(k * curve.bound), METRE)
    yield Quantity("budget/U_random_um", _or_nan(k * curve.random), METRE)
    yield Quantity("budget/random_sets", curve.random_sets)
    yield Quantity("budget/smallest_reaching", curve.reached)
    yield Quantity("budget/proven_fewest", curve.fewest)
    yield Quantity("budget/sentence", curve.sentence)


def _poses(plan: Plan) -> Iterator[Quantity]:
    """The measuring order, which poses to add after it, and the candidates for them."""
    tour, pool, names = plan.tour, plan.pool, pose_ids(plan)
    rejected = dict(zip(pool.rejection_names, pool.rejection_counts, strict=True))
    yield Quantity("blocked", [names[k] for k in tour.blocked])
    yield Quantity("clearance_mm/wanted", plan.scenario.plan.clearance_mm, AS_NAMED)
    yield Quantity("clearance_mm/smallest", tour.clearance, METRE)
    yield Quantity("untested", untested(plan))
    yield Quantity("duration_s", tour.duration, SECOND)
    yield Quantity("moving_s", float(tour.move.sum()), SECOND)
    yield Quantity("settle_s", tour.settle, SECOND)
    yield Quantity("route", tour.sentence)
    order = [
        {"pose_id": name, "role": role, "pool": int(place) if place >= 0 else None}
        for name, role, place in zip(names, tour.roles, tour.pool_place, strict=True)
    ]
    yield Quantity("order", order)
    added = [
        {
            "pool": one.place,
            "joints_deg_mm": pool.q[one.place] * joint_units(plan),
            "U_um_with_it": plan.coverage * one.u * UM,
        }
        for one in plan.next_poses
    ]
    yield Quantity("next_poses", added)
    yield Quantity("candidates/drawn", pool.n_drawn)
    yield Quantity("candidates/feasible", len(pool.q))
    yield Quantity("candidates/rejected", rejected)


def _stations(plan: Plan) -> Iterator[Quantity]:
    """The stations compared, if any were."""
    seen = plan.stations
    if seen is None:
        yield Quantity("stations", None)
        return
    yield Quantity("stations/sentence", station_words(plan))
    yield Quantity("stations/best", seen.best + 1)
    yield Quantity("stations/candidates", seen.n_candidates)
    yield Quantity("stations/poses_designed", len(seen.designs[seen.best]))
    compared = [
        {
            "station": k + 1,
            "position_mm": place * MM,
            "visible": seen.visible[k],
            "U_mean_um": _or_nan(plan.coverage * seen.u_mean[k] * UM),
            "statement": seen.statements[k],
        }
        for k, place in enumerate(seen.stations)
    ]
    yield Quantity("stations/compared", compared)


def _or_nan(values: Array) -> Array:
    """Values, nan where there is none: JSON then has null."""
    return np.where(np.isfinite(values), values, np.nan)
