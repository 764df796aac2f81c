"""How far a work is and how long it takes yet, from what each of its steps took before.

Steps differ a hundredfold in length, so their number says nothing. What is known of each is how
long it took last time, here or where the program was made; what has ended says how much faster or
slower this time is.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import isnan
from typing import NamedTuple

TRUST = 0.05
"""Share of the whole that the times before count as, beside what has ended by now."""
ROUNDS = 2
"""Pieces that each of several processes plays before the rate of all is told."""
LATE = 0.1
"""A step that takes longer than expected is expected to go on for this share of what it took."""


class Took(NamedTuple):
    """How long one step took, or may take."""

    seconds: float
    """Of one process: where pieces were played side by side, the sum over all of them; nan where
    nobody knows before a piece has ended."""
    pieces: int = 1
    """What is told one by one while it lasts."""

    def beside(self, workers: int) -> float:
        """Seconds until it is done, played by so many processes."""
        return self.seconds / min(workers, self.pieces)

    def scaled(self, pieces: int) -> "Took":
        """The same with more or fewer pieces."""
        return Took(self.seconds * pieces / self.pieces, pieces)


@dataclass(slots=True)
class TimeLeft:
    """A work as it goes on; it is called as progress is: what begins, steps done, steps in all.

    Parameters
    ----------
    expected : mapping
        What each step may take, by name, in their order; it may be empty, or name others.
    workers : int
        Processes that play pieces side by side.
    clock : callable
        Seconds that passed.
    """

    expected: Mapping[str, Took] = field(default_factory=dict)
    workers: int = 1
    clock: Callable[[], float] = time.perf_counter
    took: dict[str, Took] = field(default_factory=dict)
    """Steps that have ended."""
    name: str = ""
    """The step that goes on."""
    done: int = 0
    steps: int = 0
    _began: float = -1.0
    _since: float = 0.0
    _piece: float = 0.0
    """When the last piece ended."""
    _first: int = 0
    _farthest: float = 0.0

    def __call__(self, name: str, done: int, steps: int) -> None:
        """Take in what begins now."""
        now = self.clock()
        if self._began < 0:
            self._began = now
        if name and name == self.name:
            self._piece = now
        else:
            if self.name:
                usual = self.expected.get(self.name)
                pieces = usual.pieces if usual else max(done - self._first, 1)
                seconds = (now - self._since) * min(self.workers, pieces)
                before = self.took.get(self.name, Took(0.0))
                self.took[self.name] = Took(before.seconds + seconds, pieces)
            self.name, self._first, self._since, self._piece = name, done, now, now
        self.done, self.steps = done, steps

    @property
    def elapsed(self) -> float:
        """Seconds since the first step began."""
        return self.clock() - self._began if self._began >= 0 else 0.0

    def left(self) -> float | None:
        """Seconds until the end; None as long as nothing tells."""
        if self.steps and not self.name:
            return 0.0
        if not self.expected:
            each = (self._piece - self._began) / self.done if self.done else 0.0
            return self._by_piece(each, self.steps - self.done) if self.done else None
        names = list(self.expected)
        here = names.index(self.name) if self.name in self.expected else -1
        # what stands before the step that goes on is done, or was kept from an earlier run
        ahead = [name for name in names[here + 1 :] if name not in self.took]
        pace = self._pace()
        later = sum(self.expected[name].beside(self.workers) for name in ahead)
        left = self._rest(pace) + pace * later
        return None if isnan(left) else left

    def share(self) -> float:
        """Share of the whole time that is over, from 0 to 1; it never falls."""
        left = self.left()
        if left is not None and self._began >= 0:
            whole = self.elapsed + left
            self._farthest = max(self._farthest, self.elapsed / whole if whole > 0 else 1.0)
        return self._farthest

    def _pace(self) -> float:
        """How many times longer than before all takes now."""
        certain = {name: took for name, took in self.expected.items() if not isnan(took.seconds)}
        known = [name for name in self.took if name in certain]
        was = sum(certain[name].beside(self.workers) for name in known)
        now = sum(self.took[name].beside(self.workers) for name in known)
        if self.name in certain:
            usual, told = certain[self.name], self.done - self._first
            whole, lasts = usual.beside(self.workers), self.clock() - self._since
            # those that go on may all be about to end, and processes had to be begun
            due = whole * min((told + self._rounds(usual)) / usual.pieces, 1.0)
            if lasts > due:
                was, now = was + due, now + lasts
            elif told and self.workers == 1:  # else their beginning is in it
                was, now = was + whole * told / usual.pieces, now + self._piece - self._since
        whole = sum(took.beside(self.workers) for took in certain.values())
        trust = TRUST * whole
        return (now + trust) / (was + trust) if was + trust > 0 else 1.0

    def _rest(self, pace: float) -> float:
        """Seconds that the step that goes on takes yet."""
        if self.name not in self.expected:
            return 0.0
        usual, told = self.expected[self.name], self.done - self._first
        rounds, unknown = self._rounds(usual), isnan(usual.seconds)
        if usual.pieces > 1 and told >= (1 if unknown else rounds):
            # of those that go on beside the one that ended, half is done on average
            ended = told + (min(self.workers, usual.pieces) - 1) / 2
            rate = (self._piece - self._since) / ended
            each = rate if unknown else pace * usual.beside(self.workers) / usual.pieces
            each = (ended * rate + rounds * each) / (ended + rounds)
            return self._by_piece(each, max(usual.pieces - ended, 0.0))
        lasts = self.clock() - self._since
        return max(pace * usual.beside(self.workers) - lasts, LATE * lasts)

    def _rounds(self, step: Took) -> int:
        """Pieces after which the rate of a step is told: processes begin, and end together."""
        return ROUNDS * min(self.workers, step.pieces) if self.workers > 1 else 1

    def _by_piece(self, each: float, pieces: float) -> float:
        """Seconds that so many pieces take yet, one of them since the last one ended."""
        return max(each * pieces - (self.clock() - self._piece), each * max(pieces - 1, 0))
