"""Normal equations about one fit, from which any model with a subset of their numbers is solved.

For small steps the prediction is linear in the bends of the joints. Bends by terms are linear in
their numbers; those by springs are products of compliances and moments, and each product has a
column. Least squares of a model then needs only its part of A'A and A'r, however many the rows.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from calib.arrays import Array, Bool
from calib.geometry.bodies import Z
from calib.geometry.joint_errors import JointErrors
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.evidence.model_equations import ModelEquations, Solved, Sums
from calib.identification.evidence.spring_products import Products, products_of
from calib.identification.levels import distinct_terms
from calib.identification.prior import Prior
from calib.measurement.observations import Measurements
from calib.measurement.prediction import mount, predict_at
from calib.measurement.residual import table_whiteners
from calib.shown import Shown


@dataclass(frozen=True, slots=True, eq=False)
class NormalEquations(Shown):
    """Rows and normal equations of the widest model: geometry under a prior, and joint errors."""

    A: Array
    """(m, 6, c) whitened rows by the free numbers of the geometry, the terms, the products."""
    r: Array
    """(m, 6) whitened residual."""
    moved: Array
    """(m, 3, c) derivative of position, or of the distance in the first row, not whitened."""
    missed: Array
    """(m, 3) residual of position or distance [m]."""
    equations: Array
    """(m,) number of rows of each observation, times its weight."""
    normal: Array
    """(c, c) A'A of all rows."""
    pull: Array
    """(c,) A'r of the rows that are not left out."""
    square: float
    """r'r of the rows that are not left out."""
    names: tuple[str, ...]
    """(f + k,) names of the columns of geometry and terms."""
    products: Products
    """Columns of the springs, after those."""
    precision: Array
    """(f, f) prior precision of the geometry."""
    offset: Array
    """(f,) step from the prior mean to the fit [m, rad]."""
    less: Array
    """(n, c) whitened rows that are left out."""
    scale: float = 1.0
    """Noise in units of the stated one."""

    def __repr__(self) -> str:
        return f"NormalEquations({len(self.r)} observations, {len(self.pull)} columns)"

    @property
    def sums(self) -> Sums:
        """Those of all columns."""
        return Sums(self.normal, self.pull, self.square)

    def columns(self, terms: Iterable[str]) -> list[int]:
        """Columns of the geometry and of some terms."""
        place = _places(self.names)
        return [*range(len(self.offset)), *(place[name] for name in terms)]

    def of_model(self, errors: JointErrors, sd: Array, mean: Array | None = None) -> ModelEquations:
        """The part of a model with some joint errors, of prior sd and mean (k,).

        The prior mean of springs is zero; without `mean`, that of all.
        """
        k, f = len(errors.terms), len(self.offset)
        linear = self.columns(term.name for term in errors.terms)
        springs = self.products.of(errors, sd[k:])
        live = np.flatnonzero(np.diag(self.normal)[springs.columns])
        precision = np.eye(f + k)
        precision[:f, :f] = self.precision
        model = ModelEquations(
            sums=self.sums, precision=precision,
            believed=float(np.linalg.slogdet(self.precision)[1]),
            away=np.append(self.offset, np.zeros(k) if mean is None else -mean[:k] / sd[:k]),
            size=np.append(np.ones(f), sd[:k]), springs=springs,
            columns=np.append(linear, springs.columns[live]).astype(np.int64), live=live,
            width=len(self.pull),
        )  # fmt: skip
        sums = model.picked(self.sums)
        if len(self.less):
            less = self.less[:, model.columns]
            less[:, : f + k] *= model.size
            sums = sums._replace(normal=sums.normal - less.T @ less)
        return replace(model, sums=sums)

    def solved(
        self, errors: JointErrors, sd: Array, mean: Array | None = None, scale: float | None = None
    ) -> Solved:
        """Maximum a posteriori of the model with some joint errors, of prior sd and mean (k,).

        Geometry and terms are eliminated linearly, and the numbers of the springs are then found by
        a few steps.

        References
        ----------
        MacKay 1992: -(r'r/s^2 + x'Lambda0 x)/2 + ln|Lambda0|/2 - ln|A'A/s^2 + Lambda0|/2; all
        numbers are counted in units of their prior, where |Lambda0| of the joint errors is one.
        Eliminating the linear numbers: Golub & Pereyra 1973 (variable projection).
        """
        return self.of_model(errors, sd, mean).solved(scale or self.scale)

    def learned(
        self, errors: JointErrors, sd: Array, mean: Array | None = None, scale: float | None = None
    ) -> float:
        """Effective number of parameters that a model as in `solved` learns from the rows."""
        return self.of_model(errors, sd, mean).learned(scale or self.scale)

    def at_noise_of(
        self, errors: JointErrors, sd: Array, mean: Array | None = None
    ) -> "NormalEquations":
        """The same equations at the noise scale, one or more, that a model leaves."""
        model = self.of_model(errors, sd, mean)
        return replace(self, scale=model.noise(float(self.equations.sum())))

    def sizes_after(self, found: Solved) -> Array:
        """Root mean square (m,) of each observation's rows after a step, in stated noises."""
        left = self.r - self.A @ found.applied
        return np.asarray(np.sqrt((left**2).sum(axis=1) / self.equations))

    def misses(self, found: Solved, rows: Bool) -> Array:
        """Length of the residual of position or distance after a step, in some rows (m,) [m]."""
        left = self.missed[rows] - self.moved[rows] @ found.applied
        return np.asarray(np.linalg.norm(left, axis=1))

    def weighed(self, weights: Array) -> "NormalEquations":
        """The same with a weight of each observation (m,)."""
        root = np.sqrt(weights)[:, None]
        return self._of(root[:, :, None] * self.A, root * self.r, weights * self.equations)

    def without(self, rows: Bool) -> "NormalEquations":
        """The normal equations without some rows (m,)."""
        A, r = _flat(self.A[rows]), self.r[rows].ravel()
        return replace(self, less=A, pull=self.pull - A.T @ r, square=self.square - float(r @ r))

    def _of(self, A: Array, r: Array, equations: Array) -> "NormalEquations":
        flat, all_r = _flat(A), r.ravel()
        return replace(
            self, A=A, r=r, equations=equations, less=flat[:0],
            normal=flat.T @ flat, pull=flat.T @ all_r, square=float(all_r @ all_r),
        )  # fmt: skip


def normal_equations(
    nominal: RobotModel,
    fitted: RobotModel,
    measurements: Measurements,
    parameters: Parameters,
    added: Iterable[JointErrors],
    prior: Prior,
) -> NormalEquations:
    """Normal equations linearized about a fit of the geometry.

    Parameters
    ----------
    nominal : RobotModel
        Model that the prior refers to.
    fitted : RobotModel
        Model about which the equations are linearized.
    measurements : Measurements
        What was measured.
    parameters : Parameters
        Parameter table of `nominal`; its free numbers are the geometry.
    added : iterable of JointErrors
        Joint errors; models with the terms and springs of any of these can be solved for.
    prior : Prior
        Prior of all free numbers of the geometry.
    """
    added = tuple(added)
    terms = distinct_terms(added)
    springs = [errors.springs for errors in added if errors.springs is not None]
    q, at = measurements.q, measurements.conditions
    T, J, bends = fitted.poses_and_bends(q, at)
    products, loads = products_of(springs, q, parameters.n_free + len(terms), at.moments)
    bent = bends[:, :, list(products.places), None] * loads[:, None]
    wide = [
        J,
        fitted.term_columns(JointErrors(terms), J, bends[:, :, Z::3], q, at),
        bent.reshape(*bent.shape[:2], -1),
    ]
    whole = np.concatenate(wide, axis=2)
    mount(T, whole, fitted, measurements)
    seen = predict_at(T, whole, fitted.fixtures, fitted.first_fixture, measurements)
    own = [*parameters.free_index, *range(len(parameters.names), sum(w.shape[2] for w in wide))]
    rows, W = seen.rows[:, :, own], table_whiteners(measurements)
    order = [prior.names.index(name) for name in parameters.free_names]
    step = nominal.step_to(fitted)[parameters.free_index]
    empty = NormalEquations(
        A=rows, r=seen.residual, moved=rows[:, :3], missed=seen.residual[:, :3],
        equations=measurements.equations.astype(np.float64), normal=rows[0], pull=rows[0, 0],
        square=0.0, names=(*parameters.free_names, *(term.name for term in terms)),
        products=products, precision=prior.precision[np.ix_(order, order)],
        offset=step - prior.mean[order], less=rows[0],
    )  # fmt: skip
    filled = seen.filled
    return empty._of(
        np.where(filled[:, :, None], W @ rows, 0.0),
        np.where(filled, (W @ seen.residual[:, :, None])[:, :, 0], 0.0),
        empty.equations,
    )


@lru_cache(maxsize=4)
def _places(names: tuple[str, ...]) -> dict[str, int]:
    return {name: k for k, name in enumerate(names)}


def _flat(A: Array) -> Array:
    return A.reshape(-1, A.shape[-1])
