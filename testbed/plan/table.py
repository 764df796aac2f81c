"""plan.csv: every joint target of a plan in turn, with the stops on the way around obstacles."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from calib.arrays import Array
from testbed.laboratory.route.moves import travel_times
from testbed.plan.records import Move, Plan
from testbed.report.text import csv_text
from testbed.units import DEG, MM

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
    head = ["pose_id", "role", "order", *joint_columns(plan)]
    head += [f"{reading.target}_{name}" for reading in plan.readings for name in READING]
    rows = [_row(plan, stop) for stop in stops_of(plan)]
    return csv_text([*head, "move", "approach_s"], rows)


def _row(plan: Plan, stop: "Stop") -> list[str]:
    """The cells of one joint target."""
    row = [stop.name, stop.role, str(stop.place + 1) if stop.measured else ""]
    row += [f"{value:.{DECIMALS}f}" for value in stop.q * joint_units(plan)]
    for reading in plan.readings:
        if not stop.measured:
            row += [""] * len(READING)
            continue
        row += [f"{value * 1e3:.4f}" for value in reading.position[stop.place]]
        angles = (reading.azimuth[stop.place], reading.elevation[stop.place])
        row += [f"{np.degrees(angle):.6f}" for angle in angles]
        row += [f"{reading.range[stop.place] * 1e3:.4f}"]
    seconds = f"{stop.seconds:.3f}" if np.isfinite(stop.seconds) else ""
    return [*row, stop.move or "", seconds]


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
    """(n,) joints [rad, m]."""
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
    return [f"q{j + 1}_{'mm' if kind == 'prismatic' else 'deg'}" for j, kind in enumerate(kinds)]


def joint_units(plan: Plan) -> Array:
    """(n,) factors from rad to deg, and from m to mm where a joint slides."""
    return np.where(plan.nominal.chain.prismatic, MM, DEG)
