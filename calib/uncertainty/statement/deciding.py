"""What would decide where a tolerance is smaller than the guard band: poses, a quieter instrument.

A forecast: the noise's part of a region falls with the number of poses, the part of a misfit that
nobody saw falls more slowly, a misfit that was seen and what all readings share stay.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array
from calib.uncertainty.statement.belief import Belief
from calib.uncertainty.statement.distance import distance_radius
from calib.uncertainty.statement.misfit import SHOWN
from calib.uncertainty.statement.stated_point import widened

MOST = 100.0
"""Times as many poses, or as quiet an instrument, beyond which neither is proposed."""
LOOKED_AT = 40
"""Postures with the largest regions; the others follow."""


@dataclass(frozen=True, slots=True)
class Deciding:
    """What would bring the guard band of every posture below a tolerance."""

    radius: float
    """Largest R95 [m]."""
    shared: float
    """What of it all readings share, R95 alone [m]."""
    staying: float
    """The same with the misfit that was seen: neither poses nor quiet readings lower it [m]."""
    poses: float
    """Times as many poses to identify from and to hold out; infinite where none are enough."""
    quieter: float
    """Times as little noise; infinite where no quietness is enough."""


def what_decides(belief: Belief, q: Array, band: float, *, shared: Array | None = None) -> Deciding:
    """How many more poses, or how much less noise, bring R95 down to a band.

    Parameters
    ----------
    belief : Belief
        Of the identified robot.
    q : (N, n) array
        Postures at which is decided [rad, m].
    band : float
        Largest R95 that decides [m].
    shared : (P, P) array, optional
        Covariance of all numbers from what all readings share; contained in that of the belief.

    Notes
    -----
    With f times as many poses the noise's covariance is that of today over f. The limit of a
    misfit that was not seen is its detection limit, whose square falls as 1/sqrt(f); more slowly
    where the rows have to tell it from the scale of the noise as well (medians of 25 robots: 7.6,
    6.2 and 5.4 um at 60, 240 and 600 poses). f times less noise divides both by f^2.
    """
    target, probability = belief.proven.target, belief.probability
    whole = widened(belief.regions(q, target=target))
    chosen = np.argsort(distance_radius(whole, probability))[-LOOKED_AT:]
    q, whole = q[chosen], whole[chosen]
    own = np.zeros_like(belief.covariance) if shared is None else shared
    still = replace(belief, misfit=replace(belief.misfit, upper=0.0))
    common = widened(replace(still, covariance=own).regions(q, target=target))
    noise = widened(still.regions(q, target=target)) - common
    hidden = whole - noise - common
    size = belief.misfit
    shown = size.p_value < SHOWN and size.upper > 0  # counted errors may allow for none
    best = min(size.best / size.upper, 1.0) ** 2 if shown else 0.0

    def radius(of_noise: float, of_hidden: float) -> float:
        """Largest R95 where the noise and what was not seen are so many times as large."""
        S = common + of_noise * noise + (best + (1 - best) * of_hidden) * hidden
        return float(distance_radius(_positive(S), probability).max())

    return Deciding(
        radius(1.0, 1.0),
        float(distance_radius(_positive(common), probability).max()) if own.any() else 0.0,
        radius(0.0, 0.0) if best or own.any() else 0.0,
        _least(lambda f: radius(1 / f, f**-0.5), band),
        _least(lambda f: radius(f**-2, f**-2), band),
    )


def _positive(S: Array) -> Array:
    """Covariances (N, 3, 3) without the negative eigenvalues that differences leave."""
    values, vectors = np.linalg.eigh(S)
    kept = np.maximum(values, 1e-12 * values[:, -1:])
    return np.asarray(vectors * kept[:, None, :] @ np.swapaxes(vectors, 1, 2))


def _least(radius: Callable[[float], float], band: float) -> float:
    """The smallest factor, 1 to `MOST`, at which a falling radius is within the band."""
    if radius(1.0) <= band:
        return 1.0
    if radius(MOST) > band:
        return np.inf
    low, high = 0.0, np.log(MOST)
    for _ in range(12):  # to 0.1 %
        middle = (low + high) / 2
        low, high = (low, middle) if radius(float(np.exp(middle))) <= band else (middle, high)
    return float(np.exp(high))
