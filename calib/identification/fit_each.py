"""One model fitted to many tables, each with its own poses: the estimates of `identify`, faster.

Only estimates: no reduction, covariance or tests. Tables of full poses are fitted together by
`many`; fits that get no certificate there, and all other tables, are fitted one by one.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Bool, frozen
from calib.errors import refuse
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.identify import MOST_STEPS, require_match, row_source
from calib.identification.least_squares import Status, solve
from calib.identification.many.fit import fit_many
from calib.identification.many.tables import ManyTables, known_to_many
from calib.identification.result import Mode
from calib.identification.tangent import NEGLIGIBLE, column_norms, tangent_plane
from calib.information.rank import KEEP_TOLERANCE
from calib.measurement.observations import Measurements
from calib.measurement.residual import table_whiteners
from calib.shown import Shown

FEW_STEPS = 12
"""Gauss-Newton steps that a fit from the nominal robot may take: five or six are usual."""
System = tuple[Array, Array]
"""Residual (n,) and derivative (n, f) of one table at one model."""
End = tuple[RobotModel, float, Status]
"""Model at which a fit ended, its certificate and its status."""


@dataclass(frozen=True, slots=True, eq=False)
class Fits(Shown):
    """K fits of one set of numbers, each to a table of its own."""

    models: tuple[RobotModel, ...]
    """(K,) model at which each fit ended."""
    steps: Array
    """(K, f) step of the free numbers from the nominal robot to it [m, rad]."""
    certificate: Array
    """(K,) relative offset there, or before the last step, see `tangent.Tangent.certificate`; 1
    where nothing was fitted."""
    status: tuple[Status, ...]
    """(K,) status of each fit: only those that converged are estimates."""

    def __repr__(self) -> str:
        return f"Fits({len(self.status)} fits, {int(self.converged.sum())} converged)"

    @property
    def converged(self) -> Bool:
        """(K,) whether each has its certificate."""
        return np.array([status is Status.CONVERGED for status in self.status], dtype=np.bool_)


def fit_each(
    nominal: RobotModel,
    tables: Sequence[Measurements] | ManyTables,
    parameters: Parameters,
    *,
    mode: Mode = "whitened",
) -> Fits:
    """Fit the free numbers to each table, starting from the nominal robot.

    Gauss-Newton steps by normal equations with unit columns, until the next step is below 1e-10
    standard deviations. One by one, an orthogonal factorization certifies the end. A fit that does
    not converge like this is solved as in `identify`.

    Parameters
    ----------
    nominal : RobotModel
        Start of every fit.
    tables : sequence of Measurements, or ManyTables
        What was measured, each with its own poses.
    parameters : Parameters
        Free numbers. None is dropped: if a table cannot tell them apart, its fit is DEFICIENT.
    mode : {"whitened", "paper"}
        Estimator, as in `identify`; no prior, and least squares only.

    Raises
    ------
    InputError
        No table, nothing is free, numbers of another model, an unknown mode.
    """
    require_match(nominal, parameters)
    if mode not in ("whitened", "paper"):
        raise refuse("mode", mode, "whitened or paper", code="A3", message=f'mode is "{mode}"')
    if not len(tables):
        raise refuse("tables", 0, "at least one", code="A3", message="there is no table to fit")
    ends: list[End | None] = [None] * len(tables)
    for places, many in _groups(tables):
        if known_to_many(nominal) and 6 * many.seen.shape[2] > parameters.n_free:
            together = fit_many(nominal, many, parameters, mode=mode)
            for k, place in enumerate(places):
                if together.converged[k]:
                    certificate = float(together.certificate[k])
                    ends[place] = together.models.one(k), certificate, Status.CONVERGED
    found = []
    for k, end in enumerate(ends):
        table = tables.one(k) if isinstance(tables, ManyTables) else tables[k]
        found.append(_fit(nominal, table, parameters, mode) if end is None else end)
    models, certificates, status = zip(*found, strict=True)
    steps = np.array([nominal.step_to(model)[parameters.free_index] for model in models])
    return Fits(models, frozen(steps), frozen(certificates), status)


def _groups(
    tables: Sequence[Measurements] | ManyTables,
) -> Iterator[tuple[Sequence[int], ManyTables]]:
    """Tables of equal length together, with their indices; only tables of full poses."""
    if isinstance(tables, ManyTables):
        yield range(len(tables)), tables
        return
    for size in dict.fromkeys(len(table) for table in tables):
        places = [k for k, table in enumerate(tables) if len(table) == size]
        many = ManyTables.alike([tables[k] for k in places])
        if many is not None:
            yield places, many


def _fit(nominal: RobotModel, table: Measurements, parameters: Parameters, mode: Mode) -> End:
    """One fit by itself."""
    columns = parameters.free_index
    rows = row_source(table, mode, None if mode == "paper" else table_whiteners(table))

    def evaluate(model: RobotModel) -> System:
        stack = rows(model)
        return stack.r, stack.A[:, columns]

    def move(model: RobotModel, step: Array) -> RobotModel:
        return model.moved(parameters.expand(step))

    first = evaluate(nominal)
    if not _tells_all(first[1]):
        return nominal, 1.0, Status.DEFICIENT
    found = _gauss_newton(evaluate, move, nominal, first)
    if found is not None:
        return found
    slow = solve(evaluate, nominal, move=move, most=MOST_STEPS)
    return slow.x, slow.certificate, slow.status


def _tells_all(A: Array) -> bool:
    """Whether the rows tell all columns apart, as `reduce` asks of each."""
    n, f = A.shape
    if n < f:
        return False
    B = A / column_norms(A)
    return bool(np.linalg.eigvalsh(B.T @ B)[0] > KEEP_TOLERANCE**2)


def _gauss_newton(
    evaluate: Callable[[RobotModel], System],
    move: Callable[[RobotModel, Array], RobotModel],
    x: RobotModel,
    system: System,
) -> End | None:
    """Solution with its certificate; None if plain Gauss-Newton steps do not converge.

    Normal equations square the condition number, which slows the last steps but does not bias the
    solution: the gradient that has to vanish is exact.
    """
    (r, A), before = system, np.inf
    n, f = A.shape
    for _ in range(FEW_STEPS):
        scale = column_norms(A)
        B = A / scale
        gradient = B.T @ r
        try:
            step = np.linalg.solve(B.T @ B, gradient)
        except np.linalg.LinAlgError:
            return None
        # squared length of the residual inside the tangent plane, and outside
        inside = float(gradient @ step)
        outside = float(r @ r) - inside
        if inside * (n - f) <= NEGLIGIBLE**2 * outside * f or not inside < 0.25 * before:
            break
        before = inside
        x = move(x, step / scale)
        r, A = evaluate(x)
    end = tangent_plane(r, A, column_norms(A))
    good = end.certified and not end.deficient
    return (x, end.certificate, Status.CONVERGED) if good else None
