"""The tool point as it may be stated: position, 3-D covariance and the region it should lie in."""

from dataclasses import dataclass

from numpy.typing import ArrayLike

from calib.arrays import Array, Bool, check, frozen
from calib.geometry.model import RobotModel
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

    References
    ----------
    Sigma_t = J C J'; JCGM 102:2011, 6.5 (ellipsoidal region).
    """
    sigma = tool_covariance(model, q, covariance)[:, :3, :3]
    factor = coverage_factor(3, probability)
    if discrepancy is not None and discrepancy.covariance.any():
        sigma = sigma + discrepancy.covariance
        factor = discrepancy.factor(probability)
    return ToolStatement(frozen(model.poses(q)[:, :3, 3]), frozen(sigma), factor, probability)
