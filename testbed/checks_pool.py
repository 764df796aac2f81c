"""What [pool] asks of its robot: joint ranges inside its limits."""

from typing import TYPE_CHECKING

import numpy as np

from testbed.mistakes import Fault

if TYPE_CHECKING:
    from testbed.robots.catalog import Robot
    from testbed.settings import PoolSettings


def pool_faults(pool: "PoolSettings", robot: "Robot") -> list[Fault]:
    """Faults of joint ranges that this robot cannot have."""
    ranges, place = pool.joint_ranges_deg, ("pool", "joint_ranges_deg")
    n = robot.model.chain.n_joints
    if not ranges:
        return []
    if len(ranges) != n:
        entries = "entry" if len(ranges) == 1 else "entries"
        has = f"{len(ranges)} {entries}; {robot.name} has {n} joints"
        message = f"[pool] joint_ranges_deg has {has}"
        return [Fault(place, message, fix="give one pair per joint", value=ranges)]
    faults = []
    for i, (low, high) in enumerate(ranges):
        slides = bool(robot.model.chain.prismatic[i])
        unit, scale = ("mm", 1e3) if slides else ("deg", 180 / np.pi)
        lower, upper = robot.limits[i] * scale
        if low >= high or low < lower - 1e-6 or high > upper + 1e-6:
            faults.append(
                Fault(
                    place,
                    f"[pool] joint_ranges_deg lets joint {i + 1} go from {low:g} to {high:g} "
                    f"{unit}",
                    allowed=f"from a lower to a higher value inside {lower:g} to {upper:g} {unit}",
                    value=(low, high),
                )
            )
    return faults
