"""What every method of design asks of its caller before anything is computed."""

from collections.abc import Iterable

import numpy as np

from calib.arrays import Index, require_kind, whole_numbers, wrong_shape
from calib.design.problem import Problem
from calib.errors import refuse


def require_problem(problem: object) -> None:
    """Refuse what is no problem."""
    made = "make one with Problem.of_blocks or Problem.of_poses"
    require_kind("problem", problem, Problem, "a calib.design.Problem", made)


def require_rng(rng: object) -> None:
    """Refuse what is no generator: a seed, a module."""
    seeded = "write numpy.random.default_rng(seed)"
    require_kind("rng", rng, np.random.Generator, "a numpy.random.Generator", seeded)


def require_search(problem: object, rng: object) -> None:
    """Refuse what cannot be searched."""
    require_problem(problem)
    require_rng(rng)


def require_counts(counts: object) -> Index:
    """Numbers of poses (k,) as they were given, after refusing what holds none."""
    if isinstance(counts, str) or not isinstance(counts, Iterable):
        kind = type(counts).__name__
        message = f"counts is of the type {kind}"
        raise refuse("counts", allowed="numbers of poses", code="A3", message=message)
    sizes = whole_numbers("counts", list(counts))
    if sizes.ndim != 1:
        raise wrong_shape("counts", sizes.shape, "one number of poses after another")
    return sizes
