"""The arm of the TX60, drawn from scratch: parts by name, in the base frame at joint zero [m].

Zero is the candle: axis 1 upright through the origin, axes 2 and 3 along y at heights 0 and 0.290,
the forearm upright at y = 0.020, wrist center at 0.600, flange at 0.670, floor at -0.375.
Lengths between axes are the paper's; radii, rims, seams and bolts are our own.
"""

import numpy as np

from calib.geometry.frames import rot_x, rot_z, slide
from testbed.robots.meshes.solids import (
    Point,
    Solid,
    ball,
    corners,
    cut,
    groove,
    hull,
    moved,
    on_circle,
    posts,
    puck,
    union,
)

FLOOR, ELBOW, WRIST, FLANGE = -0.375, 0.290, 0.600, 0.670
SIDE = 0.020
"""The forearm stands this far in y from axis 1 (d3 of the paper)."""


def arm() -> dict[str, Solid]:
    """All parts of the arm: seven bodies and their trim."""
    return base() | shoulder() | upper_arm() | elbow() | forearm() | wrist() | flange()


def mirrored(low: float, high: float, radius: float, fillet: float, at: Point) -> list[Solid]:
    """Two pucks along y, from `low` to `high` on either side of `at`."""
    return [puck(radius, side * low, side * high, fillet, "y", at, 40) for side in (-1, 1)]


def base() -> dict[str, Solid]:
    """Foot with four bolted lugs, column, connector socket; static."""
    lugs = [
        hull(
            puck(0.022, FLOOR, -0.345, 0.004, "z", (x * 0.093, y * 0.085, 0), 28),
            puck(0.040, FLOOR, -0.315, 0.006, "z", (x * 0.045, y * 0.045, 0), 28),
        )
        for x, y in corners(1, 1)
    ]
    socket = hull(
        *(puck(0.034, -0.125, -0.075, 0.004, "x", (0, 0, z), 36) for z in (-0.305, -0.285))
    )
    body = union(
        puck(0.087, FLOOR, -0.1885, 0.003, "z"),
        puck(0.094, FLOOR, -0.350, 0.004, "z"),
        *lugs,
        socket,
    )
    holes = [
        hole
        for radius, low in ((0.0065, -0.40), (0.011, -0.350))
        for hole in posts(radius, low, -0.30, 0.0005, corners(0.093, 0.085), 20)
    ]
    plugs = [
        puck(radius, low, high, fillet, "x", (0, y, -0.295), 24)
        for y in (-0.017, 0.017)
        for radius, low, high, fillet in (
            (0.012, -0.165, -0.12, 0.002),
            (0.015, -0.150, -0.135, 0.003),
        )
    ]
    return {"base": cut(body, *holes, groove(0.087, -0.20)), "base_plugs": union(*plugs)}


def shoulder() -> dict[str, Solid]:
    """Upright cylinder bent into a lying one, with an inset disc on the bend; link 1."""
    body = union(
        puck(0.087, -0.1855, 0.0, 0.003, "z"),
        puck(0.087, 0.0, 0.1335, 0.003),
        ball(0.0875, (0, 0, 0), 4),
    )
    ring = cut(puck(0.0505, 0.02, 0.2, 5e-4, "z"), puck(0.0480, 0, 0.21, 5e-4, "z"))
    # the disc looks up and back, where the bend is; the ball inside keeps the cut shallow
    inset = cut(moved(ring, rot_x(np.pi / 4)), ball(0.0855, (0, 0, 0), 3))
    body = cut(body, inset, groove(0.087, -0.165), groove(0.087, 0.118, axis="y"))
    return {"shoulder": body, "shoulder_seal": puck(0.080, -0.1895, -0.1845, 0.0005, "z")}


def upper_arm() -> dict[str, Solid]:
    """Flat arm beside the shoulder, waisted on both faces, with bolted covers; link 2."""
    up = (0.0, 0.0, ELBOW)
    body = union(
        hull(puck(0.079, 0.150, 0.210, 0.012), puck(0.0640, 0.150, 0.205, 0.012, at=up)),
        puck(0.088, 0.1345, 0.210, 0.010),
        puck(0.0715, 0.1345, 0.205, 0.010, at=up),
    )
    body = cut(body, groove(0.0715, 0.207, 0.012, 0.0015, "y"))
    body = union(body, puck(0.070, 0.200, 0.2182, 0.005), puck(0.056, 0.195, 0.2125, 0.005, at=up))
    pockets = [
        hull(
            puck(0.030, low, high, 0.002, at=(0, 0, bottom), sections=36),
            puck(0.025, low_top, high, 0.002, at=(0, 0, top), sections=36),
        )
        for low, low_top, high, bottom, top in (
            (0.2075, 0.2035, 0.30, 0.105, 0.205),
            (0.0, 0.0, 0.1535, 0.110, 0.200),
        )
    ]
    screws = [
        puck(0.0045, 0.216, 0.2195, 0.001, at=(x, 0, z), sections=12)
        for x, z in on_circle(0.058, 6)
    ] + [
        puck(0.0040, 0.210, 0.2138, 0.001, at=(x, 0, ELBOW + z), sections=12)
        for x, z in on_circle(0.046, 6)
    ]
    seals = (puck(0.080, 0.1325, 0.136, 0.0004), puck(0.064, 0.1325, 0.136, 0.0004, at=up))
    return {
        "upper_arm": cut(body, *pockets),
        "upper_arm_screws": union(*screws),
        "upper_arm_seals": union(*seals),
    }


def elbow() -> dict[str, Solid]:
    """Knuckle around axis 3 that carries the forearm bearing; link 3."""
    at, top = (0.0, 0.0, ELBOW), ELBOW + 0.1085
    body = hull(
        puck(0.056, ELBOW + 0.085, top, 0.004, "z", (0, SIDE, 0)),
        puck(0.070, -0.030, 0.085, 0.016, at=at),
        puck(0.050, -0.022, 0.072, 0.016, at=(0.012, 0, ELBOW - 0.070)),
        puck(0.050, -0.022, 0.072, 0.016, at=(-0.010, 0, ELBOW - 0.070)),
    )
    body = union(
        puck(0.0700, 0.03, 0.1335, 0.004, at=at), body, puck(0.056, -0.060, 0.0, 0.020, at=at)
    )
    body = cut(
        body, groove(0.056, ELBOW + 0.098, at=(0, SIDE, 0)), groove(0.070, 0.112, axis="y", at=at)
    )
    return {
        "elbow": union(body, puck(0.040, -0.0635, -0.055, 0.003, at=at)),
        "elbow_seal": puck(0.049, top - 0.002, ELBOW + 0.1115, 0.0004, "z", (0, SIDE, 0)),
    }


def rounded_box(height: float, half_x: float, half_y: float) -> list[Solid]:
    """Four corner pucks of a rounded box around the forearm axis, to be hulled."""
    radius = 0.022
    places = [(x, SIDE + y) for x, y in corners(half_x - radius, half_y - radius)]
    return posts(radius, height - 0.008, height + 0.008, 0.006, places, 28)


def forearm() -> dict[str, Solid]:
    """Tapered forearm that ends in a fork around axis 5; link 4."""
    wrist = (0.0, SIDE, WRIST)
    neck = puck(0.0545, ELBOW + 0.1105, ELBOW + 0.135, 0.004, "z", (0, SIDE, 0))
    crotch = rounded_box(ELBOW + 0.225, 0.044, 0.064)
    shell = hull(neck, *rounded_box(ELBOW + 0.165, 0.056, 0.062), *crotch)
    ears = [
        hull(
            puck(0.043, side * 0.0225, side * 0.065, 0.008, "y", wrist),
            *(post for post in crotch if side * (post.centroid[1] - SIDE) > 0),
        )
        for side in (-1, 1)
    ]
    # the flange rim sweeps a circle of 56.2 mm about axis 5 when the wrist bends
    slot = hull(
        puck(0.0585, -0.0222, 0.0222, 0.001, "y", wrist),
        puck(0.0585, -0.0222, 0.0222, 0.001, "y", (0, SIDE, WRIST + 0.10)),
    )
    body = cut(union(shell, *ears), slot, groove(0.0545, ELBOW + 0.124, at=(0, SIDE, 0)))
    port = union(
        puck(0.010, 0.050, 0.064, 0.002, "x", sections=24),
        puck(0.0065, 0.060, 0.070, 0.001, "x", sections=24),
    )
    return {
        "forearm": union(body, *mirrored(0.0635, 0.0672, 0.033, 0.0012, wrist)),
        "forearm_port": moved(port, slide(0, SIDE, ELBOW + 0.175) @ rot_z(np.pi)),
    }


def wrist() -> dict[str, Solid]:
    """Wrist between the ears of the fork; link 5."""
    at = (0.0, SIDE, WRIST)
    neck = hull(
        puck(0.0225, WRIST + 0.030, WRIST + 0.0515, 0.002, "z", (0, SIDE, 0)),
        puck(0.022, -0.020, 0.020, 0.004, "y", (0, SIDE, WRIST + 0.006)),
    )
    body = cut(
        union(puck(0.043, -0.0212, 0.0212, 0.006, "y", at), neck),
        groove(0.0225, WRIST + 0.044, at=(0, SIDE, 0)),
    )
    return {"wrist": body, "wrist_caps": union(*mirrored(0.0205, 0.0224, 0.020, 0.0006, at))}


def flange() -> dict[str, Solid]:
    """Tool flange with four threaded holes, pilot and pin hole; link 6."""
    places = [(x, SIDE + y) for x, y in [*on_circle(0.0155, 4, np.pi / 4), (0.0125, 0.0)]]
    holes = posts(0.0025, FLANGE - 0.006, FLANGE + 0.01, 0.0003, places, 16)
    pilot = puck(0.010, FLANGE - 0.003, FLANGE + 0.01, 0.0003, "z", (0, SIDE, 0), 32)
    disc = puck(0.020, WRIST + 0.0525, FLANGE, 0.0015, "z", (0, SIDE, 0))
    return {"flange": cut(disc, *holes, pilot)}
