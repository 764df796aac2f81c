"""The believed region of the tool point: parameters, and the largest misfit that may hide.

One rule, whatever the tests say: no switch between statements at a level of significance.
"""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import LATER, Array, check, frozen
from calib.geometry.jacobian import joint_columns
from calib.geometry.model import RobotModel
from calib.geometry.operating import AS_USUAL, OperatingConditions
from calib.information.propagation import propagated
from calib.kinds import in_short
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict, predicted_positions
from calib.measurement.tool_target import ToolTarget
from calib.shown import Shown, length_words
from calib.uncertainty.frames.inner_datum import InnerDatum
from calib.uncertainty.statement.applicability import Proven
from calib.uncertainty.statement.misfit import HiddenMisfit
from calib.uncertainty.tool_point import ToolStatement


@dataclass(frozen=True, slots=True, eq=False)
class Belief(Shown):
    """What is believed of an identified robot's tool point, wherever it is asked for."""

    model: RobotModel
    covariance: Annotated[Array, "P", "P"]
    """(P, P) of all numbers, from the noise and what else is stated [m, rad]."""
    misfit: HiddenMisfit
    misfit_covariance: Annotated[Array, "P", "P"]
    """(P, P) of all numbers from a misfit of 1 m per axis in the training rows."""
    factor: float
    """k of the regions: the chi-square factor, or more if held-out errors ask for it."""
    n_guards: int
    """Held-out poses that guard the factor; 0 where there were too few."""
    probability: float
    proven: Proven
    """Where the proof stands; elsewhere the region grows."""
    turned: float = 0.0
    """How far angles are off beyond what is stated of them, per axis; what that leaves in the
    numbers is in `covariance` [rad]."""
    n_ranged: Annotated[int, LATER] = 0
    """Held-out poses whose distances alone widen the factor, which guards no direction but theirs;
    0 where there were too few, or where points guard it."""
    mirrored: Annotated[bool, LATER] = False
    """Whether `covariance` holds the image of the arm beyond the plane of its tool points, too:
    nothing tells them apart."""

    noise_counts: Annotated[bool, LATER] = False
    """Whether held-out errors guard it with all their noise in them, since nothing tells it."""

    def __repr__(self) -> str:
        return (
            f"Belief(misfit up to {length_words(self.misfit.upper, um='.3g')} per axis, factor "
            f"{self.factor:.3g}, {self.n_guards} guards)"
        )

    @property
    def datum(self) -> InnerDatum | None:
        """The frame in which regions are stated, where no reading shows where the base stands."""
        return self.proven.datum

    @in_short
    def regions(
        self,
        q: ArrayLike,
        *,
        target: ArrayLike | ToolTarget = (0.0, 0.0, 0.0),
        growth: ArrayLike | None = None,
        repeatability: ArrayLike | None = None,
        at: OperatingConditions = AS_USUAL,
    ) -> ToolStatement:
        """Regions of the mean of many moves to joints q (N, n) [rad, m], or of where one move ends.

        Parameters
        ----------
        q : (N, n) array_like
            Commanded joint values.
        target : (3,) array_like or ToolTarget
            Point in the tool frame that is stated [m], or a reflector of the model.
        growth : (N,) or scalar array_like, optional
            Factor of the misfit's variance at each posture, one or more; by default what `proven`
            says of it.
        repeatability : (n,) array_like, optional
            Standard deviation with which each joint comes back [rad, m]; given, the regions are of
            where one move ends, at the same factor.
        at : OperatingConditions, optional
            Under which the robot goes there.
        """
        mean, move = self.mean_and_move(
            q, target=target, growth=growth, repeatability=repeatability, at=at
        )
        return mean if move is None else move

    @in_short
    def mean_and_move(
        self,
        q: ArrayLike,
        *,
        target: ArrayLike | ToolTarget = (0.0, 0.0, 0.0),
        growth: ArrayLike | None = None,
        repeatability: ArrayLike | None = None,
        at: OperatingConditions = AS_USUAL,
    ) -> tuple[ToolStatement, ToolStatement | None]:
        """`regions` of the mean of many moves, and of one move where a repeatability is given."""
        grown = self.proven.applies(q, at).growth if growth is None else np.asarray(growth, float)
        T, J = self.model.poses_and_jacobian(q, at)
        position, rows = ToolTarget.of(target).positions_and_rows(self.model, T, J)
        sigma = self.spread(rows, np.broadcast_to(grown, (len(T),)), position)
        mean = ToolStatement(frozen(position), frozen(sigma), self.factor, self.probability)
        if repeatability is None:
            return mean, None
        (sd,) = check(f"{self.model.chain.n_joints}", repeatability=repeatability)
        moved = rows[:, :, joint_columns(self.model.chain)] * sd
        return mean, replace(mean, covariance=frozen(sigma + moved @ np.swapaxes(moved, 1, 2)))

    def seen_regions(self, table: Measurements) -> ToolStatement:
        """Regions of the points that rows of a table look at, with their own stations and tools.

        In the axes of each row's station: what is uncertain of its frames is in them.
        """
        rows = predict(self.model, table).rows[:, :3]
        sigma = self.spread(rows, self.proven.applies(table.q, table.conditions).growth)
        position = predicted_positions(self.model, table)
        return ToolStatement(frozen(position), frozen(sigma), self.factor, self.probability)

    def relative(self, position: Array, rows: Array) -> Array:
        """Rows (N, 3, P) of tool points at (N, 3) [m] in the frame that regions are stated in."""
        return rows if self.datum is None else self.datum.relative(position, rows)

    def spread(self, rows: Array, growth: Array, position: Array | None = None) -> Array:
        """Covariances (N, k, k) of what has the derivative `rows` (N, k, P) [m^2].

        Parameters
        ----------
        rows : (N, k, P) array
            Derivative by the numbers of the model.
        growth : (N,) array
            Factor of the misfit's variance, one or more.
        position : (N, 3) array, optional
            Given, the rows are of tool points there, which are stated in the frame of `datum` [m].
        """
        own = self.misfit.shape.rows(rows)
        seen = rows if position is None else self.relative(position, rows)
        hidden = propagated(seen, self.misfit_covariance) + own @ np.swapaxes(own, 1, 2)
        size = self.misfit.upper**2 * np.maximum(1.0, growth)
        return propagated(seen, self.covariance) + size[:, None, None] * hidden
