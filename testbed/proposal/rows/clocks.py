"""Matching of joints and readings in two files by their clocks, with the offset and tolerance."""

from dataclasses import replace

import numpy as np

from calib.arrays import Array
from testbed.files.dialects.marks import with_point
from testbed.files.dialects.numbers import number_of
from testbed.files.rows.by_time import EQUAL, nearest
from testbed.files.rows.times import Moments, moments_of
from testbed.files.table import DataTable
from testbed.files.text import Sheet
from testbed.gates.text import FileText
from testbed.proposal.data import Document, Found
from testbed.proposal.rows.dwells import clock_offset

OFFSET = "clock_offset_s"
REACH = "match_within_s"
MOST = 300_000
"""Rows of a log up to which the difference of two clocks is looked for: some seconds' work."""
STEPS = (1.0, 2.0, 5.0, 10.0)
"""Multiples of a power of ten to which a tolerance in time is rounded up."""


def have_clocks(one: Found, two: Found) -> bool:
    """Whether both files are tables with a column of times."""
    return all(look.kind == "table" and look.has("time") for look in (one, two))


def by_clocks(joints: Found, seen: Found) -> tuple[Document, Document, str]:
    """Keys of a session that matches two files by their times, of [joints], and what is assumed.

    A reading belongs to the joints nearest in time. The tolerance is the largest distance in time
    up to the step of the log, rounded up; it is the step itself if few readings are so near. If
    the clocks differ, but each reading falls into a stop of its own at one difference, it is that.
    """
    document: Document = {"match": "time"}
    log, shots = (_moments(look) for look in (joints, seen))
    if log is None or shots is None or log.kind != shots.kind:
        return document, {}, ""  # reading the session reports the error
    times, seconds = (np.sort(one.seconds[np.isfinite(one.seconds)]) for one in (log, shots))
    gap = nearest(times, seconds)[1]
    steps = np.diff(times)
    step = float(np.median(steps[steps > EQUAL])) if (steps > EQUAL).any() else 0.0
    near = gap[gap <= step + EQUAL]
    agree = 2 * len(near) > len(gap)
    reach = float(near.max(initial=0.0)) if agree else step
    if reach > EQUAL:
        document[REACH] = _rounded_up(reach)
    values = _joints(joints) if not agree and len(times) <= MOST else np.zeros((0, 0))
    if len(values) == len(log.seconds) and np.isfinite(log.seconds).all():
        order = np.argsort(log.seconds, kind="stable")
        if (found := clock_offset(log.seconds[order], values[order], seconds)) is not None:
            told = (
                f"times: the clock of {joints.called} is taken to be {found.middle:.10g} s ahead "
                f"of that of {seen.called}, since each of {len(seconds)} readings then falls into "
                f"one of as many stops, as from {found.least:.2f} to {found.most:.2f} s"
            )
            return document, {OFFSET: found.middle}, told
    most = float(gap.max(initial=0.0))
    far = "at equal times" if most <= EQUAL else f"up to {most:.3g} s from the nearest joints"
    said = f"times: both clocks are taken for one; readings are {far} of {joints.called}"
    return document, {}, said


def _joints(look: Found) -> Array:
    """Joint values (m, n) of a table in the units of its columns; none if one is no number."""
    names = [f"q{k}" for k in range(1, 65)]
    columns = next(
        (there for tail in ("", "_read")
         if (there := [look.stems[f"{name}{tail}"].theirs for name in names
                       if f"{name}{tail}" in look.stems])), [],
    )  # fmt: skip
    values: Array = np.array(
        [[number_of(with_point(cell)) for cell in look.column(name)] for name in columns]
    ).T
    return values if values.size and np.isfinite(values).all() else np.zeros((0, 0))


def beside_readings(
    joints: Found, seen: Found, lines: int, within: float, ahead: float
) -> FileText:
    """A log of joints without rows that are far in time from the first lines of readings.

    All rows if none are near; its clock is `ahead` of that of the readings [s].
    """
    log, shots = (_moments(look) for look in (joints, seen))
    if log is None or shots is None or log.kind != shots.kind:
        return joints.text
    table, other = joints.table, seen.table
    assert table is not None  # both have a column of times
    assert other is not None
    first = np.isfinite(shots.seconds) & (np.array(other.lines) <= lines)
    if not np.isfinite(log.seconds).all() or not first.any():
        return joints.text  # reading the session reports the error
    stamps = np.sort(shots.seconds[first]) + ahead
    kept = nearest(stamps, log.seconds)[1] <= within + EQUAL
    if not kept.any():
        return joints.text
    away = {line for line, near in zip(table.lines, kept, strict=True) if not near}
    text = joints.text
    # an empty line keeps the numbers of the others
    rows = tuple("" if k in away else line for k, line in enumerate(text.lines, start=1))
    return replace(text, lines=rows)


def _moments(look: Found) -> Moments | None:
    """The times of a file's rows, nan for those without one; None if they cannot be read."""
    clock = look.stems["time"]
    own = "time_s" if "s" in (clock.unit, clock.stem.rpartition("_")[2]) else "time"
    cells = look.column(clock.theirs)
    comma = any("," in cell for cell in cells) and not any("." in cell for cell in cells)
    rows = tuple((cell,) for cell in cells)
    sheet = Sheet(look.name, (own,), rows, tuple(range(len(rows))), "comma", "")
    table = DataTable(sheet, {own: own}, "," if comma else ".")
    good = np.array([bool(cell) for cell in cells])
    return moments_of(table, good)[0] if good.any() else None


def _rounded_up(seconds: float) -> float:
    """The next of 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(seconds))
    size = next(step for step in STEPS if step * power >= seconds * (1 - 1e-9))
    return float(f"{size * power:.3g}")
