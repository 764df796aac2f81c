"""Which joints belong to which reading by the clock: those of the moment, where the arm stood."""

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.errors import InputError
from testbed.files.joints import Joints
from testbed.files.matching import Match
from testbed.files.readings import Readings
from testbed.files.refusal import refusal
from testbed.files.rows.times import Moments
from testbed.units import counted, named

EQUAL = 1e-6
"""Times are equal to a microsecond, which dates are written to; float64 of seconds since 1970 has
a quarter of it [s]."""
DAY = 86_400.0
"""After so long a time of day comes again [s]."""
STILL, STILL_SLIDE = float(np.radians(0.005)), 5e-5
"""Joints that were read back at a stop lie within these: 0.09 mm at a meter [rad, m]."""
FEW = 0.5
"""Part of the readings without joints from which on the clocks differ, not these readings."""
SHOWN = 8


def by_time(
    joints: Joints,
    readings: Readings,
    slides: Bool,
    within: float,
    *,
    ahead: float = 0.0,
    drop: bool,
) -> tuple[Match, str]:
    """The joints nearest in time to each reading, and how near these are, in words.

    Parameters
    ----------
    joints, readings : Joints, Readings
        Of two files with times.
    slides : (n,) array of bool
        Joints that are lengths.
    within : float
        How far apart a reading and its joints may be [s].
    ahead : float
        How far the clock of the joints is ahead of that of the readings [s].
    drop : bool
        Leave out readings without joints, instead of refusing.

    Raises
    ------
    InputError
        M31: a file has no times, times of another kind, or times of day that come again; a reading
        has no joints so near in time, or several that differ.
    """
    stamps = [_moments(part) for part in (joints, readings)]
    sent, seen = stamps[0].seconds, stamps[1].seconds + ahead
    if stamps[0].kind != stamps[1].kind:
        raise refusal(
            readings.where, "time",
            f"its times are {stamps[1].kind}, and those of {joints.where} are {stamps[0].kind}",
            code="M31", allowed='match = "time" needs both by one clock',
            fix="write both in one way",
        )  # fmt: skip
    order = np.argsort(sent, kind="stable")
    times = sent[order]
    if stamps[0].kind == "times of day" and times[-1] - times[0] >= DAY:
        raise refusal(
            joints.where, "time", "its times of day go over 24 hours or more, and come again",
            code="M31", allowed="each time means one moment", fix="write the date beside each time",
        )  # fmt: skip
    near, gap = nearest(times, seen)
    lost = np.flatnonzero(gap > within + EQUAL)
    warnings = tuple[str, ...]()
    if len(lost):
        least = float(gap[lost].min())
        message = (
            f"{joints.where} has no joints within {within:g} s of {_lines(readings, lost)}: the "
            f"nearest are {least:.3g} s away"
        )
        if not drop or len(lost) == len(seen):
            fix = (
                "state a larger one, or add --drop-invalid"
                if len(lost) <= FEW * len(seen)
                else "set both clocks alike, state by how much they differ (clock_offset_s under "
                "[joints]), or a larger match_within_s"
            )
            raise refusal(
                readings.where, "time", message, code="M31",
                allowed="match_within_s states how far apart they may be", fix=fix,
            )  # fmt: skip
        warnings = (f"{readings.where}: {message}; left out",)
    kept = np.flatnonzero(gap <= within + EQUAL)
    most = np.where(slides, STILL_SLIDE, STILL)
    _require_still(joints.q[order], times, readings, seen[kept], kept, most, within)
    match = Match(order[near[kept]], kept, warnings)
    far = float(gap[kept].max(initial=0.0))
    apart = "at equal times" if far <= EQUAL else f"up to {far:.3g} s apart"
    apart += f" with its clock {ahead:.10g} s ahead" if ahead else ""
    return match, f"{readings.where}: matched by time with {joints.where}, {apart}"


def nearest(times: Array, moments: Array) -> tuple[Index, Array]:
    """Which of sorted times (n,) is nearest to each moment (m,), and how far it is [s]."""
    after = np.searchsorted(times, moments).clip(1, max(len(times) - 1, 1))
    both = np.stack([after - 1, after]).clip(0, len(times) - 1)
    gaps = np.abs(times[both] - moments)
    return both[gaps.argmin(axis=0), np.arange(len(moments))], gaps.min(axis=0)


def _moments(part: Joints | Readings) -> Moments:
    """The moments of the rows of a file, which must be there."""
    if part.extras.moments is None:
        raise refusal(
            part.where, "time", "has no times that can be read", code="M31",
            allowed='match = "time" needs a column time, or time_s, in both files',
            fix="name the column so, and write its times as 2026-03-01 14:05:00.0, or as seconds",
        )  # fmt: skip
    return part.extras.moments


def _require_still(
    q: Array, times: Array, readings: Readings, seen: Array, kept: Index, most: Array, within: float
) -> None:
    """Refuse readings (k,) around whose moments the joints (m, n), in time, are not one pose.

    `seen` (k,) are these moments by the clock of the joints [s], and `most` (n,) is how far joints
    of one pose lie apart. A log of the whole course shows in its lines beside a moment as well
    whether the arm moved; at the moment of a line, those on one side of it are enough, since a stop
    may begin or end there.
    """
    step = _step(q, times, most)
    reach = max(within, step) + EQUAL
    line, off = nearest(times, seen)
    at_line = (off <= EQUAL) & (step > within)
    low = np.searchsorted(times, seen - reach, side="left")
    high = np.searchsorted(times, seen + reach, side="right")
    moving: list[tuple[int, int, float]] = []
    for k in np.flatnonzero(high - low > 1):
        sides = [slice(low[k], high[k])]
        if at_line[k]:
            sides = [slice(low[k], line[k] + 1), slice(line[k], high[k])]
        spreads = (np.ptp(q[side], axis=0) for side in sides)
        spread = min(spreads, key=lambda one: float((one / most).max()))
        worst = int(np.argmax(spread / most))
        if spread[worst] > most[worst]:
            moving.append((int(kept[k]), worst, float(spread[worst])))
    if moving:
        raise _moving(readings, moving, len(seen), most, reach - EQUAL, runs_on=step > 0)


def _step(q: Array, times: Array, most: Array) -> float:
    """The step of a log that runs on where the arm stands, as most lines do; else 0 [s]."""
    alike: Bool = np.all(np.abs(np.diff(q, axis=0)) <= most, axis=1)
    return float(np.median(np.diff(times))) if 2 * alike.sum() > len(alike) else 0.0


def _moving(
    readings: Readings,
    moving: list[tuple[int, int, float]],
    count: int,
    most: Array,
    reach: float,
    *,
    runs_on: bool,
) -> InputError:
    """The error of readings at which the arm did not stand, or that may be of two poses.

    `moving` are the row, the joint and how far it turned or slid [rad, m], of `count` readings; a
    log that runs on holds the way as well.
    """
    row, joint, spread = moving[0]
    slides = most[joint] == STILL_SLIDE
    differ = f"{1e3 * spread:.3g} mm" if slides else f"{np.degrees(spread):.3g} deg"
    told = f"the joints are not one pose: joint {joint + 1} differs by {differ}"
    where, message = readings.place[row], f"within {reach:.3g} s of this reading {told}"
    fix = "state a smaller match_within_s, or number the poses in both files"
    if runs_on:
        fix = "keep one reading of each stop: of a log, the mean of those at which the arm stood"
    if runs_on and len(moving) > 1:
        rows = np.array([row for row, _, _ in moving])
        where = readings.where
        message = (
            f"{_lines(readings, rows)} of {count} were taken while the arm moved: within "
            f"{reach:.3g} s of the first {told}"
        )
    return refusal(
        where, "time", message, code="M31", allowed="the arm stands where it is measured", fix=fix
    )


def _lines(readings: Readings, rows: Index) -> str:
    """Some readings in words."""
    lines = [readings.place[row].rpartition(":")[2] for row in rows[:SHOWN]]
    return f"{counted(len(rows), 'reading')} ({named('line', lines, len(rows))})"
