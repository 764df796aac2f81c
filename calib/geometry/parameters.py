"""Which numbers of a model are free, and in what units their columns are scaled."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from itertools import compress
from typing import Annotated

import numpy as np

from calib.arrays import Array, Bool, check, frozen
from calib.errors import refuse
from calib.geometry.model import RobotModel
from calib.kinds import checked_kinds, of_kind
from calib.shown import Shown

CHARACTERISTIC_LENGTH = 0.3
"""L [m]: one radian counts as L meters in scaled columns and rows; about half a TX60's reach."""
SCALE_OF = "scale"
"""What the name of a slide's scale begins with; the number of the joint follows."""
PER_METER = 0.01
"""Argument of the sine that stands for a scale, per meter of travel [rad/m]: its beginning is a
straight line, within 0.2 % of the error at 10 m."""


@dataclass(frozen=True, slots=True, eq=False)
class Parameters(Shown):
    """Names of all P numbers of a model, the free ones, and their column scale."""

    names: Annotated[tuple[str, ...], "P"]
    """(P,) as in `RobotModel.names`."""
    is_length: Annotated[Bool, "P"]
    """(P,) whether a number is a length [m]; else it counts as an angle [rad]."""
    free: Annotated[Bool, "P"]
    """(P,) whether a number is identified; the others keep the value that the model has."""
    scale: Annotated[Array, "P"]
    """(P,) step of each number that counts as one scaled unit: 1 m, or 1/L rad for angles."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "names", of_kind("names", self.names, Sequence[str]))
        p = len(self.names)
        (scale,) = check(f"{p}", scale=self.scale)
        if (scale <= 0).any():
            raise refuse("scale", code="A3", message="scale must be positive")
        object.__setattr__(self, "scale", scale)
        for name in ("is_length", "free"):
            (flags,) = check(f"{p}", **{name: getattr(self, name)})
            object.__setattr__(self, name, frozen(flags != 0, np.bool_))

    def __repr__(self) -> str:
        return f"Parameters({self.n_free} of {len(self.names)} free)"

    @property
    def free_names(self) -> tuple[str, ...]:
        """(f,) names of the free numbers, in the order of the full vector."""
        return tuple(compress(self.names, self.free.tolist()))

    @property
    def n_free(self) -> int:
        """Number f of free numbers."""
        return int(self.free.sum())

    @property
    def free_index(self) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
        """(f,) indices of the free numbers in the full vector."""
        return np.flatnonzero(self.free)

    @property
    def free_scale(self) -> Array:
        """(f,) column scale of the free numbers [m or rad]."""
        return self.scale[self.free]

    @checked_kinds
    def freeing(self, names: Iterable[str]) -> "Parameters":
        """Same table with exactly `names` free; an unknown name is an `InputError` (A4)."""
        wanted, known = dict.fromkeys(map(str, names)), set(self.names)
        for name in wanted:
            if name not in known:
                close = get_close_matches(name, self.names, 1)
                raise refuse(
                    "free",
                    name,
                    code="A4",
                    message=f'no parameter is called "{name}"',
                    fix=f'did you mean "{close[0]}"?' if close else "see the model's names",
                )
        return replace(self, free=np.array([name in wanted for name in self.names]))

    def expand(self, step: Array) -> Array:
        """Full step (P,) from a step of the free numbers (f,) [m, rad]."""
        full = np.zeros(len(self.names))
        full[self.free] = step
        return full


def is_scale(name: str) -> bool:
    """Whether a number is the scale of a slide, the amplitude of a sine of `PER_METER`."""
    return name.rstrip("0123456789") == SCALE_OF != name


def shown_in(name: str, is_length: bool) -> tuple[str, float]:
    """Unit in which people read a number, and its value in that unit per SI unit."""
    if name == "lengths":
        return "1e-6/K", 1e6
    if is_scale(name):
        return "um/m", 1e6 * PER_METER
    if name.startswith("moment"):
        return ("kg", 1.0) if name.endswith(".m") else ("kg m", 1.0)
    unit, scale = ("mm", 1e3) if is_length else ("deg", float(np.degrees(1.0)))
    return (f"{unit} per N m, N or A" if name.startswith("torque") else unit), scale


@checked_kinds
def parameters_of(
    model: RobotModel, free: Iterable[str] | None = None, *, length: float = CHARACTERISTIC_LENGTH
) -> Parameters:
    """Parameter table of a model; all numbers free unless `free` names some.

    Parameters
    ----------
    model : RobotModel
        Model whose numbers are listed.
    free : iterable of str, optional
        Names of the numbers to identify.
    length : float
        Characteristic length L [m].

    Raises
    ------
    InputError
        A3: `length` is not above zero, or two numbers have one name; A4: a name in `free` is
        unknown.
    """
    if not length > 0:
        raise refuse("length", length, "above 0 m", code="A3")
    names = model.names
    if len({*names}) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        message, fix = f"two numbers of the model are called {twice}", "rename the term"
        raise refuse("names", twice, code="A3", message=message, fix=fix)
    is_length = np.array(model.is_length)
    table = Parameters(
        names, is_length, np.ones(len(names), dtype=bool), np.where(is_length, 1.0, 1.0 / length)
    )
    return table if free is None else table.freeing(free)
