"""Which targets lie under other conditions than the data, or under ones that nobody knows.

Transfer and leverage come from the kinematics: they see neither a load nor the warmth of an arm,
nor another tool. What the rows say of these decides apart from them: a target under other
conditions has no region, and none under conditions that are not known to be the same. A tool whose
point is stated in the flange's frame is known as well as one that was measured.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from calib.arrays import Array, Bool, Index, check, frozen
from calib.errors import refuse
from calib.shown import Shown
from calib.uncertainty.statement.conditions import (
    CENTER,
    MOST_NAMED,
    NOT_STATED,
    Conditions,
    Tolerance,
)

AS_MEASURED = "as measured"
"""Word of a target under the conditions of the data."""
PLACED = "tool with a stated point"
"""Word of a target with a tool that was not measured, whose point is stated."""


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


@dataclass(frozen=True, slots=True, eq=False)
class Departure(Shown):
    """Which of N targets lie under other conditions than the data."""

    data: Conditions
    targets: Conditions
    other: dict[str, Bool]
    """Kind, stated on both sides, to whether each target (N,) lies outside the data's."""
    untold: dict[str, Bool]
    """Kind, or `CENTER`, that the targets state and the data do not, to the targets (N,) of which
    nobody knows therefore whether they agree."""
    placed: Bool
    """(N,) whether it has a tool that was not measured, whose point is stated."""
    outside: Bool
    """(N,) whether it is other of any kind, or unknown: such a target has no region."""

    def __repr__(self) -> str:
        return f"Departure({int(self.outside.sum())} of {len(self.outside)} outside)"

    @property
    def unknown(self) -> tuple[str, ...]:
        """The kinds that the targets state and the data do not: nobody knows whether they agree."""
        return tuple(self.untold)

    @property
    def words(self) -> tuple[str, ...]:
        """(N,) ``as measured``, ``other payload and tool``, or what of it was ``not stated``."""
        inside = AS_MEASURED if self.other else NOT_STATED
        out = []
        for k in self._numbers:
            some = [kind for kind in self.other if self.other[kind][k]]
            dark = [kind for kind in self.untold if self.untold[kind][k]]
            told = [f"other {' and '.join(some)}"] * bool(some)
            told += [f"{' and '.join(dark)} of the measurements {NOT_STATED}"] * bool(dark)
            told += [PLACED] * bool(self.placed[k])
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
        hung = self.data.center is not None and self.data.moments is not None
        if hung and "payload" in theirs and self.targets.moments is None:
            only.insert(0, CENTER)
        said = []
        if only:
            there = ", ".join(f"{kind} {self.data.words(kind)}" for kind in only)
            said.append(
                f"the targets do not state their {' and '.join(only)}: the statement holds as long "
                f"as that is the same as in the measurements ({there})"
            )
        if self.unknown:
            there = ", ".join(
                f"{kind} {self.targets.rows(np.flatnonzero(rows)).words(kind)}"
                for kind, rows in self.untold.items()
            )
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
    data: Conditions,
    targets: Conditions,
    count: int,
    tolerance: Tolerance | None = None,
    *,
    placed: Collection[str] = (),
) -> Departure:
    """Compare the conditions of targets with those of the data.

    A payload or temperature is outside where it lies further than the tolerance outside the range
    of the data, and a payload whose center of mass both sides state where its moment about the
    flange lies further outside than that of the tolerance at `ARM`; a tool where no row of the data
    has it. A kind that the targets alone state puts those that state it outside: whether they have
    what was measured is unknown. So does a center of more than the tolerance of a payload. One that
    the data alone state refuses nothing: it is a condition of the statement, which whoever uses the
    targets can keep.

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
    placed : collection of str
        Names of tools whose point is stated in the flange's frame.
    """
    tolerance = tolerance or Tolerance()
    other, untold, named_point = dict[str, Bool](), dict[str, Bool](), np.zeros(count, np.bool_)
    for kind in targets.stated:
        there = getattr(targets, kind)
        if len(there) != count:
            raise refuse(kind, len(there), f"one for each of {count} targets", code="A3")
        if kind == "tool":
            known = set(data.tool or ())
            new = np.array([name not in known for name in there])
            named_point = new & np.array([name in placed for name in there])
            off = new & ~named_point
        elif kind in data.stated:
            values, there = check("m, n", data=getattr(data, kind), targets=there)
            room = getattr(tolerance, kind)
            off = _beyond(there, values, room)
            if kind == "payload" and data.moments is not None and targets.moments is not None:
                off |= _beyond(targets.moments, data.moments, room * ARM).any(axis=1)
            elif kind == "payload" and data.moments is None and targets.center is not None:
                _put(untold, CENTER, (there > room) & ~off)
        else:
            off = np.ones(count, np.bool_)
        if kind in data.stated:
            other[kind] = frozen(off, np.bool_)
        else:
            _put(untold, kind, off)
    outside = np.zeros(count, np.bool_)
    for off in (*other.values(), *untold.values()):
        outside |= off
    return Departure(
        data, targets, other, untold, frozen(named_point, np.bool_), frozen(outside, np.bool_)
    )


def _put(untold: dict[str, Bool], kind: str, rows: Bool) -> None:
    """Note a kind of which nothing is known at some targets."""
    if rows.any():
        untold[kind] = frozen(rows, np.bool_)


def _beyond(there: Array, values: Array, room: float) -> Bool:
    """Whether each of `there` (n, ...) lies further than `room` outside the range of `values`."""
    low, high = values.min(axis=0) - room, values.max(axis=0) + room
    return np.asarray((there < low) | (there > high))


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
