"""Checks of indices in a pool, and of how many of its poses are wanted."""

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import AnyArray, Bool, Index, frozen
from calib.errors import InputError, refuse

LARGER_POOL = "enlarge the pool or choose fewer poses"
NO_POSES = frozen(np.zeros(0), np.int64)


def array_of(values: ArrayLike) -> AnyArray:
    """Values as an array; one of objects if rows differ in length."""
    try:
        return np.asarray(values)
    except ValueError:
        return np.empty(1, dtype=object)  # refused by its type


def places_of(given: ArrayLike, n: int) -> Index:
    """Checked indices (k,) in a pool of n.

    Raises
    ------
    InputError
        A3: they are no indices of the pool; M31: one comes twice.
    """
    places = array_of(given)
    places = places if places.size else NO_POSES
    whole = places.ndim == 1 and np.issubdtype(places.dtype, np.integer)
    if not whole or (places < 0).any() or (places >= n).any():
        message = "given is not a list of places in the pool"
        raise refuse("given", allowed=f"numbers from 0 to {n - 1}", code="A3", message=message)
    unique, counts = np.unique(places, return_counts=True)
    if (counts > 1).any():
        twice = int(unique[np.argmax(counts > 1)])
        raise refuse(
            "given",
            twice,
            "each pose once",
            code="M31",
            message=f"pose {twice} is given {counts.max()} times",
            fix="remove the repetition, or put what it told into the prior",
        )
    return frozen(places, np.int64)


def mask_of(allowed: ArrayLike | None, n: int) -> Bool:
    """Checked mask (n,) of poses that may be chosen; all if `allowed` is None."""
    may = np.ones(n, dtype=bool) if allowed is None else array_of(allowed).copy()
    if may.shape != (n,) or may.dtype != np.bool_:
        message, wanted = f"allowed has shape {may.shape} of {may.dtype}", f"each of {n} poses"
        raise refuse("allowed", allowed=f"true or false for {wanted}", code="A1", message=message)
    return may


def poses_wanted(poses: int, allowed: str, fix: str) -> InputError:
    """The error (M27) for a number of poses that is not possible."""
    message = f"{poses} poses wanted"
    return refuse("m", poses, allowed, code="M27", message=message, fix=fix)
