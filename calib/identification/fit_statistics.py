"""Statistics of a solved fit: covariance, tests of model and noise, evidence, notes in words."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from calib.arrays import Array, frozen
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.joint_models import against_gravity
from calib.identification.lack_of_fit import LackOfFit, lack_of_fit
from calib.identification.least_squares import Solution, Status
from calib.identification.outliers.scores import Outliers, outliers
from calib.identification.prior import Prior, PriorRows
from calib.identification.result import Identification, Mode
from calib.identification.robust import Loss, loss_weights, sandwich_factor, sizes
from calib.identification.tangent import covariance_factor
from calib.information.reduction import Reduction
from calib.measurement.observations import Measurements
from calib.measurement.residual import Stack

RED = 1e-3
"""A p-value below this shows that the model or the stated noise is wrong."""
LEAST_SAID = 1e-4
"""Smallest p-value that is written out; smaller ones are only said to be small."""
MOST_OUTLIERS = 0.2
"""Share of suspect observations above which the model or the stated noise is blamed instead."""


@dataclass(frozen=True, slots=True, eq=False)
class SolvedFit:
    """The solution of a fit and how it was set up."""

    nominal: RobotModel
    kept: Parameters
    reduction: Reduction
    solution: Solution[RobotModel]
    mode: Mode
    prior: Prior | None
    belief: PriorRows | None
    loss: Loss
    mirrored: tuple[str, ...] = ()
    """Numbers with a mirrored second solution, beyond a saddle, that fits as well."""


@dataclass(frozen=True, slots=True, eq=False)
class _Statistics:
    """Covariance and tests of one fit."""

    covariance: Array
    weights: Array
    chi_square: float
    dof: int
    dof_effective: float
    p_value: float
    residual: Array
    notes: tuple[str, ...]
    variance: float = 1.0
    log_evidence: float = float("nan")
    lack_of_fit: LackOfFit | None = None


def with_statistics(
    fit: SolvedFit,
    measurements: Measurements,
    whitening: Array | None,
    rows: Callable[[RobotModel], Stack],
) -> Identification:
    """The identification that a solved fit gives."""
    if whitening is None:
        statistics = _paper_statistics(fit, len(measurements))
    elif fit.loss == "squared":
        statistics = _squared_statistics(fit, measurements, whitening)
    else:
        statistics = _robust_statistics(fit, measurements, rows(fit.solution.x))
    # the reduction was judged at the start, a saddle: beside it these numbers are observable
    notes = (*fit.reduction.sentences_without(fit.mirrored), *statistics.notes)
    errors, names = fit.solution.x.joint_errors, fit.kept.free_names
    notes += against_gravity(errors, names, statistics.covariance)
    if fit.mirrored:
        notes += (
            f"the readings look alike on both sides of {', '.join(fit.mirrored)}: an answer on the "
            "other side fits as well; start on the right one",
        )
    if fit.solution.status is not Status.CONVERGED:
        notes += (f"the fit {fit.solution.status.value}",)
    return Identification(
        model=fit.solution.x,
        parameters=fit.kept,
        reduction=fit.reduction,
        step=frozen(fit.nominal.step_to(fit.solution.x)[fit.kept.free_index]),
        covariance=frozen(statistics.covariance),
        chi_square=statistics.chi_square,
        dof=statistics.dof,
        p_value=statistics.p_value,
        variance=statistics.variance,
        rank=fit.kept.n_free,
        certificate=fit.solution.certificate,
        status=fit.solution.status,
        iterations=fit.solution.iterations,
        trace=fit.solution.trace,
        residual=frozen(statistics.residual),
        mode=fit.mode,
        notes=notes,
        prior=fit.prior,
        loss=fit.loss,
        weights=frozen(statistics.weights),
        dof_effective=statistics.dof_effective,
        log_evidence=statistics.log_evidence,
        lack_of_fit=statistics.lack_of_fit,
    )


def _paper_statistics(fit: SolvedFit, m: int) -> _Statistics:
    """Covariance that a fit of unweighted rows claims, s^2 inv(A'A), with a note on its fault."""
    n, f = fit.solution.jacobian.shape
    factor = fit.solution.factor
    variance = float(fit.solution.residual @ fit.solution.residual) / (n - f)
    note = (
        f"twelve rows per pose hold six degrees of freedom: s^2 = RSS/{n - f} counts {n // 2} rows "
        "too many, and unweighted rows do not have one common variance; the claimed covariance is "
        "not that of the estimate"
    )
    return _Statistics(
        covariance=variance * (factor @ factor.T),
        weights=np.ones(m),
        chi_square=np.nan,
        dof=n - f,
        dof_effective=float(n - f),
        p_value=np.nan,
        residual=fit.solution.residual,
        notes=(note,),
        variance=variance,
    )


def _squared_statistics(
    fit: SolvedFit, measurements: Measurements, whitening: Array
) -> _Statistics:
    """Covariance inv(A'A + Lambda0) and the tests of known noise."""
    n, f = measurements.n_equations, fit.kept.n_free
    r, A = fit.solution.residual[:n], fit.solution.jacobian[:n]
    factor = fit.solution.factor
    learned = float(f) if fit.belief is None else float(np.square(A @ factor).sum())
    total, dof = float(r @ r), n - learned
    p_value = float(chdtrc(dof, total))
    misfit = lack_of_fit(r, measurements, whitening, learned)
    return _Statistics(
        covariance=factor @ factor.T,
        weights=np.ones(len(measurements)),
        chi_square=total,
        dof=round(dof),
        dof_effective=dof,
        p_value=p_value,
        residual=r,
        notes=squared_notes(total, dof, p_value, misfit),
        log_evidence=_log_evidence(fit, factor, n),
        lack_of_fit=misfit,
    )


def squared_notes(
    total: float, dof: float, p_value: float, misfit: LackOfFit | None
) -> tuple[str, ...]:
    """Sentences on the tests of a least-squares fit with known noise."""
    return (*chi_square_notes(total, dof, p_value), *_repeat_notes(misfit, p_value))


def _robust_statistics(fit: SolvedFit, measurements: Measurements, stack: Stack) -> _Statistics:
    """Sandwich covariance, and tests of the observations that are not suspected as outliers."""
    r, A, n = stack.r, stack.A[:, fit.kept.free_index], len(stack.r)
    prior = fit.solution.jacobian[n:]
    size = sizes(r, stack.row_of)
    weights = loss_weights(size, fit.loss)
    judged = outliers(r, A, stack.row_of, prior=prior, weights=weights)
    # an observation scatters as stated unless it plainly does not
    scatter = np.where(judged.suspect, np.maximum(size, 1.0), 1.0)
    factor = sandwich_factor(A, stack.row_of, weights, scatter, prior)
    many = bool(judged.suspect.mean() > MOST_OUTLIERS)
    # chi-square of the sound rows, degrees of freedom less the numbers learned from them
    left = (~judged.suspect | many)[stack.row_of]
    near = A[left] @ covariance_factor(np.concatenate([A[left], prior]))
    total, dof = float(r[left] @ r[left]), float(left.sum() - np.square(near).sum())
    p_value = float(chdtrc(dof, total))
    return _Statistics(
        covariance=factor @ factor.T,
        weights=weights,
        chi_square=total,
        dof=round(dof),
        dof_effective=dof,
        p_value=p_value,
        residual=r,
        notes=(
            *_outlier_notes(judged, measurements, many),
            *chi_square_notes(total, dof, p_value, smaller=False),
        ),
        log_evidence=_log_evidence(fit, fit.solution.factor, n),
    )


def _log_evidence(fit: SolvedFit, factor: Array, n: int) -> float:
    """Laplace's evidence, up to a constant of the table; nan where a number has no prior.

    Both determinants are taken in the same small step at the answer, where the prior's own rows
    already carry the turn of the frames.
    """
    if fit.prior is None or len(fit.prior.names) < fit.kept.n_free:
        return float("nan")
    believed = np.linalg.slogdet(fit.solution.jacobian[n:])[1]
    return float(-fit.solution.trace[-1] / 2 + believed + np.linalg.slogdet(factor)[1])


def chi_square_notes(
    total: float, dof: float, p_value: float, *, smaller: bool = True
) -> tuple[str, ...]:
    """Sentence on a chi-square outside its range."""
    if p_value < RED:
        return (
            f"chi-square is {total / dof:.2f} per degree of freedom (p {chance(p_value)}): the "
            "residuals are larger than the stated noise explains; do not believe the intervals, "
            "look for errors that the model leaves out",
        )
    if smaller and p_value > 1 - RED:
        return (
            f"chi-square is {total / dof:.2f} per degree of freedom (p > {1 - RED:g}): the "
            "residuals are smaller than the stated noise; the intervals are too wide",
        )
    return ()


def _repeat_notes(misfit: LackOfFit | None, p_value: float) -> tuple[str, ...]:
    """Sentence on what repeats show of model and noise."""
    if misfit is None or (misfit.p_value >= RED and p_value >= RED):
        return ()
    ratio = f"compared with the scatter of repeats, the misfit has F = {misfit.ratio:.2f}"
    if misfit.p_value < RED:
        return (
            f"{ratio} (p {chance(misfit.p_value)}): the errors of the model exceed the scatter of "
            "the measurements; free more numbers or use the extended model",
        )
    return (
        f"{ratio} (p = {misfit.p_value:.3f}): repeats scatter as much as the residuals; the model "
        "may well be right and the stated noise too small",
    )


def _outlier_notes(judged: Outliers, measurements: Measurements, many: bool) -> tuple[str, ...]:
    """Sentences on observations that do not fit, or on their being too many to be outliers."""
    if many:
        count = int(judged.suspect.sum())
        return (
            f"{count} of {len(judged.suspect)} observations do not fit: too many for gross "
            "errors; the model or the stated noise is wrong",
        )
    return judged.sentences(measurements)


def chance(p: float) -> str:
    """A p-value in words; the exact size of a tiny one depends on unknown tails of the noise."""
    return f"= {p:.2g}" if p >= LEAST_SAID else "< 0.001"
