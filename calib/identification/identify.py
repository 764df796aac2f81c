"""Identification: the robot model that explains a table of measurements best, and its worth."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.special import chdtrc

from calib.arrays import Array, frozen
from calib.errors import InputError
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.least_squares import Solution, solve
from calib.identification.least_squares import Status as Status
from calib.identification.sufficiency import require_equations
from calib.identification.tangent import covariance_factor
from calib.information.reduction import Reduction, reduce
from calib.measurement.observations import Measurements
from calib.measurement.residual import Stack, paper_stack, stacked, table_whiteners

Mode = Literal["whitened", "paper"]
MOST_STEPS = 100
RED = 1e-3
"""A p-value below this says that the model or the stated noise is wrong."""


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """An identified robot with the numbers that were really estimated and their covariance."""

    model: RobotModel
    """Identified; numbers that were not estimated are those of the nominal model."""
    parameters: Parameters
    """Free are the f numbers that were estimated: the kept ones of `reduction`."""
    reduction: Reduction
    """What the measurements can tell apart, judged at the nominal model."""
    step: Array
    """(f,) estimate minus nominal [m, rad]."""
    covariance: Array
    """(f, f) of `step` [m^2, m rad, rad^2]: inv(A'A), or in paper mode the claimed s^2 inv(H'H)."""
    chi_square: float
    """Whitened sum of squares; nan in paper mode, which knows no noise to compare with."""
    dof: int
    """Rows minus numbers estimated."""
    p_value: float
    """Chance of a larger chi-square if model and noise are right; nan in paper mode."""
    variance: float
    """Factor of the covariance: 1, or in paper mode s^2 = RSS / (12 m - f), row units squared."""
    rank: int
    """Numbers estimated, f."""
    certificate: float
    """Relative offset at the end; see `tangent.relative_offset`."""
    status: Status
    """How the fit ended; its value is a sentence."""
    iterations: int
    trace: Array
    """(iterations + 1,) sum of squares from the nominal model on."""
    residual: Array
    """(N,) seen minus predicted at the end: whitened, or the paper's rows in 1 and mm."""
    mode: Mode
    notes: tuple[str, ...]
    """What a reader must know before believing the numbers."""

    @property
    def names(self) -> tuple[str, ...]:
        """(f,) names of the numbers estimated."""
        return self.parameters.free_names

    @property
    def standard_uncertainty(self) -> Array:
        """(f,) square roots of the diagonal of the covariance [m, rad]."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def full_covariance(self) -> Array:
        """(P, P) covariance of all numbers; zero where a number was not estimated."""
        full = np.zeros((len(self.parameters.names),) * 2)
        index = self.parameters.free_index
        full[np.ix_(index, index)] = self.covariance
        return full


def identify(
    nominal: RobotModel,
    measurements: Measurements,
    parameters: Parameters,
    *,
    mode: Mode = "whitened",
    report: Callable[[int, float], None] | None = None,
) -> Identification:
    """Find the free numbers of a model that fit a table best, starting from the nominal model.

    *whitened* (default): six rows per pose and three per point, whitened by their covariance. Free
    numbers that the table cannot tell apart are reduced to those it can; the others stay nominal.
    The covariance is inv(A'A), not rescaled by the residuals: the noise is known.

    *paper*: twelve unweighted rows per pose in 1 and mm, exactly the free numbers, and the
    covariance that such a fit claims for itself.

    Parameters
    ----------
    nominal : RobotModel
        Start, and the value of every number that is not free.
    measurements : Measurements
        What was seen.
    parameters : Parameters
        Which numbers are free; `calib.geometry.parameters.parameters_of(nominal, ...)`.
    mode : {"whitened", "paper"}
        Estimator.
    report : callable, optional
        Told the step count and the sum of squares after each step.

    Raises
    ------
    InputError
        Nothing is free, too few poses (how many are needed is said), or in paper mode free numbers
        that the table cannot tell apart.

    References
    ----------
    Generalized least squares with known covariance; Wen et al. 2022, eqs. (3)-(5), for paper mode.
    """
    _require_match(nominal, parameters)
    rows = _row_source(measurements, mode)
    first = rows(nominal)
    free = parameters.free_index
    reduction = reduce(
        first.A[:, free] * parameters.free_scale, parameters, model=nominal, q=measurements.q
    )
    require_equations(nominal, measurements, parameters)
    if mode == "paper" and reduction.dropped:
        raise InputError(
            f"{parameters.n_free} numbers are free, but the measurements tell only "
            f"{len(reduction.kept)} apart: {' '.join(_ended(reduction.sentences))}",
            code="M30",
            field="free",
            value=reduction.dropped,
            fix=f"hold {', '.join(reduction.dropped)} fixed",
        )
    kept = parameters.freeing(reduction.kept)
    solution = _solve(nominal, first, rows, kept, report)
    return _concluded(nominal, kept, reduction, solution, mode)


def _row_source(measurements: Measurements, mode: Mode) -> Callable[[RobotModel], Stack]:
    """Function model -> Stack of the mode; what does not depend on the model is done once."""
    if mode == "paper":
        return lambda model: paper_stack(model, measurements)
    if mode != "whitened":
        raise InputError(
            f'mode is "{mode}"', code="A3", field="mode", value=mode, allowed="whitened or paper"
        )
    whitening = table_whiteners(measurements)
    return lambda model: stacked(model, measurements, whitening=whitening)


def _solve(
    nominal: RobotModel,
    first: Stack,
    rows: Callable[[RobotModel], Stack],
    kept: Parameters,
    report: Callable[[int, float], None] | None,
) -> Solution[RobotModel]:
    """Least squares over the kept numbers; the system at the nominal model is already at hand."""
    columns = kept.free_index

    def evaluate(model: RobotModel) -> tuple[Array, Array]:
        stack = first if model is nominal else rows(model)
        return stack.r, stack.A[:, columns]

    return solve(
        evaluate,
        nominal,
        move=lambda model, step: model.moved(kept.expand(step)),
        most=MOST_STEPS,
        report=report,
    )


def _concluded(
    nominal: RobotModel,
    kept: Parameters,
    reduction: Reduction,
    solution: Solution[RobotModel],
    mode: Mode,
) -> Identification:
    """Covariance, tests of fit and notes of a finished fit."""
    n, f = solution.jacobian.shape
    total, dof = float(solution.residual @ solution.residual), n - f
    variance, chi_square, p_value = 1.0, total, float(chdtrc(dof, total))
    notes: tuple[str, ...] = reduction.sentences
    if mode == "paper":
        variance, chi_square, p_value = total / dof, float("nan"), float("nan")
        notes += (
            f"twelve rows per pose hold six freedoms: s^2 = RSS/{dof} counts {n // 2} rows too "
            "many, and unweighted rows do not have one common variance; the claimed covariance is "
            "not that of the estimate",
        )
    elif p_value < RED:
        notes += (
            f"chi-square is {total / dof:.2f} per degree of freedom (p {_chance(p_value)}): the "
            "residuals are larger than the stated noise explains; do not believe the intervals, "
            "look for errors that the model leaves out",
        )
    elif p_value > 1 - RED:
        notes += (
            f"chi-square is {total / dof:.2f} per degree of freedom (p = {p_value:.4f}): the "
            "residuals are smaller than the stated noise; the intervals are too wide",
        )
    if solution.status is not Status.CONVERGED:
        notes += (f"the fit {solution.status.value}",)
    factor = covariance_factor(solution.jacobian)
    return Identification(
        model=solution.x,
        parameters=kept,
        reduction=reduction,
        step=frozen(nominal.step_to(solution.x)[kept.free_index]),
        covariance=frozen(variance * (factor @ factor.T)),
        chi_square=chi_square,
        dof=dof,
        p_value=p_value,
        variance=variance,
        rank=f,
        certificate=solution.certificate,
        status=solution.status,
        iterations=solution.iterations,
        trace=solution.trace,
        residual=solution.residual,
        mode=mode,
        notes=notes,
    )


def _require_match(nominal: RobotModel, parameters: Parameters) -> None:
    """Refuse a parameter table of another model, or one without a free number."""
    if parameters.names != nominal.names:
        raise InputError(
            f"parameters lists {len(parameters.names)} numbers, the model has {nominal.n_numbers}",
            code="A4",
            field="parameters",
            allowed="the table of this model",
            fix="make it with parameters_of(nominal)",
        )
    if not parameters.n_free:
        raise InputError(
            "no number is free", code="A4", field="free", fix="free at least one number"
        )


def _ended(sentences: tuple[str, ...]) -> tuple[str, ...]:
    """Sentences with a full stop."""
    return tuple(f"{sentence}." for sentence in sentences)


def _chance(p: float) -> str:
    """A p-value, also where it underflows."""
    return f"= {p:.1e}" if p > 0 else "< 1e-300"
