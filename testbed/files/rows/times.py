"""When each row was measured: seconds since the first one, and days."""

import re
from datetime import datetime

import numpy as np

from calib.arrays import Array, Bool
from testbed.files.table import DataTable

DOTTED = re.compile(
    r"(\d{1,2})\. ?(\d{1,2})\. ?(\d{4})[T, ]+(\d{1,2}:\d{2}(:\d{2})?)([.,]\d{1,6})?"
)
"""``5.1.2026 14:03:00``: where dots stand in a date, the day comes first."""


def times_of(table: DataTable, good: Bool) -> tuple[Array | None, tuple[str, ...]]:
    """Times [s] of rows (m,), of which some are good, or why there are none.

    A clock that stands still orders nothing, and hours with a time zone and hours without one have
    no known difference.
    """
    said: tuple[str, ...] = ()
    if "time_s" in table:
        times = table.numbers(["time_s"])[:, 0]
    elif "time" in table:
        times = table.numbers(["time"])[:, 0]
        said = (f"{table.where}: the times are numbers without a unit and taken as seconds; call "
                "their column time_s if they are",)  # fmt: skip
        if not np.isfinite(times[good]).all():
            said, texts = (), table.texts("time")
            try:
                moments = [_moment(texts[row]) for row in np.flatnonzero(good)]
            except ValueError:
                return None, (_unread(table),)
            zoned = sum(moment.tzinfo is not None for moment in moments)
            if 0 < zoned < len(moments):
                told = f"{zoned} of {len(moments)} times state a time zone and the others do not"
                return None, (f"{table.where}: {told}: they are not used",)
            # with zones as moments in the world, without them as they stand
            times = np.zeros(len(table))
            times[good] = [(moment - moments[0]).total_seconds() for moment in moments]
    else:
        return None, ()
    if not np.isfinite(times[good]).all():
        return None, (_unread(table),)
    count = len(np.unique(times[good]))
    if good.sum() > 2 and count < good.sum() / 2:
        told = "rounded to one value" if count == 1 else f"rounded to {count} values"
        return None, (f"{table.where}: the times are {told} and are not used",)
    return times - times[good][:1], said


def _unread(table: DataTable) -> str:
    """The warning where times are no times."""
    how = "write them as 2026-03-01 14:05:00, or as seconds in a column time_s"
    return f"{table.where}: the times cannot be read and are not used; {how}"


def _moment(text: str) -> datetime:
    """The moment of a date that is written as ISO 8601 does, or with dots and the day first."""
    if (dotted := DOTTED.fullmatch(text)) is not None:
        day, month, year = (int(dotted[k]) for k in (1, 2, 3))
        text = f"{year:04d}-{month:02d}-{day:02d}T{dotted[4].zfill(8 if dotted[5] else 5)}"
        text += (dotted[6] or "").replace(",", ".")
    return datetime.fromisoformat(text)


def days_of(table: DataTable, good: Bool) -> tuple[str, ...]:
    """First and last ISO day of good rows (m,); none where times are no dates."""
    times = table.texts_of("time") or ()
    texts = [times[row] for row in np.flatnonzero(good)] if times else []
    try:
        dates = [text for text in texts if "-" in text or DOTTED.fullmatch(text)]
        days = [_moment(text).date().isoformat() for text in dates]
    except ValueError:
        return ()
    return (min(days), max(days)) if days and len(days) == len(texts) else ()
