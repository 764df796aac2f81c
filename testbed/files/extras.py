"""The columns that may stand beside joints or readings: pose, visit, split, approach and time."""

from dataclasses import dataclass
from datetime import datetime

import numpy as np

from calib.arrays import Array, Index
from testbed.files.refusal import refusal
from testbed.files.session import rows_of
from testbed.files.table import DataTable
from testbed.strict import choice_of

SPLITS = ("identify", "test")


@dataclass(frozen=True, slots=True, eq=False)
class Extras:
    """What a file says of its rows besides joints and readings; None where it says nothing."""

    pose: tuple[str, ...] | None = None
    repeat: Index | None = None
    split: tuple[str, ...] | None = None
    approach: tuple[str, ...] | None = None
    temperature: Array | None = None
    time: Array | None = None
    warnings: tuple[str, ...] = ()

    def rows(self, index: Index) -> "Extras":
        """The same for some rows (indices)."""
        columns = ("pose", "repeat", "split", "approach", "temperature", "time")
        return rows_of(self, index, columns)


def extras_of(table: DataTable) -> Extras:
    """The columns of a table that say when, how and what for.

    Raises
    ------
    InputError
        M35: a split that is neither identify nor test; a repeat that is no whole number.
    """
    split = table.texts_of("split")
    for row, word in enumerate(split or ()):
        if word not in SPLITS:
            fix = choice_of(word, SPLITS) if len(word) > 2 else ""
            raise refusal(
                table.place(row), "split", f'split is "{word[:20]}"', value=word[:20],
                allowed="it is identify or test", fix=fix,
            )  # fmt: skip
    time, warnings = _times(table)
    name = "temperature_degC"
    return Extras(
        pose=table.texts_of("pose_id"),
        repeat=_repeats(table) if "repeat" in table else None,
        split=split,
        approach=table.texts_of("approach"),
        temperature=table.numbers([name])[:, 0] if name in table else None,
        time=time,
        warnings=warnings,
    )


def _repeats(table: DataTable) -> Index:
    """Which visit each row is."""
    values = table.numbers(["repeat"])[:, 0]
    wrong = ~(np.isfinite(values) & (values >= 0) & (values == np.floor(values)) & (values < 1e9))
    if wrong.any():
        row = int(np.argmax(wrong))
        message = f'repeat is "{table.texts("repeat")[row][:20]}"'
        allowed = "it is a whole number, 0 for the first visit"
        raise refusal(table.place(row), "repeat", message, allowed=allowed, fix="mend it")
    return values.astype(np.int64)


def _times(table: DataTable) -> tuple[Array | None, tuple[str, ...]]:
    """Times [s], or why there are none: a clock that stands still orders nothing."""
    if "time_s" in table:
        times = table.numbers(["time_s"])[:, 0]
    elif "time" in table:
        times = _clock(table)
    else:
        return None, ()
    if not np.isfinite(times).all():
        return None, (f"{table.where}: the times cannot be read and are not used",)
    count = len(np.unique(times))
    if len(times) > 2 and count < len(times) / 2:
        return None, (f"{table.where}: the times are rounded to {count} values and are not used",)
    return times - times[:1], ()


def _clock(table: DataTable) -> Array:
    """Times of a column of numbers [s] or of ISO dates; nan where it is neither."""
    numbers = table.numbers(["time"])[:, 0]
    if np.isfinite(numbers).all():
        return numbers
    try:
        # an hour without zone is taken as it stands: only differences count
        moments = [
            datetime.fromisoformat(text).replace(tzinfo=None) for text in table.texts("time")
        ]
    except ValueError:
        return np.full(len(table), np.nan)
    return np.array([86400.0 * moment.toordinal() + _seconds(moment) for moment in moments])


def _seconds(moment: datetime) -> float:
    """Seconds since midnight."""
    return moment.hour * 3600 + moment.minute * 60 + moment.second + moment.microsecond / 1e6
