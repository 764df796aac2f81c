"""Checks of arguments that the methods of design have in common."""

from collections.abc import Iterable

import numpy as np

from calib.arrays import Index, require_kind, whole_numbers, wrong_shape
from calib.design.problem import Problem
from calib.errors import refuse


def require_problem(problem: object) -> None:
    """Raise an `InputError` unless `problem` is a `Problem`."""
    made = "make one with Problem.of_blocks or Problem.of_poses"
    require_kind("problem", problem, Problem, "a calib.design.Problem", made)


def require_rng(rng: object) -> None:
    """Raise an `InputError` unless `rng` is a generator; a seed or a module is not."""
    seeded = "write numpy.random.default_rng(seed)"
    require_kind("rng", rng, np.random.Generator, "a numpy.random.Generator", seeded)


def require_search(problem: object, rng: object) -> None:
    """Raise an `InputError` unless there are a `Problem` and a generator."""
    require_problem(problem)
    require_rng(rng)


def require_counts(counts: object) -> Index:
    """Checked numbers of poses (k,), in the order given."""
    if isinstance(counts, str) or not isinstance(counts, Iterable):
        kind = type(counts).__name__
        message = f"counts is of the type {kind}"
        raise refuse("counts", allowed="numbers of poses", code="A3", message=message)
    sizes = whole_numbers("counts", list(counts))
    if sizes.ndim != 1:
        raise wrong_shape("counts", sizes.shape, "one number of poses after another")
    return sizes
