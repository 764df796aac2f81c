"""The virtual laser tracker: what it reports of a true pose, and the scatter it states."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, check
from calib.geometry.chain import Chain
from calib.geometry.frames import exp_so3, inverse, slide
from calib.geometry.model import RobotModel
from calib.measurement.noise import spherical_covariance, with_joint_noise
from calib.measurement.observations import POINT, POSE, Measurements
from testbed.scenario import At960Tracker, PaperTracker

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

    def __post_init__(self) -> None:
        T, reflector = check(
            "4 4, 3", T_world_tracker=self.T_world_tracker, reflector=self.reflector
        )
        object.__setattr__(self, "T_world_tracker", T)
        object.__setattr__(self, "reflector", reflector)

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
        return np.asarray(T[:, :3, 3] + T[:, :3, :3] @ self.reflector)

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
        own = spherical_covariance(
            self.targets(T),
            self.T_world_tracker,
            range_sd=self.range_sd,
            transverse_sd=self.transverse_sd,
            rotation_sd=self.rotation_sd,
            centering_sd=self.centering_sd,
            R_world_target=T[:, :3, :3],
        )
        return with_joint_noise(
            model, q, own, sigma_q, offset=np.broadcast_to(self.reflector, (len(T), 3))
        )

    def measure(
        self,
        T_true: Array,
        q: Array,
        pose_id: Index,
        repeat: int,
        covariance: Array,
        rng: np.random.Generator,
    ) -> Measurements:
        """One reading of each true tool pose.

        The noise follows the shot as it is, not the stated covariance, which only travels along.

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
        """
        m = len(T_true)
        beam_noise, center_noise, turn_noise = rng.standard_normal((m, 3, 3)).swapaxes(0, 1)
        true, R = self.targets(T_true), T_true[:, :3, :3]
        beam = true - self.station
        distance = np.linalg.norm(beam, axis=1, keepdims=True)
        u = beam / distance
        along = self.range_sd[0] + self.range_sd[1] * distance
        across = self.transverse_sd[0] + self.transverse_sd[1] * distance
        # along u u' + across (I - u u') is the symmetric root of the beam's covariance
        share = (u * beam_noise).sum(axis=1, keepdims=True)
        position = true + across * beam_noise + (along - across) * share * u
        position += self.centering_sd * center_noise
        if self.measures == POINT:
            rotation = np.broadcast_to(np.eye(3), (m, 3, 3))
        else:
            turn = (R @ (turn_noise * self.rotation_sd)[..., None])[..., 0]
            rotation = exp_so3(turn) @ R
        return Measurements(
            q=q,
            position=position,
            rotation=rotation,
            covariance=covariance,
            kind=np.full(m, POINT if self.measures == POINT else POSE),
            offset=np.broadcast_to(self.reflector, (m, 3)),
            pose_id=pose_id,
            repeat=np.full(m, repeat),
        )


def tracker_from(settings: PaperTracker | At960Tracker, chain: Chain) -> Tracker:
    """The tracker of a scenario; `chain` is nominal, its base is what the station refers to."""
    T_world_tracker = chain.T_world_base @ slide(*(np.array(settings.station_mm) / 1e3))
    reflector = np.array(settings.reflector_mm) / 1e3
    acceptance = float(np.radians(settings.acceptance_deg))
    if isinstance(settings, PaperTracker):
        every_axis = (settings.position_um * 1e-6, 0.0)
        turn = float(np.radians(settings.rotation_mdeg * 1e-3))
        return Tracker(
            T_world_tracker,
            settings.measures,
            reflector,
            range_sd=every_axis,
            transverse_sd=every_axis,
            centering_sd=0.0,
            rotation_sd=(turn, turn, turn),
            acceptance=acceptance,
        )
    pitch, yaw, roll = (float(np.radians(sd * 1e-3)) for sd in settings.rotation_mdeg)
    return Tracker(
        T_world_tracker,
        settings.measures,
        reflector,
        range_sd=_in_meters(settings.range_um),
        transverse_sd=_in_meters(settings.transverse_um),
        centering_sd=settings.centering_um * 1e-6,
        rotation_sd=(pitch, yaw, roll),
        acceptance=acceptance,
    )


def _in_meters(pair: tuple[float, float]) -> tuple[float, float]:
    """Constant and per-meter part, from um and um/m."""
    return pair[0] * 1e-6, pair[1] * 1e-6
