"""A 6-D tracker target, invented: parts by name, in the flange frame [m], z out of the flange."""

from calib.geometry.frames import rot_z
from testbed.robots.meshes.solids import Solid, ball, corners, cut, hull, moved, posts, puck, union


def probe() -> dict[str, Solid]:
    """Mount, housing, bezel, reflector, light spots."""
    plate = hull(
        puck(0.021, 0.010, 0.013, 0.001, "z"),
        *posts(0.008, 0.0125, 0.0175, 0.001, corners(0.034, 0.034), 20),
    )
    housing = hull(*posts(0.012, 0.017, 0.058, 0.004, corners(0.038, 0.038), 28))
    bezel = cut(puck(0.031, 0.054, 0.0630, 0.002, "z"), puck(0.0225, 0.0585, 0.08, 0.0005, "z"))
    spots = [ball(0.0036, (x, y, 0.0572), 2) for x, y in corners(0.0395, 0.0395)]
    # one spot more breaks the symmetry, so that a roll can be seen
    spots.append(ball(0.0036, (0.0, 0.0425, 0.0572), 2))
    grip = [
        moved(puck(0.004, 0.046, 0.0512, 0.001, "x", (0, 0, 0.037), 16), rot_z(t))
        for t in (0.0, 3.14159)
    ]
    return {
        "probe_mount": union(puck(0.021, 0.0, 0.0115, 0.0015, "z"), plate),
        "probe": union(housing, *grip),
        "probe_bezel": bezel,
        "probe_reflector": ball(0.0190, (0.0, 0.0, 0.0600), 3),
        "probe_lights": union(*spots),
    }
