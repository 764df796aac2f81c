"""When each row was measured: seconds since the first one, and days."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import compress
from typing import Literal

import numpy as np

from calib.arrays import Array, Bool, Index
from testbed.files.table import DataTable

DOTTED = re.compile(
    r"(\d{1,2})\. ?(\d{1,2})\. ?(\d{4})[T, ]+(\d{1,2}:\d{2}(:\d{2})?)([.,]\d{1,6})?"
)
"""``5.1.2026 14:03:00``: where dots stand in a date, the day comes first."""
SLASHED = re.compile(
    r"(\d{1,2})/(\d{1,2})/(\d{4})[T, ]+(\d{1,2}):(\d{2})(?::(\d{2})(?:[.,](\d{1,6}))?)?"
    r"(?: ?([ap])\.?m\.?)?",
    re.IGNORECASE,
)
"""``11/23/2026 2:03:00 PM``, ``23/11/2026 14:03``: day or month comes first."""
YEAR_FIRST = re.compile(r"(\d{4})/(\d{1,2})/(\d{1,2})(?!\d)")
CLOCK = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{2}(?:[.,]\d{1,6})?))?")
"""``14:03:00.25``: a time of day, whose day nothing says."""
TEXT = "'"
"""Before a time that a spreadsheet is to leave as it stands, as in exports of Leica."""
NOON, HOUR = 12, 3600.0


@dataclass(frozen=True, slots=True, eq=False)
class Moments:
    """When rows were measured, by a clock that another file may have, too."""

    kind: Literal["numbers", "times of day", "dates", "dates with time zones"]
    """What the times are written as: only times of one kind can be held against each other."""
    seconds: Array
    """(m,) since the zero of the clock, of dates since 1970, of times of day since the midnight
    before the first row [s]; nan of rows that are not good."""

    def rows(self, index: Index) -> "Moments":
        """The same for some rows (indices)."""
        return replace(self, seconds=self.seconds[index])


def moments_of(table: DataTable, good: Bool) -> tuple[Moments | None, tuple[str, ...]]:
    """Moments of rows (m,), of which some are good, or why there are none.

    Hours with a time zone and hours without one have no known difference.
    """
    said: tuple[str, ...] = ()
    if "time_s" in table:
        seconds = table.numbers(["time_s"])[:, 0]
    elif "time" in table:
        seconds = table.numbers(["time"])[:, 0]
        said = (f"{table.where}: the times are numbers without a unit and taken as seconds; call "
                "their column time_s if they are",)  # fmt: skip
        if not np.isfinite(seconds[good]).all():
            texts = [text.removeprefix(TEXT) for text in compress(table.texts("time"), good)]
            if (clock := _of_day(texts)) is not None:
                seconds = np.full(len(table), np.nan)
                seconds[good] = clock
                return Moments("times of day", seconds), ()
            try:
                moments = _moments(texts)
            except ValueError:
                return None, (_unread(table),)
            zoned = sum(moment.tzinfo is not None for moment in moments)
            if 0 < zoned < len(moments):
                told = f"{zoned} of {len(moments)} times state a time zone and the others do not"
                return None, (f"{table.where}: {told}: they are not used",)
            # with zones as moments in the world, without them as they stand
            zero = datetime(1970, 1, 1, tzinfo=UTC if zoned else None)
            seconds = np.full(len(table), np.nan)
            seconds[good] = [(moment - zero).total_seconds() for moment in moments]
            return Moments("dates with time zones" if zoned else "dates", seconds), ()
    else:
        return None, ()
    if not np.isfinite(seconds[good]).all():
        return None, (_unread(table),)
    return Moments("numbers", seconds), said


def _of_day(texts: Sequence[str]) -> Array | None:
    """Times of day (m,) [s], those after a midnight on; None where some are none, or go back.

    Of rows that lie more than half a day apart nothing says how many days they do.
    """
    found = [one for text in texts if (one := CLOCK.fullmatch(text)) is not None]
    if len(found) < len(texts) or not found:
        return None
    parts = np.array(
        [[float((one[k] or "0").replace(",", ".")) for k in (1, 2, 3)] for one in found]
    )
    if (parts >= (2 * NOON, 60.0, 60.0)).any():
        return None
    seconds = parts @ (HOUR, 60.0, 1.0)
    day = 2 * NOON * HOUR
    seconds = seconds + day * np.cumsum(np.diff(seconds, prepend=seconds[:1]) < -day / 2)
    steps = np.diff(seconds)
    return None if (steps < 0).any() or (steps > day / 2).any() else seconds


def times_of(
    moments: Moments | None, good: Bool, where: str
) -> tuple[Array | None, tuple[str, ...]]:
    """Times (m,) since the first good row [s], or why there are none in a file `where`.

    A clock that stands still orders nothing.
    """
    if moments is None or not good.any():
        return None, ()
    times = moments.seconds
    count = len(np.unique(times[good]))
    if good.sum() > 2 and count < good.sum() / 2:
        told = "rounded to one value" if count == 1 else f"rounded to {count} values"
        return None, (f"{where}: the times are {told} and are not used",)
    return times - times[good][0], ()


def _unread(table: DataTable) -> str:
    """The warning where times are no times."""
    how = "write them as 2026-03-01 14:05:00, or as seconds in a column time_s"
    return f"{table.where}: the times cannot be read and are not used; {how}"


def _moments(texts: Sequence[str]) -> list[datetime]:
    """The moments of a column; of slashes it decides together whether the day comes first.

    Where nothing decides it, all dates must be one: then times are apart as they are either way.

    Raises
    ------
    ValueError
        Some are no moments, or may be two.
    """
    found = [one for text in texts if (one := SLASHED.fullmatch(text)) is not None]
    if len(found) < len(texts) or not found:
        return [_moment(text) for text in texts]
    day_first = any(int(one[1]) > NOON for one in found)
    if _either_way(texts) and len({(int(one[1]), int(one[2]), one[3]) for one in found}) > 1:
        raise ValueError("the day or the month may come first")
    return [_slashed(one, day_first) for one in found]


def _either_way(texts: Sequence[str]) -> bool:
    """Whether some dates have slashes, and nothing tells day from month."""
    found = [one for text in texts if (one := SLASHED.fullmatch(text)) is not None]
    pairs = [(int(one[1]), int(one[2])) for one in found]
    return any(a != b for a, b in pairs) and all(max(pair) <= NOON for pair in pairs)


def _slashed(found: re.Match[str], day_first: bool) -> datetime:
    """The moment of a date with slashes."""
    first, second, hour = (int(found[k]) for k in (1, 2, 4))
    month, day = (second, first) if day_first else (first, second)
    if found[8]:
        hour = hour % NOON + NOON * (found[8].lower() == "p")
    seconds = f"{found[6] or '00'}.{(found[7] or '').ljust(6, '0')}"
    return _moment(f"{found[3]}-{month:02d}-{day:02d}T{hour:02d}:{found[5]}:{seconds}")


def _moment(text: str) -> datetime:
    """The moment of a date that is written as ISO 8601 does, or with dots and the day first."""
    if (dotted := DOTTED.fullmatch(text)) is not None:
        day, month, year = (int(dotted[k]) for k in (1, 2, 3))
        text = f"{year:04d}-{month:02d}-{day:02d}T{dotted[4].zfill(8 if dotted[5] else 5)}"
        text += (dotted[6] or "").replace(",", ".")
    text = YEAR_FIRST.sub(lambda one: f"{one[1]}-{one[2]:0>2}-{one[3]:0>2}", text, count=1)
    return datetime.fromisoformat(text)


def days_of(table: DataTable, good: Bool) -> tuple[str, ...]:
    """First and last ISO day of good rows (m,); none where times are no dates, or may be two."""
    texts = [text.removeprefix(TEXT) for text in compress(table.texts_of("time") or (), good)]
    try:
        dates = [text for text in texts if set("-/") & set(text) or DOTTED.fullmatch(text)]
        days = [moment.date().isoformat() for moment in _moments(dates)]
    except ValueError:
        return ()
    if _either_way(dates):
        return ()
    return (min(days), max(days)) if days and len(days) == len(texts) else ()
