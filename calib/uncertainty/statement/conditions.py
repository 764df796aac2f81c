"""Under which conditions rows were measured and targets are used: payload, tool, temperature."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from calib.arrays import LATER, Array, Bool, Index
from calib.shown import Shown

NOT_STATED = "not stated"
"""Of conditions of which nothing is known."""
UNITS = {"payload": "kg", "tool": "", "temperature": "degC"}
"""The kinds of conditions, in the order in which they are told, and their units."""
CENTER = "payload center"
"""What the center of mass of a payload is called beside them."""
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
        if kind == CENTER:
            return self.center_words
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
        """(N, 3) first moments of the payload about the flange; None if not known [kg m].

        Without a center they are known where nothing is carried.
        """
        if self.payload is None:
            return None
        if self.center is None:
            return None if self.payload.any() else np.zeros((len(self.payload), 3))
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


def _range(values: Array) -> str:
    """Smallest and largest of some values, or the one there is."""
    ends = dict.fromkeys(f"{end + 0.0:.4g}" for end in (values.min(), values.max()))
    return " to ".join(ends)
