"""Least squares of one set of numbers for many tables at once, with the results of `identify`.

Estimates, covariances and tests of R robots in a few passes over arrays. All share model, free
numbers and prior; if they share the poses too, the curvature at the start is computed once.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc

from calib.arrays import Array, Index
from calib.errors import refuse
from calib.geometry.many import ManyModels
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.identify import require_match
from calib.identification.many.result import ManyFits, joined_fits
from calib.identification.many.tables import ManyRows, ManyTables, known_to_many, twelve_rows
from calib.identification.many.tangents import ManyBeliefs, ManyCurvatures, ManyTangents, times
from calib.identification.prior import Prior
from calib.identification.result import Mode
from calib.identification.tangent import RELATIVE_OFFSET

BLOCK = 32
"""Most robots in one pass, whose columns stay in the second-level cache; results depend on it in
their last bits."""
ENTRIES = 2**18
"""Most entries of a stack of (f, f) matrices, of which a pass needs some ten: models with hundreds
of numbers are fitted few at a time."""
NEAR, NEARER, NEAREST = 1e-7, 1e-9, 1e-10
"""Relative offset below which one more step ends a fit. That step leaves the square of the offset,
but only a hundredth of it in paper mode and where a prior holds numbers that the rows hardly
determine, since their columns turn with the step, those of springs most: limits are smaller."""
CHORDS, SHORT = 2, 2.0
"""Most steps with the columns at the start, before each robot's own are computed; and the length,
in standard uncertainties of all numbers, below which such a step is the last one."""
MOST_STEPS = 12
"""Steps after which a fit is left to `identify`; two or three are usual."""
SLOW = 0.1
"""Fraction of the offset that a step by shared curvature may leave; with more left, a robot takes
its own curvature."""


def fit_many(
    nominal: RobotModel,
    tables: ManyTables,
    parameters: Parameters,
    *,
    mode: Mode = "whitened",
    prior: Prior | None = None,
    start: RobotModel | ManyModels | None = None,
    shared: bool | None = None,
) -> ManyFits:
    """Fit the free numbers to each of many tables.

    Newton steps with the exact gradient until the relative offset is below its limit. The curvature
    is that at the start if all tables share their poses, and each robot's own otherwise or where
    that is slow. With springs it has the second derivatives of their products with moments and
    tilts, without which convergence would be slow.

    Parameters
    ----------
    nominal : RobotModel
        Model from which estimates are counted, with the values of all numbers that are not free;
        it has to pass `known_to_many`.
    tables : ManyTables
        Measurements of all robots.
    parameters : Parameters
        Free numbers. All are estimated: there is no reduction to those that a table determines.
    mode : {"whitened", "paper"}
        Estimator, as in `identify`.
    prior : Prior, optional
        Prior of all free numbers.
    start : RobotModel or ManyModels, optional
        Start of the search as in `identify`, one for all robots or one for each.
    shared : bool, optional
        Whether fits share the curvature at the start, which needs tables at the same poses. The
        default is true for several such tables with one start. It
        affects the last bits of a result; the number of fits done together does not.

    Raises
    ------
    InputError
        A3: arrays cannot express the model; A4: `parameters` are of another model, or none is free;
        M27: there is no prior, and there are no more rows than free numbers.

    References
    ----------
    As in `identify`. Normal equations square the condition: their loss of digits is bounded by the
    pivots of their Cholesky factor, and the gradient that has to vanish is exact.
    """
    require_match(nominal, parameters)
    if not known_to_many(nominal, ()):
        raise refuse(
            "nominal", code="A3",
            message="fits of many robots know chains, waves and springs of the stiff arm alone",
            allowed="a model without fixtures, terms that follow rows, springs of several passes",
            fix="identify the robots one by one",
        )  # fmt: skip
    n, f = 6 * tables.seen.shape[2], parameters.n_free
    if n <= f and prior is None:
        message = f"{n} rows for {f} unknowns"
        raise refuse("tables", n, "more rows than unknowns", code="M27", message=message)
    if shared is None:
        shared = not isinstance(start, ManyModels) and len(tables.q) == 1 < len(tables)
    if not isinstance(start, ManyModels):
        start = ManyModels.of(nominal if start is None else start, len(tables), nominal)
    rows = ManyRows.of(nominal, tables, parameters.free_index, mode)
    belief = None if prior is None else ManyBeliefs.of(prior, parameters)
    return fit_rows(rows, parameters, start, belief, shared)


def fit_rows(
    rows: ManyRows,
    parameters: Parameters,
    start: ManyModels,
    belief: ManyBeliefs | None,
    shared: bool,
) -> ManyFits:
    """`fit_many` for rows and a prior that are already prepared."""
    common = _shared(rows, start.some(slice(0, 1)), belief) if shared else None
    parts = [
        _fit_block(
            parameters, rows.some(part), start.some(part), belief and belief.some(part), common
        )
        for part in blocks(len(start), parameters.n_free)
    ]
    return joined_fits(parts)


def blocks(count: int, f: int = 1) -> list[slice]:
    """Parts of `count` robots that are fitted in one pass, for f free numbers."""
    size = min(BLOCK, max(1, ENTRIES // f**2))
    return [slice(k, k + size) for k in range(0, count, size)]


class _Shared(NamedTuple):
    """Linearization at the common start of fits at the same poses."""

    A: Array
    """(6 m, f) whitened columns."""
    C: Array
    """(f, f) inverse of the curvature."""


def _shared(rows: ManyRows, start: ManyModels, belief: ManyBeliefs | None) -> _Shared | None:
    """Columns and curvature at the common start; None if they do not determine all numbers.

    They are computed for readings equal to the prediction, so that they depend on no robot.
    """
    first = slice(0, 1)
    belief = belief and belief.some(first)
    at = ManyTangents.of(rows.some(first).seeing(start), start, belief)
    found = ManyCurvatures.of(at)
    return _Shared(at.A[0].T, found.inverses[0]) if found.sound[0] else None


def _fit_block(
    parameters: Parameters,
    rows: ManyRows,
    models: ManyModels,
    belief: ManyBeliefs | None,
    shared: _Shared | None,
) -> ManyFits:
    """Fit the tables of one block."""
    if shared is not None:
        models = _by_chords(rows, models, belief, shared)
    slow = np.full(len(models), shared is None)
    before = np.full(len(models), np.inf)
    near = NEAR if rows.mode == "whitened" and belief is None else NEARER
    if rows.like.joint_errors.springs is not None:
        near = NEAREST
    for _ in range(MOST_STEPS):
        at = ManyTangents.of(rows, models, belief)
        step, own = at.gradient if shared is None else times(at.gradient, shared.C), None
        if slow.any():
            own = ManyCurvatures.of(at)
            step = np.where(slow[:, None], own.step(at.gradient), step)
        inside = (step * at.gradient).sum(axis=1)
        # robots that have arrived stop, whatever the others do: below rounding steps gain nothing
        left = ~(at.certificate(inside) <= near) & (inside < 0.25 * before)
        if not left.any():
            break
        slow |= left & (inside > SLOW**2 * before)
        before = np.where(left, inside, 0.0)
        models = moved_by(models, rows.free, np.where(left[:, None], step, 0.0))
    return _ended(parameters, rows, models, at, own or ManyCurvatures.of(at))


def _by_chords(
    rows: ManyRows, models: ManyModels, belief: ManyBeliefs | None, shared: _Shared
) -> ManyModels:
    """Models after some steps that use only the columns at the start."""
    going = np.ones(len(models), dtype=bool)
    for _ in range(CHORDS):
        pull = times(rows.residual_at(models), shared.A)
        if belief is not None:
            pull += belief.at(models).pull
        step = times(pull, shared.C)
        models = moved_by(models, rows.free, np.where(going[:, None], step, 0.0))
        going &= (step * pull).sum(axis=1) >= SHORT**2 * len(rows.free)
        if not going.any():
            break
    return models


def _ended(
    parameters: Parameters, rows: ManyRows, models: ManyModels, at: ManyTangents,
    found: ManyCurvatures,
) -> ManyFits:  # fmt: skip
    """Fits after a last step by each robot's own curvature, with their statistics."""
    R, f, n = at.A.shape
    data, C = found.data, found.inverses
    step = found.step(at.gradient)
    inside = (step * at.gradient).sum(axis=1)
    certificate = at.certificate(inside)
    models = moved_by(models, rows.free, np.nan_to_num(step))
    dof, chi_square, evidence = np.full(R, float(n - f)), np.full(R, np.nan), np.full(R, np.nan)
    variance, p_value = np.ones(R), np.full(R, np.nan)
    if rows.mode == "paper":
        dof = dof + n  # the twelve rows
        variance = twelve_rows(models, rows.tables) / dof
    else:
        # to second order in the last step, which is short enough for that to be exact
        pull = (at.A @ at.r[:, :, None])[:, :, 0]
        chi_square = np.einsum("ri,ri->r", at.r, at.r)
        chi_square += np.einsum("rf,rf->r", step, (data @ step[:, :, None])[:, :, 0] - 2 * pull)
        if at.held is not None:
            dof = n - np.einsum("rij,rij->r", data, C)
            evidence = -(at.cost - inside - at.held.spread + found.spread) / 2
        p_value = chdtrc(dof, chi_square)
    return ManyFits(
        parameters=parameters,
        models=models,
        steps=models.steps()[:, rows.free],
        covariance=variance[:, None, None] * C,
        normal=found.normal,
        variance=variance,
        chi_square=chi_square,
        dof=dof,
        p_value=p_value,
        log_evidence=evidence,
        certificate=certificate,
        converged=found.sound & (certificate < RELATIVE_OFFSET),
    )


def moved_by(models: ManyModels, free: Index, step: Array) -> ManyModels:
    """Models after steps (R, f) of the free numbers."""
    full = np.zeros((len(models), models.like.n_numbers))
    full[:, free] = step
    return models.moved(full)
