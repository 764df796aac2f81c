"""What is stated of the tool point, and its Monte Carlo over many perturbed robots.

Only the tool point is carried, from tip to base, and cos(q + theta + step) comes from the cosines
of the posture and of the step: no frame and no trigonometric function in the draws x poses loop.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Bool, check, frozen
from calib.geometry.chain import joint_vectors
from calib.geometry.frames import exp_so3
from calib.geometry.model import RobotModel
from calib.geometry.operating import AS_USUAL, OperatingConditions
from calib.information.propagation import (
    axis_uncertainty,
    point_uncertainty,
    propagated,
    tool_covariance,
)
from calib.kinds import checked_kinds, in_short
from calib.measurement.tool_target import ToolTarget
from calib.shown import Shown, length_words, mean_of
from calib.uncertainty.discrepancy import Discrepancy
from calib.uncertainty.regions import coverage_factor, ellipsoid, inside, require_covariance


@dataclass(frozen=True, slots=True, eq=False)
class ToolStatement(Shown):
    """Tool points at N postures with their regions; in world axes."""

    position: Array
    """(N, 3) predicted tool point [m]."""
    covariance: Array
    """(N, 3, 3) Sigma_t, plus Sigma_d if a discrepancy was given [m^2]."""
    factor: float
    """k: the region is all e with e' inv(covariance) e <= k^2."""
    probability: float

    def __repr__(self) -> str:
        u = length_words(mean_of(self.point), um=".3g")
        return f"ToolStatement({len(self.position)} postures, mean u {u})"

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

    @in_short
    def holds(self, position: ArrayLike) -> Bool:
        """(N,) whether each region holds the position (N, 3) [m]."""
        (position,) = check(f"{len(self.position)} 3", position=position)
        return self.covers(position - self.position)

    def covers(self, error: Array) -> Bool:
        """(..., N) whether regions of these sizes hold what is off by errors (..., N, 3) [m]."""
        stretch = (self.factor / coverage_factor(3, self.probability)) ** 2
        return inside(error, stretch * self.covariance, probability=self.probability)


@checked_kinds
def tool_statement(
    model: RobotModel,
    q: ArrayLike,
    covariance: ArrayLike,
    *,
    discrepancy: Discrepancy | None = None,
    probability: float = 0.95,
    target: ArrayLike | ToolTarget | None = None,
    at: OperatingConditions = AS_USUAL,
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
    target : (3,) array_like or ToolTarget, optional
        Point in the tool frame that is stated, or a reflector of the model; the origin of the frame
        by default [m].
    at : OperatingConditions, optional
        Under which the robot goes there.

    References
    ----------
    Sigma_t = J C J'; JCGM 102:2011, 6.5 (ellipsoidal region).
    """
    (covariance,) = check(f"{model.n_numbers} {model.n_numbers}", covariance=covariance)
    require_covariance(covariance)
    if target is None and not at.stated:
        position = model.poses(q)[:, :3, 3]
        sigma = tool_covariance(model, q, covariance)[:, :3, :3]
    else:
        point = np.zeros(3) if target is None else target
        position, sigma = _of_target(model, q, covariance, point, at)
    factor = coverage_factor(3, probability)
    if discrepancy is not None and discrepancy.covariance.any():
        sigma = sigma + discrepancy.covariance
        factor = discrepancy.factor(probability)
    return ToolStatement(frozen(position), frozen(sigma), factor, probability)


def _of_target(
    model: RobotModel,
    q: ArrayLike,
    covariance: Array,
    target: ArrayLike | ToolTarget,
    at: OperatingConditions,
) -> tuple[Array, Array]:
    """Positions (N, 3) and covariances (N, 3, 3) of a point fixed in the tool frame."""
    T, J = model.poses_and_jacobian(q, at)
    position, rows = ToolTarget.of(target).positions_and_rows(model, T, J)
    return position, propagated(rows, covariance)


BATCH_POINTS = 16_384
"""Draws times poses per pass: the dozen arrays in flight then stay in the second-level cache."""


@dataclass(frozen=True, slots=True, eq=False)
class Configurations:
    """Commanded postures with everything that does not change from draw to draw."""

    model: RobotModel
    """Robot that the steps start from."""
    cosine: Array
    """(n, N) cosine of each joint's nominal turn."""
    sine: Array
    """(n, N) its sine."""
    slide: Array
    """(n, N) nominal shift of each joint along its axis [m]."""
    basis: Array
    """(k, N) values of the joint terms."""
    q: Array
    """(N, n) joint vectors [rad, m]."""

    @property
    def rows(self) -> int:
        """Draws that make one pass of about `BATCH_POINTS` points."""
        return max(1, BATCH_POINTS // max(1, len(self.cosine[0])))


def configurations(
    model: RobotModel, q: ArrayLike, at: OperatingConditions = AS_USUAL
) -> Configurations:
    """Prepare joint vectors q (N, n) [rad, m] under some conditions for `tool_points`."""
    q = joint_vectors(model.chain, q)
    slides, links = model.chain.prismatic, model.chain.links
    value = q + model.joint_errors.of_terms(q, at)
    turn = (value * (1 - slides) + links[:, 0]).T
    slide = (value * slides + links[:, 1]).T
    basis = model.joint_errors.basis(q, at).T
    return Configurations(model, np.cos(turn), np.sin(turn), slide, basis, q)


@checked_kinds
def propagate(model: RobotModel, q: ArrayLike, steps: ArrayLike) -> Array:
    """Tool points (M, N, 3) [m] in the world of M moved models at N postures.

    Row by row the same as ``model.moved(step).poses(q)[:, :3, 3]``, about a thousand times faster.

    Parameters
    ----------
    model : RobotModel
        Robot that the steps start from.
    q : (N, n) array_like
        Commanded joint values [rad, m].
    steps : (M, P) array_like
        Steps of the full parameter vector [m, rad], as in `RobotModel.moved`.
    """
    (steps,) = check(f"k {model.n_numbers}", steps=steps)
    at = configurations(model, q)
    out = np.empty((len(steps), at.cosine.shape[1], 3))
    for start in range(0, len(steps), at.rows):
        part = slice(start, start + at.rows)
        out[part] = np.moveaxis(tool_points(at, steps[part]), 0, -1)
    return out


def tool_points(at: Configurations, steps: Array) -> Array:
    """Tool points (3, M, N) [m] for one batch of steps (M, P); inputs are trusted.

    References
    ----------
    Wen et al. 2022, eq. (1), nested from the last link to the first (Horner).
    """
    chain, n = at.model.chain, at.model.chain.n_joints
    moves = steps[:, 6 : 6 + 5 * n].reshape(-1, n, 5)
    base, tool = steps[:, :6], steps[:, 6 + 5 * n :][:, :6]
    terms = steps[:, 12 + 5 * n : at.model.first_fixture]
    bends = _bends_of_springs(at, terms[:, len(at.basis) :])
    start = chain.T_flange_tool[:3, 3] + tool[:, :3] @ chain.T_flange_tool[:3, :3].T
    x, y, z = start.T[:, :, None]
    for i in reversed(range(n)):
        dtheta, dd, da, dalpha, dbeta = moves[:, i].T[:, :, None]
        if chain.links[i, 4] != 0 or dbeta.any():
            c, s = _cos_sin(chain.links[i, 4], dbeta)
            x, z = c * x + s * z, c * z - s * x
        c, s = _cos_sin(chain.links[i, 3], dalpha)
        y, z = c * y - s * z, s * y + c * z
        x = x + (da + chain.links[i, 2])
        own = [k for k, joint in enumerate(at.model.joint_errors.joints) if joint == i]
        shift = terms[:, own] @ at.basis[own] if terms[:, own].any() else 0.0  # (M, N)
        turned = chain.kinds[i] == "revolute"
        if i in bends:
            bx, by, bz = bends[i]
            x, z = _turned(x, z + (chain.links[i, 1] + dd), by)
            z, y = _turned(z, y, bx)
            z, shift = z - (chain.links[i, 1] + dd), shift + bz
        z = z + (at.slide[i] + dd if turned else at.slide[i] + dd + shift)
        c, s = at.cosine[i], at.sine[i]
        turn = dtheta + shift if turned else dtheta
        if turn.any():
            ct, st = np.cos(turn), np.sin(turn)
            c, s = c * ct - s * st, s * ct + c * st
        x, y = c * x - s * y, s * x + c * y
    return _into_world(chain.T_world_base, base, np.stack(np.broadcast_arrays(x, y, z)))


def _bends_of_springs(at: Configurations, steps: Array) -> dict[int, tuple[Array, Array, Array]]:
    """Bends about x, y and z (M, N) of the joints that have springs, at steps (M, s)."""
    errors = at.model.joint_errors
    springs = errors.springs
    if springs is None:
        return {}
    bent = springs.bends_of_many(at.q, errors.of_springs + steps)
    out = {}
    for i in np.unique(springs.joint):
        three = [np.zeros(bent.shape[:2]) for _ in range(3)]
        for k in np.flatnonzero(springs.joint == i):
            three[springs.axis[k]] = bent[:, :, k]
        out[int(i)] = three[0], three[1], three[2]
    return out


def _turned(u: Array, v: Array, angle: Array) -> tuple[Array, Array]:
    """Coordinates u, v after a turn that takes the axis of v towards that of u."""
    c, s = np.cos(angle), np.sin(angle)
    return c * u + s * v, c * v - s * u


def _cos_sin(nominal: float, step: Array) -> tuple[Array, Array]:
    """Cosine and sine (M, 1) of a moved angle; one value (1, 1) where nothing moves."""
    angle = nominal + (step if step.any() else step[:1])
    return np.cos(angle), np.sin(angle)


def _into_world(T_world_base: Array, base: Array, points: Array) -> Array:
    """Points (3, M, N) of the base frame in the world, with base steps (M, 6)."""
    R, p = T_world_base[:3, :3], T_world_base[:3, 3]
    if not base.any():
        if np.array_equal(T_world_base, np.eye(4)):
            return points
        return np.tensordot(R, points, 1) + p[:, None, None]
    turned = R @ exp_so3(base[:, 3:])
    moved = base[:, :3] @ R.T + p
    return np.asarray(np.einsum("mij,jmn->imn", turned, points) + moved.T[:, :, None])
