"""A cache of predictions for work that needs the same ones many times."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from typing import TypeVar

from calib.geometry.model import RobotModel
from calib.measurement.observations import COLUMNS, Measurements

X = TypeVar("X")
Known = dict[tuple[object, ...], tuple[RobotModel, Measurements, object]]

MOST = 6
"""Latest results that are kept. Rows of many poses and many numbers take much memory."""
SEEN = tuple(name for name in COLUMNS if name != "covariance")
"""Columns of a table that a prediction depends on: all but the noise."""

_known: ContextVar[Known | None] = ContextVar("known", default=None)


@contextmanager
def remembering() -> Iterator[None]:
    """Within this context, a prediction of one model for one table is computed once.

    Tables count as the same if their columns are the same arrays, whatever their noise is.
    """
    token = _known.set({})
    try:
        yield
    finally:
        _known.reset(token)


def remembered(
    compute: Callable[[RobotModel, Measurements], X],
) -> Callable[[RobotModel, Measurements], X]:
    """Decorate a function (model, table) -> result, so that within `remembering` it is cached.

    The result must be read-only, since several callers share it.
    """

    @wraps(compute)
    def once(model: RobotModel, measurements: Measurements) -> X:
        known = _known.get()
        if known is None:
            return compute(model, measurements)
        columns = (id(getattr(measurements, name)) for name in SEEN)
        key = (compute.__name__, id(model), *columns, id(measurements.conditions))
        # model and table are held, so that no other object has their place in memory
        found = known.pop(key, None) or (model, measurements, compute(model, measurements))
        known[key] = found
        if len(known) > MOST:
            del known[next(iter(known))]
        return found[2]  # type: ignore[return-value]  # of this function, by its name

    return once
