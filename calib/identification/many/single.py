"""Identifications of many robots at one set of poses: each as `identify` makes it, all at once."""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array, frozen
from calib.geometry.many import ManyModels
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.fit_statistics import squared_notes
from calib.identification.identify import identify
from calib.identification.joint_models import against_gravity
from calib.identification.lack_of_fit import lack_of_fit
from calib.identification.least_squares import Status
from calib.identification.many.fit import BLOCK, ManyFits, fit_many
from calib.identification.many.tables import ManyRows, ManyTables, known_to_many
from calib.identification.prior import Prior
from calib.identification.result import Identification
from calib.information.reduction import Reduction, reduce
from calib.measurement.observations import Measurements
from calib.measurement.prediction import perfect
from calib.measurement.residual import linearize, table_whiteners


def identify_many(
    nominal: RobotModel,
    tables: Sequence[Measurements],
    parameters: Parameters,
    *,
    prior: Prior | None = None,
) -> list[Identification]:
    """Identify from each table as `identify` does, by least squares of whitened rows.

    All at once where the tables are of the same poses and the model is known to arrays; what gets
    no certificate there, and all else, one by one. What rows of these poses tell apart is judged
    once. Of the steps only start and end are noted.

    Parameters
    ----------
    nominal : RobotModel
        As in `identify`.
    tables : sequence of Measurements
        One of each robot.
    parameters : Parameters
        Which numbers are free.
    prior : Prior, optional
        Of all free numbers.
    """
    fits, reduction = _together(nominal, tables, parameters, prior)
    if fits is None or reduction is None:
        return [identify(nominal, table, parameters, prior=prior) for table in tables]
    begun, ended = _residuals(nominal, tables, fits)
    precision = np.zeros(0) if prior is None else _precision(prior, fits)
    return [
        _single(fits, k, table, reduction, (begun[k], ended[k]), prior, precision)
        if fits.converged[k]
        else identify(nominal, table, parameters, prior=prior)
        for k, table in enumerate(tables)
    ]


def _together(
    nominal: RobotModel,
    tables: Sequence[Measurements],
    parameters: Parameters,
    prior: Prior | None,
) -> tuple[ManyFits | None, Reduction | None]:
    """All fits, and what their rows tell apart; None where arrays do not know them."""
    many = ManyTables.alike(tables)
    told = prior is None or set(prior.names) == set(parameters.free_names)
    if many is None or len(many.q) > 1 or not known_to_many(nominal) or not told:
        return None, None
    # of a table that sees what is predicted: it hangs on no robot
    A = linearize(nominal, perfect(nominal, tables[0])).A[:, parameters.free_index]
    A = A * parameters.free_scale
    sd = None
    if prior is not None:
        sd = prior.sd[[prior.names.index(name) for name in parameters.free_names]]
    reduction = reduce(A, parameters, model=nominal, q=tables[0].q, prior_sd=sd)
    kept = parameters.freeing(reduction.kept) if prior is None else parameters
    if prior is None and len(A) <= kept.n_free:
        return None, None
    return fit_many(nominal, many, kept, prior=prior, shared=True), reduction


def _residuals(
    nominal: RobotModel, tables: Sequence[Measurements], fits: ManyFits
) -> tuple[Array, Array]:
    """Whitened residuals (R, N), rows pose by pose, of the nominal robot and of each fit."""
    rows = ManyRows.of(nominal, ManyTables.of(tables), fits.parameters.free_index, "whitened")
    found = []
    for models in (ManyModels.of(nominal, len(tables)), fits.models):
        parts = (slice(k, k + BLOCK) for k in range(0, len(tables), BLOCK))
        r = np.concatenate([rows.some(some).residual_at(models.some(some)) for some in parts])
        found.append(r.reshape(len(r), 6, -1).swapaxes(1, 2).reshape(len(r), -1))
    return found[0], found[1]


def _precision(prior: Prior, fits: ManyFits) -> Array:
    """Lambda0 (f, f) in the order of the free numbers."""
    order = [prior.names.index(name) for name in fits.parameters.free_names]
    return prior.precision[np.ix_(order, order)]


def _single(
    fits: ManyFits,
    k: int,
    table: Measurements,
    reduction: Reduction,
    residuals: tuple[Array, Array],
    prior: Prior | None,
    precision: Array,
) -> Identification:
    """One fit as an identification."""
    model, step, C = fits.models.one(k), fits.steps[k], fits.covariance[k]
    total, dof, p_value = (float(part[k]) for part in (fits.chi_square, fits.dof, fits.p_value))
    misfit = None
    if table.n_poses < len(table):
        learned = len(residuals[1]) - dof
        misfit = lack_of_fit(residuals[1], table, table_whiteners(table), learned)
    trace = [float(residuals[0] @ residuals[0]), total]
    if prior is not None:
        mean = prior.mean[[prior.names.index(name) for name in fits.parameters.free_names]]
        trace = [
            square + float(left @ precision @ left)
            for square, left in zip(trace, (mean, mean - step), strict=True)
        ]
    names = fits.parameters.free_names
    return Identification(
        model=model,
        parameters=fits.parameters,
        reduction=reduction,
        step=frozen(step),
        covariance=frozen(C),
        chi_square=total,
        dof=round(dof),
        p_value=p_value,
        variance=1.0,
        rank=fits.parameters.n_free,
        certificate=float(fits.certificate[k]),
        status=Status.CONVERGED,
        iterations=1,
        trace=frozen(trace),
        residual=frozen(residuals[1]),
        mode="whitened",
        notes=(
            *reduction.sentences,
            *squared_notes(total, dof, p_value, misfit),
            *against_gravity(model.joint_errors, names, C),
        ),
        prior=prior,
        weights=frozen(np.ones(len(table))),
        dof_effective=dof,
        log_evidence=float(fits.log_evidence[k]),
        lack_of_fit=misfit,
    )
