"""Whether something moved between two readings, so that all later ones are displaced together.

A tracker that was pushed, a robot that was shifted on its foot, a reflector that came loose, a tool
that slipped with all of its reflectors, a joint whose zero slipped, another load and another robot
leave a step in the readings: from some row on they differ by a few numbers, which are the same in
all later rows. Model misfit follows the poses instead, and thermal drift comes slowly.
"""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import fdtrc

from calib.arrays import LATER, Array, Index, frozen
from calib.geometry.gravity import DOWN
from calib.identification.fit_statistics import RED
from calib.identification.outliers.changes import What, changes, told
from calib.identification.outliers.whitened import WhitenedRows
from calib.identification.result import Identification
from calib.identification.start.on_a_line import extents_told
from calib.measurement.observations import POINT, Measurements
from calib.shown import Shown, length_words

FEWEST = 8
"""Fewest poses on either side of a step; six numbers would fit fewer too well."""
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
JUMP = 0.25
"""Part of all that a joint moves which no pose may leave out at such a step: misfit follows the
poses, and jumps with them. The widest gap of sixteen at random in order is 0.22 in the mean ((1 +
1/2 + ... + 1/15) / 15)."""
SUDDEN = 20.0
"""Chi-square, in units of the rest per degree of freedom, by which a step must beat a slow change.
"""
APART = 4.0
"""Standard errors between the means of a joint before and after the step, from which the poses lie
elsewhere: there, model misfit looks like a step. For a load and another robot, which follow the
poses, between the mean squares, too."""
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
    """Number of rows that the step displaces."""
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
    in_time = np.argsort(order, kind="stable")
    rows = table.rows(in_time)
    places = _places(rows)
    free = WhitenedRows.of(identification, rows)
    kinds, alike = list(changes(identification, rows, gravity)), len(rows) / rows.n_poses
    equations = int(free.whiteners.any(axis=2).sum())
    steps: list[tuple[float, int, Moved]] = []
    for what, number, plain in kinds:
        # what an arm without springs bends by all the time is no step in its load
        fit = free.beside(plain) if what == "load" else free
        gain, k, rank, change = fit.step(plain, places)
        if gain <= 0 or not rank:
            continue
        rest, freedom = max(fit.square - gain, ROUNDING * fit.square), fit.freedom - rank
        excess = fit.square - fit.freedom
        once = equations * _once(rows, k) - (equations - freedom)
        if freedom < 1 or once <= 0 or excess <= 0:
            continue
        scale = rest / freedom
        one = float(fdtrc(rank, min(freedom / alike, once), gain / rank / scale / alike))
        chance = one * len(places) * len(kinds)
        if chance >= RED:
            continue
        least = _least(what, chance, rows, k)
        if least is None or gain < least * excess:
            continue
        if gain - fit.slow(plain) < SUDDEN * max(scale, 1.0) * alike:
            continue
        if what in ("station", "base", "robot") and _at_one_place(rows, k):
            continue
        by = plain[k:] @ change
        seen = np.abs(plain[k:]).max(axis=(1, 2)) > 0
        found = Moved(
            what, number, int(in_time[k - 1]), int(in_time[k]), int(seen.sum()), frozen(change),
            float(np.sqrt((by[seen, :3] ** 2).sum() / max(int(seen.sum()), 1))),
            min(gain / excess, 1.0), min(chance, 1.0),
        )  # fmt: skip
        steps.append((_evidence(free, rest, free.freedom - freedom, alike), k, found))
    if not steps:
        return None
    best, at, found = max(steps, key=lambda step: step[0])
    near = best - 2 * np.log(ODDS)
    others = [one for worth, _, one in steps if worth > near and one is not found]
    if _come_again(rows, at) or _elsewhere(rows, at):  # perhaps from the other side
        joints = [plain for what, _, plain in kinds if what == "joint"]
        gain, _, rank, _ = free.step(np.concatenate(joints, axis=2), np.array([at]))
        rest = max(free.square - gain, ROUNDING * free.square)
        if _evidence(free, rest, rank, alike) > near or "joint" in {
            one.what for one in (found, *others)
        }:
            return None
    return replace(found, or_else=tuple((one.what, one.number) for one in others))


def _least(what: What, chance: float, rows: Measurements, k: int) -> float | None:
    """Fraction of the chi-square beyond noise that a step at row k must explain; None: none is.

    A load and another robot follow the poses, as misfit does; and where rows state what bends the
    arm, a misfit may begin at a row, too.
    """
    if what in ("load", "robot"):
        if _elsewhere(rows, k, spread=True):
            return None
        return BY_ANOTHER if what == "robot" else EXPLAINED
    certain = chance < CERTAIN and not told(rows.conditions)
    if _elsewhere(rows, k):
        return ELSEWHERE if certain and not _jumps(rows.q, k) else None
    return BESIDE if certain else EXPLAINED


def _evidence(free: WhitenedRows, rest: float, numbers: int, alike: float) -> float:
    """Twice the log evidence for a step of so many numbers that leaves `rest` of chi-square."""
    count = free.freedom / alike
    return float(count * np.log(free.square / rest) - numbers * np.log(count))


def _come_again(rows: Measurements, k: int) -> bool:
    """Whether as many poses as a step needs were measured on either side of row k."""
    return len(np.intersect1d(rows.pose_id[:k], rows.pose_id[k:])) >= FEWEST


def _places(rows: Measurements) -> Index:
    """First rows of stops, in time, with enough poses on either side."""
    pose = rows.pose_id
    first = np.flatnonzero(np.concatenate([[False], pose[1:] != pose[:-1]]))
    count = np.arange(1, len(first) + 1)  # stops before each
    return np.asarray(first[(count >= FEWEST) & (len(first) + 1 - count >= FEWEST)])


def _once(rows: Measurements, k: int) -> float:
    """Part of the rows that one shot of each target is, at each pose on either side of row k."""
    after = np.arange(len(rows)) >= k
    seen = np.column_stack([rows.pose_id, rows.target_key, after])
    return len(np.unique(seen, axis=0)) / len(rows)


def _at_one_place(rows: Measurements, k: int) -> bool:
    """Whether all that was seen before row k, or from it on, is one place within its noise.

    A step of the station, or another arm, would be free to put it anywhere: what lengths the
    readings tell is lost, and a place whose coordinates are wrong looks alike.
    """
    index = np.arange(len(rows))
    sides = (rows.rows(index[:k]), rows.rows(index[k:]))
    return any((side.kind == POINT).all() and extents_told(side) == 0 for side in sides)


def _jumps(q: Array, k: int) -> bool:
    """Whether some joint of q (m, n) goes across a wide gap, for good, at row k."""
    before, after = q[:k], q[k:]
    gap = np.maximum(after.min(axis=0) - before.max(axis=0), before.min(axis=0) - after.max(axis=0))
    return bool((gap > JUMP * np.ptp(q, axis=0)).any())


def _elsewhere(rows: Measurements, k: int, *, spread: bool = False) -> bool:
    """Whether the mean of some joint differs between the poses before row k and those after.

    With `spread` also how far it goes from its mean: what follows the poses, as misfit does, would
    look like that.
    """
    q = rows.q
    if spread:
        q = np.hstack([q, (q - np.unique(q, axis=0).mean(axis=0)) ** 2])
    # poses that come again after the step stand on both sides of it
    before, after = np.unique(q[:k], axis=0), np.unique(q[k:], axis=0)
    if min(len(before), len(after)) < 2:
        return True
    noise = before.var(axis=0, ddof=1) / len(before) + after.var(axis=0, ddof=1) / len(after)
    gap = np.abs(before.mean(axis=0) - after.mean(axis=0))
    return bool((gap > APART * np.sqrt(noise)).any())
