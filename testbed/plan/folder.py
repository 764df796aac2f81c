"""The files of a plan: table, numbers, report, recording, scenario and robot programs."""

from pathlib import Path
from typing import Any

import numpy as np

from testbed.plan.plan import plan as make_plan
from testbed.plan.programs import programs
from testbed.plan.recording import plan_story
from testbed.plan.records import Plan
from testbed.plan.report import plan_report_html
from testbed.plan.table import joint_units, plan_csv, pose_ids
from testbed.plan.words import station_words, untested
from testbed.progress import Progress
from testbed.recording.write import write_story
from testbed.report.page import SIMULATED
from testbed.robots.catalog import Robot, load_robot
from testbed.scenario.read import Scenario, dump_scenario, scenario_hash
from testbed.store.layout import PLAN, SCENARIO
from testbed.store.npz import pretty_json
from testbed.store.run_folder import check_free, whole_folder
from testbed.versions import all_versions, number_versions

FORMAT = 1
TABLE, REPORT, RECORDING = "plan.csv", "plan_report.html", "plan.rrd"


def play_plan(
    scenario: Scenario,
    out: Path,
    *,
    overwrite: bool = False,
    progress: Progress | None = None,
    where: str = "scenario",
) -> Plan:
    """Make a plan and write its folder; the folder is checked first, and written last."""
    check_free(out, PLAN, overwrite=overwrite)
    made = make_plan(scenario, progress=progress, where=where)
    write_plan(made, load_robot(scenario.robot), out, overwrite=overwrite)
    return made


def write_plan(plan: Plan, robot: Robot, out: Path, *, overwrite: bool = False) -> None:
    """Write every file of a plan; the folder appears whole or not at all."""
    with whole_folder(out, PLAN, overwrite=overwrite) as folder:
        texts = {
            SCENARIO: dump_scenario(plan.scenario),
            TABLE: plan_csv(plan),
            **programs(plan),
            REPORT: plan_report_html(plan, robot, versions=all_versions()),
        }
        for name, text in texts.items():
            (folder / name).write_bytes(text.encode())
        write_story(plan_story(plan, robot), folder / RECORDING)
        (folder / PLAN).write_bytes(pretty_json(plan_numbers(plan, robot)))


def plan_numbers(plan: Plan, robot: Robot) -> dict[str, Any]:
    """plan.json: every headline number, units in the keys."""
    scenario, settings, tour = plan.scenario, plan.scenario.plan, plan.tour
    k, names = settings.coverage, pose_ids(plan)
    counts = dict(zip(plan.pool.rejection_names, map(int, plan.pool.rejection_counts), strict=True))
    return {
        "format": FORMAT,
        "notice": SIMULATED,
        "scenario": scenario.name,
        "title": scenario.title,
        "robot": robot.name,
        "seed": scenario.seed,
        "scenario_sha256": scenario_hash(scenario, robot),
        "versions": number_versions(),
        "goal": plan.goal.sentence,
        "criterion": settings.criterion,
        "method": plan.method,
        "station_mm": list(plan.station_mm),
        "start_joints_deg": (tour.start * joint_units(plan)).tolist(),
        "poses": len(plan.places),
        "poses_measured_already": len(plan.measured_q),
        "held_out_poses": tour.roles.count("test"),
        "parameters": list(plan.parameters.free_names),
        "predicted": {
            "u_mean_um": plan.u_mean * 1e6,
            "u_worst_um": plan.u_worst * 1e6,
            "coverage_factor": k,
            "U_mean_um": k * plan.u_mean * 1e6,
            "U_worst_um": k * plan.u_worst * 1e6,
        },
        "certificate": {
            "efficiency": plan.proof.efficiency,
            "sentence": plan.proof.sentence,
        },
        "budget": {
            "target_U_um": settings.target_um or None,
            "target_is": settings.target_is,
            "poses": plan.curve.counts.tolist(),
            "U_um": [k * value * 1e6 for value in plan.curve.u],
            "U_bound_um": _numbers(k * plan.curve.bound * 1e6),
            "U_random_um": _numbers(k * plan.curve.random * 1e6),
            "random_sets": plan.curve.random_sets,
            "smallest_reaching": plan.curve.reached,
            "proven_fewest": plan.curve.fewest,
            "sentence": plan.curve.sentence,
        },
        "blocked": [names[k] for k in tour.blocked],
        "clearance_mm": {"wanted": settings.clearance_mm, "smallest": tour.clearance * 1e3},
        "untested": list(untested(plan)),
        "duration_s": tour.duration,
        "moving_s": float(tour.move.sum()),
        "settle_s": tour.settle,
        "route": tour.sentence,
        "order": [
            {"pose_id": name, "role": role, "pool": int(place) if place >= 0 else None}
            for name, role, place in zip(names, tour.roles, tour.pool_place, strict=True)
        ],
        "next_poses": [
            {
                "pool": one.place,
                "joints_deg_mm": (plan.pool.q[one.place] * joint_units(plan)).tolist(),
                "U_um_with_it": k * one.u * 1e6,
            }
            for one in plan.next_poses
        ],
        "candidates": {
            "drawn": plan.pool.n_drawn,
            "feasible": len(plan.pool.q),
            "rejected": counts,
        },
        "stations": None
        if plan.stations is None
        else {
            "sentence": station_words(plan),
            "best": plan.stations.best + 1,
            "candidates": plan.stations.n_candidates,
            "poses_designed": len(plan.stations.designs[plan.stations.best]),
            "compared": [
                {
                    "station": number + 1,
                    "position_mm": (1e3 * station).tolist(),
                    "visible": int(visible),
                    "U_mean_um": _number(k * u * 1e6),
                    "statement": statement,
                }
                for number, (station, visible, u, statement) in enumerate(
                    zip(
                        plan.stations.stations,
                        plan.stations.visible,
                        plan.stations.u_mean,
                        plan.stations.statements,
                        strict=True,
                    )
                )
            ],
        },
    }


def _number(value: float) -> float | None:
    """A number, or None where there is none."""
    return float(value) if np.isfinite(value) else None


def _numbers(values: np.ndarray[Any, Any]) -> list[float | None]:
    """Numbers, None where there are none."""
    return [_number(float(value)) for value in values]
