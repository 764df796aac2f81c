"""A calibration report's section on where it applies: joints, workspace, poses, targets."""

import numpy as np

from calib.arrays import Array
from calib.uncertainty.statement.applicability import REFUSED, WARNED
from calib.uncertainty.statement.places import room_words
from testbed.identify.applies.rows import held_out_words
from testbed.identify.applies.targets import datum_words, named, target_words
from testbed.identify.calibration import Calibration
from testbed.identify.handback.delivered import Delivered, TargetStatement
from testbed.lengths import column_unit
from testbed.report.page import Block, Points, Section, Table, Text, heads
from testbed.units import DEG, MM, sentences, significant

MOST_TARGETS = 30
"""Targets of a program in the report; all are in a file beside it."""


def reach_section(calibration: Calibration, delivered: Delivered) -> Section:
    """Where the result holds: what was calibrated, what was proven, and where targets lie."""
    blocks: list[Block] = [joint_table(calibration), workspace_table(calibration, delivered.root)]
    blocks.append(Points(sentences(held_out_words(calibration))))
    belief = calibration.proof.belief
    if belief is None:
        blocks.append(Text("No statement can be believed, so none applies anywhere."))
    else:
        here = belief.proven.applies(calibration.stated_q)
        room = room_words(calibration.nominal.chain.kinds)
        steps = " and on one of the steps at which it stood" if belief.proven.step.any() else ""
        blocks.append(
            Text(
                f"Over the {len(calibration.stated_q)} poses on which the radius rests, transfer g "
                f"lies between {_ends(here.transfer)} and leverage h between "
                f"{_ends(here.leverage)}; the mean of each is one. A target is inside what was "
                f"proven if both are at most {WARNED:g} and every joint is within {room} of its "
                f"proven range{steps}. Up to {REFUSED:g} it is at the edge, and its region grows "
                "with g. Beyond that it is outside, and no region is stated. Neither g nor h "
                "accounts for a payload, another tool or another temperature."
            )
        )
    if delivered.targets is not None:
        told = sentences(target_words(delivered.targets) + datum_words(calibration))
        blocks += [target_table(delivered.targets), Points(told)]
    return Section("reach", "Where it applies", tuple(blocks))


def joint_table(calibration: Calibration) -> Table:
    """How far each joint was moved to identify, to prove, and how far it can be."""
    table = calibration.measurements
    rows = []
    for k, kind in enumerate(calibration.nominal.chain.kinds):
        scale, unit = (DEG, "deg") if kind == "revolute" else (MM, "mm")
        cells = [str(k + 1), unit]
        for which in (calibration.is_used, calibration.is_stated & calibration.split.is_test):
            cells += _range(table.q[which, k] * scale)
        limits = calibration.limits[k] * scale if len(calibration.limits) else np.zeros(0)
        rows.append((*cells, *_range(limits)))
    return Table(
        caption="Joint ranges that were calibrated and proven",
        head=("joint", "unit", "identified from", "to", "proven from", "to", "limit", "to"),
        rows=tuple(rows),
        align="llrrrrrr",
        note="proven: over the held-out poses. Beyond these ranges nothing was tested, and errors "
        "that the model leaves out may be larger. Limits are those of the robot's description.",
    )


def workspace_table(calibration: Calibration, root: str) -> Table:
    """The box of the tool, and how far it is from the axis of the base.

    In the base of a robot.toml, or the root of another file, as programs have their poses.
    """
    model = calibration.nominal
    base = np.eye(4) if root else model.chain.T_world_base
    p = (model.poses(calibration.measurements.q)[:, :3, 3] - base[:3, 3]) @ base[:3, :3]
    p = np.column_stack([p, np.hypot(p[:, 0], p[:, 1])])
    sides = (calibration.is_used, calibration.is_stated & calibration.split.is_test)
    rows = [
        (name, *(cell for which in sides for cell in _range(p[which, k] * MM)))
        for k, name in enumerate(("x", "y", "z", "distance from the z axis"))
    ]
    return Table(
        caption=f"The calibrated workspace: where the tool was, in {root or 'the base frame'} [mm]",
        head=("coordinate", "identified from", "to", "proven from", "to"),
        rows=tuple(rows),
        align="lrrrr",
        note="Computed from the robot's description, including its tool.",
    )


def target_table(found: TargetStatement) -> Table:
    """What is stated at the first targets of a program."""
    rows, (names, places) = [], named(found)
    scale, unit = column_unit([*found.radius_mean, *found.radius_move])
    for k in range(min(len(found.why), MOST_TARGETS)):
        moves = found.radius_move[k : k + 1]
        radii = [significant(float(x) * scale) for x in (found.radius_mean[k], *moves)]
        cells = [*radii, "–"][:2] if found.stated[k] else ["–", "–"]
        reach = (significant(float(x[k]), 2) for x in (found.transfer, found.leverage))
        told = (str(found.place[k]), found.why[k])
        rows.append((str(k + 1), names[k] or places[k], *cells, *reach, *told))
    more = len(found.why) - len(rows)
    return Table(
        caption="What is stated at the targets of the corrected program",
        head=heads(
            f"target, name, R95 mean {unit}, R95 one move {unit}, transfer g, leverage h, "
            "place, why"
        ),
        rows=tuple(rows),
        align="rlrrrrll",
        size="small",
        note="R95: 3-D radius, 95 %. A dash: no region is stated there."
        + (f" {more} more targets are in the table beside the program." if more > 0 else ""),
    )


def _ends(values: Array) -> str:
    """Least and largest."""
    return " and ".join(significant(float(end), 2) for end in (values.min(), values.max()))


def _range(values: Array) -> list[str]:
    """Smallest and largest, in whole units."""
    if not len(values):
        return ["–", "–"]
    return [f"{value:.0f}".replace("-", "−") for value in (values.min(), values.max())]
