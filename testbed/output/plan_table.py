"""plan.csv: one row per joint target in measuring order, units in the names of the columns."""

import csv
import io

import numpy as np

from testbed.output.plan_stops import joint_columns, joint_units, stops_of
from testbed.planning.records import Plan

DECIMALS = 9
"""Of joint targets: 1e-9 deg moves no arm; the pool's joints come back to within rounding."""
READING = ("x_mm", "y_mm", "z_mm", "azimuth_deg", "elevation_deg", "range_mm")
"""Of every target, in the tracker's axes, which are parallel to the base frame's."""


def plan_csv(plan: Plan) -> str:
    """The table of a plan, to be read by people, controllers and `[plan] measured`.

    The first row, with the role ``start``, is where to bring the robot by hand; rows with the role
    ``via`` are passed, not measured: whoever follows all rows hits nothing, unless a move is
    ``blocked``, which has no time.
    """
    scale = joint_units(plan)
    head = ["pose_id", "role", "order", *joint_columns(plan)]
    for reading in plan.readings:
        head += [f"{reading.target}_{name}" for name in READING]
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*head, "move", "approach_s"])
    for stop in stops_of(plan):
        row = [stop.name, stop.role, str(stop.place + 1) if stop.measured else ""]
        row += [f"{value:.{DECIMALS}f}" for value in stop.q * scale]
        for reading in plan.readings:
            if not stop.measured:
                row += [""] * len(READING)
                continue
            row += [f"{value * 1e3:.4f}" for value in reading.position[stop.place]]
            angles = (reading.azimuth[stop.place], reading.elevation[stop.place])
            row += [f"{np.degrees(angle):.6f}" for angle in angles]
            row += [f"{reading.range[stop.place] * 1e3:.4f}"]
        seconds = f"{stop.seconds:.3f}" if np.isfinite(stop.seconds) else ""
        writer.writerow([*row, stop.move or "", seconds])
    return text.getvalue()
