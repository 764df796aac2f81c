"""End-to-end bootstrap: simulate the campaign of the identified robot, identify, compare."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, frozen
from calib.errors import refuse
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.kernels.loops import Loops, loops_for
from calib.kinds import checked_kinds
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.shown import ResultTable, Shown
from calib.uncertainty.batch import WIDTH
from calib.uncertainty.covariance import covariance_factor, standard_uncertainty
from calib.uncertainty.one_by_one import fitted_one_by_one
from calib.uncertainty.parallel import in_batches
from calib.uncertainty.refit import (
    BLOCKS,
    STEPS,
    Frozen,
    Refits,
    descend,
    freeze,
    joined,
    unknown_to_loops,
)

REPLICATES = 1000
"""Virtual campaigns; they leave 2 % in each standard deviation."""
FEWEST = 100
"""Replicates below which a standard deviation (7 %) checks nothing."""
UNSETTLED = 0.01
"""Part of the replicates that may not settle: their last steps are long for a solver, short beside
the scatter of all."""
FURTHER = 4
"""So many times the steps are taken where more than that part is left."""
BAND = 4.0
"""Standard errors that a sound result stays within: one of 16 000 numbers goes beyond."""


@dataclass(frozen=True, slots=True, eq=False)
class Bootstrap(Shown):
    """What N virtual calibrations of the identified robot say about the stated covariance."""

    names: Annotated[tuple[str, ...], "f"]
    """(f,) numbers estimated."""
    estimates: Annotated[Array, "N", "f"]
    """(N, f) estimate minus the robot that was simulated [m, rad]."""
    chi_square: Annotated[Array, "N"]
    """(N,) whitened sum of squares of each fit, without the prior."""
    covariance: Annotated[Array, "f", "f"]
    """(f, f) stated: inv(A'A + Lambda0) at the identified robot."""
    dof: int
    """Rows minus numbers estimated."""
    unconverged: int
    """Replicates whose last step was still long; they are counted, not dropped."""

    def __repr__(self) -> str:
        return f"Bootstrap({self.sentence})"

    def tables(self) -> dict[str, ResultTable]:
        """``numbers``: scatter over the stated sd, and mean error in stated sd."""
        return {
            "numbers": ResultTable({"name": self.names, "ratio": self.ratio, "bias": self.bias})
        }

    @property
    def replicates(self) -> int:
        """Number N of virtual calibrations."""
        return len(self.estimates)

    @property
    def empirical(self) -> Array:
        """(f, f) covariance over the replicates [m^2, m rad, rad^2]."""
        return np.cov(self.estimates, rowvar=False).reshape(self.covariance.shape)

    @property
    def ratio(self) -> Array:
        """(f,) standard deviation over the replicates by the stated one."""
        return np.asarray(
            self.estimates.std(axis=0, ddof=1) / standard_uncertainty(self.covariance)
        )

    @property
    def bias(self) -> Array:
        """(f,) mean error in units of the stated standard deviation."""
        return np.asarray(self.estimates.mean(axis=0) / standard_uncertainty(self.covariance))

    @property
    def agrees(self) -> bool:
        """Whether scatter and bias are those of the covariance, within sampling error."""
        N = self.replicates
        return bool(
            (np.abs(self.ratio - 1) <= BAND / np.sqrt(2 * N)).all()
            and (np.abs(self.bias) <= BAND / np.sqrt(N)).all()
            and self.settled
        )

    @property
    def settled(self) -> bool:
        """Whether the replicates arrived, but for a few."""
        return self.unconverged <= UNSETTLED * self.replicates

    @property
    def sentence(self) -> str:
        """The outcome in words."""
        N, off = self.replicates, np.abs(self.ratio - 1)
        worst, lean = int(np.argmax(off)), int(np.argmax(np.abs(self.bias)))
        if not self.settled:
            return (
                f"{self.unconverged} of {N} virtual calibrations did not converge: the readings "
                "hardly determine some numbers; vary the poses more, or free fewer numbers"
            )
        if self.agrees:
            late = f"; {self.unconverged} of them did not converge" if self.unconverged else ""
            return (
                f"{N} virtual calibrations scatter as the stated covariance predicts: standard "
                f"deviations within {100 * off[worst]:.1f} %, bias within "
                f"{abs(self.bias[lean]):.3f} standard deviations{late}"
            )
        return (
            f"{N} virtual calibrations do not scatter as the stated covariance predicts: "
            f"{self.names[worst]} by a factor {self.ratio[worst]:.3f}, bias of {self.names[lean]} "
            f"{self.bias[lean]:+.3f} standard deviations; the model is not linear over its own "
            "uncertainty: trust the scatter of the replicates instead"
        )


@checked_kinds
def bootstrap(
    model: RobotModel,
    measurements: Measurements,
    parameters: Parameters,
    rng: np.random.Generator,
    *,
    replicates: int = REPLICATES,
    steps: int = STEPS,
    prior_precision: ArrayLike | None = None,
    threads: int = 1,
) -> Bootstrap:
    """Measure and identify the identified robot again and again, with the stated noise.

    What it can show is that linear propagation holds; model errors are in no replicate. Arms on
    springs, lengths that follow the temperature, distances, several stations and free fixtures are
    fitted one by one, which takes a hundred times as long; so are fits that do not settle, where
    readings hardly tell a number.

    Parameters
    ----------
    model : RobotModel
        The identified robot: the truth of every replicate.
    measurements : Measurements
        The plan: joints, covariances, kinds of rows.
    parameters : Parameters
        Numbers that were identified, `Identification.parameters`.
    rng : numpy.random.Generator
        Source of the draws; each batch of replicates has its own child stream.
    replicates : int
        N, at least 100.
    steps : int
        Steps of each fit, but of those that are fitted one by one; `FURTHER` times as many where
        fits did not settle in these.
    prior_precision : (f, f) array_like, optional
        Lambda0 of the identification; the center of the prior is drawn anew for each replicate, so
        that the scatter to expect is inv(A'A + Lambda0).
    threads : int
        At work side by side; the result does not depend on it.

    References
    ----------
    x += inv(A'A + Lambda0) (A(x)'r(x) + Lambda0 (x0 - x)), the Hessian frozen at the model.
    """
    if steps < 1:
        raise refuse("steps", steps, "at least 1", code="A3")
    if replicates < FEWEST:
        allowed = f"{FEWEST} or more: fewer leave a standard deviation unknown by 7 %"
        raise refuse("replicates", replicates, allowed, code="A3")
    start = freeze(model, measurements, parameters, prior_precision=prior_precision)
    spread = _prior_spread(start)
    if unknown_to_loops(start.model, start.measurements, parameters) is not None:
        normal = rng.standard_normal((replicates, len(start.measurements), 6))
        center = rng.standard_normal((replicates, parameters.n_free)) @ spread.T
        return _told(start, fitted_one_by_one(start, normal, center))
    loops, pulls = loops_for(replicates), _pulls(start)
    parts = in_batches(
        lambda stream, count: _replicate(start, spread, pulls, stream, count, steps, loops),
        rng,
        replicates,
        size=BLOCKS * WIDTH,
        threads=threads,
    )
    return _told(start, joined(parts))


def _told(start: Frozen, whole: Refits) -> Bootstrap:
    """What all replicates say."""
    return Bootstrap(
        names=start.parameters.free_names,
        estimates=whole.steps,
        chi_square=whole.chi_square,
        covariance=start.covariance,
        dof=start.n_rows - start.parameters.n_free,
        unconverged=int((~whole.converged).sum()),
    )


def _replicate(
    start: Frozen,
    spread: Array,
    pulls: Array,
    rng: np.random.Generator,
    count: int,
    steps: int,
    loops: Loops,
) -> Refits:
    """One batch of virtual campaigns."""
    plan, blocks = start.measurements, -(-count // WIDTH)
    normal = rng.standard_normal((blocks, len(plan), 6, WIDTH))
    measured = np.empty((blocks, len(plan), 12, WIDTH))
    loops.noisy_poses(normal, plan.position, plan.rotation, start.factor, measured)
    center = np.zeros((blocks, len(spread), WIDTH))
    if spread.any():
        center = spread @ rng.standard_normal(center.shape)
    first = pulls @ normal.reshape(blocks, -1, WIDTH)
    for taken in (steps, FURTHER * steps):
        found = descend(start, measured, center, taken, loops.gradient, first).first(count)
        late = np.flatnonzero(~found.converged)
        if len(late) <= UNSETTLED * count:
            return found  # numbers that the readings hardly tell ask for more
    # their curvature changes within their own noise: the one at the model leads nowhere
    normal, center = (np.moveaxis(x, -1, 1).reshape(-1, *x.shape[1:-1]) for x in (normal, center))
    others = fitted_one_by_one(start, normal[late], center[late])
    columns = [getattr(found, name).copy() for name in Refits.__slots__]
    for column, name in zip(columns, Refits.__slots__, strict=True):
        column[late] = getattr(others, name)
    return Refits(*map(frozen, columns))


def _pulls(start: Frozen) -> Array:
    """J'W L (f, 6 m): how standard normal noise of every row pulls at each free number."""
    rows = predict(start.model, start.measurements).rows[:, :, start.parameters.free_index]
    noise = start.weight @ start.factor  # zero where a row has no entries
    return frozen(np.moveaxis(np.swapaxes(rows, 1, 2) @ noise, 1, 0).reshape(rows.shape[2], -1))


def _prior_spread(start: Frozen) -> Array:
    """G (f, f) with G G' the covariance of the prior; zero where nothing is known beforehand."""
    if not start.prior.any():
        return start.prior
    factor = covariance_factor(start.prior)
    known = np.flatnonzero(np.diagonal(start.prior))
    spread = np.zeros_like(factor)
    own = np.ix_(known, known)
    # Lambda0 = L L': inv(L') scatters with inv(Lambda0)
    spread[own] = np.linalg.solve(factor[own].T, np.eye(len(known)))
    return frozen(spread)
