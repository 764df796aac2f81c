"""plan.csv and plan.json: every joint target in turn, every headline number in its unit."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from typing import Any, Literal

import numpy as np

from calib.arrays import Array
from testbed.laboratory.route.moves import travel_times
from testbed.plan.cautions import uncounted, untested
from testbed.plan.promises import PLANNED, factor_words, promise, reach_warnings, reach_words
from testbed.plan.records import Move, Plan
from testbed.plan.target import target_numbers
from testbed.plan.words import station_words
from testbed.report.text import csv_text
from testbed.robots.catalog import Robot
from testbed.scenario.hashes import scenario_hash
from testbed.store.quantities import AS_NAMED, METRE, SECOND, Quantity, as_json
from testbed.units import DEG, MM, UM
from testbed.versions import number_versions

DECIMALS = 9
"""Of joint targets: 1e-9 deg moves no arm; the pool's joints come back to within rounding."""
READING = ("x_mm", "y_mm", "z_mm", "azimuth_deg", "elevation_deg", "range_mm")
"""Of every target, in the tracker's axes: level, and parallel to the base frame's if it is."""
FORMAT = 1


def plan_csv(plan: Plan) -> str:
    """The table of a plan, to be read by people, controllers and `[plan] measured`.

    The first row, with the role ``start``, is where to bring the robot by hand; rows with the role
    ``via`` are passed, not measured: whoever follows all rows hits nothing, unless a move is
    ``blocked``, which has no time.
    """
    head = ["pose_id", "role", "order", *joint_columns(plan)]
    head += [f"{reading.target}_{name}" for reading in plan.readings for name in READING]
    rows = [_row(plan, stop) for stop in stops_of(plan)]
    return csv_text([*head, "move", "approach_s", *_use(plan)], rows)


def goal_csv(plan: Plan) -> str:
    """Each posture of the goal: how well it will be known, and whether a statement reaches it."""
    seen, u = plan.foresight, plan.coverage * plan.u * UM
    rows = []
    for k, q in enumerate(plan.goal.q):
        row = [str(k + 1), *(f"{value:.{DECIMALS}f}" for value in joint_values(plan, q))]
        row += [f"{plan.goal.weights[k]:.6g}", f"{u[k]:.4g}"]
        if seen.applies is not None:
            reach = seen.applies
            row += [f"{reach.transfer[k]:.3g}", f"{reach.leverage[k]:.3g}", str(reach.place[k])]
            row.append(seen.why[k])
        rows.append(row)
    head = ["posture", *joint_columns(plan), "weight", "U_um"]
    if seen.applies is not None:
        head += ["transfer", "leverage", "place", "why"]
    return csv_text(head, rows)


def _use(plan: Plan) -> dict[str, object]:
    """The conditions that every pose is to be measured under, as far as they are stated."""
    use = plan.scenario.plan.use
    return use.model_dump(exclude_none=True) if use is not None else {}


def _row(plan: Plan, stop: "Stop") -> list[str]:
    """The cells of one joint target."""
    row = [stop.name, stop.role, str(stop.place + 1) if stop.measured else ""]
    row += [f"{value:.{DECIMALS}f}" for value in joint_values(plan, stop.q)]
    for reading in plan.readings:
        if not stop.measured:
            row += [""] * len(READING)
            continue
        row += [f"{value * 1e3:.4f}" for value in reading.position[stop.place]]
        angles = (reading.azimuth[stop.place], reading.elevation[stop.place])
        row += [f"{np.degrees(angle):.6f}" for angle in angles]
        row += [f"{reading.range[stop.place] * 1e3:.4f}"]
    seconds = f"{stop.seconds:.3f}" if np.isfinite(stop.seconds) else ""
    return [*row, stop.move or "", seconds, *map(str, _use(plan).values())]


@dataclass(frozen=True, slots=True, eq=False)
class Stop:
    """One joint target."""

    name: str
    """Of the pose, or of the stop on the way to it."""
    role: Literal["identify", "test", "via", "start"]
    """Measured to identify, measured to check, only passed, or where to bring the robot first."""
    place: int
    """Its pose's place in the measuring order; -1 for the start."""
    move: Move | None
    """How the robot gets there; None for the start, which nothing is known about."""
    q: Array
    """(n,) joints of the arm [rad, m]."""
    seconds: float
    """Time of the straight joint move to it; nan where there is no free one [s]."""

    @property
    def measured(self) -> bool:
        """Whether the robot rests there to be measured."""
        return self.role in ("identify", "test")


def stops_of(plan: Plan) -> list[Stop]:
    """Every joint target of the tour in turn, the start first."""
    tour, before = plan.tour, plan.tour.start
    stops = [Stop("start", "start", -1, None, before, np.nan)]
    for k, (name, role) in enumerate(zip(pose_ids(plan), tour.roles, strict=True)):
        move = tour.move_word(k)
        for number, q in enumerate(tour.vias[k]):
            seconds = float(travel_times(before, q, tour.speeds))
            stops.append(Stop(f"{name}via{number + 1}", "via", k, move, q, seconds))
            before = q
        q = tour.q[k]
        seconds = float(travel_times(before, q, tour.speeds)) if move != "blocked" else np.nan
        stops.append(Stop(name, role, k, move, q, seconds))
        before = q
    return stops


def pose_ids(plan: Plan) -> list[str]:
    """P1, P2 ... for poses to identify from, T1, T2 ... for held-out ones, in measuring order."""
    counts = {"identify": 0, "test": 0}
    names = []
    for role in plan.tour.roles:
        counts[role] += 1
        names.append(f"{'P' if role == 'identify' else 'T'}{counts[role]}")
    return names


def joint_columns(plan: Plan) -> list[str]:
    """Names of the joint columns: q1_deg, or q1_mm where a joint slides."""
    kinds = plan.nominal.chain.kinds
    return [
        f"q{j + 1}_{'mm' if kinds[j] == 'prismatic' else 'deg'}"
        for j in plan.controller.counted(len(kinds))
    ]


def joint_values(plan: Plan, q: Array) -> Array:
    """Joints (k,) of the controller, from those (n,) of the arm [deg, mm where a joint slides]."""
    slides = plan.nominal.chain.prismatic[plan.controller.counted(len(q))]
    return plan.controller.written(q) * np.where(slides, MM, DEG)


def plan_numbers(plan: Plan, robot: Robot) -> dict[str, Any]:
    """The document."""
    parts = (_task(plan, robot), _promise(plan), _poses(plan), _stations(plan))
    return as_json(chain.from_iterable(parts))


def _task(plan: Plan, robot: Robot) -> Iterator[Quantity]:
    """What was asked for, of whom, from where."""
    scenario = plan.scenario
    yield Quantity("format", FORMAT)
    yield Quantity("notice", PLANNED)
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
    yield Quantity("start_joints_deg", joint_values(plan, plan.tour.start), AS_NAMED)
    yield Quantity("poses", len(plan.places))
    yield Quantity("poses_measured_already", len(plan.measured_q))
    yield Quantity("held_out_poses", plan.tour.roles.count("test"))
    yield Quantity("parameters", plan.parameters.free_names)
    yield Quantity("assumed", plan.assumed)
    yield Quantity("use", _use(plan), AS_NAMED)


def _promise(plan: Plan) -> Iterator[Quantity]:
    """What will come out, and what is proven about it."""
    settings, curve, k, seen = plan.scenario.plan, plan.curve, plan.coverage, plan.foresight
    yield Quantity("predicted/sentence", promise(plan))
    yield Quantity("predicted/R95_over_goal_um", seen.R95_over, METRE)
    yield Quantity("predicted/R95_worst_um", seen.R95_worst, METRE)
    arms, medians = (("", seen.stated.links), ("_joints", seen.stated.joints)), seen.stated.medians
    for (arm, radii), (at_held_out, over_goal, worst) in zip(
        arms, map(_or_nan, medians), strict=True
    ):
        yield Quantity(f"predicted/R95_stated{arm}_um", at_held_out, METRE)
        yield Quantity(f"predicted/R95_stated{arm}_over_goal_um", over_goal, METRE)
        yield Quantity(f"predicted/R95_stated{arm}_worst_um", worst, METRE)
        yield Quantity(f"predicted/R95_stated{arm}_rehearsals_um", radii[:, 0], METRE)
    yield Quantity("predicted/u_mean_um", plan.u_mean, METRE)
    yield Quantity("predicted/u_noise_mean_um", plan.over_goal(seen.noise), METRE)
    yield Quantity("predicted/u_systematic_mean_um", plan.over_goal(seen.shared), METRE)
    yield Quantity("predicted/u_worst_um", plan.u_worst, METRE)
    yield Quantity("predicted/coverage_factor", k)
    yield Quantity("predicted/U_is", factor_words(k))
    yield Quantity("predicted/U_mean_um", k * plan.u_mean, METRE)
    yield Quantity("predicted/U_worst_um", k * plan.u_worst, METRE)
    yield Quantity("predicted/misfit_seen_um", _or_nan(np.array(seen.misfit_seen)), METRE)
    if seen.sources is not None:
        for name, at_tool, shown in zip(
            seen.sources.names, seen.sources.at_tool, seen.sources.seen, strict=True
        ):
            yield Quantity(f"predicted/systematic/{name}/u_at_tool_um", float(at_tool), METRE)
            yield Quantity(f"predicted/systematic/{name}/u_seen_um", float(shown), METRE)
    yield Quantity("certificate/efficiency", plan.proof.efficiency)
    yield Quantity("certificate/sentence", plan.proof.sentence)
    yield Quantity("budget/target_U_um", settings.target_um or None, AS_NAMED)
    yield Quantity("budget/target_is", settings.target_is)
    yield Quantity("budget/poses", curve.counts)
    yield Quantity("budget/U_um", k * curve.u, METRE)
    yield Quantity("budget/U_systematic_um", k * curve.shared, METRE)
    yield Quantity("budget/U_bound_um", _or_nan(k * curve.bound), METRE)
    yield Quantity("budget/U_random_um", _or_nan(k * curve.random), METRE)
    yield Quantity("budget/random_sets", curve.random_sets)
    yield Quantity("budget/smallest_reaching", curve.reached)
    yield Quantity("budget/proven_fewest", curve.fewest)
    yield Quantity("budget/sentence", curve.sentence)
    yield from target_numbers(plan)
    yield from _reach(plan)


def _reach(plan: Plan) -> Iterator[Quantity]:
    """Where the statement will hold."""
    seen = plan.foresight.applies
    yield Quantity("applies/sentences", [*reach_warnings(plan), *reach_words(plan)])
    if seen is None:
        return
    yield Quantity("applies/reaches", seen.reaches)
    for word in ("inside", "edge", "outside"):
        yield Quantity(f"applies/share_{word}", float((seen.place == word).mean()))
    for name, values in (("transfer", seen.transfer), ("leverage", seen.leverage)):
        yield Quantity(f"applies/{name}_median", float(np.median(values)))
        yield Quantity(f"applies/{name}_largest", float(values.max()))
    yield Quantity("applies/joint_beyond_share", seen.beyond.mean(axis=0))


def _poses(plan: Plan) -> Iterator[Quantity]:
    """The measuring order, which poses to add after it, and the candidates for them."""
    tour, pool, names = plan.tour, plan.pool, pose_ids(plan)
    rejected = dict(zip(pool.rejection_names, pool.rejection_counts, strict=True))
    yield Quantity("blocked", [names[k] for k in tour.blocked])
    yield Quantity("clearance_mm/wanted", plan.scenario.plan.clearance_mm, AS_NAMED)
    yield Quantity("clearance_mm/smallest", _or_nan(np.array(tour.clearance)), METRE)
    yield Quantity("untested", untested(plan))
    yield Quantity("uncounted", uncounted(plan))
    yield Quantity("duration_s", tour.duration, SECOND)
    yield Quantity("moving_s", float(tour.move.sum()), SECOND)
    yield Quantity("settle_s", tour.settle, SECOND)
    yield Quantity("route", tour.sentence)
    yield Quantity("order_is", plan.scenario.plan.order)
    yield Quantity("other_order_duration_s", _or_nan(np.array(tour.other_duration)), SECOND)
    order = [
        {"pose_id": name, "role": role, "pool": int(place) if place >= 0 else None}
        for name, role, place in zip(names, tour.roles, tour.pool_place, strict=True)
    ]
    yield Quantity("order", order)
    added = [
        {
            "pool": one.place,
            "joints_deg_mm": joint_values(plan, pool.q[one.place]),
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
