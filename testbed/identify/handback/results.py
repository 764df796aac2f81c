"""What is handed back, for result.json and as tables: numbers with what holds them, the tool."""

from collections.abc import Iterator

from testbed.identify.calibration import Calibration
from testbed.identify.handback.states import (
    hand_back_words,
    handed_numbers,
    handed_robot,
    tool_words,
)
from testbed.report.text import csv_text
from testbed.robots.write.dh_table import DhRow, dh_rows
from testbed.store.quantities import AS_NAMED, METRE, Quantity, stated
from testbed.units import UM

DH_HEAD = ("number", "unit", "old", "new", "delta", "U_k2", "tolerance", "held_by")
ROUNDING = 1e-9
"""What of a number is none [mm, deg]."""
TIP_HEAD = ("pose_id", "R95_measured_target_um", "R95_tool_in_use_um", "R95_relative",
            "transfer")  # fmt: skip


def dh_csv(calibration: Calibration) -> str:
    """dh_table.csv: every number that is handed out, old and new, its U, and what holds it."""
    rows = [
        (
            *_changed(one.row),
            "" if one.row.expanded is None else f"{one.row.expanded:.3g}",
            "" if one.tolerance is None else f"{one.tolerance:.4g}",
            one.held_by,
        )
        for one in handed_numbers(calibration)
    ]
    return csv_text(DH_HEAD, rows)


def geometric_csv(calibration: Calibration) -> str:
    """dh_table.csv of the geometric model beside an extended one: for what has no joint terms.

    Without U, which its misfit would make too small.
    """
    fit = calibration.fits[0]
    handed, parameters = handed_robot(calibration, fit), fit.identification.parameters
    free = parameters.freeing(parameters.names)
    rows = dh_rows(calibration.before, handed.model, free, handed.covariance)
    return csv_text(DH_HEAD[:5], [_changed(row) for row in rows])


def _changed(row: DhRow) -> tuple[str, ...]:
    """Name, unit, old and new value of a number, and their difference."""
    values = (row.old, row.new, row.delta)
    return (row.name, row.unit, *(f"{x if abs(x) > ROUNDING else 0.0:.9g}" for x in values))


def hand_back_numbers(calibration: Calibration) -> Iterator[Quantity]:
    """The rule, what held the links, and what is believed of the tool in use."""
    given = calibration.handback
    yield Quantity("sentences", hand_back_words(calibration))
    yield Quantity("links_held_because", given.why or None)
    found = given.in_use
    if found is None:
        yield Quantity("tool_in_use", None)
        return
    yield Quantity("tool_in_use/name", found.tool.name)
    yield Quantity("tool_in_use/sentences", tool_words(calibration))
    yield stated("tool_in_use/point_mm", found.worst, METRE)
    yield Quantity("tool_in_use/R95_mean_um", found.radius_mean, METRE)
    yield Quantity("tool_in_use/R95_move_um", found.radius_move, METRE)
    yield Quantity("tool_in_use/largest_R95_um", float(found.at_poses.max()), METRE)
    yield Quantity("tool_in_use/transfer_largest", float(found.transfer.max()), AS_NAMED)


def tool_csv(calibration: Calibration) -> str | None:
    """tool_in_use.csv: R95 at each judged pose, of the target measured and of the tool in use."""
    found = calibration.handback.in_use
    if found is None:
        return None
    rows = [
        (
            calibration.pose_names[pose],
            f"{found.measured_at_poses[k] * UM:.4g}",
            f"{found.at_poses[k] * UM:.4g}",
            "yes" if calibration.relative else "no",
            f"{found.transfer[k]:.3g}",
        )
        for k, pose in enumerate(calibration.stated_poses)
    ]
    return csv_text(TIP_HEAD, rows)
