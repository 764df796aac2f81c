"""The end of a fit: covariance, tests of model and noise, evidence, and notes in words."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from calib.arrays import Array, frozen
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.lack_of_fit import LackOfFit, lack_of_fit
from calib.identification.least_squares import Solution, Status
from calib.identification.outliers import Outliers, outliers
from calib.identification.prior import Prior, PriorRows
from calib.identification.result import Identification, Mode
from calib.identification.robust import Loss, loss_weights, sandwich_factor, sizes
from calib.identification.tangent import covariance_factor
from calib.information.reduction import Reduction
from calib.measurement.observations import Measurements
from calib.measurement.residual import Stack

RED = 1e-3
"""A p-value below this says that the model or the stated noise is wrong."""
MOST_OUTLIERS = 0.2
"""Part of the observations above which misfits are the model's fault, not theirs."""


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A finished fit and how it was set up."""

    nominal: RobotModel
    kept: Parameters
    reduction: Reduction
    solution: Solution[RobotModel]
    mode: Mode
    prior: Prior | None
    belief: PriorRows | None
    loss: Loss


@dataclass(frozen=True, slots=True, eq=False)
class _Ending:
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


def concluded(
    fit: Fit,
    measurements: Measurements,
    whitening: Array | None,
    rows: Callable[[RobotModel], Stack],
) -> Identification:
    """The result of a finished fit."""
    if whitening is None:
        end = _paper_end(fit, len(measurements))
    elif fit.loss == "squared":
        end = _squared_end(fit, measurements, whitening)
    else:
        end = _robust_end(fit, measurements, rows(fit.solution.x))
    notes = (*fit.reduction.sentences, *end.notes)
    if fit.solution.status is not Status.CONVERGED:
        notes += (f"the fit {fit.solution.status.value}",)
    return Identification(
        model=fit.solution.x,
        parameters=fit.kept,
        reduction=fit.reduction,
        step=frozen(fit.nominal.step_to(fit.solution.x)[fit.kept.free_index]),
        covariance=frozen(end.covariance),
        chi_square=end.chi_square,
        dof=end.dof,
        p_value=end.p_value,
        variance=end.variance,
        rank=fit.kept.n_free,
        certificate=fit.solution.certificate,
        status=fit.solution.status,
        iterations=fit.solution.iterations,
        trace=fit.solution.trace,
        residual=frozen(end.residual),
        mode=fit.mode,
        notes=notes,
        prior=fit.prior,
        loss=fit.loss,
        weights=frozen(end.weights),
        dof_effective=end.dof_effective,
        log_evidence=end.log_evidence,
        lack_of_fit=end.lack_of_fit,
    )


def _paper_end(fit: Fit, m: int) -> _Ending:
    """What a fit of unweighted rows claims for itself."""
    n, f = fit.solution.jacobian.shape
    factor = covariance_factor(fit.solution.jacobian)
    variance = float(fit.solution.residual @ fit.solution.residual) / (n - f)
    note = (
        f"twelve rows per pose hold six freedoms: s^2 = RSS/{n - f} counts {n // 2} rows too "
        "many, and unweighted rows do not have one common variance; the claimed covariance is "
        "not that of the estimate"
    )
    nothing = float("nan")
    return _Ending(
        variance * (factor @ factor.T),
        np.ones(m),
        nothing,
        n - f,
        float(n - f),
        nothing,
        fit.solution.residual,
        (note,),
        variance,
    )


def _squared_end(fit: Fit, measurements: Measurements, whitening: Array) -> _Ending:
    """Covariance inv(A'A + Lambda0) and the tests of known noise."""
    n, f = measurements.n_equations, fit.kept.n_free
    r, A = fit.solution.residual[:n], fit.solution.jacobian[:n]
    factor = covariance_factor(fit.solution.jacobian)
    learned = float(f) if fit.belief is None else float(np.square(A @ factor).sum())
    total, dof = float(r @ r), n - learned
    p_value = float(chdtrc(dof, total))
    misfit = lack_of_fit(r, measurements, whitening, learned)
    return _Ending(
        factor @ factor.T,
        np.ones(len(measurements)),
        total,
        round(dof),
        dof,
        p_value,
        r,
        (*_chi_square_notes(total, dof, p_value), *_repeat_notes(misfit, p_value)),
        log_evidence=_log_evidence(fit, factor, n),
        lack_of_fit=misfit,
    )


def _robust_end(fit: Fit, measurements: Measurements, stack: Stack) -> _Ending:
    """Sandwich covariance, and the tests of what is left when gross errors are named."""
    r, A, n = stack.r, stack.A[:, fit.kept.free_index], len(stack.r)
    prior = fit.solution.jacobian[n:]
    size = sizes(r, stack.row_of)
    weights = loss_weights(size, fit.loss)
    found = outliers(r, A, stack.row_of, prior=prior, weights=weights)
    # an observation scatters as stated unless it plainly does not
    scatter = np.where(found.suspect, np.maximum(size, 1.0), 1.0)
    factor = sandwich_factor(A, stack.row_of, weights, scatter, prior)
    many = bool(found.suspect.mean() > MOST_OUTLIERS)
    sound = ~found.suspect | many
    left = sound[stack.row_of]
    near = A[left] @ covariance_factor(np.concatenate([A[left], prior]))
    total, dof = float(r[left] @ r[left]), float(left.sum() - np.square(near).sum())
    p_value = float(chdtrc(dof, total))
    return _Ending(
        factor @ factor.T,
        weights,
        total,
        round(dof),
        dof,
        p_value,
        r,
        (
            *_outlier_notes(found, measurements, many),
            *_chi_square_notes(total, dof, p_value, smaller=False),
        ),
        log_evidence=_log_evidence(fit, covariance_factor(fit.solution.jacobian), n),
    )


def _log_evidence(fit: Fit, factor: Array, n: int) -> float:
    """Laplace's evidence, up to a constant of the table; nan where a number has no prior.

    Both determinants are taken in the same small step at the answer, where the prior's own rows
    already carry the turn of the frames.
    """
    if fit.prior is None or len(fit.prior.names) < fit.kept.n_free:
        return float("nan")
    believed = np.linalg.slogdet(fit.solution.jacobian[n:])[1]
    return float(-fit.solution.trace[-1] / 2 + believed + np.linalg.slogdet(factor)[1])


def _chi_square_notes(
    total: float, dof: float, p_value: float, *, smaller: bool = True
) -> tuple[str, ...]:
    """What a chi-square out of its range means."""
    if p_value < RED:
        return (
            f"chi-square is {total / dof:.2f} per degree of freedom (p {_chance(p_value)}): the "
            "residuals are larger than the stated noise explains; do not believe the intervals, "
            "look for errors that the model leaves out",
        )
    if smaller and p_value > 1 - RED:
        return (
            f"chi-square is {total / dof:.2f} per degree of freedom (p = {p_value:.4f}): the "
            "residuals are smaller than the stated noise; the intervals are too wide",
        )
    return ()


def _repeat_notes(found: LackOfFit | None, p_value: float) -> tuple[str, ...]:
    """What repeats say about model and noise."""
    if found is None or (found.p_value >= RED and p_value >= RED):
        return ()
    said = f"against the scatter of repeats the misfit has F = {found.ratio:.2f}"
    if found.p_value < RED:
        return (
            f"{said} (p {_chance(found.p_value)}): the model misses more than the measurements "
            "scatter; free more numbers or use the extended model",
        )
    return (
        f"{said} (p = {found.p_value:.3f}): repeats scatter as much as the residuals; the model "
        "may well be right and the stated noise too small",
    )


def _outlier_notes(found: Outliers, measurements: Measurements, many: bool) -> tuple[str, ...]:
    """The observations that do not fit, or that they are too many to be outliers."""
    count = int(found.suspect.sum())
    if many:
        return (
            f"{count} of {len(found.suspect)} observations do not fit: that many are no gross "
            "errors; the model or the stated noise is wrong",
        )
    return found.sentences(measurements)


def _chance(p: float) -> str:
    """A p-value, also where it underflows."""
    return f"= {p:.1e}" if p > 0 else "< 1e-300"
