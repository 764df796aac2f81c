"""When each row was measured: seconds since the first one, and days."""

from datetime import datetime

import numpy as np

from calib.arrays import Array, Bool
from testbed.files.table import DataTable


def times_of(table: DataTable, good: Bool) -> tuple[Array | None, tuple[str, ...]]:
    """Times [s] of rows (m,), of which some are good, or why there are none.

    A clock that stands still orders nothing, and hours with a time zone and hours without one have
    no known difference.
    """
    if "time_s" in table:
        times = table.numbers(["time_s"])[:, 0]
    elif "time" in table:
        times = table.numbers(["time"])[:, 0]
        if not np.isfinite(times).all():
            try:
                moments = [datetime.fromisoformat(text) for text in table.texts("time")]
            except ValueError:
                return None, (_unread(table),)
            zoned = sum(moment.tzinfo is not None for moment in moments)
            if 0 < zoned < len(moments):
                told = f"{zoned} of {len(moments)} times state a time zone and the others do not"
                return None, (f"{table.where}: {told}: they are not used",)
            # with zones as moments in the world, without them as they stand
            times = np.array([(moment - moments[0]).total_seconds() for moment in moments])
    else:
        return None, ()
    if not np.isfinite(times[good]).all():
        return None, (_unread(table),)
    count = len(np.unique(times[good]))
    if good.sum() > 2 and count < good.sum() / 2:
        told = "rounded to one value" if count == 1 else f"rounded to {count} values"
        return None, (f"{table.where}: the times are {told} and are not used",)
    return times - times[good][:1], ()


def _unread(table: DataTable) -> str:
    """The warning where times are no times."""
    return f"{table.where}: the times cannot be read and are not used"


def days_of(table: DataTable, good: Bool) -> tuple[str, ...]:
    """First and last ISO day of good rows (m,); none where times are no dates."""
    times = table.texts_of("time") or ()
    texts = [times[row] for row in np.flatnonzero(good)] if times else []
    try:
        days = [datetime.fromisoformat(text).date().isoformat() for text in texts if "-" in text]
    except ValueError:
        return ()
    return (min(days), max(days)) if days and len(days) == len(texts) else ()
