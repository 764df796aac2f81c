"""A plan's report: promise and proof first; order, number of poses, stations, candidates."""

from collections.abc import Mapping

import numpy as np

from calib.geometry.parameters import shown_in
from testbed.lengths import column_unit
from testbed.plan import plots
from testbed.plan.cautions import mark
from testbed.plan.lengths import expanded, or_dash, unit_of
from testbed.plan.promises import PLANNED, factor_words, has_shared, promise
from testbed.plan.records import Plan
from testbed.plan.report_goal import joint_cells, joint_head, number_section, prediction_section
from testbed.plan.results import pose_ids
from testbed.plan.target import falls_short
from testbed.plan.words import (
    PROMISED,
    axes_words,
    certificate_word,
    headline_rows,
    next_step,
    reasons,
    warnings,
)
from testbed.report.apart import left_nominal
from testbed.report.page import (
    Block,
    Figure,
    Page,
    Points,
    Section,
    Table,
    Text,
    record_section,
    rejections,
    render,
)
from testbed.report.svg import on_phone
from testbed.robots.catalog import Robot
from testbed.store.layout import PLAYED_PLAN
from testbed.units import DEG, MDEG, MM, counted, fixed, sentence, significant

ABREAST = 3
"""Numbers in one row of a table."""


def plan_report_html(plan: Plan, robot: Robot, *, versions: Mapping[str, str]) -> str:
    """The report of a plan as one HTML page: no network, same bytes each time.

    Parameters
    ----------
    plan : Plan
        As `testbed.plan.plan.plan` makes it.
    robot : Robot
        Its name for people.
    versions : mapping of str to str
        Program and packages.
    """
    scenario = plan.scenario
    sections = (
        order_section(plan),
        number_section(plan),
        prediction_section(plan),
        station_section(plan),
        candidate_section(plan),
        parameter_section(plan),
        record_section(
            f"Seed {scenario.seed}. scenario.toml beside this page, planned again with the same "
            f"versions, gives the same table; plan.json has every figure. {certificate_word(plan)}",
            versions,
        ),
    )
    page = Page(
        banner=PLANNED,
        title=scenario.title or scenario.name,
        subtitle=f"Measuring plan {scenario.name}, seed {scenario.seed}, {robot.title}. Predicted "
        "from the nominal robot; nothing has been measured.",
        believable=not (plan.tour.blocked or warnings(plan) or falls_short(plan)),
        mark=mark(plan),
        verdict=promise(plan),
        reasons=reasons(plan),
        headline=headline(plan),
        next_step=next_step(plan),
        recording=PLAYED_PLAN,
        sections=tuple(section for section in sections if section is not None),
    )
    return render(page)


def headline(plan: Plan) -> Table:
    """What the plan asks for and what it promises."""
    return Table(
        caption="The plan in numbers",
        head=("what", "value", "unit"),
        rows=tuple(headline_rows(plan)),
        align="lrl",
        strong=PROMISED,
        note="The tool point is the mean of many moves to a posture; the repeatability of one move "
        "comes on top. u: its standard uncertainty, root of the summed variances along x, y, z. "
        f"Included are the scatter of tracker and joints{counted_too(plan)}, as the identified "
        "numbers carry them to the tool, where each reading is weighed by its noise along and "
        "across the beam; weighed by one number for all directions it is a few percent more. What "
        "the model leaves out (sag, harmonics, backlash) is not included; the smallest misfit that "
        "the measurements would show stands in the table.",
    )


def counted_too(plan: Plan) -> str:
    """What else is counted."""
    return " and the errors that all readings of the tracker share" if has_shared(plan) else ""


def order_section(plan: Plan) -> Section:
    """Every pose in measuring order, with what the tracker will show."""
    tour, reading = plan.tour, plan.readings[-1]
    rows = tuple(
        (
            str(k + 1),
            name,
            "held out" if tour.roles[k] == "test" else "identify",
            *joint_cells(plan, tour.q[k]),
            fixed(float(reading.azimuth[k]) * DEG, 2),
            fixed(float(reading.elevation[k]) * DEG, 2),
            fixed(float(reading.range[k]) * MM, 1),
            fixed(float(tour.move[k]), 1) + (" *" if len(tour.vias[k]) else ""),
        )
        for k, name in enumerate(pose_ids(plan))
    )
    joints = joint_head(plan)
    starred = ' *: the move passes a stop on the way around, a row "via" of plan.csv.'
    table = Table(
        caption=f"{counted(len(tour), 'pose')} in measuring order",
        head=(
            "step",
            "pose",
            "role",
            *joints,
            "azimuth deg",
            "elevation deg",
            "range mm",
            "move s",
        ),
        rows=rows,
        align="lll" + "r" * (len(joints) + 4),
        size="small",
        note=f"Azimuth, elevation and range of the {reading.target}, seen from the tracker in "
        f"{axes_words(plan)}. plan.csv has every digit and every target."
        + (starred if any(map(len, tour.vias)) else "")
        + (f" {sentence(told)}" if (told := plan.controller.sentence) else ""),
    )
    caption = (
        "Path of the tool from pose to pose, numbered as in the table where there is room; square: "
        "start, blue: poses to identify from, amber: held-out poses."
    )
    figure = Figure(caption, plots.order_map(plan), phone=on_phone(plots.order_map, plan))
    return Section("order", "Measuring order", (figure, table))


def station_section(plan: Plan) -> Section | None:
    """Where the tracker should stand, and why."""
    seen = plan.stations
    if seen is None:
        return None
    scale, unit = unit_of(plan, seen.u_mean[seen.best], seen.u_worst[seen.best])
    rows = tuple(
        (
            str(n + 1),
            *(fixed(float(value) * MM, 0) for value in seen.stations[n]),
            str(int(seen.visible[n])),
            str(int(seen.turned_away[n])),
            str(int(seen.hidden[n])),
            or_dash(seen.range_mean[n]),
            expanded(plan, seen.u_mean[n], scale=scale),
            expanded(plan, seen.u_worst[n], scale=scale),
        )
        for n in map(int, np.argsort(seen.u_mean, kind="stable"))
    )
    table = Table(
        caption=f"{counted(len(rows), 'station')} compared on the same "
        f"{seen.n_candidates} candidate poses, best first",
        head=("station", "x mm", "y mm", "z mm", "seen", "turned away", "hidden", "mean range m",
              f"U RMS {unit}", f"U worst {unit}"),
        rows=rows,
        size="small",
        strong=(0,),
        note="seen: candidates that can be measured from there; turned away: the probe does not "
        "face the tracker; hidden: the beam is blocked. U: of the best design of "
        f"{len(seen.designs[seen.best])} poses found from there ({factor_words(plan.coverage)}), "
        "RMS and worst over the goal.",
    )  # fmt: skip
    figure = Figure(
        "Stations from above, and U of the design from each; vermilion: the best"
        f"{'' if np.isfinite(seen.u_mean).all() else ', cross: sees too few poses'}.",
        plots.stations(plan),
    )
    text = (
        "This comparison only ranks the stations: for the best one the plan is made anew, from "
        "candidates that are all visible from there."
    )
    return Section("stations", "Tracker stations", (Text(text), figure, table))


def candidate_section(plan: Plan) -> Section:
    """The pool: what was refused and why, and what each pose is worth."""
    low, high = plots.shade_range(plan)
    pool, clearance = plan.pool, plan.scenario.plan.clearance_mm
    near = f"nearer than {clearance:g} mm to it" if clearance else "touches it"
    blocks = (
        Figure(
            "The pool colored by leverage, the information a pose would add to the chosen set "
            f"(trace of K_jj): from {low} or less, pale, to {high} or more, dark, in equal steps. "
            "Vermilion: the chosen poses.",
            plots.leverage_map(plan),
        ),
        Text(
            rejections(pool.n_drawn, pool.rejection_names, pool.rejection_counts, len(pool.q))
            + f" By floor or obstacle: {near}, the base aside."
        ),
    )
    return Section("candidates", "Candidate poses", blocks)


def parameter_section(plan: Plan) -> Section:
    """What will be identified, and how well."""
    u = np.sqrt(np.diagonal(plan.foresight.covariance))
    lengths = plan.parameters.is_length[plan.parameters.free]
    names = plan.parameters.free_names
    cells = [
        (name, significant(float(value) * factor), unit)
        for name, value, length in zip(names, u, lengths, strict=True)
        for factor, unit in [_fine(name, bool(length), float(value))]
    ]
    lines = -(-len(cells) // ABREAST)
    cells += [("", "", "")] * (ABREAST * lines - len(cells))
    rows = zip(*(cells[k * lines : (k + 1) * lines] for k in range(ABREAST)), strict=True)
    table = Table(
        caption=f"{counted(len(names), 'number')} will be identified",
        head=("number", "predicted u", "unit") * ABREAST,
        rows=tuple(tuple(cell for one in row for cell in one) for row in rows),
        align="lrl" * ABREAST,
        note="Standard uncertainties, k = 1. They are strongly correlated: never combine them as "
        "if they were independent.",
    )
    blocks: list[Block] = [table]
    if left := left_nominal(plan.reduction):
        blocks.append(Points(left))
    return Section("parameters", "What will be identified", tuple(blocks))


def _fine(name: str, is_length: bool, u: float) -> tuple[float, str]:
    """How many of the unit that suits a number's uncertainty are one of SI, and the unit."""
    unit, _ = shown_in(name, is_length)
    if unit == "mm":
        return column_unit(u)
    if unit == "deg":
        return (MDEG, "mdeg") if u * MDEG < 999.5 else (DEG, "deg")
    return 1.0, unit
