"""Under which conditions a calibration was measured, in words and numbers."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from calib.arrays import Bool
from calib.uncertainty.statement.conditions import UNITS, Conditions
from calib.uncertainty.statement.departure import counted, departure
from testbed.files.conditions import SetUp
from testbed.identify.calibration import Calibration
from testbed.store.quantities import AS_NAMED, Quantity
from testbed.units import listed


def conditions_words(calibration: Calibration) -> str:
    """What was mounted, how warm it was, from where and when; what of it nobody stated."""
    rows, set_up = measured(calibration), calibration.set_up
    by, parts = set_up.job.instrument, [rows.phrase] if rows.stated else []
    if by.name:
        serial = f" (serial number {by.serial_number})" if by.serial_number else ""
        parts.append(f"by {by.name}{serial}")
    if set_up.stations:
        parts.append(f"from station{'s' * (len(set_up.stations) > 1)} {listed(set_up.stations)}")
    if set_up.date:
        parts.append(f"{'from' if ' to ' in set_up.date else 'on'} {set_up.date}")
    said = [f"Measured {' '.join(parts)}."] if parts else []
    if missing := [kind for kind in UNITS if kind not in rows.stated]:
        are, they = ("are", "they stay") if len(missing) > 1 else ("is", "it stays")
        text = f"{listed(missing)} {are} not stated"
        said.append(f"{text[0].upper()}{text[1:]}: the results hold as long as {they} the same.")
    return " ".join(said)


def held_out_departs(
    conditions: Conditions, set_up: SetUp, used: Bool, is_test: Bool
) -> tuple[str, ...]:
    """How the conditions of held-out rows differ from those of the training rows, by kind."""
    there = conditions.rows(is_test)
    found = departure(conditions.rows(used), there, int(is_test.sum()), set_up.tolerance)
    return tuple(found.clauses(partial(counted, "held-out row"), "the training rows").values())


def held_out_warnings(
    conditions: Conditions, set_up: SetUp, used: Bool, is_test: Bool
) -> tuple[str, ...]:
    """What judges a calibration under other conditions than it was made, by kind of condition."""
    return tuple(
        f"{said}: they judge the calibration under other conditions than those it was made under"
        for said in held_out_departs(conditions, set_up, used, is_test)
    )


def measured(calibration: Calibration) -> Conditions:
    """Conditions of all rows that a statement rests on: identified from, and held out."""
    return calibration.conditions.rows(calibration.is_used | calibration.split.is_test)


def conditions_numbers(calibration: Calibration) -> Iterator[Quantity]:
    """The same for result.json: ranges, names, day."""
    rows, set_up = measured(calibration), calibration.set_up
    for name, values in (("payload_kg", rows.payload), ("temperature_degC", rows.temperature)):
        span = None if values is None else [np.min(values), np.max(values)]
        yield Quantity(name, span, AS_NAMED)
    yield Quantity("tools", list(dict.fromkeys(rows.tool or ())))
    yield Quantity("stations", set_up.stations)
    yield Quantity("date", set_up.date or None)
    yield Quantity("sentence", conditions_words(calibration))
