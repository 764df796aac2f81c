"""The arm of a seven-axis LBR iiwa, drawn from scratch: parts by name, base frame at zero [m].

Zero is the candle: axes 1, 3, 5, 7 upright through the origin, axes 2, 4, 6 along y at heights of
0.34, 0.74 and 1.14, flange at 1.266. It stands on a pedestal, floor at -0.675.
Lengths between axes are the maker's; the shells, their seams and the pedestal are our own.
"""

from testbed.robots.meshes.solids import (
    Point,
    Solid,
    cut,
    groove,
    hull,
    on_circle,
    posts,
    puck,
    union,
)

FLOOR, SHOULDER, ELBOW, WRIST, FLANGE = -0.675, 0.340, 0.740, 1.140, 1.266
SEAM_1, SEAM_3, SEAM_5, SEAM_7 = 0.1575, 0.5445, 0.9445, 1.2210
"""Heights at which the bodies turn on each other about the upright axes."""


def arm() -> dict[str, Solid]:
    """All parts: pedestal and foot, seven moving bodies with their caps and seals."""
    out = pedestal() | base()
    for number, (below, above, radius, hub, side) in enumerate(SHELLS, 1):
        out |= shell(number, below, above, radius, hub, side)
    return out | wrist() | flange()


SHELLS = (
    # from the seam to the hub about the next axis across; radius at the seam, of the hub, its side
    (SEAM_1, SHOULDER, 0.0860, 0.0860, -1),
    (SEAM_3, SHOULDER, 0.0800, 0.0860, 1),
    (SEAM_3, ELBOW, 0.0800, 0.0800, 1),
    (SEAM_5, ELBOW, 0.0700, 0.0800, -1),
    (SEAM_5, WRIST, 0.0680, 0.0640, -1),
)
"""Links 1 to 5; the hubs of two neighbors lie side by side on one axis."""


def shell(
    number: int, seam: float, axis: float, radius: float, hub: float, side: int
) -> dict[str, Solid]:
    """A smooth body from a collar at a seam to a hub beside the middle; with cap and seal."""
    up = 1.0 if axis > seam else -1.0
    start = seam + up * 0.0020
    at: Point = (0.0, 0.0, axis)
    collar = puck(radius, start, start + up * 0.045, 0.003, "z", sections=40)
    face, end = 0.0015 * side, (hub + 0.012) * side
    drum = puck(hub, face, end, 0.020, "y", at, 40)
    shoulders = hull(
        puck(radius, start + up * 0.010, start + up * 0.045, 0.006, "z", sections=40),
        puck(0.93 * hub, 0.012 * side, end - 0.012 * side, 0.020, "y", at, 40),
    )
    # what leans over to the neighbor's side ends in a ball about the axis, clear of its hub
    reach = cut(shoulders, puck(hub + 0.004, face, -side * 0.3, 5e-4, "y", at, 40))
    body = cut(union(collar, reach, drum), groove(radius, start + up * 0.012, 0.002, 0.0015))
    cap = puck(0.62 * hub, end - 0.004 * side, end + 0.0035 * side, 0.003, "y", at, 40)
    name = f"link_{number}"
    parts = {name: body, f"{name}_cap": cap}
    if number in (1, 3, 5):  # the seal belongs to the body above the seam
        parts[f"{name}_seal"] = puck(radius - 0.005, seam - 0.003, seam + 0.003, 4e-4, "z")
    return parts


def pedestal() -> dict[str, Solid]:
    """Round column with a bolted foot and a top plate; static."""
    bolts = posts(0.010, FLOOR + 0.018, FLOOR + 0.030, 0.002, on_circle(0.185, 6), 6)
    cone = hull(
        puck(0.145, FLOOR + 0.015, FLOOR + 0.03, 0.002, "z", sections=48),
        puck(0.110, FLOOR + 0.085, FLOOR + 0.09, 0.002, "z", sections=48),
    )
    plates = [
        puck(0.210, FLOOR, FLOOR + 0.020, 0.004, "z", sections=48),
        puck(0.150, -0.022, 0.0, 0.004, "z", sections=48),
        cone,
    ]
    return {
        "pedestal": puck(0.105, FLOOR + 0.01, -0.01, 0.003, "z", sections=48),
        "pedestal_plates": union(*plates),
        "pedestal_bolts": union(*bolts),
    }


def base() -> dict[str, Solid]:
    """Foot: a flat cone with a connector panel at the back; static."""
    cone = hull(
        puck(0.125, 0.0, 0.030, 0.006, "z", sections=48),
        puck(0.088, SEAM_1 - 0.030, SEAM_1 - 0.0030, 0.004, "z", sections=48),
    )
    panel = hull(
        *(
            puck(0.012, -0.150, -0.070, 0.003, "x", (0, y, z), 24)
            for y in (-0.045, 0.045)
            for z in (0.022, 0.062)
        )
    )
    plugs = [
        puck(radius, low, high, 0.002, "x", (0, y, 0.042), 24)
        for y in (-0.028, 0.028)
        for radius, low, high in ((0.013, -0.172, -0.145), (0.016, -0.160, -0.150))
    ]
    return {
        "base": cut(union(cone, panel), groove(0.088, SEAM_1 - 0.015, 0.002, 0.002)),
        "base_plugs": union(*plugs),
    }


def wrist() -> dict[str, Solid]:
    """Round head beside the last hub, on which the flange turns; link 6."""
    at = (0.0, 0.0, WRIST)
    neck = hull(
        puck(0.0500, SEAM_7 - 0.022, SEAM_7 - 0.003, 0.004, "z", sections=40),
        puck(0.0520, 0.004, 0.0500, 0.016, "y", at, 40),
    )
    neck = cut(neck, puck(0.068, 0.0015, -0.3, 5e-4, "y", at, 40))
    drum = puck(0.0610, 0.0015, 0.0620, 0.020, "y", at, 40)
    cap = puck(0.038, 0.058, 0.0655, 0.003, "y", at, 40)
    return {"link_6": union(drum, neck), "link_6_cap": cap}


def flange() -> dict[str, Solid]:
    """Media flange with a ring of holes and a light ring; link 7."""
    holes = posts(0.0030, FLANGE - 0.008, FLANGE + 0.01, 3e-4, on_circle(0.025, 7), 16)
    disc = union(
        puck(0.0480, SEAM_7, FLANGE - 0.012, 0.003, "z", sections=40),
        puck(0.0315, FLANGE - 0.014, FLANGE, 0.001, "z", sections=40),
    )
    ring = puck(0.0488, SEAM_7 + 0.012, SEAM_7 + 0.017, 8e-4, "z", sections=40)
    return {"flange": cut(disc, *holes), "flange_light": ring}
