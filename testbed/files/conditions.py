"""What files say of the conditions of rows and targets: payload, tool and temperature."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Self

import numpy as np
from pydantic import model_validator

from calib.arrays import Array, Bool, frozen
from calib.shown import in_a_line
from calib.uncertainty.statement.conditions import Conditions, Tolerance
from testbed.bounds import COORDINATE, PAYLOAD, TEMPERATURE
from testbed.files.columns import NUMBERS
from testbed.files.refusal import refusal, require_names
from testbed.files.table import Columns, DataTable, together
from testbed.files.valid import valid_rows
from testbed.jobsheet.settings import Day
from testbed.jobsheet.sheet import JobSheet
from testbed.scenario.use import UseSettings

COLUMNS = {"payload": "payload_kg", "tool": "tool", "temperature": "temperature_degC"}
"""Kinds of conditions to what their columns, and keys of session.toml, are called."""
CENTERS = ("payload_x", "payload_y", "payload_z")
"""Stems of the columns of a payload's center."""


Coordinate = Annotated[float, COORDINATE.signed("mm")]


class SessionUse(UseSettings):
    """[use] of a session: conditions of targets that do not say theirs."""

    payload_center_mm: tuple[Coordinate, Coordinate, Coordinate] | None = None
    """Center of mass of the payload in the flange frame (of a URDF or MJCF, that of its tip); the
    flange itself if left out."""

    @model_validator(mode="after")
    def _center_of_something(self) -> Self:
        """A center belongs to a mass."""
        if self.payload_center_mm is not None and self.payload_kg is None:
            raise ValueError("payload_center_mm needs payload_kg beside it")
        return self

    def rows(self, m: int) -> Conditions:
        """The stated conditions of m rows."""
        stated = super().rows(m)
        if self.payload_center_mm is None:
            return stated
        return replace(stated, center=frozen(np.tile(self.payload_center_mm, (m, 1)) / 1e3))


class ConditionsTable(SessionUse):
    """[conditions]: under which conditions all rows were measured, where no column says it."""

    date: Day = ""
    """Printed beside the result; where it is not stated, times that are dates say it."""
    payload_tolerance_kg: Annotated[float, PAYLOAD.or_zero("kg")] = 0.5
    """Payloads that lie no further outside the measured ones are the same."""
    temperature_tolerance_k: Annotated[float, TEMPERATURE.or_zero("degC")] = 2.0
    """The same of temperatures."""

    @property
    def tolerance(self) -> Tolerance:
        """How far conditions may differ."""
        return Tolerance(self.payload_tolerance_kg, self.temperature_tolerance_k)


@dataclass(frozen=True, slots=True, eq=False)
class SetUp:
    """What all rows share: when and from where they were measured, and what that is good for."""

    use: Conditions = field(default_factory=Conditions)
    """One row: of targets that do not say theirs."""
    tolerance: Tolerance = field(default_factory=Tolerance)
    """How far targets may lie outside the conditions of the rows."""
    date: str = ""
    """ISO day, or ``FIRST to LAST``: as stated, else of the rows."""
    stations: tuple[str, ...] = ()
    """Names of the stations that were used."""
    job: JobSheet = field(default_factory=JobSheet)
    """Who measured what for whom, with which instrument."""

    def __repr__(self) -> str:
        return in_a_line(self)


def conditions_of(table: DataTable, good: Bool) -> Conditions:
    """What a table says of its rows' conditions; rows (m,) whose numbers are good are checked.

    Raises
    ------
    InputError
        M25: a payload below zero.
    """
    name = COLUMNS["payload"]
    payload, temperature = (_numbers(table, COLUMNS[kind]) for kind in ("payload", "temperature"))
    if payload is not None and (below := good & (payload < 0)).any():
        row = int(np.argmax(below))
        message, allowed = f"{name} is {payload[row]:g}", "a payload is 0 kg or more"
        raise refusal(
            table.place(row), name, message, allowed=allowed, code="M25", fix="correct it"
        )
    tools = table.texts_of(COLUMNS["tool"]) or ()
    center = table.find("length", *CENTERS)
    if center is not None and payload is None:
        raise table.incomplete(center.names[0], [name], "give the mass, or leave the center out")
    return Conditions(
        payload,
        tools if any(tools) else None,
        temperature,
        None if center is None else frozen(np.where(good[:, None], table.values(center), 0.0)),
    )


def target_conditions(table: DataTable) -> Conditions:
    """What a program says of its targets' conditions, each cell looked at.

    Raises
    ------
    InputError
        M25, V9: a cell is empty, no number, or one beyond sense.
    """
    own = Columns(tuple(name for name in NUMBERS if name in table and name in COLUMNS.values()))
    numbers = together(own, table.find("length", *CENTERS))
    if numbers.names:
        valid_rows(table, numbers, drop=None)
    found = conditions_of(table, np.ones(len(table), dtype=np.bool_))
    require_names(COLUMNS["tool"], found.tool or (), table.places)
    return found


def _numbers(table: DataTable, name: str) -> Array | None:
    """A column of numbers (m,), where it is there."""
    return table.values(Columns((name,)))[:, 0] if name in table else None


def first_stated(*several: Conditions) -> Conditions:
    """Of each kind what the first one states that states it."""
    found = {
        kind: next((getattr(one, kind) for one in several if kind in one.stated), None)
        for kind in COLUMNS
    }
    heavy = next((one for one in several if one.payload is not None), Conditions())
    return Conditions(found["payload"], found["tool"], found["temperature"], heavy.center)


def joined(parts: Sequence[tuple[str, Conditions]]) -> Conditions:
    """Conditions of the rows of several files, each with its name.

    Raises
    ------
    InputError
        M35: one file states a kind that another one does not.
    """
    found = dict[str, list[Array | tuple[str, ...]]]()
    for kind, name in COLUMNS.items():
        says = [where for where, one in parts if kind in one.stated]
        silent = [where for where, one in parts if kind not in one.stated]
        if says and silent:
            raise refusal(
                silent[0], name, f"states no {name}, and {says[0]} does",
                fix=f"give a column {name} in all files or in none, or one for all under "
                "[conditions] in session.toml",
            )  # fmt: skip
        found[kind] = [getattr(one, kind) for _, one in parts if says]
    payload, tool, temperature = found.values()
    return Conditions(
        frozen(np.concatenate(payload)) if payload else None,
        tuple(name for names in tool for name in names) if tool else None,
        frozen(np.concatenate(temperature)) if temperature else None,
        _centers([one for _, one in parts]) if payload else None,
    )


def _centers(several: Sequence[Conditions]) -> Array | None:
    """Centers (m, 3) of the payloads of all rows, at the flange where only others state one."""
    if all(one.center is None for one in several):
        return None
    there = []
    for one in several:
        count = 0 if one.payload is None else len(one.payload)
        there.append(np.zeros((count, 3)) if one.center is None else one.center)
    return frozen(np.concatenate(there))


def of_session(
    parts: Sequence[tuple[str, Conditions]], stated: ConditionsTable, m: int
) -> Conditions:
    """What the columns of all files say of m rows, or [conditions] where none does.

    Raises
    ------
    InputError
        M35: both do, or a column is in some files only.
    """
    columns, constant = joined(parts), stated.rows(m)
    for kind in columns.stated:
        if kind in constant.stated:
            where = next(where for where, one in parts if kind in one.stated)
            name = COLUMNS[kind]
            message = f"{name} is a column, and stated under [conditions] in session.toml, too"
            raise refusal(where, name, message, fix="keep one of them")
    return first_stated(columns, constant)
