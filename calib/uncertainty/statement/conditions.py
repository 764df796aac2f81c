"""Under which conditions a calibration was measured, and which targets lie under others.

Transfer and leverage come from the kinematics: they see neither a load nor the warmth of an arm,
nor another tool. What the rows say of these decides apart from them: a target under other
conditions has no region, and none under conditions that are not known to be the same.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated, NamedTuple

import numpy as np

from calib.arrays import LATER, Array, Bool, Index, check, frozen
from calib.errors import refuse
from calib.shown import Shown

AS_MEASURED, NOT_STATED = "as measured", "not stated"
"""Words of a target under the conditions of the data, and of one of which that cannot be told."""
UNITS = {"payload": "kg", "tool": "", "temperature": "degC"}
"""The kinds of conditions, in the order in which they are told, and their units."""


class Verbs(NamedTuple):
    """What targets do under a kind of condition, and what the data did."""

    one: str
    alike: str
    """Several targets, all of them the same."""
    several: str
    """Several, not all the same."""
    data: str


VERBS = {
    "payload": Verbs("carries", "carry", "carry", "had a payload of"),
    "tool": Verbs("has the tool", "have the tool", "have the tools", "had the tool"),
    "temperature": Verbs("is at", "are at", "are at", "were at"),
}
UNTIL = {
    "payload": "rows whose payload varies as much have identified a term for it",
    "tool": "rows have been measured with that tool",
    "temperature": "rows whose temperature varies as much have identified a term for it",
}
"""What must be done before a statement reaches such targets."""
ARM = 0.1
"""Where the tolerance of a payload hangs, when centers of mass are compared [m]."""
MOST_NAMED = 10
"""Targets named in one sentence."""


@dataclass(frozen=True, slots=True)
class Tolerance:
    """How far conditions may lie outside those of the data and still be the same."""

    payload: float = 0.5
    """[kg]"""
    temperature: float = 2.0
    """[K]"""


@dataclass(frozen=True, slots=True, eq=False)
class Conditions(Shown):
    """What N rows or targets say of their conditions; None where they say nothing."""

    payload: Annotated[Array, "N"] | None = None
    """(N,) mass at the flange beyond the arm's own [kg]."""
    tool: Annotated[tuple[str, ...], "N"] | None = None
    """(N,) name of what is mounted there."""
    temperature: Annotated[Array, "N"] | None = None
    """(N,) [degC]"""
    center: Annotated[Array, "N", 3, LATER] | None = None
    """(N, 3) center of mass of the payload in the flange frame, where it is stated [m]."""

    def __repr__(self) -> str:
        return f"Conditions({', '.join(map(self.words, self.stated)) or NOT_STATED})"

    @property
    def stated(self) -> tuple[str, ...]:
        """The kinds of conditions that are stated."""
        return tuple(kind for kind in UNITS if len(self._column(kind)))

    def rows(self, which: Bool | Index) -> "Conditions":
        """The same for some rows (a mask or indices)."""
        some = {kind: self._column(kind)[which] for kind in self.stated}
        tool = some.get("tool")
        return Conditions(
            some.get("payload"),
            None if tool is None else tuple(map(str, tool)),
            some.get("temperature"),
            None if self.center is None else self.center[which],
        )

    def words(self, kind: str) -> str:
        """What is stated of one kind, as a range or a list: ``0 to 5 kg``; empty if nothing."""
        values = self._column(kind)
        if not len(values):
            return ""
        if kind == "tool":
            names = list(dict.fromkeys(values.tolist()))
            more = [f"{len(names) - MOST_NAMED} more"] * (len(names) > MOST_NAMED)
            return " and ".join([*names[:MOST_NAMED], *more])
        return f"{_range(values)} {UNITS[kind]}"

    @property
    def center_words(self) -> str:
        """Where the payload's center of mass is: ``at 0, 0, 40 to 60 mm``; empty if not stated."""
        if self.center is None:
            return ""
        return f"at {', '.join(_range(1e3 * axis) for axis in self.center.T)} mm"

    @property
    def moments(self) -> Array | None:
        """(N, 3) first moments of the payload about the flange; None without centers [kg m]."""
        if self.payload is None or self.center is None:
            return None
        return np.asarray(np.asarray(self.payload)[:, None] * self.center)

    @property
    def phrase(self) -> str:
        """All that is stated: ``with a payload of 5 kg and the tool gripper at 21 degC``."""
        carried = {"payload": "a payload of", "tool": "the tool"}
        mounted = [f"{carried[kind]} {self.words(kind)}" for kind in carried if self.words(kind)]
        parts = [f"with {' and '.join(mounted)}"] * bool(mounted)
        return " ".join([*parts, *(f"at {warm}" for warm in [self.words("temperature")] if warm)])

    def _column(self, kind: str) -> Array:
        """Values (N,) of a kind; none if nothing is stated."""
        values = getattr(self, kind)
        return np.zeros(0) if values is None else np.asarray(values)


@dataclass(frozen=True, slots=True, eq=False)
class Departure(Shown):
    """Which of N targets lie under other conditions than the data."""

    data: Conditions
    targets: Conditions
    other: dict[str, Bool]
    """Kind, stated on both sides, to whether each target (N,) lies outside the data's."""
    outside: Bool
    """(N,) whether any kind does, or nobody knows of one: such a target has no region."""

    def __repr__(self) -> str:
        return f"Departure({int(self.outside.sum())} of {len(self.outside)} outside)"

    @property
    def unknown(self) -> tuple[str, ...]:
        """The kinds that the targets state and the data do not: nobody knows whether they agree."""
        return tuple(kind for kind in self.targets.stated if kind not in self.data.stated)

    @property
    def words(self) -> tuple[str, ...]:
        """(N,) ``as measured``, ``other payload and tool``, or what of it was ``not stated``."""
        inside = AS_MEASURED if self.other else NOT_STATED
        unknown = [f"{' and '.join(self.unknown)} of the measurements {NOT_STATED}"]
        out = []
        for k in self._numbers:
            some = [kind for kind in self.other if self.other[kind][k]]
            told = [f"other {' and '.join(some)}"] * bool(some) + unknown * bool(self.unknown)
            out.append("; ".join(told) or inside)
        return tuple(out)

    @property
    def sentences(self) -> tuple[str, ...]:
        """One sentence for each kind of condition that refuses targets, which it names from 1."""
        return tuple(
            f"{said}: nothing can be stated there until {UNTIL[kind]}"
            for kind, said in self.clauses(partial(named, "target"), "the measurements").items()
        )

    @property
    def unsaid(self) -> tuple[str, ...]:
        """What only one side states, in a sentence for each side."""
        mine, theirs = self.data.stated, self.targets.stated
        only = [kind for kind in mine if kind not in theirs]
        said = []
        if only:
            there = ", ".join(f"{kind} {self.data.words(kind)}" for kind in only)
            said.append(
                f"the targets do not state their {' and '.join(only)}: the statement holds as long "
                f"as that is the same as in the measurements ({there})"
            )
        if self.unknown:
            there = ", ".join(f"{kind} {self.targets.words(kind)}" for kind in self.unknown)
            same, it = ("it is", "it") if len(self.unknown) == 1 else ("they are", "them")
            said.append(
                f"the targets state their {' and '.join(self.unknown)} ({there}), and the "
                f"measurements do not: whether {same} the same is unknown, so that nothing can be "
                f"stated at these targets until the measurements state {it}"
            )
        return tuple(said)

    def clauses(self, who: Callable[[Index], str], data: str) -> dict[str, str]:
        """Kind to ``target 7 carries 5 kg; the measurements had a payload of 0 kg``."""
        said = {}
        for kind, off in self.other.items():
            rows = np.flatnonzero(off)
            if not len(rows):
                continue
            verbs, some = VERBS[kind], self.targets.rows(rows)
            alike = kind == "tool" and len(set(some.tool or ())) == 1
            verb = verbs.one if len(rows) == 1 else verbs.alike if alike else verbs.several
            there, here = some.words(kind), self.data.words(kind)
            if kind == "payload" and some.center is not None and self.data.center is not None:
                there, here = f"{there} {some.center_words}", f"{here} {self.data.center_words}"
            said[kind] = f"{who(rows)} {verb} {there}; {data} {verbs.data} {here}"
        return said

    @property
    def _numbers(self) -> range:
        return range(len(self.outside))


def departure(
    data: Conditions, targets: Conditions, count: int, tolerance: Tolerance | None = None
) -> Departure:
    """Compare the conditions of targets with those of the data.

    A payload or temperature is outside where it lies further than the tolerance outside the range
    of the data, and a payload whose center of mass both sides state where its moment about the
    flange lies further outside than that of the tolerance at `ARM`; a tool where no row of the data
    has it. A kind that the targets alone state puts all of them outside: whether they have what was
    measured is unknown. One that the data alone state refuses nothing: it is a condition of the
    statement, which whoever uses the targets can keep.

    Parameters
    ----------
    data : Conditions
        Of all rows that the statement rests on, held-out ones among them.
    targets : Conditions
        Of the targets.
    count : int
        Number of targets.
    tolerance : Tolerance, optional
        By default 0.5 kg and 2 K.
    """
    tolerance = tolerance or Tolerance()
    other = dict[str, Bool]()
    for kind in data.stated:
        if kind not in targets.stated:
            continue
        there = getattr(targets, kind)
        if len(there) != count:
            raise refuse(kind, len(there), f"one for each of {count} targets", code="A3")
        if kind == "tool":
            known = set(data.tool or ())
            off = np.array([name not in known for name in there])
        else:
            values, there = check("m, n", data=getattr(data, kind), targets=there)
            room = getattr(tolerance, kind)
            off = _beyond(there, values, room)
            if kind == "payload" and data.moments is not None and targets.moments is not None:
                off |= _beyond(targets.moments, data.moments, room * ARM).any(axis=1)
        other[kind] = frozen(off, np.bool_)
    outside = np.full(count, not set(targets.stated) <= set(data.stated))
    for off in other.values():
        outside |= off
    return Departure(data, targets, other, frozen(outside, np.bool_))


def _beyond(there: Array, values: Array, room: float) -> Bool:
    """Whether each of `there` (n, ...) lies further than `room` outside the range of `values`."""
    low, high = values.min(axis=0) - room, values.max(axis=0) + room
    return np.asarray((there < low) | (there > high))


def _range(values: Array) -> str:
    """Smallest and largest of some values, or the one there is."""
    ends = dict.fromkeys(f"{end + 0.0:.4g}" for end in (values.min(), values.max()))
    return " to ".join(ends)


def counted(noun: str, rows: Index) -> str:
    """How many rows: ``3 held-out rows``."""
    return f"{len(rows)} {noun}{'s' * (len(rows) > 1)}"


def named(noun: str, rows: Index) -> str:
    """Some rows, counted from 0, by their numbers from 1: ``targets 3, 7 and 2 more``."""
    numbers = [str(row + 1) for row in rows[:MOST_NAMED]]
    more = len(rows) - len(numbers)
    if len(rows) == 1:
        return f"{noun} {numbers[0]}"
    last = f"{more} more" if more else numbers.pop()
    return f"{noun}s {', '.join(numbers)} and {last}"
