"""Sections of a plan's report on what surrounds its poses: stations, candidates, parameters."""

import numpy as np

from testbed.output import plan_plots
from testbed.output.plan_report_poses import or_none
from testbed.output.plan_words import station_words
from testbed.output.quantities import DEG, MM, UM, counted, fixed, significant
from testbed.output.report_design import pool_rows
from testbed.output.report_parts import Block, Figure, Points, Section, Table, Text
from testbed.planning.records import Plan


def station_section(plan: Plan) -> Section | None:
    """Where the tracker should stand, and why."""
    seen = plan.stations
    if seen is None:
        return None
    k = plan.scenario.plan.coverage
    order = np.argsort(np.where(np.isfinite(seen.u_mean), seen.u_mean, np.inf), kind="stable")
    rows = tuple(
        (
            str(n + 1),
            *(fixed(float(value) * MM, 0) for value in seen.stations[n]),
            str(int(seen.visible[n])),
            str(int(seen.turned_away[n])),
            str(int(seen.hidden[n])),
            or_none(float(seen.range_mean[n])),
            or_none(k * float(seen.u_mean[n]) * UM),
            or_none(k * float(seen.u_worst[n]) * UM),
        )
        for n in map(int, order)
    )
    table = Table(
        caption=f"{counted(len(rows), 'station')} compared on the same "
        f"{seen.n_candidates} candidate poses, best first",
        head=("station", "x mm", "y mm", "z mm", "seen", "turned away", "hidden", "mean range m",
              "U mean µm", "U worst µm"),
        rows=rows,
        align="l" + "r" * 9,
        size="small",
        strong=(0,),
        note="seen: candidates that can be measured from there; turned away: the probe does not "
        "face the tracker; hidden: the beam is blocked. U: of the best design of "
        f"{len(seen.designs[seen.best])} poses found from there.",
    )  # fmt: skip
    figure = Figure(
        "Stations from above and the uncertainty of the design from each; vermilion: the best, "
        "cross: sees too little.",
        plan_plots.stations(plan),
    )
    text = (
        f"{station_words(plan)} Only the order of the stations is taken from this: the plan is "
        "made afresh for the best one, from candidates that are all seen from there."
    )
    return Section("stations", "Tracker stations", (Text(text), figure, table))


def candidate_section(plan: Plan) -> Section:
    """The pool: what was refused and why, and what each pose is worth."""
    low, high = plan_plots.shade_range(plan)
    pool, clearance = plan.pool, plan.scenario.plan.clearance_mm
    return Section(
        "candidates",
        "Candidate poses",
        (
            Figure(
                "The pool colored by leverage, how much a pose tells beside the chosen set (trace "
                f"of K_jj): from {low} or less, pale, to {high} or more, dark, in equal steps. "
                "Vermilion: the chosen poses.",
                plan_plots.leverage_map(plan),
            ),
            Text(
                f"Refused by floor or obstacle: nearer than {clearance:g} mm to it, the base aside."
                if clearance
                else "Refused by floor or obstacle: touches it, the base aside."
            ),
            pool_rows(pool.n_drawn, pool.rejection_names, pool.rejection_counts, len(pool.q)),
            Figure(
                "Candidates refused inside the box, by reason (at most 100 each), over the pool "
                "(gray).",
                plan_plots.rejections(plan),
            ),
        ),
    )


def parameter_section(plan: Plan) -> Section:
    """What will be identified, and how well."""
    u = np.sqrt(np.diagonal(plan.covariance))
    lengths = plan.parameters.is_length[plan.parameters.free]
    names = plan.parameters.free_names
    rows = tuple(
        (name, significant(float(value) * (UM if length else DEG * 1e3), 3),
         "µm" if length else "mdeg")
        for name, value, length in zip(names, u, lengths, strict=True)
    )  # fmt: skip
    table = Table(
        caption=f"{counted(len(names), 'number')} will be identified",
        head=("number", "predicted u", "unit"),
        rows=rows,
        align="lrl",
        note="Standard uncertainties, k = 1. They are strongly correlated: never combine them as "
        "if they were independent.",
    )
    blocks: list[Block] = [table]
    if plan.notes:
        blocks += [Text("What the measurements cannot tell apart:"), Points(plan.notes)]
    return Section("parameters", "What will be identified", tuple(blocks))
