"""Certificates: how close a pose set is to the best possible one, proven by relaxation."""

from dataclasses import dataclass
from math import ceil, floor

import numpy as np
from numpy.typing import ArrayLike

from calib.design.borders import require_problem
from calib.design.problem import Problem
from calib.design.relaxation import ITERATIONS, TOLERANCE, relaxation
from calib.information.criteria.base import Certifiable, Criterion
from calib.information.criteria.d import D
from calib.information.criteria.spectral import Spectral
from calib.information.criteria.whitened import relative_rounding
from calib.kinds import in_short
from calib.shown import Shown, length_unit

CERTAIN = 1e-9
"""Relative difference below which two figures count as equal."""
KNOWN = 1e-3
"""Largest relative rounding error of the smallest eigenvalue at which that is certified."""


@dataclass(frozen=True, slots=True, eq=False)
class Certificate(Shown):
    """A proven bound on all sets of the same size from the same pool, and this set against it."""

    value: float
    """Value of the criterion, larger is better: D log det M; A, V, G minus variance; E lambda_min.
    """
    bound: float
    """No set of this size has a larger value."""
    efficiency: float
    """Proven lower bound, 0 to 1, on det^(1/p) for D, else on the figure, relative to the best."""
    figure: float
    """Figure of the set: O1, u of the tool point [m], O3, ..."""
    figure_bound: float
    """No set of this size has a better figure."""
    iterations: int
    """Number of steps of the relaxation."""
    sentence: str
    """The certificate in words."""

    def __repr__(self) -> str:
        return f"Certificate({self.sentence})"


@in_short
def certify(
    problem: Problem,
    indices: ArrayLike,
    *,
    iterations: int = ITERATIONS,
    tolerance: float = TOLERANCE,
) -> Certificate | None:
    """Certify a set against every other set of its size; None for O2, O4, O5 (see `no_proof`).

    Parameters
    ----------
    problem : Problem
        The problem that the set is a solution of.
    indices : (m,) array_like of int
        The set, as indices in the pool, without the poses given.
    iterations, tolerance
        As in `relaxation`; the bound holds after any number of steps.

    References
    ----------
    The bounds are those of `calib.design.relaxation.relaxation`.
    """
    require_problem(problem)
    chosen = problem.require_set(indices, "indices")
    return certificate_of(problem, chosen, iterations=iterations, tolerance=tolerance)


def certificate_of(
    problem: Problem,
    chosen: ArrayLike,
    *,
    iterations: int = ITERATIONS,
    tolerance: float = TOLERANCE,
) -> Certificate | None:
    """Certificate of a set (m,); None if no bound is known or M is singular."""
    criterion = problem.criterion
    M = problem.information(chosen)
    value = float(criterion.value(M))
    if not isinstance(criterion, Certifiable) or not np.isfinite(value):
        return None
    if problem.is_singular(chosen):
        return None
    if isinstance(criterion, Spectral) and relative_rounding(M, any_units=False) > KNOWN:
        return None  # its smallest eigenvalue is rounding, in the units as they are
    relaxed = relaxation(problem, iterations=iterations, tolerance=tolerance)
    return certificate_of_bound(problem, criterion, value, relaxed.bound, len(relaxed.trace))


def certificate_of_bound(
    problem: Problem, criterion: Certifiable, value: float, bound: float, iterations: int = 0
) -> Certificate:
    """Certificate from the value of a set and a proven bound."""
    p, n = problem.p, problem.n_poses
    # a set that reaches the bound may lie above it by the rounding of both
    bound = max(bound, value)
    efficiency = min(criterion.efficiency(value, bound, p), 1.0)
    figure = criterion.figure_of_value(value, p, n)
    limit = criterion.figure_of_value(bound, p, n)
    sentence = _sentence(problem, criterion, efficiency, figure, limit)
    return Certificate(value, bound, efficiency, figure, limit, iterations, sentence)


def no_proof(criterion: str | Criterion) -> str:
    """Sentence on why a set chosen by this criterion has no certificate."""
    name = criterion if isinstance(criterion, str) else criterion.name
    if name in ("O2", "O4", "O5"):
        return f"no certificate: no bound on the best possible {name} is known"
    if name in ("E", "O3"):
        return "no certificate: the set leaves a direction unseen, or next to it in these units"
    return "no certificate: the set leaves a direction unseen"


def _sentence(
    problem: Problem, criterion: Certifiable, efficiency: float, figure: float, limit: float
) -> str:
    """The certificate in words."""
    # rounded down, so that the sentence is true; up to CERTAIN counts as equal
    change = _more(1 / efficiency if criterion.larger_is_better else 2 - efficiency)
    part = f"{floor(min(efficiency + CERTAIN, 1.0) * 1000) / 1000:.3f}"
    of = f"no {problem.m} of the {int(problem.open.sum())} poses"
    if isinstance(criterion, D):
        its = "an O1" if criterion.name == "O1" else f"a {criterion.name}"
        more = _more(limit / figure)
        return f"D-efficiency at least {part} in det^(1/p): {of} have {its} {more} larger"
    if criterion.unit == "m" and criterion.name != "A":
        which = "worst" if criterion.name == "G" else "RMS"
        scale, unit = length_unit([limit, figure])
        return (
            f"{criterion.name}-efficiency at least {part}: {of} give a tool point u ({which}) "
            f"below {limit * scale:.4g} {unit}; this set gives {figure * scale:.4g} {unit}"
        )
    word = "larger" if criterion.larger_is_better else "smaller"
    return f"{criterion.name}-efficiency at least {part}: {of} have a figure {change} {word}"


def _more(factor: float) -> str:
    """A factor just above one in words, in percent."""
    # rounded up, as the efficiency is rounded down
    percent = ceil(1e4 * (factor - 1)) / 100
    return f"more than {percent:g} %" if factor - 1 > CERTAIN else "any"
