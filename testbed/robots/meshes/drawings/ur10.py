"""The arm of the UR10, drawn from scratch: parts by name, in the base frame at joint zero [m].

Zero lies flat: axis 1 upright through the origin, the arm along -x at a height of 0.1273, axes 2, 3
and 4 along -y at x = 0, -0.612 and -1.1843, axis 5 down at y = -0.1639, axis 6 along -y again at a
height of 0.0116, flange at y = -0.2561. It stands on a pedestal, floor at -0.675.
Lengths between axes are the maker's; tubes, housings, lids and the pedestal are our own.
"""

from typing import NamedTuple

from testbed.robots.meshes.solids import (
    Axis,
    Point,
    Solid,
    corners,
    cut,
    groove,
    hull,
    posts,
    puck,
    union,
)

FLOOR, SHOULDER, ELBOW, WRIST = -0.675, 0.1273, -0.612, -1.1843
SIDE = -0.163941
"""Where axis 5 goes down, in y."""
LOW, FLANGE = 0.0116, -0.256141
"""Height of axis 6; end of the arm in y."""
UPPER, FORE = -0.176, -0.049
"""The tubes of upper arm and forearm run in these planes y."""


class Housing(NamedTuple):
    """A drive housing: a drum whose free end is closed by a lid."""

    drum: Solid
    lid: Solid


def housing(radius: float, inner: float, lid: float, axis: Axis, at: Point) -> Housing:
    """Drum along `axis` through `at`, from its face at `inner` to where the lid ends, at `lid`."""
    out = 1 if lid > inner else -1
    rim, height = lid - out * 0.16 * radius, 0.16 * radius
    drum = union(
        puck(radius, inner, rim, 0.003, axis, at, 40),
        puck(radius - 0.004, inner, rim + out * 0.003, 0.001, axis, at, 40),
    )
    drum = cut(drum, groove(radius, rim - out * 0.012, 0.002, 0.002, axis, at))
    return Housing(drum, puck(radius - 0.002, rim + out * 0.002, lid, 0.6 * height, axis, at, 40))


def arm() -> dict[str, Solid]:
    """All parts: pedestal and foot, six moving bodies with their lids and seals."""
    moving = shoulder() | upper_arm() | forearm() | wrist_1() | wrist_2() | flange()
    return pedestal() | base() | moving


def pedestal() -> dict[str, Solid]:
    """Square column with a bolted foot and a top plate; static."""
    plates = [
        hull(*posts(0.02, low, low + 0.02, 0.003, corners(w, w), 20))
        for low, w in ((FLOOR, 0.18), (-0.02, 0.11))
    ]
    ribs = [
        hull(
            puck(0.006, FLOOR + 0.015, FLOOR + 0.03, 0.001, "z", (0.17 * x, 0.17 * y, 0), 12),
            puck(0.006, FLOOR + 0.015, FLOOR + 0.20, 0.001, "z", (0.06 * x, 0.06 * y, 0), 12),
        )
        for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))
    ]
    bolts = posts(0.011, FLOOR + 0.018, FLOOR + 0.032, 0.002, corners(0.165, 0.165), 6)
    return {
        "pedestal": hull(*posts(0.02, FLOOR + 0.01, -0.01, 0.003, corners(0.07, 0.07), 20)),
        "pedestal_plates": union(*plates, *ribs),
        "pedestal_bolts": union(*bolts),
    }


def base() -> dict[str, Solid]:
    """Foot with four lugs and a cable gland; static."""
    lugs = [
        hull(
            puck(0.017, 0.0, 0.016, 0.003, "z", (x, y, 0), 24),
            puck(0.030, 0.0, 0.026, 0.004, "z", (0.55 * x, 0.55 * y, 0), 24),
        )
        for x, y in corners(0.067, 0.067)
    ]
    body = union(puck(0.082, 0.0, 0.044, 0.005, "z"), *lugs)
    holes = posts(0.0045, -0.1, 0.1, 5e-4, corners(0.067, 0.067), 16)
    gland = union(
        puck(0.013, 0.075, 0.104, 0.002, "x", (0, 0, 0.023), 24),
        puck(0.009, 0.100, 0.118, 0.002, "x", (0, 0, 0.023), 20),
    )
    return {"base": cut(body, *holes), "base_gland": gland}


def shoulder() -> dict[str, Solid]:
    """Upright drum bent into a lying one, lid at its back; link 1."""
    drum, lid = housing(0.0795, -0.0870, 0.1040, "y", (0, 0, SHOULDER))
    body = union(puck(0.0795, 0.0475, SHOULDER, 0.003, "z"), drum)
    body = cut(body, groove(0.0795, 0.060, 0.002, 0.002))
    return {
        "shoulder": body,
        "shoulder_lid": lid,
        "shoulder_seal": puck(0.075, 0.042, 0.0495, 4e-4, "z"),
    }


def upper_arm() -> dict[str, Solid]:
    """Tube between two drums, lids in front, in front of shoulder and forearm; link 2."""
    top, end = (0.0, 0.0, SHOULDER), (ELBOW, 0.0, SHOULDER)
    big, big_lid = housing(0.0795, -0.0905, -0.2560, "y", top)
    small, small_lid = housing(0.0625, -0.1130, -0.2420, "y", end)
    tube = hull(
        puck(0.0565, -0.070, -0.050, 0.002, "x", (0, UPPER, SHOULDER)),
        puck(0.0490, ELBOW + 0.060, ELBOW + 0.045, 0.002, "x", (0, UPPER, SHOULDER)),
    )
    cuffs = [
        puck(0.0600, -0.100, -0.050, 0.004, "x", (0, UPPER, SHOULDER)),
        puck(0.0530, ELBOW + 0.085, ELBOW + 0.045, 0.004, "x", (0, UPPER, SHOULDER)),
    ]
    return {
        "upper_arm": union(big, small, tube, *cuffs),
        "upper_arm_lids": union(big_lid, small_lid),
        "upper_arm_seals": union(
            puck(0.075, -0.0855, -0.0920, 4e-4, "y", top),
            puck(0.059, -0.1085, -0.1145, 4e-4, "y", end),
        ),
    }


def forearm() -> dict[str, Solid]:
    """Thinner tube behind the upper arm, lids at its back; link 3.

    The elbow is a part of its own: one hull around both would be in the way of the wrist.
    """
    top, end = (ELBOW, 0.0, SHOULDER), (WRIST, 0.0, SHOULDER)
    big, big_lid = housing(0.0625, -0.1100, 0.0200, "y", top)
    small, small_lid = housing(0.0475, -0.1055, 0.0050, "y", end)
    tube = hull(
        puck(0.0450, ELBOW - 0.060, ELBOW - 0.045, 0.002, "x", (0, FORE, SHOULDER)),
        puck(0.0390, WRIST + 0.045, WRIST + 0.035, 0.002, "x", (0, FORE, SHOULDER)),
    )
    cuffs = [
        puck(0.0490, ELBOW - 0.085, ELBOW - 0.045, 0.004, "x", (0, FORE, SHOULDER)),
        puck(0.0425, WRIST + 0.065, WRIST + 0.030, 0.004, "x", (0, FORE, SHOULDER)),
    ]
    return {
        "elbow": big,
        "forearm": union(small, tube, *cuffs),
        "forearm_lids": union(big_lid, small_lid),
        "forearm_seal": puck(0.0445, -0.1040, -0.1100, 4e-4, "y", end),
    }


def wrist_1() -> dict[str, Solid]:
    """Drum about axis 4 that carries the one about axis 5, lid on top; link 4."""
    drum, lid = housing(0.0475, SHOULDER - 0.0555, SHOULDER + 0.0620, "z", (WRIST, SIDE, 0.0))
    neck = puck(0.0475, -0.1085, SIDE, 0.003, "y", (WRIST, 0.0, SHOULDER), 40)
    low = SHOULDER - 0.0590
    return {
        "wrist_1": union(drum, neck),
        "wrist_1_lid": lid,
        "wrist_1_seal": puck(0.0445, low, SHOULDER - 0.0540, 4e-4, "z", (WRIST, SIDE, 0.0)),
    }


def wrist_2() -> dict[str, Solid]:
    """The same about axes 5 and 6, lid at its back; link 5."""
    drum, lid = housing(0.0475, SIDE - 0.0500, SIDE + 0.0545, "y", (WRIST, 0.0, LOW))
    neck = puck(0.0475, SHOULDER - 0.0580, LOW, 0.003, "z", (WRIST, SIDE, 0.0), 40)
    return {
        "wrist_2": union(drum, neck),
        "wrist_2_lid": lid,
        "wrist_2_seal": puck(0.0445, SIDE - 0.0485, SIDE - 0.0535, 4e-4, "y", (WRIST, 0.0, LOW)),
    }


def flange() -> dict[str, Solid]:
    """Tool flange with four threaded holes and a connector on its side; link 6."""
    at = (WRIST, 0.0, LOW)
    disc = union(
        puck(0.0475, SIDE - 0.0525, SIDE - 0.0720, 0.003, "y", at, 40),
        puck(0.0315, SIDE - 0.0700, FLANGE, 0.001, "y", at, 40),
    )
    holes = [
        puck(0.003, FLANGE + 0.008, FLANGE - 0.01, 3e-4, "y", (WRIST + x, 0.0, LOW + z), 16)
        for x, z in corners(0.0177, 0.0177)
    ]
    plug = puck(0.0075, -0.055, -0.040, 0.0015, "z", (WRIST, SIDE - 0.0622, LOW), 20)
    return {"flange": cut(disc, *holes), "flange_plug": plug}
