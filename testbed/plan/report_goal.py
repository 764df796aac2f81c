"""Sections of a plan's report about the goal: how many poses, how good, and where it will hold."""

import numpy as np

from calib.arrays import Array
from calib.uncertainty.statement.applicability import REFUSED, WARNED
from calib.uncertainty.statement.shared import HIDDEN, NOTHING
from testbed.lengths import column_unit
from testbed.plan import plots
from testbed.plan.lengths import curve_unit, expanded, unit_of
from testbed.plan.promises import OVER, efficiency_word, factor_words, has_shared
from testbed.plan.records import Plan
from testbed.plan.results import joint_columns, joint_values
from testbed.report.page import Block, Figure, Section, Table, Text
from testbed.units import UM, fixed, percent, significant


def joint_head(plan: Plan) -> tuple[str, ...]:
    """Heads of the columns of joints."""
    return tuple(name.replace("_", " ") for name in joint_columns(plan))


def joint_cells(plan: Plan, q: Array) -> tuple[str, ...]:
    """One posture (n,), a cell per joint."""
    return tuple(fixed(value, 2) for value in joint_values(plan, q))


def number_section(plan: Plan) -> Section:
    """How many poses, how good they are, which to add."""
    curve, (scale, unit) = plan.curve, curve_unit(plan)
    parts = has_shared(plan)
    caption = (
        f"Predicted U ({factor_words(plan.coverage)}) against the number of poses. Blue: the "
        "designed sets. Dashed: no set of so many poses from this pool can go below (proven). "
        "Line: the plan."
        + (" Gray: its parts, from noise and from systematic errors." if parts else "")
        + (f" Dotted: median of {curve.random_sets} random sets." if curve.random_sets else "")
    )
    table = Table(
        caption="Uncertainty against the number of poses",
        head=(
            "poses",
            f"designed U {unit}",
            *(("of noise", "of systematic errors") if parts else ()),
            f"no set below {unit}",
            "efficiency",
            f"random U {unit}",
        ),
        rows=tuple(
            (
                str(int(m)),
                expanded(plan, u, 4, scale),
                *(expanded(plan, part, 4, scale) for part in ((u**2 - b**2) ** 0.5, b) if parts),
                expanded(plan, bound, 4, scale),
                efficiency_word(bound / u),
                expanded(plan, random, 4, scale),
            )
            for m, u, b, bound, random in zip(
                curve.counts, curve.u, curve.shared, curve.bound, curve.random, strict=True
            )
        ),
        note="U is the root of the sum of the squares of its parts; more poses hardly reduce the "
        "second."
        if parts
        else "",
    )
    blocks: list[Block] = [Figure(caption, plots.budget(plan)), table]
    if plan.next_poses:
        scale, unit = unit_of(plan, *(one.u for one in plan.next_poses))
        ranking = Table(
            caption="The best next pose, if one more can be measured",
            head=("rank", *joint_head(plan), f"U with it {unit}"),
            rows=tuple(
                (
                    str(rank),
                    *joint_cells(plan, plan.pool.q[one.place]),
                    expanded(plan, one.u, 4, scale),
                )
                for rank, one in enumerate(plan.next_poses, start=1)
            ),
            note=f"Each alone in addition to the plan, best first. U: "
            f"{factor_words(plan.coverage)}.",
        )
        blocks.append(ranking)
    return Section("number", "Number of poses", tuple(blocks))


def prediction_section(plan: Plan) -> Section:
    """Where the tool will be known how well."""
    figure = Figure(
        f"Left: U ({factor_words(plan.coverage, OVER['V'])}) after each pose, in the order of the "
        "plan; not drawn while some number is still undetermined. Right: U of each posture of the "
        "goal.",
        plots.prediction(plan),
    )
    goal = Text(f"The goal: {plan.goal.sentence}.")
    return Section(
        "prediction",
        "Predicted uncertainty",
        (goal, figure, *source_blocks(plan), *reach_blocks(plan)),
    )


def source_blocks(plan: Plan) -> tuple[Block, ...]:
    """The systematic errors one by one."""
    seen = plan.foresight.sources
    if seen is None:
        return ()
    rows = zip(seen.names, seen.at_tool, seen.seen, seen.shown, strict=True)
    scale, unit = column_unit([*seen.at_tool, *seen.seen])
    table = Table(
        caption="The tracker's systematic errors",
        head=(
            "source",
            f"at the tool {unit}",
            f"held-out poses will show {unit}",
            "enough to see it",
        ),
        rows=tuple((name, fine(u, scale), fine(v, scale), words) for name, u, v, words in rows),
        align="lrrl",
        note="Standard uncertainties, 3-D, k = 1, RMS over the held-out poses. At the tool: the "
        "part that the calibrated robot takes over. More poses hardly reduce it. no: held-out "
        f"poses of this instrument show less than {HIDDEN:g} of what is left at the tool; "
        f"negligible: less than {percent(NOTHING)} of the whole is left there.",
    )
    return (table,)


def fine(u: float, scale: float) -> str:
    """A standard uncertainty [m] in um to two decimals, in mm to three; what is less is no zero."""
    places = 2 if scale == UM else 3
    least = 10.0**-places
    return fixed(u * scale, places) if u * scale >= least / 2 else f"< {least:g}"


def reach_blocks(plan: Plan) -> tuple[Block, ...]:
    """How much of what no model holds will arrive at the goal, and of the noise."""
    seen = plan.foresight.applies
    if seen is None:
        return ()
    table = Table(
        caption="Where the statement will hold: variances over the goal",
        head=("against the held-out poses", "median", "largest", "above 4", "above 9"),
        rows=tuple(
            (
                name,
                significant(float(np.median(values))),
                significant(float(values.max())),
                *(percent(float((values > limit).mean())) for limit in (WARNED, REFUSED)),
            )
            for name, values in (
                ("transfer g, of unmodelled errors", seen.transfer),
                ("leverage h, of noise", seen.leverage),
            )
        ),
        note="Ratios of variances, to the mean over the held-out poses. The region will grow with "
        f"g; above {WARNED:g} the posture is at the edge, above {REFUSED:g} no region is stated.",
    )
    return (table,)
