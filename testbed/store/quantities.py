"""Published figures: a value under a name that ends in its unit, for result.json and arrays.npz."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, get_type_hints

import numpy as np

from calib.arrays import Array
from testbed.units import DEG, MDEG, MM, UM, Mean

STATED = 12
"""Significant digits of numbers that people state, or fewer."""


@dataclass(frozen=True, slots=True)
class Unit:
    """What a number is kept in, and under which endings of its name it may be shown."""

    kept: str
    factors: Mapping[str, float]
    """Shown per kept unit, by the ending of the name."""

    def factor(self, name: str) -> float:
        """Factor to the unit that a name ends in: ``mean_mm``, or ``budget_um/tracker``.

        Raises
        ------
        ValueError
            The name does not end in one of the units, or it does and the number has none.
        """
        endings = [part.rpartition("_")[2] for part in reversed(name.split("/"))]
        if self == ONE and endings[0] in {*METRE.factors, *RADIAN.factors}:
            raise ValueError(f'"{name}" ends in a unit, but the number has none')
        if not self.factors:
            return 1.0
        if unit := next((ending for ending in endings if ending in self.factors), None):
            return self.factors[unit]
        raise ValueError(f'"{name}" does not end in one of {", ".join(self.factors)}')


METRE = Unit("metre", {"m": 1.0, "mm": MM, "um": UM})
RADIAN = Unit("radian", {"rad": 1.0, "urad": UM, "deg": DEG, "mdeg": MDEG})
SECOND = Unit("second", {"s": 1.0})
ONE = Unit("one", {})
"""A count, a share, a ratio, a word."""
AS_NAMED = Unit("as its name says", {})
"""Already in the unit of the name, or in several: nothing is converted or checked."""


def declared(record: type, name: str) -> Unit:
    """Unit of a record's field, ``radius: Annotated[Array, METRE]``; ONE if it declares none."""
    notes = getattr(get_type_hints(record, include_extras=True)[name], "__metadata__", ())
    return next((note for note in notes if isinstance(note, Unit)), ONE)


@dataclass(frozen=True, slots=True)
class Quantity:
    """One figure that a campaign publishes, under a name that ends in its unit."""

    name: str
    """Path in result.json, ``trials/optimal-29/mean_mm``; also its name in arrays.npz."""
    value: object
    """In `unit`: a number, an array, a Mean, lists and mappings of them; a word, None."""
    unit: Unit = ONE

    def __post_init__(self) -> None:
        self.unit.factor(self.name)  # a name without its unit is refused here

    @property
    def shown(self) -> Any:
        """The value in the unit of the name, as JSON has it: a Mean with its interval."""
        return _shown(self.value, self.unit.factor(self.name))

    @property
    def array(self) -> np.ndarray[Any, Any]:
        """The value in the unit of the name, as arrays.npz has it."""
        factor, array = self.unit.factor(self.name), np.asarray(self.value)
        return array if factor == 1.0 else array * factor


def _shown(value: Any, factor: float) -> Any:
    """A value times a factor, in the types of JSON."""
    if isinstance(value, Mapping):
        return {str(key): _shown(item, factor) for key, item in value.items()}
    if isinstance(value, Mean):  # a printed figure has no interval, nor has that of one pool
        ends = (value.low, value.high) if 0.0 < value.half_width < float("inf") else None
        return _shown({"value": value.value, "ci_95": ends}, factor)
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [_shown(item, factor) for item in value]
    if value is None or isinstance(value, bool | str) or factor == 1.0:
        return value
    return value * factor


def stated(name: str, value: float | Sequence[float] | Array, unit: Unit) -> Quantity:
    """What somebody stated, without the rounding of the unit that it is kept in.

    Examples
    --------
    >>> tolerance = 60 * 1e-6
    >>> tolerance * 1e6, stated("tolerance_um", tolerance, METRE).shown
    (59.99999999999999, 60.0)
    """
    shown = np.asarray(value) * unit.factor(name)
    numbers = [float(f"{number:.{STATED}g}") for number in shown.ravel().tolist()]
    return Quantity(name, numbers if shown.ndim else numbers[0], AS_NAMED)


def unitless(values: Mapping[str, object]) -> list[Quantity]:
    """Counts, shares and words, which have no unit."""
    return [Quantity(name, value) for name, value in values.items()]


def in_si(values: Mapping[str, object]) -> list[Quantity]:
    """Arrays as memory has them: in metres or radians where the name ends in ``_m`` or ``_rad``."""
    units = {"m": METRE, "rad": RADIAN}
    return [
        Quantity(name, value, units.get(name.rpartition("_")[2], ONE))
        for name, value in values.items()
    ]


def as_json(quantities: Iterable[Quantity]) -> dict[str, Any]:
    """Quantities as a document for result.json: a table for each part of their names.

    Examples
    --------
    >>> as_json([Quantity("robots", 8), Quantity("error/mean_mm", 0.25, METRE)])
    {'robots': 8, 'error': {'mean_mm': 250.0}}
    """
    document: dict[str, Any] = {}
    for quantity in quantities:
        *path, last = quantity.name.split("/")
        table = document
        for part in path:
            table = table.setdefault(part, {})
        if last in table:
            raise ValueError(f'"{quantity.name}" is published twice')
        table[last] = quantity.shown
    return document


def as_arrays(quantities: Iterable[Quantity]) -> dict[str, np.ndarray[Any, Any]]:
    """Quantities as the arrays of arrays.npz, by their whole names."""
    return {quantity.name: quantity.array for quantity in quantities}


def below(path: str, quantities: Iterable[Quantity]) -> list[Quantity]:
    """The same quantities in a table of their own: ``mean_mm`` becomes ``path/mean_mm``."""
    return [replace(one, name=f"{path}/{one.name}") for one in quantities]


def fields_of(record: object, names: Mapping[str, str]) -> list[Quantity]:
    """Fields of a record as quantities, ``{"radius_m": "radius"}``, in their declared units."""
    return [
        Quantity(name, getattr(record, field), declared(type(record), field))
        for name, field in names.items()
    ]
