"""A 6-D tracker target and a laser tracker, both invented: parts by name [m]."""

import numpy as np

from calib.geometry.frames import rot_z, slide
from testbed.robots.meshes.solids import (
    Solid,
    ball,
    corners,
    cut,
    groove,
    hull,
    moved,
    posts,
    puck,
    union,
)


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


def tracker(beam_height: float) -> dict[str, Solid]:
    """All parts, standing on a floor `beam_height` below the beam origin."""
    return stand(beam_height) | yoke() | head()


def stand(beam_height: float) -> dict[str, Solid]:
    """Three-legged foot, column and platform; only the column grows with `beam_height`."""
    floor = -beam_height
    leg = hull(
        puck(0.026, floor, floor + 0.016, 0.004, "z", (0.235, 0, 0), 28),
        puck(0.040, floor + 0.020, floor + 0.075, 0.006, "z", (0.020, 0, 0), 28),
    )
    legs = [moved(leg, rot_z(float(t))) for t in np.arange(3) * 2 * np.pi / 3 + np.pi / 3]
    column = puck(0.045, floor + 0.02, -0.225, 0.004, "z")
    collar = puck(0.060, floor + 0.070, floor + 0.100, 0.006, "z")
    platform = puck(0.098, -0.235, -0.205, 0.006, "z")
    return {
        "stand": union(*legs, column, collar),
        "stand_platform": union(platform, puck(0.070, -0.2065, -0.196, 0.002, "z")),
    }


def yoke() -> dict[str, Solid]:
    """Round body with two cheeks that hold the head."""
    body = hull(puck(0.092, -0.196, -0.130, 0.006, "z"), puck(0.080, -0.135, -0.100, 0.010, "z"))
    body = cut(body, groove(0.092, -0.180), groove(0.092, -0.172, 0.0015, 0.001))
    cheeks = [
        hull(
            puck(0.046, side * 0.064, side * 0.094, 0.008, "y"),
            puck(0.060, side * 0.066, side * 0.090, 0.008, "y", (0, 0, -0.100)),
        )
        for side in (-1, 1)
    ]
    # trimmed to the round of the body below
    cheeks = [cut(c, groove(0.099, -0.05, 0.5, 1e-3)) for c in cheeks]
    caps = [puck(0.030, side * 0.092, side * 0.0955, 0.0012, "y") for side in (-1, 1)]
    return {"yoke": union(body, *cheeks), "yoke_caps": union(*caps)}


def head() -> dict[str, Solid]:
    """Head between the cheeks: rounded block, aperture ring, glass, camera on top."""
    block = hull(
        *(
            puck(0.024, -0.058, 0.058, 0.010, "y", (x, 0, z), 36)
            for x, z in ((0.044, 0.036), (0.044, -0.036), (-0.044, -0.036), (-0.050, 0.030))
        )
    )
    camera = hull(
        *(
            puck(0.014, -0.036, 0.036, 0.006, "y", (x, 0, z), 28)
            for x, z in ((0.040, 0.062), (-0.030, 0.062), (-0.024, 0.085), (0.034, 0.085))
        )
    )
    aperture = cut(puck(0.030, 0.060, 0.0745, 0.002, "x"), puck(0.0205, 0.070, 0.09, 0.0005, "x"))
    lens = moved(puck(0.013, 0.044, 0.0535, 0.0015, "x", sections=32), slide(0, 0, 0.075))
    status = moved(puck(0.006, 0.064, 0.0700, 0.001, "x", sections=20), slide(0, 0.042, -0.030))
    return {
        "head": union(block, camera),
        "head_aperture": union(aperture, lens),
        "head_glass": union(
            ball(0.0190, (0.0545, 0, 0), 3),
            puck(0.0095, 0.052, 0.0545, 0.0008, "x", (0, 0, 0.075), 28),
        ),
        "head_status": status,
    }
