"""Identification of many robots at one set of poses at once, with the results of `identify`."""

from collections.abc import Sequence
from dataclasses import replace

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
from calib.identification.many.fit import blocks, fit_rows
from calib.identification.many.result import ManyFits
from calib.identification.many.tables import ManyRows, ManyTables, known_to_many
from calib.identification.many.tangents import ManyBeliefs
from calib.identification.prior import Prior
from calib.identification.result import Identification
from calib.information.rank import learned
from calib.information.reduction import Reduction, reduce
from calib.measurement.observations import Measurements
from calib.measurement.residual import table_whiteners


def identify_many(
    nominal: RobotModel,
    tables: Sequence[Measurements],
    parameters: Parameters,
    *,
    prior: Prior | None = None,
) -> list[Identification]:
    """Identify from each table as `identify` does, by least squares of whitened rows.

    All robots are fitted at once if the tables have the same poses and arrays can express the model
    (`known_to_many`). Otherwise, and where a fit does not converge, `identify` is used. The
    reduction is computed once for these poses, and traces have only the start and the end.

    Parameters
    ----------
    nominal : RobotModel
        As in `identify`.
    tables : sequence of Measurements
        One table per robot.
    parameters : Parameters
        Free numbers.
    prior : Prior, optional
        Prior of all free numbers.
    """
    found = together(nominal, tables, parameters, prior)
    return [
        identify(nominal, table, parameters, prior=prior) if one is None else one
        for one, table in zip(found, tables, strict=True)
    ]


def together(
    nominal: RobotModel,
    tables: Sequence[Measurements],
    parameters: Parameters,
    prior: Prior | None,
    *,
    weights: Array | None = None,
    starts: Sequence[RobotModel] | None = None,
) -> list[Identification | None]:
    """Identification of each robot as by `identify`; None where that function has to be used.

    Parameters
    ----------
    nominal, tables, parameters, prior
        As in `identify_many`.
    weights : (R,) array, optional
        Factor of each robot on the precision of the prior.
    starts : sequence of RobotModel, optional
        Model from which each search starts; `nominal` by default.
    """
    many, R = ManyTables.alike(tables), len(tables)
    told = prior is None or set(prior.names) == set(parameters.free_names)
    known = known_to_many(nominal, (table.conditions for table in tables))
    if many is None or len(many.q) > 1 or not known or not told:
        return [None] * R
    rows = ManyRows.of(nominal, many, parameters.free_index, "whitened")
    told_apart = _reductions(rows, parameters, prior, weights)
    kept, belief = parameters, None if prior is None else ManyBeliefs.of(prior, parameters, weights)
    if len(told_apart[0].kept) < parameters.n_free and belief is None:
        kept = parameters.freeing(told_apart[0].kept)
        rows = ManyRows.of(nominal, many, kept.free_index, "whitened")
    if belief is None and 6 * len(tables[0]) <= kept.n_free:
        return [None] * R
    begin = ManyModels.of(nominal, R) if starts is None else ManyModels.each(nominal, starts)
    fits = fit_rows(rows, kept, begin, belief, shared=weights is None and starts is None)
    residuals = zip(*(_residuals(rows, models) for models in (begin, fits.models)), strict=True)
    costs = None if belief is None else _held(belief, begin, fits)
    believed = [prior] * R
    if prior is not None and weights is not None:
        believed = [prior.weighed(float(weight)) for weight in weights]
    return [
        _single(fits, k, table, told_apart[k % len(told_apart)], both, believed[k], costs)
        if fits.converged[k]
        else None
        for k, (table, both) in enumerate(zip(tables, residuals, strict=True))
    ]


def _reductions(
    rows: ManyRows, parameters: Parameters, prior: Prior | None, weights: Array | None
) -> list[Reduction]:
    """Reduction at these poses, or one for each weight of the prior.

    It is computed for readings equal to the prediction, so that it depends on no robot.
    """
    nominal = ManyModels.of(rows.like, 1)
    A = rows.some(slice(0, 1)).seeing(nominal).at(nominal).A[0].T
    found = reduce(A * parameters.free_scale, parameters, model=rows.like, q=rows.tables.q[0])
    if prior is None:
        return [found]
    sd = prior.sd[[prior.names.index(name) for name in parameters.free_names]]
    beyond = learned(A, sd, np.sqrt(np.ones(1) if weights is None else weights))
    return [replace(found, practical_rank=count) for count in beyond.tolist()]


def _residuals(rows: ManyRows, models: ManyModels) -> Array:
    """Whitened residuals (R, N), rows pose by pose."""
    parts = [rows.some(b).residual_at(models.some(b)) for b in blocks(len(models))]
    r = np.concatenate(parts)
    return r.reshape(len(r), 6, -1).swapaxes(1, 2).reshape(len(r), -1)


def _held(belief: ManyBeliefs, begin: ManyModels, fits: ManyFits) -> Array:
    """Contribution (2, R) of the prior to the sums of squares at the start and the end of fits."""
    both = (belief.at(models) for models in (begin, fits.models))
    return np.array([(held.pull * held.left).sum(axis=1) for held in both])


def _single(
    fits: ManyFits,
    k: int,
    table: Measurements,
    reduction: Reduction,
    residuals: tuple[Array, Array],
    prior: Prior | None,
    held: Array | None,
) -> Identification:
    """Fit number k as an `Identification`."""
    model, step, C = fits.models.one(k), fits.steps[k], fits.covariance[k]
    total, dof, p_value = (float(part[k]) for part in (fits.chi_square, fits.dof, fits.p_value))
    misfit = None
    if table.n_poses < len(table):
        learned = len(residuals[1]) - dof
        misfit = lack_of_fit(residuals[1], table, table_whiteners(table), learned)
    trace = np.array([residuals[0] @ residuals[0], total])
    if held is not None:
        trace += held[:, k]
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
