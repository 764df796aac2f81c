"""The tool point as it may be stated: position, 3-D covariance and the region it should lie in."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Bool, check, frozen
from calib.geometry.model import RobotModel
from calib.geometry.sweep import reflector_rows
from calib.information.propagation import axis_uncertainty, point_uncertainty, tool_covariance
from calib.uncertainty.discrepancy import Discrepancy
from calib.uncertainty.regions import coverage_factor, ellipsoid, inside


@dataclass(frozen=True, slots=True, eq=False)
class ToolStatement:
    """Tool points at N postures with their regions; in world axes."""

    position: Array
    """(N, 3) predicted tool point [m]."""
    covariance: Array
    """(N, 3, 3) Sigma_t, plus Sigma_d if a discrepancy was given [m^2]."""
    factor: float
    """k: the region is all e with e' inv(covariance) e <= k^2."""
    probability: float

    @property
    def axes(self) -> Array:
        """(N, 3) u_x, u_y, u_z [m]."""
        return axis_uncertainty(self.covariance)

    @property
    def point(self) -> Array:
        """(N,) u_3D [m]."""
        return point_uncertainty(self.covariance)

    @property
    def region(self) -> tuple[Array, Array]:
        """Semi-axes (N, 3) [m], longest first, and their directions (N, 3, 3) in columns."""
        half, turn = ellipsoid(self.covariance, probability=self.probability)
        return half * (self.factor / coverage_factor(3, self.probability)), turn

    @property
    def mean_radius(self) -> float:
        """Mean over postures of the radius of the ball with the region's volume [m]."""
        half, _ = self.region
        return float(np.cbrt(half.prod(axis=1)).mean())

    def holds(self, position: ArrayLike) -> Bool:
        """(N,) whether each region holds the position (N, 3) [m]."""
        (position,) = check(f"{len(self.position)} 3", position=position)
        stretch = (self.factor / coverage_factor(3, self.probability)) ** 2
        return inside(
            position - self.position, stretch * self.covariance, probability=self.probability
        )


def tool_statement(
    model: RobotModel,
    q: ArrayLike,
    covariance: ArrayLike,
    *,
    discrepancy: Discrepancy | None = None,
    probability: float = 0.95,
    target: ArrayLike | None = None,
) -> ToolStatement:
    """State the tool point at joints q (N, n) [rad, m].

    Parameters
    ----------
    model : RobotModel
        Identified.
    q : (N, n) array_like
        Commanded joint values.
    covariance : (P, P) array_like
        Of the full parameter vector, `Identification.full_covariance`, type B included where known.
    discrepancy : Discrepancy, optional
        Added at every posture; the region then uses its wider factor.
    probability : float
        Content of each region.
    target : (3,) array_like, optional
        Point in the tool frame that is stated; its origin by default [m].

    References
    ----------
    Sigma_t = J C J'; JCGM 102:2011, 6.5 (ellipsoidal region).
    """
    if target is None:
        position = model.poses(q)[:, :3, 3]
        sigma = tool_covariance(model, q, covariance)[:, :3, :3]
    else:
        position, sigma = _of_target(model, q, covariance, target)
    factor = coverage_factor(3, probability)
    if discrepancy is not None and discrepancy.covariance.any():
        sigma = sigma + discrepancy.covariance
        factor = discrepancy.factor(probability)
    return ToolStatement(frozen(position), frozen(sigma), factor, probability)


def _of_target(
    model: RobotModel, q: ArrayLike, covariance: ArrayLike, target: ArrayLike
) -> tuple[Array, Array]:
    """Positions (N, 3) and covariances (N, 3, 3) of a point fixed in the tool frame."""
    covariance, target = check(
        f"{model.n_numbers} {model.n_numbers}, 3", covariance=covariance, target=target
    )
    T, J = model.poses_and_jacobian(q)
    position, rows = reflector_rows(T, J, np.broadcast_to(target, (len(T), 3)))
    sigma = rows @ covariance @ np.swapaxes(rows, -1, -2)
    return position, (sigma + np.swapaxes(sigma, -1, -2)) / 2
