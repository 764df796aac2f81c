"""Least squares of one set of numbers for many tables at once: what `identify` finds of each.

Estimates, covariances and tests of R robots in a few passes over arrays. All share model, free
numbers and prior; where they share the poses as well, the curvature where they start is made once.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc

from calib.arrays import Array, Bool, Index
from calib.errors import refuse
from calib.geometry.many import ManyModels
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.identify import require_match
from calib.identification.many.tables import ManyRows, ManyTables, known_to_many, twelve_rows
from calib.identification.many.tangents import ManyBeliefs, ManyCurvatures, ManyTangents, times
from calib.identification.prior import Prior
from calib.identification.result import Mode
from calib.identification.tangent import RELATIVE_OFFSET
from calib.shown import Shown

BLOCK = 32
"""Robots in one pass, whose columns stay in the second-level cache; part of what fixes the bits of
a result."""
NEAR, NEARER, NEAREST = 1e-7, 1e-9, 1e-10
"""Relative offset from which one more step ends a fit. The step leaves the square of that; the
smaller ones where it leaves a hundredth, in paper mode, and where a prior holds what the rows
hardly tell, whose columns turn with the step: those of springs most."""
CHORDS, SHORT = 2, 2.0
"""Steps by the columns at the start, before any robot's own are made, and the length in standard
uncertainties of all numbers below which a step was the last: what those columns miss stays."""
MOST_STEPS = 12
"""Steps after which a fit is left to `identify`; two or three are usual."""
SLOW = 0.1
"""Part of the way that a step by shared curvature may leave before robots take their own."""


@dataclass(frozen=True, slots=True, eq=False)
class ManyFits(Shown):
    """R fits of the same f numbers; one that is not `converged` is no estimate."""

    parameters: Parameters
    """Which numbers are free."""
    models: ManyModels
    """Where each ended."""
    steps: Array
    """(R, f) estimates minus nominal [m, rad]."""
    covariance: Array
    """(R, f, f) as in `Identification` [m^2, m rad, rad^2]."""
    normal: Array
    """(R, f, f) A'A + Lambda0 there; in paper mode H'H of the twelve rows."""
    variance: Array
    """(R,) factor of the covariance: 1, or s^2 in paper mode."""
    chi_square: Array
    """(R,) whitened sums of squares of the rows; nan in paper mode."""
    dof: Array
    """(R,) rows minus numbers learned from them; see `Identification.dof_effective`."""
    p_value: Array
    """(R,) chances of a larger chi-square; nan in paper mode."""
    log_evidence: Array
    """(R,) as in `Identification`; nan without a prior."""
    certificate: Array
    """(R,) relative offset before the last step, see `tangent.Tangent.certificate`."""
    converged: Bool
    """(R,) whether each ended with its certificate; of the others ask `identify`."""

    def __len__(self) -> int:
        return len(self.models)

    def __repr__(self) -> str:
        return f"ManyFits({len(self)} fits, {int(self.converged.sum())} converged)"

    @property
    def standard_uncertainty(self) -> Array:
        """(R, f) square roots of the diagonals of the covariances [m, rad]."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))


def fit_many(
    nominal: RobotModel,
    tables: ManyTables,
    parameters: Parameters,
    *,
    mode: Mode = "whitened",
    prior: Prior | None = None,
    weight: Array | None = None,
    start: RobotModel | ManyModels | None = None,
    shared: bool | None = None,
) -> ManyFits:
    """Fit the free numbers to each of many tables.

    Newton steps along the exact gradient: by the curvature at the start, where all tables share
    their poses, else and where that is slow by each robot's own; until a step leaves nothing. That
    of springs has what their products with moments and tilts bend: without it steps would be slow.

    Parameters
    ----------
    nominal : RobotModel
        What the estimates are counted from, and the value of every number that is not free; which
        models there may be, `known_to_many` says.
    tables : ManyTables
        What was measured.
    parameters : Parameters
        Free numbers, all of them estimated: none is left out that a table cannot tell.
    mode : {"whitened", "paper"}
        Estimator, as in `identify`.
    prior : Prior, optional
        Of all free numbers.
    weight : (R,) array, optional
        Factor of each robot on the precision of the prior.
    start : RobotModel or ManyModels, optional
        Where the search begins, as in `identify`, of all or of each.
    shared : bool, optional
        Whether fits share the curvature there, which tables of one plan may; so do several by
        default, from one start and under one prior. No bit of a fit hangs on how many there are
        beside it, but on this.

    Raises
    ------
    InputError
        A model that arrays do not know, nothing free, no more rows than numbers without a prior.

    References
    ----------
    As `identify`. Normal equations square the condition: what they lose is bounded by the pivots of
    their Cholesky factor, and the gradient that has to vanish is exact.
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
        alike = weight is None and not isinstance(start, ManyModels)
        shared = alike and len(tables.q) == 1 < len(tables)
    if not isinstance(start, ManyModels):
        start = ManyModels.of(nominal if start is None else start, len(tables), nominal)
    rows = ManyRows.of(nominal, tables, parameters.free_index, mode)
    belief = None if prior is None else ManyBeliefs.of(prior, parameters, weight)
    return fit_rows(rows, parameters, start, belief, shared)


def fit_rows(
    rows: ManyRows,
    parameters: Parameters,
    start: ManyModels,
    belief: ManyBeliefs | None,
    shared: bool,
) -> ManyFits:
    """As `fit_many`, of rows and beliefs at hand."""
    common = _shared(rows, start.some(slice(0, 1)), belief) if shared else None
    parts = [
        _fit_block(
            parameters, rows.some(part), start.some(part), belief and belief.some(part), common
        )
        for part in (slice(k, k + BLOCK) for k in range(0, len(start), BLOCK))
    ]
    return joined_fits(parts)


def joined_fits(parts: list[ManyFits]) -> ManyFits:
    """The fits of all parts, in order."""
    names = [name for name in ManyFits.__slots__ if name not in ("parameters", "models")]
    return ManyFits(
        parts[0].parameters,
        ManyModels.joined([part.models for part in parts]),
        *(np.concatenate([getattr(part, name) for part in parts]) for name in names),
    )


class _Shared(NamedTuple):
    """What all tables of one plan have in common where their fits start."""

    A: Array
    """(6 m, f) whitened columns."""
    C: Array
    """(f, f) inverse of the curvature."""


def _shared(rows: ManyRows, start: ManyModels, belief: ManyBeliefs | None) -> _Shared | None:
    """Columns and curvature at the one start; None where they do not tell all numbers.

    Of a table that sees what is predicted there: they hang on no robot.
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
        # those that are there stay, whatever the others do: at rounding no step leads further
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
    """Models after some steps that need no columns but those at the start."""
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
    """The last step, by each robot's own curvature, and the statistics there."""
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
        # to second order in the last step, which is exact for it is so short
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
