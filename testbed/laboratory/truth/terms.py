"""What the true robot does beyond its geometry: sag, waves, warmth, springs; how to switch it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array
from calib.geometry.chain import Chain
from calib.geometry.joint_errors import JointErrors, JointTerm, gravity_terms, harmonic_terms
from calib.identification.joint_models import gravity_quarters
from testbed.laboratory.truth.backlash import GRAVITY, Backlash
from testbed.scenario.laboratory import TruthSettings

SEVENTH = 0.6
"""Amplitude of seven times a turn, as a share of that of three times."""

TERM_KEYS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "geometry": {"angle_sd_deg": 0.0, "length_sd_mm": 0.0},
        "frames": {"frame_sd_mm": 0.0, "frame_sd_deg": 0.0},
        "gravity": {"gravity_mdeg": (0.0, 0.0, 0.0)},
        "harmonics": {"harmonic_mdeg": 0.0},
        "high_harmonics": {"high_harmonic_mdeg": 0.0},
        "encoder": {"encoder_mdeg": 0.0},
        "backlash": {"backlash_mdeg": 0.0},
        "thermal": {"thermal_k": 0.0},
        "elastic": {"drive_nm_per_mrad": (), "bearing_nm_per_mrad": (), "payload_kg": 0.0},
        "repeatability": {"joint_repeatability_mdeg": 0.0},
    }
)
"""The terms of the truth and the keys of [truth] that switch them, with what switches them off."""


def terms_of(truth: TruthSettings) -> tuple[str, ...]:
    """Names of the terms that are switched on."""
    # None is the robot's own repeatability
    return tuple(
        term
        for term, keys in TERM_KEYS.items()
        if any(value is None or np.any(value) for value in (getattr(truth, key) for key in keys))
    )


def only(truth: TruthSettings, *terms: str) -> TruthSettings:
    """The same truth with no other terms than these; what they draw stays the same."""
    off = {
        key: value
        for term in TERM_KEYS
        if term not in terms
        for key, value in TERM_KEYS[term].items()
    }
    return truth.model_copy(update=off)


@dataclass(frozen=True, slots=True)
class Thermal:
    """Links that warm up from the start of the campaign: dT = rise (1 - exp(-t / tau))."""

    rise: float
    """In the end [K]."""
    tau: float
    """[s]"""
    expansion: float
    """[1/K]"""

    def growth(self, time: Array) -> Array:
        """Relative growth (m,) of all link lengths at times (m,) [s]."""
        return np.asarray(-self.expansion * self.rise * np.expm1(-time / self.tau))


@dataclass(frozen=True, slots=True, eq=False)
class Springs:
    """Masses and stiffnesses of an arm that gives way."""

    masses: Array
    """(n,) of the bodies [kg]."""
    centers: Array
    """(n, 3) centers of mass in the body frames [m]."""
    inertias: Array
    """(n, 3) principal moments, axes of the body frames; rest does not depend on them [kg m^2]."""
    drive: Array
    """(n,) stiffness about the joint's axis [N m/rad]."""
    bearing: Array
    """(n,) about x and about y of the body, or (0,) for stiff ones [N m/rad]."""
    payload: float
    """On the flange [kg]."""
    payload_center: Array
    """(3,) of the payload in the flange frame [m]."""
    gravity: Array = field(default_factory=lambda: np.array([0.0, 0.0, -GRAVITY]))
    """(3,) in the world [m/s^2]."""


@dataclass(frozen=True, slots=True)
class UnmodelledTerms:
    """What no `RobotModel` can hold of a true robot; each None where it is switched off."""

    backlash: Backlash | None = None
    thermal: Thermal | None = None
    springs: Springs | None = field(default=None, repr=False)


def per_joint(chain: Chain, value: float | tuple[float, ...]) -> Array:
    """Amplitudes of all joints (n,) from one for all or one for each [mdeg to rad]."""
    return np.broadcast_to(mdeg(value), (chain.n_joints,))


def mdeg(value: ArrayLike) -> Array:
    """Thousandths of a degree in rad."""
    return np.asarray(np.radians(np.asarray(value, dtype=np.float64) * 1e-3))


def gravity(chain: Chain, amplitudes: Array) -> JointErrors:
    """Sag of joints 2 and 3 with amplitudes g1, g2, g3 [rad]: dq2 = g1 sin q2 + g2 sin(q2+q3), ...

    On an arm that lies level at joint zero these are cosines; see `gravity_terms`. The closed form
    must hold for the arm; see `gravity_quarters`.
    """
    quarters = gravity_quarters(chain)
    if quarters is None:
        raise RuntimeError("the sag of this arm has no closed form")
    upper, fore = (1 if k < 2 else -1 for k in quarters)  # sines or cosines that droop
    return JointErrors(gravity_terms(chain.n_joints, quarters), amplitudes * [upper, fore, fore])


def harmonics(chain: Chain, amplitudes: Array, rng: np.random.Generator) -> JointErrors:
    """Gear errors of every revolute joint: dq = h [A sin(q + phi1) + 0.5 B sin(2 q + phi2)].

    A and B are uniform on 0.5 to 1.5, the phases on a full turn, drawn anew for each joint;
    `amplitudes` are the h (n,) [rad].
    """
    n = chain.n_joints
    size = rng.uniform(0.5, 1.5, (n, 2)) * [1.0, 0.5]
    phase = rng.uniform(0.0, 2 * np.pi, (n, 2))
    return turning(chain, harmonic_terms(n), waves(amplitudes[:, None] * size, phase))


def high_harmonics(chain: Chain, amplitudes: Array, rng: np.random.Generator) -> JointErrors:
    """Errors dq = h [sin(3 q + phi) + 0.6 sin(7 q + phi')] of every turning joint, h (n,) [rad]."""
    n = chain.n_joints
    phase = rng.uniform(0.0, 2 * np.pi, (n, 2))
    size = amplitudes[:, None] * np.array([1.0, SEVENTH])
    return turning(chain, harmonic_terms(n, (3, 7)), waves(size, phase))


def encoder(
    chain: Chain, amplitudes: Array, rng: np.random.Generator, *, periods: int
) -> JointErrors:
    """Interpolation errors dq = e sin(N q + phi) of every turning joint, e (n,) [rad].

    They look like noise from pose to pose and come back exactly at every return to one.
    """
    n = chain.n_joints
    terms = tuple(
        JointTerm(f"encoder{i + 1}.{wave}", i, wave, tuple(periods * int(k == i) for k in range(n)))
        for i in range(n)
        for wave in _WAVES
    )
    phase = rng.uniform(0.0, 2 * np.pi, (n, 1))
    return turning(chain, terms, waves(amplitudes[:, None], phase))


_WAVES: tuple[Literal["sin", "cos"], ...] = ("sin", "cos")


def waves(size: Array, phase: Array) -> Array:
    """Coefficients of sines and cosines in turn, from sizes and phases (n, k)."""
    # A sin(kq + phi) = (A cos phi) sin kq + (A sin phi) cos kq; terms run joint, order, sin, cos
    return np.asarray((size[..., None] * np.stack([np.cos(phase), np.sin(phase)], axis=-1)).ravel())


def turning(chain: Chain, terms: tuple[JointTerm, ...], coefficients: Array) -> JointErrors:
    """The terms of turning joints with their coefficients."""
    turns = np.array([chain.kinds[term.joint] == "revolute" for term in terms])
    kept = tuple(term for term, one in zip(terms, turns, strict=True) if one)
    return JointErrors(kept, coefficients[turns])


def joined(sums: Sequence[JointErrors]) -> JointErrors:
    """Several sums of joint terms as one."""
    return JointErrors(
        tuple(term for one in sums for term in one.terms),
        np.concatenate([one.coefficients for one in sums]),
    )
