"""The uncertainty budget: what each source leaves in the parameters and at the tool."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, check, frozen
from calib.errors import refuse
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.information.propagation import point_uncertainty, tool_covariance
from calib.kinds import checked_kinds
from calib.shown import ResultTable, Shown, length_words, mean_of
from calib.uncertainty.covariance import (
    common_input_covariance,
    covariance_factor,
    standard_uncertainty,
)
from calib.uncertainty.refit import Frozen
from calib.uncertainty.regions import student_factor
from calib.uncertainty.type_b import CommonInput, estimator_maps


@dataclass(frozen=True, slots=True, eq=False)
class RowNoise:
    """A source that scatters anew in every row: tracker noise, joint repeatability."""

    name: str
    covariance: Array
    """(m, 6, 6) what it adds to the covariance of each row [m^2, m rad, rad^2], world axes."""
    degrees_of_freedom: float = np.inf


@dataclass(frozen=True, slots=True, eq=False)
class Contribution(Shown):
    """One line of a budget."""

    name: str
    covariance: Array
    """(f, f) what it leaves in the estimate [m, rad]."""
    degrees_of_freedom: float

    def __repr__(self) -> str:
        return f"Contribution({self.name!r} to {len(self.covariance)} numbers)"


@dataclass(frozen=True, slots=True, eq=False)
class ToolBudget(Shown):
    """What each source leaves at the tool point of N postures."""

    names: tuple[str, ...]
    """(s,) sources."""
    standard: Array
    """(s, N) u_3D from each source alone [m]."""
    covariance: Array
    """(N, 3, 3) combined [m^2]."""
    degrees_of_freedom: Array
    """(N,) effective, of the combined u_3D."""

    def __repr__(self) -> str:
        u = length_words(mean_of(self.combined), um=".3g")
        return f"ToolBudget({len(self.names)} sources, mean u {u})"

    def tables(self) -> dict[str, ResultTable]:
        """``sources``: what each leaves at the tool point alone, root mean square [m]."""
        u = [np.sqrt(mean_of(own**2)) for own in self.standard]
        return {"sources": ResultTable({"source": self.names, "u_m": u})}

    @property
    def combined(self) -> Array:
        """(N,) combined u_3D [m]."""
        return point_uncertainty(self.covariance)

    @property
    def share(self) -> Array:
        """(s, N) part of the combined variance that each source brings; sums to one.

        Zero where no source leaves anything.
        """
        whole = np.broadcast_to(np.square(self.combined), self.standard.shape)
        none = np.zeros(whole.shape)
        return np.asarray(np.divide(self.standard**2, whole, out=none, where=whole > 0))


@dataclass(frozen=True, slots=True, eq=False)
class Budget(Shown):
    """Contributions to the covariance of the estimate, source by source."""

    parameters: Parameters
    sources: tuple[Contribution, ...]

    def __repr__(self) -> str:
        return f"Budget({', '.join(self.names)})"

    def tables(self) -> dict[str, ResultTable]:
        """``numbers``: u of each from each source and from all, in its unit."""
        sources = dict(zip(self.names, self.standard, strict=True))
        unit = np.where(self.parameters.is_length[self.parameters.free], "m", "rad")
        columns = {"name": self.parameters.free_names, **sources, "combined": self.combined}
        return {"numbers": ResultTable(columns | {"unit": unit})}

    @property
    def names(self) -> tuple[str, ...]:
        """(s,) names of the sources."""
        return tuple(source.name for source in self.sources)

    @property
    def covariance(self) -> Array:
        """(f, f) of the estimate, all sources together [m^2, m rad, rad^2]."""
        return np.asarray(sum(source.covariance for source in self.sources))

    @property
    def standard(self) -> Array:
        """(s, f) standard uncertainty of each number from each source alone [m, rad]."""
        return np.stack([standard_uncertainty(source.covariance) for source in self.sources])

    @property
    def combined(self) -> Array:
        """(f,) combined standard uncertainty [m, rad]."""
        return standard_uncertainty(self.covariance)

    @property
    def degrees_of_freedom(self) -> Array:
        """(f,) effective degrees of freedom of the combined standard uncertainties."""
        return effective_dof(self.standard, self._dof)

    @property
    def _dof(self) -> Array:
        """(s,) degrees of freedom of the sources."""
        return np.array([source.degrees_of_freedom for source in self.sources])

    def expanded(self, probability: float = 0.95) -> Array:
        """Expanded uncertainty (f,) with the Student factor of the effective degrees [m, rad].

        References
        ----------
        JCGM 100:2008, G.4.1, G.6.4: degrees of freedom rounded down.
        """
        # nine degrees of freedom must not become eight by rounding
        whole = np.maximum(np.floor(self.degrees_of_freedom * (1 + 1e-9)), 1.0)
        return student_factor(whole, probability) * self.combined

    @checked_kinds
    def at_tool(self, model: RobotModel, q: ArrayLike) -> ToolBudget:
        """The same at the tool point of joints q (N, n) [rad, m], in the axes of the world.

        Parameters
        ----------
        model : RobotModel
            Identified: the one whose numbers the budget is of.
        q : (N, n) array_like
            Commanded joint values [rad, m].
        """
        if model.names != self.parameters.names:
            sizes = f"{len(self.parameters.names)} numbers, the model has {model.n_numbers}"
            allowed, message = "the model that the budget is of", f"the budget has {sizes}"
            raise refuse("model", allowed=allowed, code="A4", message=message)
        index = self.parameters.free_index
        parts = []
        for source in self.sources:
            full = np.zeros((model.n_numbers,) * 2)
            full[np.ix_(index, index)] = source.covariance
            parts.append(tool_covariance(model, q, full)[:, :3, :3])
        standard = np.stack([point_uncertainty(part) for part in parts])
        return ToolBudget(
            self.names,
            frozen(standard),
            frozen(sum(parts)),
            frozen(effective_dof(standard, self._dof)),
        )


@checked_kinds
def budget(
    start: Frozen, noise: Sequence[RowNoise], *, common: Sequence[CommonInput] = ()
) -> Budget:
    """Take the covariance of an estimate apart by source.

    Parameters
    ----------
    start : Frozen
        From `freeze`: the identified robot, the plan with the covariances that weighted the fit,
        the prior. Its sources need not be those the fit believed in: the budget is of what the
        estimate really does with them.
    noise : sequence of RowNoise
        What scatters anew in every row. If these sum to the covariance of the plan, they and the
        prior sum to inv(A'A + Lambda0).
    common : sequence of CommonInput
        What is wrong the same way all campaign long.

    References
    ----------
    F Sigma F' for each source, F = inv(A'A + Lambda0) A'N; JCGM 100:2008, 5.1 and 8.
    """
    F, m, f = estimator_maps(start), len(start.measurements), start.parameters.n_free
    sources = []
    for own in noise:
        (covariance,) = check(f"{m} 6 6", covariance=own.covariance)
        roots = np.stack([covariance_factor(block) for block in covariance])
        # (F L)(F L)' stays positive
        columns = np.moveaxis(F @ roots, 1, 0).reshape(f, m * 6)
        sources.append(Contribution(own.name, frozen(columns @ columns.T), own.degrees_of_freedom))
    for shared in common:
        C = common_input_covariance(F, _same_rows(shared, m), shared.covariance)
        sources.append(Contribution(shared.name, C, shared.degrees_of_freedom))
    if start.prior.any():
        G = start.covariance @ covariance_factor(start.prior)
        sources.append(Contribution("prior", frozen(G @ G.T), np.inf))
    if not sources:
        raise refuse("noise", code="A3", message="the budget has no source", fix="name one")
    return Budget(start.parameters, tuple(sources))


def effective_dof(standard: ArrayLike, degrees_of_freedom: ArrayLike) -> Array:
    """Effective degrees of freedom (...) of a sum of uncorrelated contributions (s, ...).

    Infinite where no contribution with finite degrees of freedom counts. Not for correlated
    contributions: the formula does not hold for them.

    References
    ----------
    Welch-Satterthwaite; JCGM 100:2008, G.4.1.
    """
    u = np.asarray(standard, dtype=np.float64)
    nu = np.asarray(degrees_of_freedom, dtype=np.float64)
    if nu.shape != (len(u),) or not (nu > 0).all():
        raise refuse("degrees_of_freedom", nu.tolist(), f"{len(u)} values above zero", code="A3")
    total = np.square(np.square(u).sum(axis=0))
    finite = np.isfinite(nu)
    lost = (u[finite] ** 4 / nu[finite].reshape(-1, *([1] * (u.ndim - 1)))).sum(axis=0)
    return np.asarray(np.divide(total, lost, out=np.full(total.shape, np.inf), where=lost > 0))


def _same_rows(shared: CommonInput, m: int) -> Array:
    """Its sensitivity, if it has a row for each of the plan."""
    if len(shared.sensitivity) != m:
        rows, allowed = len(shared.sensitivity), f"one per row of the plan, {m}"
        message = f'"{shared.name}" has {rows} rows'
        raise refuse("sensitivity", rows, allowed, code="A1", message=message)
    return shared.sensitivity
