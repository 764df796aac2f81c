"""Whether something moved between two readings, for good or until it was put back.

A tracker that was pushed, a robot that was shifted on its foot, a reflector that came loose, a tool
that slipped with all of its reflectors, a joint whose zero slipped, another load and another robot
leave a step in the readings: from some row on they differ by a few numbers, which are the same in
all later rows. What was put back, as another tool for a few poses, leaves the same between two
rows. Model misfit follows the poses instead, and thermal drift comes slowly.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import fdtrc

from calib.arrays import LATER, Array, Bool, Index, frozen
from calib.geometry.gravity import DOWN
from calib.identification.fit_statistics import RED
from calib.identification.outliers.changes import What, changes, told
from calib.identification.outliers.sides import (
    at_one_place,
    come_again,
    elsewhere,
    jumps,
    moves_one_place,
    seen_once,
)
from calib.identification.outliers.spans import FEWEST, Spans, intervals_of, steps_of
from calib.identification.outliers.whitened import WhitenedRows
from calib.identification.result import Identification
from calib.measurement.observations import Measurements
from calib.shown import Shown, length_words

EXPLAINED = 0.8
"""Fraction of the chi-square beyond noise that a step must explain; misfit has no place in time."""
BESIDE, CERTAIN = 0.5, 1e-6
"""The same of a step beside a misfit of its size, and the chance below which it is taken for one:
of 400 arms with waves, play and sag in five orders none showed a third that is as improbable, and
of 640 that drifted or had gross errors only another robot did."""
BY_ANOTHER = 0.95
"""The same of another robot, whose many numbers follow some misfit as well."""
ELSEWHERE = 0.9
"""The same, at that chance, where the poses lie elsewhere after the step: of 750 arms as those
above no misfit and no drift looked like more than 75 % of a step, of whatever order."""
NEVER_BACK: tuple[What, ...] = ("robot",)
"""What is not asked of a few rows between others: it has too many numbers for them."""
MOST_GAIN = 0.75
"""Part of the stops between a step and the one back that must fit better by it."""
SUDDEN = 20.0
"""Chi-square, in units of the rest per degree of freedom, by which a step must beat a slow change.
"""
SUDDEN_BACK = 8.0
"""The same of what came back, beside what comes and goes: odds of 55 to 1. The few rows between two
ends are told from a hump by their flanks alone. Of 864 arms of a quick simulator with waves, play,
sag, gross errors and readings that drifted, in five orders, none showed what was not there."""
ODDS = 20.0
"""Odds, by BIC, from which what moved is told from something else that may have."""
ROUNDING = 1e-10
"""Part of chi-square below which its rest after a step is rounding, which may be below zero: sums
and projections of squares lose a few of sixteen digits."""


@dataclass(frozen=True, slots=True, eq=False)
class Moved(Shown):
    """What moved between two readings, and how far."""

    what: What
    number: int
    """Number of the station, of the target in `targets_of`, or of the joint, from 0; else 0."""
    last: int
    """Last row of the table before the step, in time."""
    row: int
    """First row after the step, in time."""
    rows: int
    """Number of rows that it displaces."""
    change: Annotated[Array, "k"]
    """(k,) shift [m] and rotation [rad] of station or base about the mean point; of the tool about
    the mean target, in its axes; shift of the target in these axes [m], and its rotation [rad] if
    that was measured; change of the joint [rad, m]; mass of a load times the compliance of each
    joint [kg rad/(N m)]; change of all free numbers [m, rad]."""
    size: float
    """Root mean square displacement of those readings [m]."""
    explained: float
    """Fraction of the chi-square beyond noise that the step explains."""
    p_value: float
    """Probability of as large a step anywhere by chance, for noise of any scale."""
    or_else: Annotated[tuple[tuple[What, int], ...], LATER] = ()
    """What else may have moved instead, with its number: the readings do not tell the two apart."""
    until: Annotated[int | None, LATER] = None
    """Last row that is displaced, in time, where it came back; None: it stayed."""
    back: Annotated[int | None, LATER] = None
    """First row after it came back, in time; None: it stayed."""

    def __repr__(self) -> str:
        size = length_words(self.size, um=".3g")
        return f"Moved({self.what} {self.number + 1}, {size}, row {self.row})"


def moved_once(
    identification: Identification, table: Measurements, order: Index, *, gravity: ArrayLike = DOWN
) -> Moved | None:
    """The one thing that moved between two rows of a table, if such a step explains the residuals.

    None otherwise, and with distances or fewer than twice `FEWEST` poses.

    Parameters
    ----------
    identification : Identification
        Fit of all rows of `table`.
    table : Measurements
        Poses and points.
    order : (m,) array
        Place of each row in time.
    gravity : (3,) array_like
        Acceleration of gravity in the frame of the base [m/s^2].

    References
    ----------
    Fall of chi-square by columns C of the rows from k on, beside the free numbers and their basis
    Q: b' S^+ b with b = C'r and S = C'C - C'Q Q'C over these rows; F test with Bonferroni's factor
    for all k and all kinds, and the kinds compared by BIC: those that may be it as well at odds of
    less than `ODDS` are named. Where poses come again after the step, or lie elsewhere, joints may
    have come from the other side, or be loaded from it: None if steps of joints, one or all of
    them, explain it about as well. The rows of a pose share its misfit: c of them count as one,
    with chi-square and degrees of freedom divided by c (design effect: Kish 1965), and shots of one
    target on one side of a step leave no more freedom than one of them would.
    """
    if table.is_distance.any() or table.n_poses < 2 * FEWEST:
        return None
    return _Rows.of(identification, table, order, gravity).best((steps_of,))


def moved_or_back(
    identification: Identification, table: Measurements, order: Index, *, gravity: ArrayLike = DOWN
) -> Moved | None:
    """The same, or what moved between two rows and came back between two later ones.

    Parameters as of `moved_once`. What came back must explain as much, at a chance below `CERTAIN`
    times all pairs of rows and all kinds; most of its stops must each fit better by it, and it must
    be steeper at both ends than what comes and goes slowly.
    """
    if table.is_distance.any() or table.n_poses < 2 * FEWEST:
        return None
    return _Rows.of(identification, table, order, gravity).best((steps_of, intervals_of))


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """Rows in order of time, off the free numbers, and what may have moved between them."""

    in_time: Index
    rows: Measurements
    free: WhitenedRows
    kinds: list[tuple[What, int, Array]]

    @classmethod
    def of(
        cls, identification: Identification, table: Measurements, order: Index, gravity: ArrayLike
    ) -> "_Rows":
        """Those of a table that a fit is of."""
        in_time = np.argsort(order, kind="stable")
        rows = table.rows(in_time)
        kinds = list(changes(identification, rows, gravity))
        return cls(in_time, rows, WhitenedRows.of(identification, rows), kinds)

    @property
    def alike(self) -> float:
        """Rows of a pose."""
        return len(self.rows) / self.rows.n_poses

    def best(self, ways: Sequence[Callable[[Measurements], Spans]]) -> Moved | None:
        """What explains most, with all that may have moved instead of it."""
        found = [
            one
            for way in ways
            if len((spans := way(self.rows)).first)
            for kind in self.kinds
            if (one := self._one(spans, *kind)) is not None
        ]
        if not found:
            return None
        worth, at, best = max(found, key=lambda one: one[0])
        near = worth - 2 * np.log(ODDS)
        others = [
            one for much, _, one in found
            if much > near and (one.what, one.number) != (best.what, best.number)
        ]  # fmt: skip
        others = list({(one.what, one.number): one for one in others}.values())
        side = _side(self.rows, *at)
        if come_again(self.rows, side) >= FEWEST or elsewhere(self.rows, side):
            # perhaps from the other side
            joints = [plain for what, _, plain in self.kinds if what == "joint"]
            ends = (np.array([end]) for end in at)
            gain, _, rank, _ = self.free.step(np.concatenate(joints, axis=2), *ends)
            if self._evidence(self._rest(self.free, gain), rank) > near or "joint" in {
                one.what for one in (best, *others)
            }:
                return None
        return replace(best, or_else=tuple((one.what, one.number) for one in others))

    def _one(
        self, spans: Spans, what: What, number: int, plain: Array
    ) -> tuple[float, tuple[int, int], Moved] | None:
        """Evidence for a kind of change, first and last row of its best span, and what it is."""
        if spans.back and what in NEVER_BACK:
            return None
        rows, alike = self.rows, self.alike
        # what an arm without springs bends by all the time is no step in its load
        fit = self.free.beside(plain) if what == "load" else self.free
        gain, k, rank, change = fit.step(plain, spans.first, spans.end)
        if gain <= 0 or not rank:
            return None
        first, end = int(spans.first[k]), int(spans.end[k])
        side = _side(rows, first, end)
        rest, freedom = self._rest(fit, gain), fit.freedom - rank
        excess = fit.square - fit.freedom
        equations = int(self.free.whiteners.any(axis=2).sum())
        once = equations * seen_once(rows, side) - (equations - freedom)
        if freedom < 1 or once <= 0 or excess <= 0:
            return None
        scale = rest / freedom
        one = float(fdtrc(rank, min(freedom / alike, once), gain / rank / scale / alike))
        chance = one * spans.tried * len(self.kinds)
        if chance >= (CERTAIN if spans.back else RED):
            return None
        least = _least(what, chance, rows, side, back=spans.back)
        if least is None or gain < least * excess:
            return None
        sudden = SUDDEN_BACK if spans.back else SUDDEN
        if gain - fit.slow(plain, (first, end)) < sudden * max(scale, 1.0) * alike:
            return None
        if not spans.back and what not in NEVER_BACK and fit.wandering(plain, first):
            return None
        if what in ("station", "base", "load", "robot") and at_one_place(rows, side):
            return None
        if moves_one_place(rows, side, plain):
            return None
        if spans.back and not self._most_gain(fit, plain, change, side):
            return None
        by = plain[side] @ change
        seen = np.abs(plain[side]).max(axis=(1, 2)) > 0
        found = Moved(
            what, number, int(self.in_time[first - 1]), int(self.in_time[first]), int(seen.sum()),
            frozen(change), float(np.sqrt((by[seen, :3] ** 2).sum() / max(int(seen.sum()), 1))),
            min(gain / excess, 1.0), min(chance, 1.0),
            until=int(self.in_time[end - 1]) if spans.back else None,
            back=int(self.in_time[end]) if spans.back else None,
        )  # fmt: skip
        numbers = self.free.freedom - freedom + spans.back
        return self._evidence(rest, numbers), (first, end), found

    def _most_gain(self, fit: WhitenedRows, plain: Array, change: Array, side: Bool) -> bool:
        """Whether most stops of a span fit better by a change: two wrong shots in it do not."""
        stop = np.cumsum(np.r_[True, self.rows.pose_id[1:] != self.rows.pose_id[:-1]])[side]
        before, after = (
            np.bincount(stop, np.square(r[side]).sum(axis=1))[np.unique(stop)]
            for r in (fit.r, fit.without(plain, change, side))
        )
        return bool((after < before).mean() >= MOST_GAIN)

    @staticmethod
    def _rest(fit: WhitenedRows, gain: float) -> float:
        """Chi-square that a change leaves."""
        return max(fit.square - gain, ROUNDING * fit.square)

    def _evidence(self, rest: float, numbers: int) -> float:
        """Twice the log evidence for a change of so many numbers that leaves `rest`."""
        count = self.free.freedom / self.alike
        return float(count * np.log(self.free.square / rest) - numbers * np.log(count))


def _side(rows: Measurements, first: int, end: int) -> Bool:
    """Rows (m,) of a span, in time."""
    index = np.arange(len(rows))
    return (index >= first) & (index < end)


def _least(
    what: What, chance: float, rows: Measurements, side: Bool, *, back: bool
) -> float | None:
    """Fraction of the chi-square beyond noise that a change must explain; None: none is.

    A load and another robot follow the poses, as misfit does; and where rows state what bends the
    arm, a misfit may begin at a row, too. Between two rows, poses that all lie near each other
    have a misfit of their own as well as poses that lie elsewhere, and a joint of the arm, whose
    one number follows a few wrong shots, is asked as strictly as another robot.
    """
    if what in ("load", "robot"):
        if elsewhere(rows, side, spread=True):
            return None
        return BY_ANOTHER if what == "robot" or back else EXPLAINED
    if what == "joint" and back:
        return None if elsewhere(rows, side, spread=True) else BY_ANOTHER
    certain = chance < CERTAIN and not told(rows.conditions)
    if elsewhere(rows, side, spread=back):
        return ELSEWHERE if certain and not jumps(rows, side) else None
    return BESIDE if certain else EXPLAINED
