"""Sections of a plan's report on its poses: their order, their number, what comes out of them."""

import numpy as np

from testbed.output import plan_plots
from testbed.output.plan_stops import joint_columns, joint_units, pose_ids
from testbed.output.quantities import DEG, MM, UM, counted, fixed, significant
from testbed.output.report_parts import Block, Figure, Section, Table, Text
from testbed.planning.records import Plan


def order_section(plan: Plan) -> Section:
    """Every pose in measuring order, with what the tracker will show."""
    tour, reading = plan.tour, plan.readings[-1]
    scale = joint_units(plan)
    rows = []
    for k, name in enumerate(pose_ids(plan)):
        rows.append(
            (
                str(k + 1),
                name,
                "held out" if tour.roles[k] == "test" else "identify",
                *(fixed(value, 2) for value in tour.q[k] * scale),
                fixed(float(reading.azimuth[k]) * DEG, 2),
                fixed(float(reading.elevation[k]) * DEG, 2),
                fixed(float(reading.range[k]) * MM, 1),
                fixed(float(tour.move[k]), 1) + (" *" if len(tour.vias[k]) else ""),
            )
        )
    joints = tuple(name.replace("_", " ") for name in joint_columns(plan))
    table = Table(
        caption=f"{counted(len(tour), 'pose')} in measuring order",
        head=("", "pose", "role", *joints, "azimuth deg", "elevation deg", "range mm", "move s"),
        rows=tuple(rows),
        align="lll" + "r" * (len(joints) + 4),
        size="small",
        note=f"Azimuth, elevation and range of the {reading.target}, seen from the tracker in axes "
        "parallel to the robot's base. plan.csv has every digit and every target."
        + (
            ' *: the move passes a stop on the way around, a row "via" of plan.csv.'
            if any(map(len, tour.vias))
            else ""
        ),
    )
    caption = (
        "The way of the tool from pose to pose, numbered as in the table; square: where the robot "
        "starts, blue: poses to identify from, amber: held-out poses."
    )
    return Section("order", "Measuring order", (Figure(caption, plan_plots.order_map(plan)), table))


def number_section(plan: Plan) -> Section:
    """How many poses, how good they are, which to add."""
    curve, k = plan.curve, plan.scenario.plan.coverage
    caption = (
        f"Predicted U (k = {k:g}) against the number of poses. Blue: the designed sets. Dashed: no "
        "set of so many poses from this pool can go below (proven). Line: the plan."
        + (f" Dotted: median of {curve.random_sets} random sets." if curve.random_sets else "")
    )
    rows = [
        (
            str(int(m)),
            significant(k * float(u) * UM, 4),
            or_none(k * float(bound) * UM, 4),
            or_none(float(bound / u)),
            or_none(k * float(random) * UM, 4),
        )
        for m, u, bound, random in zip(
            curve.counts, curve.u, curve.bound, curve.random, strict=True
        )
    ]
    table = Table(
        caption="Uncertainty against the number of poses",
        head=("poses", "designed U µm", "no set below µm", "efficiency", "random U µm"),
        rows=tuple(rows),
        align="lrrrr",
    )
    blocks: list[Block] = [Figure(caption, plan_plots.budget(plan)), table]
    if plan.next_poses:
        scale = joint_units(plan)
        ranking = [
            (
                str(rank + 1),
                *(fixed(value, 2) for value in plan.pool.q[one.place] * scale),
                significant(k * one.u * UM, 4),
            )
            for rank, one in enumerate(plan.next_poses)
        ]
        joints = tuple(name.replace("_", " ") for name in joint_columns(plan))
        blocks.append(
            Table(
                caption="The best next pose, if one more can be measured",
                head=("", *joints, "U with it µm"),
                rows=tuple(ranking),
                align="l" + "r" * (len(joints) + 1),
                note="Each alone in addition to the plan, best first.",
            )
        )
    return Section("number", "Number of poses", tuple(blocks))


def prediction_section(plan: Plan) -> Section:
    """Where the tool will be known how well."""
    return Section(
        "prediction",
        "Predicted uncertainty",
        (
            Text(f"The goal: {plan.goal.sentence}."),
            Figure(
                "Left: U over the goal after each pose, in the order of the plan; nothing is "
                "drawn while some number cannot be told yet. Right: U of each posture of the goal.",
                plan_plots.prediction(plan),
            ),
        ),
    )


def or_none(value: float, digits: int = 3) -> str:
    """A number with so many digits, a dash where there is none."""
    return significant(value, digits) if np.isfinite(value) else "–"
