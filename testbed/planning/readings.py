"""What the tracker will show at each pose of a plan, target by target."""

import numpy as np

from calib.arrays import Array, frozen
from testbed.planning.bench import PlanBench
from testbed.planning.records import Reading


def readings_of(bench: PlanBench, q: Array) -> tuple[Reading, ...]:
    """Predicted readings at joint targets q (s, n), from the nominal robot.

    A 6-D target has two: the tool frame's origin, which the tracker reports, and the probe, which
    the beam goes to.
    """
    tracker, chain = bench.tracker, bench.robot.model.chain
    T = bench.robot.model.poses(q)
    targets: tuple[tuple[str, Array], ...]
    if tracker.measures == "point":
        targets = (("reflector", tracker.reflector),)
    else:
        targets = (("tool", tracker.reflector), ("probe", tracker.aim(chain)))
    return tuple(
        _reading(name, T[:, :3, 3] + T[:, :3, :3] @ offset, tracker.T_world_tracker)
        for name, offset in targets
    )


def _reading(target: str, points: Array, T_world_tracker: Array) -> Reading:
    """World points (s, 3) as the tracker tells them."""
    seen = (points - T_world_tracker[:3, 3]) @ T_world_tracker[:3, :3]
    x, y, z = seen.T
    return Reading(
        target=target,
        position=frozen(seen),
        azimuth=frozen(np.arctan2(y, x)),
        elevation=frozen(np.arctan2(z, np.hypot(x, y))),
        range=frozen(np.linalg.norm(seen, axis=1)),
    )
