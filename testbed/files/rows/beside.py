"""What columns say of the drives and of the order in which rows were measured."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Bool, Index, frozen
from testbed.files.columns import DRIVE, UNITS
from testbed.files.refusal import refusal
from testbed.files.session import rows_of
from testbed.files.table import Columns, DataTable


@dataclass(frozen=True, slots=True, eq=False)
class BesideJoints:
    """What the rows of one file say of drives and order; None where they say nothing."""

    torque: Array | None = None
    """(m, n) of each drive [N m, or N; A of currents]."""
    drive: str = ""
    """torque or current."""
    order: Array | None = None
    """(m,) numbers that sort the rows by time."""

    def rows(self, index: Index) -> "BesideJoints":
        """The same for some rows (indices)."""
        return rows_of(self, index, ("torque", "order"))


def drive_columns(table: DataTable) -> Columns | None:
    """Columns of what the drives report, in the order of the joints; None if there are none.

    Raises
    ------
    InputError
        M35: both torques and currents are there, one is there twice, or one is missing.
    """
    found: dict[str, dict[int, str]] = {}
    for name in table.names:
        stem, _, unit = name.rpartition("_")
        drive = DRIVE.fullmatch(stem)
        if drive and unit in UNITS[drive[1]]:
            others = found.setdefault(drive[1], {})
            if int(drive[2]) in others:
                message = f"{others[int(drive[2])]} and {name} are both present"
                raise refusal(table.where, stem, message, fix="keep one of them")
            others[int(drive[2])] = name
    if not found:
        return None
    if len(found) > 1:
        message = "has torques and currents of the drives"
        raise refusal(table.where, "torque1", message, fix="keep one of them")
    ((kind, columns),) = found.items()
    missing = [f"{kind}{k}" for k in range(1, max(columns) + 1) if k not in columns]
    if missing:
        raise table.incomplete(columns[max(columns)], missing, "give that of every joint")
    return Columns(tuple(columns[k] for k in sorted(columns)))


def beside_of(table: DataTable, good: Bool) -> BesideJoints:
    """What a table says of its drives and order, of rows (m,) whose numbers are good."""
    drives = drive_columns(table)
    torque, kind = None, ""
    if drives is not None:
        torque = frozen(np.where(good[:, None], table.values(drives), 0.0))
        kind = "current" if drives.names[0].startswith("current") else "torque"
    order = table.numbers(["order"])[:, 0] if "order" in table else None
    return BesideJoints(torque, kind, order)
