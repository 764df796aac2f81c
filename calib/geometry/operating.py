"""Operating conditions of poses: payload, direction of approach, drive torques and temperature."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Bool, Index, check, wrong_shape
from calib.errors import refuse
from calib.shown import Shown

STILL = 1e-4
"""A joint that moves less than this between two poses counts as not moving [rad, m]."""
_SHAPES = {
    "payload": "m", "center": "m 3", "approach": "m n", "torque": "m n", "temperature": "m"
}  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class OperatingConditions(Shown):
    """Operating conditions of m poses beside their joint values; None where not stated.

    A condition that a model needs and that is not stated takes its mean over the rows the model
    was identified from; directions of approach count as unknown.

    Examples
    --------
    A table of measurements that says which mass the arm carried:

    >>> import calib
    >>> from dataclasses import replace
    >>> table = calib.points([[0.1], [0.2]], [[0.1, 0, 0.4], [0.1, 0, 0.4]], sd=1e-5)
    >>> replace(table, conditions=calib.OperatingConditions(payload=[2.0, 5.0])).conditions
    OperatingConditions(payload)
    """

    payload: Annotated[Array, "m"] | None = None
    """(m,) mass at the flange beyond the arm's own [kg]."""
    center: Annotated[Array, "m", 3] | None = None
    """(m, 3) its center of mass in the flange frame [m]; the flange origin if left out."""
    approach: Annotated[Array, "m", "n"] | None = None
    """(m, n) direction of each joint's last move: 1, -1, or 0 if unknown."""
    torque: Annotated[Array, "m", "n"] | None = None
    """(m, n) torque that each drive reports [N m, or N; or A, where it reports its current]."""
    temperature: Annotated[Array, "m"] | None = None
    """(m,) temperature of the arm [degC]."""

    def __post_init__(self) -> None:
        there = {name: getattr(self, name) for name in self.stated}
        arrays = check(", ".join(_SHAPES[name] for name in there), **there) if there else ()
        for name, array in zip(there, arrays, strict=True):
            object.__setattr__(self, name, array)
        if self.center is not None and self.payload is None:
            message = "center is given, and payload is not"
            raise refuse("center", code="A3", message=message, fix="give the mass as well")
        if self.payload is not None and (self.payload < 0).any():
            least = float(self.payload.min())
            raise refuse("payload", least, "0 kg or more", code="A3")
        if self.approach is not None and not np.isin(self.approach, (-1.0, 0.0, 1.0)).all():
            message = "approach has other values than directions"
            raise refuse("approach", allowed="each 1, -1 or 0", code="A3", message=message)

    def __repr__(self) -> str:
        return f"OperatingConditions({', '.join(self.stated) or 'nothing stated'})"

    @property
    def stated(self) -> tuple[str, ...]:
        """Names of the conditions that are stated."""
        return tuple(name for name in _SHAPES if getattr(self, name) is not None)

    @property
    def moments(self) -> Array | None:
        """(m, 4) mass and first moments of the payload in the flange frame [kg, kg m]."""
        if self.payload is None:
            return None
        center = np.zeros((len(self.payload), 3)) if self.center is None else self.center
        return self.payload[:, None] * np.column_stack([np.ones(len(center)), center])

    @property
    def usual_payload(self) -> Array | None:
        """(4,) mean of `moments` over the poses; None if no payload is stated [kg, kg m]."""
        return None if self.moments is None else np.asarray(self.moments.mean(axis=0))

    def rows(self, which: Sequence[int] | Bool | Index) -> "OperatingConditions":
        """Conditions of some of the poses (a mask or indices)."""
        if not self.stated:
            return self
        return OperatingConditions(**{name: getattr(self, name)[which] for name in self.stated})

    def alike(self, other: "OperatingConditions") -> bool:
        """Whether both state the same conditions with equal values."""
        return self.stated == other.stated and all(
            np.array_equal(getattr(self, name), getattr(other, name)) for name in self.stated
        )

    def require_rows(self, m: int, n: int) -> None:
        """Raise an `InputError` (A1) unless all that is stated is for m poses and n joints."""
        for name in self.stated:
            shape = getattr(self, name).shape
            if shape[0] != m:
                raise refuse(name, shape[0], f"one for each of {m} poses", code="A1")
            if name in ("approach", "torque") and shape[1] != n:
                message = f"{name} has {shape[1]} columns"
                allowed = f"one for each of {n} joints"
                raise refuse(name, shape[1], allowed, code="A1", message=message)


AS_USUAL = OperatingConditions()
"""No condition stated."""


def joined_conditions(
    parts: Sequence[OperatingConditions], counts: Sequence[int]
) -> OperatingConditions:
    """Conditions of several tables stacked; `counts` are their numbers of rows.

    A table that does not state what another one does gets the mean of what is stated, and unknown
    directions. A payload without a center lies at the flange origin, whatever others state.
    """
    found = {}
    for name in _SHAPES:
        columns = [getattr(part, name) for part in parts]
        if name == "center" and any(column is not None for column in columns):
            hung = [part.payload for part in parts]
            columns = [
                np.zeros((len(mass), 3)) if column is None and mass is not None else column
                for column, mass in zip(columns, hung, strict=True)
            ]
        there = [column for column in columns if column is not None]
        if there and any(map(len, there)):
            usual = np.concatenate(there).mean(axis=0) * (name != "approach")
            found[name] = np.concatenate(
                [
                    np.tile(usual, (count, *[1] * usual.ndim)) if column is None else column
                    for column, count in zip(columns, counts, strict=True)
                ]
            )
    return OperatingConditions(**found) if found else AS_USUAL


def approaches(q: ArrayLike, order: ArrayLike | None = None) -> Array:
    """Direction (m, n) of the last move of every joint in a sequence of poses: 1, -1 or 0.

    A joint that stays keeps its last direction; 0 until it first moves.

    Parameters
    ----------
    q : (m, n) array_like
        Commanded joint values [rad, m].
    order : (m,) array_like, optional
        Sort key, such as the time of each pose; by default poses are in the order of the rows.
    """
    (q,) = check("m n", q=q)
    if order is not None and np.shape(order) != (len(q),):
        raise wrong_shape("order", np.shape(order), f"one for each of {len(q)} poses")
    at = np.arange(len(q)) if order is None else np.argsort(order, kind="stable")
    moves = np.diff(q[at], axis=0)
    sides = np.where(np.abs(moves) > STILL, np.sign(moves), 0.0)
    # the last move until each pose, by its number; the first one is none
    latest = np.where(sides != 0, np.arange(1, len(sides) + 1)[:, None], 0)
    latest = np.maximum.accumulate(latest, axis=0)
    out, known = np.zeros(q.shape), np.vstack([np.zeros((1, q.shape[1])), sides])
    out[at[1:]] = np.take_along_axis(known, latest, axis=0)
    return out
