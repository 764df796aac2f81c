"""Frames for nominal links from rows of one tool, and their refinement on rows of all tools."""

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, Index
from calib.errors import refuse
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters, parameters_of
from calib.identification.start.alignment import (
    SCALE,
    Alignment,
    StartProblem,
    refine,
    start_problem,
)
from calib.identification.start.guesses import initial_guesses
from calib.identification.sufficiency import require_equations
from calib.information.reduction import Reduction, reduce
from calib.measurement.observations import GIVEN, Measurements
from calib.measurement.prediction import Prediction

SUBSET = 200
"""Number of rows on which initial guesses are compared."""
GOOD = 0.01
"""Misfit, as a fraction of the spread of flange positions, below which no other guess is tried."""


@dataclass(frozen=True, slots=True, eq=False)
class FoundFrames:
    """A robot with fitted frames."""

    model: RobotModel
    """Nominal links, with fitted frames and fixtures."""
    names: tuple[str, ...]
    """Names of the unknown numbers."""
    prediction: Prediction
    """Prediction of the rows that they were fitted to."""
    reduction: Reduction
    """Which of these numbers the rows determine."""


def frames_of_one_tool(
    model: RobotModel,
    F: Array,
    measurements: Measurements,
    free_tool: bool,
    free_anchors: Collection[int],
    placed: Collection[int] = (),
) -> FoundFrames:
    """Base, tool and fixtures from rows that were all measured with the tool of the chain.

    Parameters
    ----------
    model : RobotModel
        Nominal links, and the values of all numbers that are held.
    F : (m, 4, 4) array
        Poses T_base_flange of the rows, by the nominal links alone [m].
    measurements : Measurements
        The rows.
    free_tool : bool
        Whether the tool is fitted.
    free_anchors : collection of int
        Anchors whose place is unknown.
    placed : collection of int
        Stations that other rows have already placed: they are held. With 0, the world, the base is
        held too.
    """
    names = _unknowns(model, measurements, free_tool, free_anchors, placed)
    parameters = parameters_of(model, names)
    require_equations(model, measurements, parameters)
    problem = start_problem(model, F, measurements, free_tool, free_anchors, placed)
    # best guess on some rows, refined on all of them
    return _refined(_best_guess(problem, parameters), problem, parameters)


def refined_frames(
    model: RobotModel, F: Array, measurements: Measurements, names: tuple[str, ...]
) -> FoundFrames:
    """Refine nearly correct frames of all tools together on all rows."""
    parameters = parameters_of(model, names)
    problem = start_problem(model, F, measurements, True, ())
    chain = model.chain
    alignment = Alignment(F, chain.T_world_base, chain.T_flange_tool, model.fixtures)
    return _refined(alignment, problem, parameters)


def _refined(alignment: Alignment, problem: StartProblem, parameters: Parameters) -> FoundFrames:
    """Least-squares fit near an alignment, over the numbers that the rows determine."""
    measurements, names = problem.measurements, parameters.free_names
    free = _indices(problem.model, _reduction(alignment, problem, parameters).kept)
    alignment = refine(alignment, measurements, free)
    reduction = _reduction(alignment, problem, parameters, q=measurements.q)
    found = _with_frames(alignment, problem, names)
    return FoundFrames(found, names, alignment.predict(measurements), reduction)


def _unknowns(
    model: RobotModel,
    measurements: Measurements,
    free_tool: bool,
    free_anchors: Collection[int],
    placed: Collection[int],
) -> tuple[str, ...]:
    """Names of the unknown numbers: those that rows of the table depend on."""
    wrong = [k for k in free_anchors if not 0 <= k < len(model.fixtures.anchors)]
    if wrong:
        count = len(model.fixtures.anchors)
        message = f"free_anchors names anchor {wrong[0]}, the model has {count}"
        allowed = "anchors of the fixtures, from 0"
        raise refuse("free_anchors", wrong[0], allowed, code="A3", message=message)
    far = measurements.is_distance
    optical = set(np.unique(measurements.station[~far]).tolist())
    anchored = set(np.unique(measurements.anchor[far]).tolist())
    prefixes = []
    # without any known place the base itself is the world
    known = 0 in optical or (not optical and anchored - set(free_anchors))
    if known and 0 not in placed:
        prefixes.append("base.")
    if free_tool and (measurements.reflector == GIVEN).any():
        prefixes.append("tool.")
    reflectors = set(np.unique(measurements.reflector).tolist()) - {GIVEN}
    prefixes += [f"reflector{k + 1}." for k in sorted(reflectors)]
    prefixes += [f"anchor{k + 1}." for k in sorted(anchored & set(free_anchors))]
    prefixes += [f"station{s + 1}." for s in sorted(optical - {0, *placed})]
    return tuple(name for name in model.names if name.startswith(tuple(prefixes)))


def _indices(model: RobotModel, names: tuple[str, ...]) -> Index:
    """Indices of named numbers among those of an alignment: base, tool, fixtures."""
    n = model.chain.n_numbers
    names_here = (*model.names[:6], *model.names[n - 6 : n], *model.fixtures.names)
    return np.array([names_here.index(name) for name in names], dtype=np.int64)


def _with_frames(alignment: Alignment, problem: StartProblem, names: tuple[str, ...]) -> RobotModel:
    """The model with the frames of an alignment; numbers that were held keep every bit."""
    chain = problem.model.chain
    base = alignment.base if "base.x" in names else chain.T_world_base
    tool = alignment.tool if "tool.x" in names else chain.T_flange_tool
    return replace(
        problem.model,
        chain=replace(chain, T_world_base=base, T_flange_tool=tool),
        fixtures=alignment.fixtures,
    )


def _reduction(
    alignment: Alignment, problem: StartProblem, parameters: Parameters, q: Array | None = None
) -> Reduction:
    """Reduction to those of the unknown numbers that the table determines."""
    names = parameters.free_names
    prediction = alignment.predict(problem.measurements)
    rows = (prediction.rows * SCALE[:, None])[prediction.filled]
    A = rows[:, _indices(problem.model, names)]
    model = _with_frames(alignment, problem, names)
    return reduce(A * parameters.free_scale, parameters, model=model, q=q)


def _best_guess(problem: StartProblem, parameters: Parameters) -> Alignment:
    """The initial guess that fits best after refinement, judged on a sample of rows."""
    rows = _sample(problem.measurements)
    few = replace(problem, F=problem.F[rows], measurements=problem.measurements.rows(rows))
    spread = float(np.linalg.norm(problem.F[:, :3, 3].std(axis=0))) or 1.0
    best, least, begun = None, np.inf, set[float]()
    ranged = bool(few.measurements.is_distance.all())
    for guess in initial_guesses(problem):
        alignment = guess.rows(rows)
        if ranged:  # a base that is the world may be turned about free anchors as one likes
            cost = float(f"{_misfit(alignment, few):.9g}")
            if cost in begun:
                continue
            begun.add(cost)
        free = _indices(problem.model, _reduction(alignment, few, parameters).kept)
        alignment = refine(alignment, few.measurements, free, most=15)
        misfit = _misfit(alignment, few)
        if best is None or misfit < least:
            best, least = alignment, misfit
        if least < (GOOD * spread) ** 2:
            break
    assert best is not None  # there is always a guess
    return replace(best, F=problem.F)


def _misfit(alignment: Alignment, problem: StartProblem) -> float:
    """Mean square of the rows of a problem times `SCALE` [m^2]."""
    residual = alignment.predict(problem.measurements).residual * SCALE
    return float(np.square(residual).sum() / len(residual))


def _sample(table: Measurements) -> Index:
    """About `SUBSET` rows, spread evenly over the targets."""
    _, group = np.unique(table.target_key, axis=0, return_inverse=True)
    group = group.ravel()
    each = -(-SUBSET // (int(group.max()) + 1))
    chosen = []
    for k in range(int(group.max()) + 1):
        rows = np.flatnonzero(group == k)
        chosen.append(rows[np.unique(np.linspace(0, len(rows) - 1, each).round().astype(int))])
    return np.sort(np.concatenate(chosen))
