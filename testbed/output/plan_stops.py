"""Every joint target of a plan in turn: its poses and the stops on the way around obstacles."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from calib.arrays import Array
from testbed.laboratory.moves import travel_times
from testbed.planning.records import Plan


@dataclass(frozen=True, slots=True, eq=False)
class Stop:
    """One joint target."""

    name: str
    """Of the pose, or of the stop on the way to it."""
    role: Literal["identify", "test", "via"]
    """Measured to identify, measured to check, or only passed."""
    place: int
    """Its pose's place in the measuring order."""
    q: Array
    """(n,) joints [rad, m]."""
    seconds: float
    """Time of the straight joint move to it [s]."""

    @property
    def measured(self) -> bool:
        """Whether the robot rests there to be measured."""
        return self.role != "via"


def stops_of(plan: Plan) -> list[Stop]:
    """Every joint target of the tour in turn."""
    tour, before, stops = plan.tour, plan.tour.start, list[Stop]()
    for k, (name, role) in enumerate(zip(pose_ids(plan), tour.roles, strict=True)):
        for number, q in enumerate(tour.vias[k]):
            seconds = float(travel_times(before, q, tour.speeds))
            stops.append(Stop(f"{name}via{number + 1}", "via", k, q, seconds))
            before = q
        q = tour.q[k]
        stops.append(Stop(name, role, k, q, float(travel_times(before, q, tour.speeds))))
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
    return np.where(plan.nominal.chain.prismatic, 1e3, 180 / np.pi)
