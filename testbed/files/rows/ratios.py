"""Drives that pass through each other by a ratio that nobody states: the one that fits."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import pi

from calib.arrays import Array
from calib.geometry.chain import JointKind
from testbed.files.alternatives import Interpretation
from testbed.files.frames_fit import Misfit
from testbed.files.rows.counts import COUPLED, Count, added
from testbed.files.rows.shifts import misfit_of
from testbed.robots.robot import Robot
from testbed.units import listed

SUSPECT = 2e-3
"""What base and tool of the right reading of a file rarely leave [m]."""
BETTER = 2.0
"""Several ratios leave so many times less than one, or one is enough."""
STEPS = (0.02, 0.005, 0.001)
"""By which a ratio is asked for, nearer and nearer."""
LARGEST, SMALLEST, PLAIN = 3.0, 2e-3, 0.02
"""A ratio beyond the first is none of drives that pass through each other, nor one below the second
beside others; so near to 1 it is that."""
SPINDLE = 1e-4
"""What rises by less as it turns, 0.6 mm a turn, is no spindle [m]."""
ENOUGH = 12
"""Rows from which on several ratios at once are asked for."""
MM_PER_DEG = 1e3 * pi / 180
Ratios = dict[tuple[int, int], float]
"""How much of the first joint turns or moves the second, both from 0."""


def ratios_that_fit(
    robot: Robot, read: Interpretation, stated: Misfit
) -> list[tuple[Count, Misfit]]:
    """Joints counted with drives that pass through each other, and what that leaves.

    Nothing where base and tool leave little. A single ratio where one explains the readings, else
    all at once. The squared misfit is a parabola in a small ratio, whose lowest point is taken
    again from there.

    Parameters
    ----------
    robot : Robot
        Nominal; joints that it states are as stated.
    read : Interpretation
        Some rows as they were read.
    stated : Misfit
        What they leave.
    """
    kinds, controller = robot.model.chain.kinds, robot.controller
    gears = [(a, b) for a, b in COUPLED if b < len(kinds) and kinds[a] == kinds[b]]
    pairs = [(a, b) for a, b in (*gears, *_spindles(kinds)) if b not in controller.stated]
    if not SUSPECT < stated.score < float("inf"):
        return []
    J = controller.of_arm(read.q)

    def left(ratios: Ratios) -> Misfit:
        q = controller.to_arm(_driven(J, ratios))
        return misfit_of(robot.model, replace(read, q=q), one_valley=True)

    def nearer(ratios: Ratios, pair: tuple[int, int], step: float) -> Ratios:
        at = ratios.get(pair, 0.0)
        below, here, above = (left(ratios | {pair: at + k * step}).score ** 2 for k in (-1, 0, 1))
        bend = below - 2 * here + above
        ratio = at + step * (below - above) / (2 * bend) if bend > 0 else LARGEST
        return ratios | {pair: max(-LARGEST, min(LARGEST, ratio))}

    found = list[Ratios]()
    for pair in pairs:
        one = Ratios()
        for step in STEPS:
            one = nearer(one, pair, step)
        found.append(one)
    least = min((left(one).score for one in found), default=0.0)
    if least > SUSPECT and len(read.q) >= ENOUGH:
        every = Ratios()
        for step in (*STEPS, STEPS[-1]):
            for pair in pairs:
                every = nearer(every, pair, step)
        least_of = {(a, b): SMALLEST if kinds[a] == kinds[b] else SPINDLE for a, b in pairs}
        every = {pair: ratio for pair, ratio in every.items() if abs(ratio) > least_of[pair]}
        found += [every] if BETTER * left(every).score < least else []
    shown = {(a, b): 1.0 if kinds[a] == kinds[b] else MM_PER_DEG for a, b in pairs}
    rounded = [
        {pair: float(f"{ratio * shown[pair]:.4f}") / shown[pair] for pair, ratio in one.items()}
        for one in found
    ]
    sound = [one for one in rounded if one and all(map(_may_be, one.values()))]
    return [(_count(robot, J, one), left(one)) for one in sound]


def _spindles(kinds: Sequence[JointKind]) -> Iterator[tuple[int, int]]:
    """Joints that turn beside one that slides: a spindle that makes both moves it as it turns."""
    for b, kind in enumerate(kinds):
        for a in (b - 1, b + 1) if kind == "prismatic" else ():
            if 0 <= a < len(kinds) and kinds[a] == "revolute":
                yield a, b


def _may_be(ratio: float) -> bool:
    """Whether a ratio may be that of drives, and is not 1, which is tried by itself."""
    return 0 < abs(ratio) < LARGEST and abs(abs(ratio) - 1) > PLAIN


def _driven(J: Array, ratios: Ratios) -> Array:
    """Joints J (m, n) where some are turned by others as well."""
    out = J.copy()
    for (a, b), ratio in ratios.items():
        out[:, b] += ratio * J[:, a]
    return out


def _count(robot: Robot, J: Array, ratios: Ratios) -> Count:
    """Joints counted with some ratios, and the lines of the robot's file for it."""
    said, texts = list[str](), list[str]()
    for joint in sorted({b for _, b in ratios}):
        terms = [
            f" {'-' if ratio < 0 else '+'} {_number(robot, a, b, abs(ratio))} {{}}{a + 1}"
            for (a, b), ratio in ratios.items()
            if b == joint
        ]
        said.append(f"joint {joint + 1} is q{joint + 1}" + "".join(t.format("q") for t in terms))
        own = "".join(term.format("J") for term in terms)
        texts.append(f"q{joint + 1} = J{joint + 1}{own}")
    return Count(
        f"if {listed(said)}",
        f"{added(robot.controller, *texts)}, with the ratio{'s' * (len(ratios) > 1)} that its "
        "maker states",
        max(b for _, b in ratios), robot.controller.to_arm(_driven(J, ratios)),
    )  # fmt: skip


def _number(robot: Robot, a: int, b: int, ratio: float) -> str:
    """A ratio as a robot's file has it."""
    kinds = robot.model.chain.kinds
    return f"{ratio:.4f}" if kinds[a] == kinds[b] else f"{ratio * MM_PER_DEG:.4f} mm/deg"
