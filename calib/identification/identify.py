"""Identification: the robot model that explains a table of measurements best."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from calib.arrays import Array, frozen
from calib.errors import refuse
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.fit_statistics import SolvedFit, with_statistics
from calib.identification.least_squares import Solution, solve
from calib.identification.least_squares import Status as Status
from calib.identification.prior import Prior, PriorRows, prior_rows
from calib.identification.result import Identification as Identification
from calib.identification.result import Mode as Mode
from calib.identification.robust import LOSSES, Loss, flattened
from calib.identification.sufficiency import require_equations
from calib.identification.tangent import NEGLIGIBLE, System
from calib.identification.untold.saddles import way_down
from calib.information.reduction import Reduction, reduce
from calib.kinds import checked_kinds
from calib.measurement.observations import Measurements
from calib.measurement.residual import Stack, linearize, paper_stack, table_whiteners
from calib.measurement.term_rows import TermRows

MOST_STEPS, MOST_HELD = 100, 200
"""Steps of a fit, and of one whose numbers a prior holds: that one has an end."""
UNMOVED = 1e-12
"""Rounding of a step between two models [m, rad]."""
MOST_SADDLES = 5
"""Most saddles, in numbers that only a prior determines, that a fit leaves and goes on from."""
NEARBY = 1e-2
"""Relative offset at which a fit that only starts the next loss may end: a hundredth of the effect
of noise."""


@checked_kinds
def identify(
    nominal: RobotModel,
    measurements: Measurements,
    parameters: Parameters,
    *,
    mode: Mode = "whitened",
    prior: Prior | None = None,
    loss: Loss = "squared",
    report: Callable[[int, float], None] | None = None,
    start: RobotModel | None = None,
) -> Identification:
    """Estimate the free numbers of a model by least squares, starting from the nominal model.

    The solution is searched nearby: if base, tool or fixtures are not known to a few millimeters
    and degrees, find them with `start.start_frames` first.

    *whitened* (default): six rows per pose, three per point and one per distance, whitened by their
    covariance. Free numbers that the table cannot tell apart are reduced to those it can; the
    others stay nominal. The covariance is inv(A'A) and not rescaled by the residuals, because the
    noise is known.

    *paper*: the twelve unweighted rows per pose of Wen et al. in 1 and mm, exactly the free
    numbers, and the covariance that such a fit claims.

    Parameters
    ----------
    nominal : RobotModel
        Start of the search, and the values of all numbers that are not free, fixtures included.
    measurements : Measurements
        What was measured.
    parameters : Parameters
        Which numbers are free; `calib.geometry.parameters.parameters_of(nominal, ...)`.
    mode : {"whitened", "paper"}
        Estimator.
    prior : Prior, optional
        Prior of some or all free numbers. These are all estimated (maximum a posteriori), even
        where the table cannot tell them apart. Only for *whitened*.
    loss : {"squared", "huber", "cauchy"}
        Loss of an observation's residual. Robust losses start near the least-squares solution
        (Cauchy's, which has several minima, near Huber's). Only for *whitened*.
    report : callable, optional
        Called with the step count and the sum of squares after each step; a robust loss starts the
        count again.
    start : RobotModel, optional
        Start of the search, if better than the nominal model. Numbers that are not free, or cannot
        be told apart, keep their values of `nominal`.

    Raises
    ------
    InputError
        Nothing is free; too few poses (how many are needed is stated); a prior of numbers that are
        not free; or, in paper mode, free numbers that the table cannot tell apart.

    References
    ----------
    Generalized least squares with known covariance; Wen et al. 2022, eqs. (3)-(5), for paper mode;
    Huber 1981 and Holland & Welsch 1977 for the losses.
    """
    require_match(nominal, parameters)
    _require_whitened(mode, prior, loss)
    belief = None if prior is None else prior_rows(prior, nominal, parameters)
    whitening = None if mode == "paper" else table_whiteners(measurements)
    rows = row_source(measurements, mode, whitening)
    first = rows(nominal)
    free = parameters.free_index
    reduction = reduce(
        first.A[:, free] * parameters.free_scale,
        parameters,
        model=nominal,
        q=measurements.q,
        prior_sd=_prior_sd(prior, parameters),
    )
    if mode == "paper" and reduction.dropped:
        require_equations(nominal, measurements, parameters)
        why = " ".join(f"{sentence}." for sentence in reduction.sentences)
        message = (
            f"{parameters.n_free} numbers are free, but the measurements tell only "
            f"{len(reduction.kept)} apart: {why}"
        )
        fix = f"hold {', '.join(reduction.dropped)} fixed"
        raise refuse("free", reduction.dropped, code="M30", message=message, fix=fix)
    kept = _estimable(nominal, measurements, parameters, prior, reduction, first)
    near = nominal if start is None else _held_as(nominal, start, kept)
    many = None if whitening is None else TermRows.of(nominal, measurements, whitening, kept)
    for step in LOSSES[: LOSSES.index(loss) + 1]:
        until = NEGLIGIBLE if step == loss else NEARBY
        solution, mirrored = _solve(
            nominal, first, rows, kept, belief, step, near, until, report, many
        )
        near = solution.x
    fit = SolvedFit(nominal, kept, reduction, solution, mode, prior, belief, loss, mirrored)
    return with_statistics(fit, measurements, whitening, rows)


def _held_as(nominal: RobotModel, start: RobotModel, kept: Parameters) -> RobotModel:
    """The model `start` with the numbers that are not estimated as in `nominal`."""
    step = nominal.step_to(start)
    if np.abs(step[~kept.free]).max(initial=0.0) < UNMOVED:
        return start
    return nominal.moved(np.where(kept.free, step, 0.0))


def _estimable(
    nominal: RobotModel,
    measurements: Measurements,
    parameters: Parameters,
    prior: Prior | None,
    reduction: Reduction,
    first: Stack,
) -> Parameters:
    """Parameter table with those numbers free that the data or the prior determine."""
    believed = () if prior is None else prior.names
    bare = parameters.freeing(set(parameters.free_names).difference(believed))
    if not bare.n_free:
        return parameters
    require_equations(nominal, measurements, bare)
    if not believed:
        if not reduction.kept:
            why = "; ".join(reduction.sentences)
            message = f"the measurements tell none of the free numbers: {why}"
            fix = "free numbers that move what is measured, or measure poses"
            raise refuse("free", parameters.free_names, code="M30", message=message, fix=fix)
        return parameters.freeing(reduction.kept)
    # a prior can only make up for directions of its own numbers
    by_data = reduce(first.A[:, bare.free_index] * bare.free_scale, bare, model=nominal).kept
    return parameters.freeing((*believed, *by_data))


def _prior_sd(prior: Prior | None, parameters: Parameters) -> Array | None:
    """Prior sd (f,) of the free numbers, if all have one."""
    if prior is None or len(prior.names) < parameters.n_free:
        return None
    sd = dict(zip(prior.names, prior.sd, strict=True))
    return np.array([sd[name] for name in parameters.free_names])


def row_source(
    measurements: Measurements, mode: Mode, whitening: Array | None
) -> Callable[[RobotModel], Stack]:
    """Function from a model to its `Stack` in a mode; what all models share is computed once."""
    if mode == "paper":
        return lambda model: paper_stack(model, measurements)
    return lambda model: linearize(model, measurements, whitening=whitening)


def _solve(
    nominal: RobotModel,
    first: Stack,
    rows: Callable[[RobotModel], Stack],
    kept: Parameters,
    belief: PriorRows | None,
    loss: Loss,
    start: RobotModel,
    until: float,
    report: Callable[[int, float], None] | None,
    many: TermRows | None,
) -> tuple[Solution[RobotModel], tuple[str, ...]]:
    """Least squares over the kept numbers, and the names of those with a mirrored second solution.

    `first` is the linear system at the nominal model.
    """
    columns, every = kept.free_index, kept.free.all()

    def evaluate(model: RobotModel) -> System:
        believed = None if belief is None else belief.beside(model, columns)
        if many is not None:
            r, A = flattened(*many.at(model), loss)
            return System(r, many.by_joint(A), believed)
        stack = first if model is nominal else rows(model)
        own = stack.A if every else stack.A[:, columns]
        return System(*flattened(stack.r, own, stack.row_of, loss), believed)

    def move(model: RobotModel, step: Array) -> RobotModel:
        return model.moved(kept.expand(step))

    def ended(near: RobotModel) -> Solution[RobotModel]:
        most = MOST_STEPS if belief is None else MOST_HELD
        return solve(evaluate, near, move=move, most=most, until=until, report=report)

    found, mirrored = ended(start), tuple[str, ...]()
    if belief is None:
        return found, mirrored
    # a wave is linear in its coefficient: a derivative that is zero here is zero everywhere
    waves = nominal.chain.n_numbers + np.arange(len(nominal.joint_errors.terms))
    bent = ~np.isin(belief.index, waves)
    some = np.searchsorted(columns, belief.index[bent])
    sd = 1 / np.linalg.norm(belief.root, axis=0)[bent]
    for _ in range(MOST_SADDLES):
        down = None
        if found.status is Status.CONVERGED and len(some):
            down = way_down(evaluate, move, found.x, some, sd)
        if down is None:
            break
        again = ended(move(found.x, down.step))
        found = replace(
            again,
            iterations=found.iterations + 1 + again.iterations,
            trace=frozen(np.concatenate([found.trace, again.trace])),
        )
        if down.both:
            mirrored += tuple(kept.free_names[k] for k in down.along)
    return found, mirrored


def require_match(nominal: RobotModel, parameters: Parameters) -> None:
    """Raise an `InputError` (A4) for a parameter table of another model or without free numbers."""
    if parameters.names != nominal.names:
        sizes = f"{len(parameters.names)} numbers, the model has {nominal.n_numbers}"
        raise refuse(
            "parameters",
            allowed="the table of this model",
            code="A4",
            message=f"parameters lists {sizes}",
            fix="make it with parameters_of(nominal)",
        )
    if not parameters.n_free:
        fix = "free at least one number"
        raise refuse("free", code="A4", message="no number is free", fix=fix)


def _require_whitened(mode: Mode, prior: Prior | None, loss: Loss) -> None:
    """Raise an `InputError` (A3) for paper mode with a prior or another loss."""
    if mode == "paper" and (prior is not None or loss != "squared"):
        field = "loss" if prior is None else "prior"
        message = f"paper mode takes no {field}: its rows are not weighed against any noise"
        raise refuse(field, code="A3", message=message, fix='use the mode "whitened"')
