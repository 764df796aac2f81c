"""Normal equations about one fit: every model whose numbers are some of theirs in one solve.

Where steps are small the prediction is linear in them, and least squares of any part of the columns
needs no more than that part of A'A and A'r.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from calib.arrays import Array, Bool
from calib.geometry.joint_errors import JointTerm
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.ladders import with_terms
from calib.identification.prior import Prior
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.measurement.residual import table_whiteners

SETTLED = 1e-4
"""Part by which the noise scale changes once it is found."""
MOST_TURNS = 50
"""Turns in which it is looked for."""
LEAST_FREE = 0.2
"""Part of the rows that counts as degrees of freedom however many numbers are learned."""


class Solved(NamedTuple):
    """A model's part of the normal equations, solved."""

    step: Array
    """(k,) from the fit about which they stand [m, rad]."""
    evidence: float
    """Log evidence by Laplace's method, up to a constant that all models share."""
    learned: float
    """Numbers learned from the measurements: k less the part that the prior holds."""
    left: float
    """Whitened sum of squares of the measurements after the step."""


@dataclass(frozen=True, slots=True, eq=False)
class NormalEquations:
    """Rows and normal equations of the widest model: geometry under a prior, and added terms."""

    A: Array
    """(m, 6, f + k) whitened rows: the free numbers of the geometry, then the terms."""
    r: Array
    """(m, 6) whitened residual."""
    moved: Array
    """(m, 3, f + k) change of position, or of the distance in the first row."""
    missed: Array
    """(m, 3) residual of them [m]."""
    equations: Array
    """(m,) rows that each observation has, times its weight."""
    normal: Array
    """(f + k, f + k) A'A."""
    pull: Array
    """(f + k,) A'r."""
    square: float
    """r'r."""
    names: tuple[str, ...]
    """(f + k,) of the columns."""
    precision: Array
    """(f, f) prior of the geometry."""
    offset: Array
    """(f,) step to the fit from what is believed [m, rad]."""
    scale: float = 1.0
    """Noise in units of the stated one."""

    def __repr__(self) -> str:
        return f"NormalEquations({len(self.r)} observations, {len(self.names)} numbers)"

    def columns(self, terms: Sequence[str]) -> list[int]:
        """Columns of the geometry and of some terms."""
        place = {name: k for k, name in enumerate(self.names)}
        return [*range(len(self.offset)), *(place[name] for name in terms)]

    def solved(self, terms: Sequence[str], sd: Array, scale: float | None = None) -> Solved:
        """Maximum a posteriori of the model with some terms, of prior sd (k,), about zero.

        References
        ----------
        MacKay 1992: -(r'r/s^2 + x'Lambda0 x)/2 + ln|Lambda0|/2 - ln|A'A/s^2 + Lambda0|/2; all
        numbers are counted in units of their prior, where |Lambda0| of the terms is one.
        """
        at, f, s = self.columns(terms), len(self.offset), scale or self.scale
        size = np.concatenate([np.ones(f), sd])
        seen = size[:, None] * self.normal[np.ix_(at, at)] * size / s**2
        prior = np.eye(len(at))
        prior[:f, :f] = self.precision
        force = size * self.pull[at] / s**2
        force[:f] -= self.precision @ self.offset
        root = np.sqrt(np.diag(seen + prior))
        factor = cho_factor((seen + prior) / root[:, None] / root)
        step = cho_solve(factor, force / root) / root
        held = cho_solve(factor, prior / root[:, None] / root)
        loss = self.square / s**2 + self.offset @ self.precision @ self.offset - force @ step
        spread = 2 * float(np.log(np.diag(factor[0])).sum() + np.log(root).sum())
        own = float(np.linalg.slogdet(self.precision)[1])
        left = self.square + step @ (seen @ step - 2 * size * self.pull[at] / s**2) * s**2
        return Solved(
            size * step,
            float(own - loss - spread) / 2,
            len(at) - float(np.trace(held)),
            float(left),
        )

    def at_noise_of(self, terms: Sequence[str], sd: Array) -> "NormalEquations":
        """The same with the noise scale, one or more, that a model leaves."""
        rows, scale = float(self.equations.sum()), 1.0
        for _ in range(MOST_TURNS):
            found = self.solved(terms, sd, scale)
            free = max(rows - found.learned, LEAST_FREE * rows)
            last, scale = scale, max(1.0, float(np.sqrt(found.left / free)))
            if abs(scale / last - 1) < SETTLED:
                break
        return replace(self, scale=scale)

    def sizes_after(self, terms: Sequence[str], step: Array) -> Array:
        """Root mean square (m,) of each observation's rows after a step, in stated noises."""
        left = self.r - self.A[:, :, self.columns(terms)] @ step
        return np.asarray(np.sqrt((left**2).sum(axis=1) / self.equations))

    def misses(self, terms: Sequence[str], step: Array, rows: Bool) -> Array:
        """What a step leaves of position or distance in some rows (m,) [m]."""
        moved = self.moved[rows][:, :, self.columns(terms)] @ step
        return np.asarray(np.linalg.norm(self.missed[rows] - moved, axis=1))

    def weighed(self, weights: Array) -> "NormalEquations":
        """The same with a weight of each observation (m,)."""
        root = np.sqrt(weights)[:, None]
        return self._of(root[:, :, None] * self.A, root * self.r, weights * self.equations)

    def without(self, rows: Bool) -> "NormalEquations":
        """The normal equations without some rows (m,)."""
        A, r = _flat(self.A[rows]), self.r[rows].ravel()
        return replace(
            self,
            normal=self.normal - A.T @ A,
            pull=self.pull - A.T @ r,
            square=self.square - float(r @ r),
        )

    def _of(self, A: Array, r: Array, equations: Array) -> "NormalEquations":
        flat, all_r = _flat(A), r.ravel()
        return replace(
            self, A=A, r=r, equations=equations,
            normal=flat.T @ flat, pull=flat.T @ all_r, square=float(all_r @ all_r),
        )  # fmt: skip


def normal_equations(
    nominal: RobotModel,
    fitted: RobotModel,
    measurements: Measurements,
    parameters: Parameters,
    terms: Sequence[JointTerm],
    prior: Prior,
) -> NormalEquations:
    """Normal equations about a fit.

    Parameters
    ----------
    nominal : RobotModel
        Where the fit began: what the prior speaks of.
    fitted : RobotModel
        Where it ended.
    measurements : Measurements
        What is looked at.
    parameters : Parameters
        Of `nominal`: its free numbers are the geometry.
    terms : sequence of JointTerm
        Added to the fitted model, all zero.
    prior : Prior
        Of all free numbers of the geometry.
    """
    wide = with_terms(fitted, terms)
    seen = predict(wide, measurements)
    names = (*parameters.free_names, *(term.name for term in terms))
    place = {name: k for k, name in enumerate(wide.names)}
    rows, W = seen.rows[:, :, [place[name] for name in names]], table_whiteners(measurements)
    order = [prior.names.index(name) for name in parameters.free_names]
    step = nominal.step_to(fitted)[parameters.free_index]
    empty = NormalEquations(
        A=rows, r=seen.residual, moved=rows[:, :3], missed=seen.residual[:, :3],
        equations=measurements.equations.astype(np.float64), normal=rows[0], pull=rows[0, 0],
        square=0.0, names=names, precision=prior.precision[np.ix_(order, order)],
        offset=step - prior.mean[order],
    )  # fmt: skip
    filled = seen.filled
    return empty._of(
        np.where(filled[:, :, None], W @ rows, 0.0),
        np.where(filled, (W @ seen.residual[:, :, None])[:, :, 0], 0.0),
        empty.equations,
    )


def _flat(A: Array) -> Array:
    return A.reshape(-1, A.shape[-1])
