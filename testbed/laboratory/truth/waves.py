"""What true joints add to what is commanded: sag, gear and encoder errors, as sums of waves."""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array
from calib.geometry.chain import Chain
from calib.geometry.joint_errors import JointErrors, JointTerm, gravity_terms, harmonic_terms
from calib.identification.joint_models import gravity_quarters

SEVENTH = 0.6
"""Amplitude of seven times a turn, as a share of that of three times."""


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


def transmission(
    chain: Chain, sds: Array, rng: np.random.Generator, *, orders: tuple[int, int]
) -> JointErrors:
    """Gear errors of every turning joint at each whole number of waves a turn from some to some.

    Sines and cosines of all of them have normal coefficients of one size, so that the error of a
    joint is a stationary Gaussian process on the circle with standard deviation sds (n,) [rad].
    """
    counts = tuple(range(orders[0], orders[1] + 1))
    size = np.repeat(sds / np.sqrt(len(counts)), 2 * len(counts))
    return turning(
        chain, harmonic_terms(chain.n_joints, counts), size * rng.standard_normal(len(size))
    )


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


def gear(
    chain: Chain, amplitudes: Array, rng: np.random.Generator, *, ratio: float | tuple[float, ...]
) -> JointErrors:
    """Errors dq = g [sin(N q + phi) + 0.5 sin(2 N q + phi')] of every turning joint, g (n,) [rad].

    N is the ratio of its gear, which need not be whole: once and twice a turn of its motor.
    """
    n = chain.n_joints
    ratios = np.broadcast_to(np.asarray(ratio, dtype=np.float64), (n,))
    terms = tuple(
        JointTerm(
            f"gear{i + 1}.{wave}{turns}",
            i,
            wave,
            tuple(float(turns * ratios[i] * (k == i)) for k in range(n)),
        )
        for i in range(n)
        for turns in (1, 2)
        for wave in _WAVES
    )
    phase = rng.uniform(0.0, 2 * np.pi, (n, 2))
    return turning(chain, terms, waves(amplitudes[:, None] * np.array([1.0, 0.5]), phase))


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
