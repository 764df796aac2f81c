"""The virtual laser tracker: its readings of a pose, with gross errors and failures."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index
from calib.geometry.chain import Chain
from calib.geometry.frames import exp_so3, inverse, target_points
from calib.geometry.model import RobotModel
from calib.measurement.noise import spherical_covariance, with_joint_noise
from calib.measurement.observations import POINT, POSE, Measurements
from testbed.laboratory.tracker.errors import GrossErrors, StationBias, StationDrift, some_rows


def streams_below(rng: np.random.Generator) -> list[np.random.Generator]:
    """Four streams below another one, however much was drawn from it already."""
    seeds = rng.bit_generator.seed_seq
    if not isinstance(seeds, np.random.SeedSequence):
        raise RuntimeError("the noise needs a generator made from a seed")
    return [
        np.random.default_rng(
            np.random.SeedSequence(seeds.entropy, spawn_key=(*seeds.spawn_key, _BELOW, k))
        )
        for k in range(4)
    ]


_BELOW = 0x7472  # apart from the children that `spawn` counts from 0


PROBE_CENTER = (0.0, 0.0, 0.060)
"""Where the reflector of the drawn 6-D probe sits in the flange frame [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Tracker:
    """A laser tracker at its station; isotropic noise is the spherical model with equal parts."""

    T_world_tracker: Array
    """(4, 4) station; the origin is where the beam starts [m]."""
    measures: Literal["pose", "point"]
    """Full poses of a 6-D target at the tool frame, or one reflector."""
    reflector: Array
    """(3,) reflector in the tool frame, zero for poses [m]."""
    range_sd: tuple[float, float]
    """Along the beam: constant [m], per meter of range."""
    transverse_sd: tuple[float, float]
    """Across the beam: constant [m], per meter of range."""
    centering_sd: float
    """Of the target's center, any direction [m]."""
    rotation_sd: tuple[float, float, float]
    """Of the target's rotation about the tool's x, y, z [rad]."""
    acceptance: float = np.pi
    """Half angle of the cone about the tool's z axis from which the target is seen [rad]."""
    pose_time: float = 10.0
    """From one observation to the next [s]."""
    bias: StationBias | None = None
    """What it gets wrong the same way all campaign long; None: nothing."""
    drift: StationDrift | None = None
    """How its station wanders; None: it stands still."""
    gross_errors: GrossErrors = field(default_factory=GrossErrors)
    """Wrong and failed observations."""

    @property
    def station(self) -> Array:
        """(3,) where the beam starts, in the world [m]."""
        return self.T_world_tracker[:3, 3]

    def aim(self, chain: Chain) -> Array:
        """(3,) what the beam must reach, in the tool frame of `chain`: reflector or probe [m]."""
        if self.measures == POINT:
            return self.reflector
        return np.asarray(inverse(chain.T_flange_tool) @ [*PROBE_CENTER, 1.0])[:3]

    def targets(self, T: Array) -> Array:
        """Positions (m, 3) of the tracked point at tool poses T (m, 4, 4) [m]."""
        return target_points(T, self.reflector)

    def covariance(self, model: RobotModel, q: ArrayLike, sigma_q: ArrayLike) -> Array:
        """Stated covariance (m, 6, 6) of a measurement at joints q, world axes [m^2, m rad, rad^2].

        Taken at the poses of `model`, the nominal robot, as a real laboratory would; includes what
        the joints scatter. The rotation part of a point measurement is not used.

        Parameters
        ----------
        model : RobotModel
            Nominal model.
        q : (m, n) array_like
            Commanded joints [rad, m].
        sigma_q : (n,) array_like
            Stated repeatability of each joint [rad or m].

        References
        ----------
        Hollerbach & Wampler 1996 (input noise): Sigma_j = Sigma_tracker + J_q diag(sigma_q^2) J_q'.
        """
        T = model.poses(q)
        own = self.own_covariance(self.targets(T), T[:, :3, :3])
        return with_joint_noise(
            model, q, own, sigma_q, offset=np.broadcast_to(self.reflector, (len(T), 3))
        )

    def own_covariance(self, target: Array, R: Array | None = None) -> Array:
        """Scatter (m, 6, 6) of observations of targets (m, 3) on tools R (m, 3, 3), world axes."""
        return spherical_covariance(
            target,
            self.T_world_tracker,
            range_sd=self.range_sd,
            transverse_sd=self.transverse_sd,
            rotation_sd=self.rotation_sd,
            centering_sd=self.centering_sd,
            R_world_target=R,
        )

    @property
    def steady(self) -> bool:
        """Whether it reads full poses, every one of them, with noise alone."""
        gross = self.gross_errors.outliers or self.gross_errors.missed
        return self.measures == POSE and self.bias is None and self.drift is None and not gross

    def readings(
        self, T_true: Array, normal: Array, fixed: Array | None = None
    ) -> tuple[Array, Array]:
        """Positions (..., m, 3) [m] and rotations (..., m, 3, 3) read of true poses (..., m, 4, 4).

        Without drift and gross errors; leading axes are visits or robots. `normal` (..., m, 3, 3)
        are standard normal numbers, `fixed` (..., m, 6) systematic errors [m, rad].
        """
        beam_noise, center_noise, turn_noise = np.moveaxis(normal, -2, 0)
        R = T_true[..., :3, :3]
        true = T_true[..., :3, 3] + R @ self.reflector
        beam = true - self.station
        distance = np.linalg.norm(beam, axis=-1, keepdims=True)
        u = beam / distance
        along = self.range_sd[0] + self.range_sd[1] * distance
        across = self.transverse_sd[0] + self.transverse_sd[1] * distance
        # along u u' + across (I - u u') is the symmetric root of the beam's covariance
        share = (u * beam_noise).sum(axis=-1, keepdims=True)
        position = true + across * beam_noise + (along - across) * share * u
        position = position + self.centering_sd * center_noise
        turn = (R @ (turn_noise * self.rotation_sd)[..., None])[..., 0]
        if fixed is not None:
            position, turn = position + fixed[..., :3], turn + fixed[..., 3:]
        return np.asarray(position), exp_so3(turn) @ R

    def measure(
        self,
        T_true: Array,
        q: Array,
        pose_id: Index,
        repeat: int,
        covariance: Array,
        rng: np.random.Generator,
        *,
        time: ArrayLike | None = None,
    ) -> Measurements:
        """One reading of each true tool pose, but for those that are missed.

        The noise follows the true pose, not the stated covariance, which is only passed along.
        Drift, outliers and misses have streams of their own below `rng`: switching one of
        them never moves the noise or the others.

        Parameters
        ----------
        T_true : (m, 4, 4) array
            True tool poses; joint repeatability is already in them [m].
        q : (m, n) array
            Commanded joints [rad, m].
        pose_id : (m,) array
            Which pose of the pool each row is.
        repeat : int
            Which visit, from 0.
        covariance : (m, 6, 6) array
            What is stated with the readings, from `covariance`.
        rng : Generator
            Noise of this visit: nine normal numbers a row.
        time : (m,) array_like, optional
            Of each observation; one every `pose_time` by default. The first begins the visit [s].
        """
        m = len(T_true)
        normal, fixed = rng.standard_normal((m, 3, 3)), None
        if self.bias is not None:
            R = T_true[:, :3, :3]
            fixed = self.bias.errors(self.targets(T_true), R, self.T_world_tracker)
        position, rotation = self.readings(T_true, normal, fixed)
        axes = self.T_world_tracker[:3, :3]
        walk_rng, nest_rng, wrong_rng, lost_rng = streams_below(rng)
        if self.drift is not None:
            since = np.arange(m) * self.pose_time if time is None else np.asarray(time)
            elapsed = since - since[:1]
            position = position + self.drift.walk(elapsed, walk_rng) @ axes.T
            nests = self.own_covariance(self.drift.nests)[:, :3, :3]
            position = position + self.drift.nest_noise(elapsed, nests, nest_rng)
        if self.gross_errors.outliers:
            rows = some_rows(m, self.gross_errors.outliers, wrong_rng, "outliers")
            gross = wrong_rng.standard_normal((2, len(rows), 3))
            position[rows] += gross[0] * self.gross_errors.position_sd
            rotation[rows] = exp_so3(gross[1] * self.gross_errors.rotation_sd) @ rotation[rows]
        if self.measures == POINT:
            rotation = np.broadcast_to(np.eye(3), (m, 3, 3))
        found = Measurements(
            q=q,
            position=position,
            rotation=rotation,
            covariance=covariance,
            kind=np.full(m, POINT if self.measures == POINT else POSE),
            offset=np.broadcast_to(self.reflector, (m, 3)),
            pose_id=pose_id,
            repeat=np.full(m, repeat),
        )
        if not self.gross_errors.missed:
            return found
        seen = np.ones(m, dtype=bool)
        seen[some_rows(m, self.gross_errors.missed, lost_rng, "missed")] = False
        return found.rows(seen)
