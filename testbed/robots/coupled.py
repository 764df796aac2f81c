"""[controller] of robot.toml: equations between the controller's joints and the arm's.

Each statement is about one joint and solved for either side: ``q3 = J3 + J2`` gives the arm's
joint, ``J3 = q3 - q2`` the controller's. A joint without its own J, as in ``q4 = -q2 - q3``, is
held by others and has no motor.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from calib.arrays import Array, frozen
from calib.geometry.chain import JointKind
from testbed.bounds import ANGLE, LINK
from testbed.robots.controller import UNLIMITED, Controller
from testbed.robots.units import degrees, millimeters
from testbed.strict import PlainText, Strict

NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
TERM = re.compile(
    rf"\s*(?P<sign>[+-]?)\s*(?:(?P<number>{NUMBER}(?:\s*/\s*{NUMBER})?)\s*"
    r"(?P<unit>[a-z]+/[a-z]+)?\s*\*?\s*)?(?P<name>[qJ])(?P<joint>[1-9][0-9]?)\s*"
)
SIDE = re.compile(r"\s*(?P<name>[qJ])(?P<joint>[1-9][0-9]?)\s*")
SMALL, LARGE = 1e-6, 1e6
"""Smallest and largest coefficient; numbers beyond are typing errors."""
UNITS = {
    ("prismatic", "revolute"): ("mm/deg", 1e-3 / float(np.radians(1.0))),
    ("revolute", "prismatic"): ("deg/mm", float(np.radians(1.0)) / 1e-3),
}
"""Unit of a coefficient between joints of different kinds, and its factor to SI."""
Angles = Annotated[
    tuple[Annotated[float, ANGLE.signed("deg")], ...], Field(min_length=2, max_length=2)
]
Lengths = Annotated[
    tuple[Annotated[float, LINK.signed("mm")], ...], Field(min_length=2, max_length=2)
]
Statement = Annotated[PlainText, Field(min_length=1, max_length=200)]
JointName = Annotated[str, Field(max_length=3)]


class ControllerTable(Strict):
    """[controller]: joints that the controller counts differently from the arm.

    q1, q2 ... are the joints of the arm, [[joints]]; J1, J2 ... those that the controller shows,
    which tables and programs have. Joints without a statement are the same.
    """

    joints: Annotated[tuple[Statement, ...], Field(min_length=1, max_length=64)]
    """One statement per such joint: "q3 = J3 + J2", or equally "J3 = q3 - q2"; "q2 = -J2" turns
    the other way; "q5 = J5 + 0.02 J4" is driven along by J4; "q4 = -q2 - q3" is held, without a
    motor. If one joint slides and the other turns, the number has a unit: "q3 = J3 + 0.05 mm/deg
    J4"."""
    limits_deg: dict[JointName, Angles] = Field(default_factory=dict)
    """Lower and upper limit of the controller's turning joints: { J3 = [-140, 210] }. They apply
    in addition to those of the arm."""
    limits_mm: dict[JointName, Lengths] = Field(default_factory=dict)
    """The same for its sliding joints."""

    def controller(self, kinds: Sequence[JointKind]) -> Controller:
        """The stated controller for joints of some kinds; ValueError if it is impossible."""
        equations: dict[int, _Equation] = {}
        for text in self.joints:
            one = _equation(" ".join(text.split()), kinds)
            if one.joint in equations:
                raise ValueError(
                    f'joint {one.joint + 1} is stated twice: "{equations[one.joint].text}" and '
                    f'"{one.text}"'
                )
            equations[one.joint] = one
        _require_motors(equations)
        matrix, inverse = _solved(equations, len(kinds))
        return Controller(
            statements=tuple(one.text for one in equations.values()),
            stated=tuple(equations),
            matrix=frozen(matrix),
            inverse=frozen(inverse),
            held=tuple(sorted(k for k, one in equations.items() if one.held)),
            limits=frozen(self._limits(equations, kinds)),
        )

    def _limits(self, equations: dict[int, "_Equation"], kinds: Sequence[JointKind]) -> Array:
        """Limits (n, 2) of the controller's joints [rad, m]."""
        out = np.tile([-UNLIMITED, UNLIMITED], (len(kinds), 1))
        for unit, factor, kind, stated in (
            ("deg", np.radians(1.0), "revolute", self.limits_deg),
            ("mm", 1e-3, "prismatic", self.limits_mm),
        ):
            for name, (lower, upper) in stated.items():
                found = SIDE.fullmatch(name)
                j = int(found["joint"]) - 1 if found and found["name"] == "J" else -1
                if j not in equations or equations[j].held:
                    own = [f"J{k + 1}" for k, one in equations.items() if not one.held]
                    raise ValueError(
                        f"limits_{unit} names {name}: it is for joints that are stated and have a "
                        f"motor ({', '.join(own) or 'none'}); those of others stand in [[joints]]"
                    )
                if kinds[j] != kind:
                    raise ValueError(f"limits_{unit} names {name}, which is {kinds[j]}")
                if lower >= upper:
                    raise ValueError(f"limits_{unit}: {name} goes from {lower:g} to {upper:g}")
                out[j] = lower * factor, upper * factor
        return out


@dataclass(frozen=True, slots=True)
class _Equation:
    """One statement: a joint as a linear function of others [SI]."""

    text: str
    joint: int
    """Number of the joint, from 0."""
    of_arm: bool
    """Whether it gives the arm's joint, q, rather than the controller's."""
    own: float
    """Coefficient of its own joint on the other side; 1 if it is held."""
    held: bool
    others: dict[tuple[str, int], float]
    """Coefficients of others by ("q" or "J", joint from 0)."""


def _equation(text: str, kinds: Sequence[JointKind]) -> _Equation:
    """Parse a statement; ValueError if it is none."""
    left, mark, right = text.partition("=")
    side = SIDE.fullmatch(left)
    if side is None or not mark:
        raise ValueError(
            f'"{text}" is no statement on a joint; write "q3 = J3 + J2" or "J3 = q3 - q2"'
        )
    name, joint = side["name"], int(side["joint"]) - 1
    _require_joint(text, joint, len(kinds))
    terms: dict[tuple[str, int], float] = {}
    at = 0
    while at < len(right):
        term = TERM.match(right, at)
        if term is None or (at and not term["sign"]):
            raise ValueError(
                f'"{text}" cannot be read at "{right[at:].strip()[:20]}"; terms are like J2, '
                "-0.5 J4 or 1/50 q4, with + or - between them, and constants belong to theta_deg"
            )
        key = (term["name"], int(term["joint"]) - 1)
        _require_joint(text, key[1], len(kinds))
        if key in terms:
            raise ValueError(f'"{text}" names {key[0]}{key[1] + 1} twice')
        terms[key] = _number(text, term, kinds[joint], kinds[key[1]])
        at = term.end()
    if (name, joint) in terms:
        raise ValueError(f'"{text}" has {name}{joint + 1} on both sides')
    if not terms:
        raise ValueError(f'"{text}" says nothing of {name}{joint + 1}')
    other = ("J" if name == "q" else "q", joint)
    if name == "J" and other not in terms:
        raise ValueError(
            f'"{text}" does not name q{joint + 1}; write it as "J{joint + 1} = q{joint + 1} ..."'
        )
    held = other not in terms
    own = terms.pop(other, 1.0)
    return _Equation(text, joint, name == "q", own, held, terms)


def turned_about(text: str) -> str:
    """A statement with the other sign at every joint but its own: ``q3 = J3 - J2``."""
    left, mark, right = text.partition("=")
    joint, out = SIDE.fullmatch(left), ""
    for term in TERM.finditer(right):
        own = joint is not None and term["joint"] == joint["joint"]
        minus = (term["sign"] == "-") == own
        sign = " - " if minus else " + " if out else " "
        body = term.group().strip().lstrip("+-").strip()
        out += f"{'-' if minus else ''}{body}" if not out else f"{sign}{body}"
    return f"{left.strip()} {mark} {out}"


def _number(text: str, term: re.Match[str], kind: JointKind, by: JointKind) -> float:
    """Coefficient of a term `by` one kind of joint, in the statement of a joint of `kind` [SI]."""
    top, _, bottom = (term["number"] or "1").partition("/")
    below = float(bottom or 1.0)
    value = float(top) / below if below else np.inf
    if not SMALL <= value <= LARGE:
        raise ValueError(
            f'"{text}" has {term["number"]} at {term["name"]}{term["joint"]}; allowed: '
            f"{SMALL:g} to {LARGE:g}, with + or - before it"
        )
    unit, factor = UNITS.get((kind, by), ("", 1.0))
    if (term["unit"] or "") != unit:
        what = f"needs the unit {unit}" if unit else "takes no unit"
        why = f"joint {term['joint']} is {by} and the stated one {kind}"
        raise ValueError(
            f'"{text}": the number at {term["name"]}{term["joint"]} {what}: {why}'
            + (f', as in "0.05 {unit} {term["name"]}{term["joint"]}"' if unit else "")
        )
    return (-value if term["sign"] == "-" else value) * factor


def _require_joint(text: str, joint: int, n: int) -> None:
    """Refuse a joint that an arm of n joints does not have."""
    if joint >= n:
        raise ValueError(
            f'"{text}" names joint {joint + 1}; there are q1 to q{n} of the arm and J1 to J{n} of '
            "its controller"
        )


def _require_motors(equations: dict[int, _Equation]) -> None:
    """Refuse statements that use the motor of a joint that is held."""
    for joint, one in equations.items():
        for name, k in one.others:
            if name == "J" and k in equations and equations[k].held:
                raise ValueError(
                    f'"{one.text}" names J{k + 1}, and "{equations[k].text}" leaves the controller '
                    f"none; add J{k + 1} there if it has one, or write J{joint + 1} here if it is "
                    f"the one that turns q{joint + 1}: J is counted as q, with those that are held"
                )


def _solved(equations: dict[int, _Equation], n: int) -> tuple[Array, Array]:
    """Matrix (n, n) of the arm's joints by the controller's, and its inverse, by substitution.

    Every joint comes after those that its statement names, so that neither can be singular.
    """
    unit = np.eye(n)
    matrix, inverse = unit.copy(), unit.copy()
    done = set(range(n)) - set(equations)
    while left := [k for k in equations if k not in done]:
        ready = [k for k in left if {j for _, j in equations[k].others} <= done]
        if not ready:
            texts = " and ".join(f'"{equations[k].text}"' for k in left[:4])
            raise ValueError(
                f"joints {', '.join(str(k + 1) for k in left)} are stated by each other, in a "
                f"circle: {texts}; state one of them by joints that need no other"
            )
        for k in ready:
            one = equations[k]
            # q = own J + others, or J = own q + others: once as it is, once solved for the other
            here, there = (matrix, inverse) if one.of_arm else (inverse, matrix)
            given = "J" if one.of_arm else "q"
            direct = sum(
                (value * (unit[j] if name == given else here[j])
                 for (name, j), value in one.others.items()), np.zeros(n),
            )  # fmt: skip
            solved = sum(
                (value * (there[j] if name == given else unit[j])
                 for (name, j), value in one.others.items()), np.zeros(n),
            )  # fmt: skip
            here[k] = one.own * unit[k] + direct
            there[k] = (unit[k] - solved) / one.own
        done.update(ready)
    if max(np.abs(matrix).max(), np.abs(inverse).max()) > LARGE:
        raise ValueError(f"the statements together multiply joints by more than {LARGE:g}")
    return matrix, inverse


def controller_table(controller: Controller, kinds: Sequence[JointKind]) -> dict[str, Any] | None:
    """The table [controller] to write; None if joints are counted as the arm turns."""
    if controller.plain:
        return None
    out: dict[str, Any] = {"joints": list(controller.statements)}
    for unit, own, kind in (("deg", degrees, "revolute"), ("mm", millimeters, "prismatic")):
        limits = {
            f"J{k + 1}": [own(lower), own(upper)]
            for k, (lower, upper) in enumerate(controller.limits.tolist())
            if kinds[k] == kind and lower > -UNLIMITED
        }
        out |= {f"limits_{unit}": limits} if limits else {}
    return out
