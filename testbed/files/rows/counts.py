"""Other ways in which a controller may count joints, each with the line of robot.toml for it."""

from collections.abc import Iterator
from dataclasses import dataclass

from calib.arrays import Array
from calib.geometry.chain import Chain
from testbed.robots.controller import Controller
from testbed.robots.coupled import ControllerTable, turned_about

COUPLED = ((1, 2), (3, 4), (4, 5), (3, 5))
"""Joints of which many arms state the second with the first in it: those of a parallelogram or
counted from the horizontal, and of a wrist whose drives pass through each other."""

HERE = "in its robot.toml"
"""Where messages have lines of robot.toml written: of a URDF or MJCF there has to be one first."""


@dataclass(frozen=True, slots=True, eq=False)
class Count:
    """Joints of the arm, if the controller counts otherwise than its robot's file says."""

    condition: str
    """``if q3 = J3 + J2``: ends a sentence on what it leaves."""
    fix: str
    joint: int
    """Which is counted otherwise, from 0."""
    q: Array
    """(m, n) [rad, m]."""


def added(controller: Controller, *statements: str) -> str:
    """What to do so that a robot's file has some statements more."""
    listed = ", ".join(f'"{text}"' for text in statements)
    if controller.plain:
        return f"write joints = [{listed}] under [controller] {HERE}"
    return f"add {listed} to joints under [controller] {HERE}"


def other_counts(J: Array, chain: Chain, controller: Controller) -> Iterator[Count]:
    """Joints J (m, n) of a controller that counts otherwise than it is said to [rad, m]."""
    for a, b in COUPLED:
        if b >= chain.n_joints or chain.kinds[a] != chain.kinds[b] or b in controller.stated:
            continue
        for mark in "+-":
            text = f"q{b + 1} = J{b + 1} {mark} J{a + 1}"
            yield from _as(
                (*controller.statements, text), f"if joint {b + 1} is q{b + 1} {mark} q{a + 1}",
                added(controller, text), b, J, chain,
            )  # fmt: skip
    for k, (j, text) in enumerate(zip(controller.stated, controller.statements, strict=True)):
        before, after = controller.statements[:k], controller.statements[k + 1 :]
        if j not in controller.held:
            yield from _as(
                (*before, *after), f'without "{text}"',
                f'take "{text}" out of [controller] {HERE}', j, J, chain,
            )  # fmt: skip
        other = turned_about(text)
        if other != text:
            yield from _as(
                (*before, other, *after), f"if {other}",
                f'write "{other}" for "{text}" under [controller] {HERE}', j, J, chain,
            )  # fmt: skip


def _as(
    statements: tuple[str, ...], condition: str, fix: str, joint: int, J: Array, chain: Chain
) -> Iterator[Count]:
    """The joints by some statements; nothing where they contradict each other."""
    try:
        table = ControllerTable(joints=statements) if statements else None
        q = J if table is None else table.controller(chain.kinds).to_arm(J)
    except ValueError:
        return
    yield Count(condition, fix, joint, q)
