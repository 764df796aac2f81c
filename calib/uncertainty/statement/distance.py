"""How far a point may lie from where it is said to be: probability within a ball, and its radius.

Every U of a point names probability and dimension: k = 2 holds 95.4 % in one dimension, 86.5 % in
two and 73.9 % in the ellipsoid of three. Of a distance the ball is stated, by its exact radius.
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtr, erf, ndtr, roots_legendre

from calib.arrays import Array, check, require_probability
from calib.errors import refuse
from calib.uncertainty.regions import coverage_factor

NODES = 40
"""Nodes of each of two nested Gauss-Legendre rules: 1e-7 for round shapes, 5e-6 for thin ones."""
ALONG, ABOUT = 24, 12
"""Directions along the longest axis and about it: more change nothing beyond 1e-9."""
FAR = 9.0
"""Standard deviations beyond which a normal number is never looked for: 1e-19 lie there."""
THINNEST = 1e-7
"""Least standard deviation of an axis, as part of the largest: a disk or a line is as good."""
EXACT = 1e-10
"""Of a radius over many points."""
SPARE = 1e-6
"""Room on both sides of the smallest and the largest radius that can be."""
EDGES = ((1, -SPARE), (3, SPARE))
"""Dimensions whose factors are the least and the largest radius, and a little room."""


def probability_within(radius: ArrayLike, covariance: ArrayLike, center: ArrayLike = 0.0) -> Array:
    """Probability (N,) that normal points lie within a distance of the origin.

    Parameters
    ----------
    radius : (N,) or scalar array_like
        Distance, not negative [m].
    covariance : (N, 3, 3) or (3, 3) array_like
        Of each point, positive semidefinite, not zero [m^2].
    center : (N, 3), (3,) or scalar array_like
        Its mean [m].

    References
    ----------
    P(|d + e| <= R), e ~ N(0, S): along the principal axes, the thinnest in closed form, the others
    by Gauss-Legendre in the angle t of x = R sin t, where the integrand has no edge.
    """
    covariance = np.atleast_3d(np.asarray(covariance, dtype=np.float64))
    covariance = covariance.reshape(-1, 3, 3)
    count = max(len(covariance), np.size(radius), np.size(center) // 3)
    S, R, d = check(
        "n 3 3, n, n 3",
        covariance=np.broadcast_to(covariance, (count, 3, 3)),
        radius=np.broadcast_to(np.asarray(radius, dtype=np.float64), (count,)),
        center=np.broadcast_to(np.asarray(center, dtype=np.float64), (count, 3)),
    )
    if (R < 0).any():
        raise refuse("radius", float(R.min()), "zero or more", code="A3")
    sd, c = _principal(S, d)
    x, wx = _nodes(R[:, None], c[:, None, 2], sd[:, None, 2])  # (N, K)
    half = np.sqrt(np.maximum(R[:, None] ** 2 - x**2, 0.0))
    y, wy = _nodes(half[:, :, None], c[:, None, None, 1], sd[:, None, None, 1])  # (N, K, K)
    z = np.sqrt(np.maximum(half[:, :, None] ** 2 - y**2, 0.0))
    middle, thin = c[:, None, None, 0], sd[:, None, None, 0]
    inner = ndtr((z - middle) / thin) - ndtr((-z - middle) / thin)
    return np.asarray((wx * (wy * inner).sum(axis=2)).sum(axis=1))


def distance_radius(covariance: ArrayLike, probability: float = 0.95) -> Array:
    """Radius (N,) of the ball that holds a normal point with this probability: R95 [m].

    Over u_3D = sqrt(trace S) it is 1.6140 for a round region, 1.7308 for a disk, 1.9600 for a line.

    Parameters
    ----------
    covariance : (N, 3, 3) array_like
        Of each point about its stated place [m^2].
    probability : float
        Content of the ball.

    References
    ----------
    P(|e| <= R) = p, e ~ N(0, S), solved for R.
    """
    from scipy.optimize.elementwise import find_root

    require_probability(probability)
    (S,) = check("n 3 3", covariance=covariance)
    sd, _ = _principal(S, np.zeros((len(S), 3)))
    shape = S / sd[:, 2, None, None] ** 2

    length, weight = spread_over_directions(shape)

    def excess(ratio: Array, index: Array) -> Array:
        """Probability beyond the one asked for, of the points numbered `index`."""
        some = length[index.astype(int)]
        return content(np.asarray(ratio)[:, None], some) @ weight - probability

    # a line along the longest axis is held more easily, a ball of that size less easily
    low, high = (np.full(len(S), coverage_factor(k, probability) * (1 + s)) for k, s in EDGES)
    number = np.arange(len(S), dtype=np.float64)
    root = find_root(excess, (low, high), args=(number,), tolerances={"xrtol": 1e-10})
    return np.asarray(root.x * sd[:, 2])


def spread_over_directions(covariance: Array) -> tuple[Array, Array]:
    """|S^(1/2) w| (N, K) [m] for directions w spread over the sphere, and their weights (K,).

    A normal point is e = S^(1/2) w chi with w uniform and chi of three dimensions, so that the mean
    of `content` over w is its probability: as smooth for a line or a disk as for a ball.

    References
    ----------
    Gauss-Legendre along the longest axis (Archimedes: it is uniform there), midpoints about it.
    """
    sd, _ = _principal(covariance, np.zeros((len(covariance), 3)))
    nodes, weights = roots_legendre(ALONG)
    t = (nodes[:, None] + 1) / 2
    phi = (np.arange(ABOUT) + 0.5) * np.pi / (2 * ABOUT)
    square = sd[:, :, None, None] ** 2
    aside = square[:, 0] * np.cos(phi) ** 2 + square[:, 1] * np.sin(phi) ** 2
    length = np.sqrt(square[:, 2] * t**2 + aside * (1 - t**2))
    return length.reshape(len(sd), ALONG * ABOUT), np.repeat(weights / 2 / ABOUT, ABOUT)


def content(radius: Array | float, length: Array) -> Array:
    """P(chi_3 <= radius / length): what a ball holds in one direction."""
    x = radius / length
    inside = erf(x / np.sqrt(2)) - np.sqrt(2 / np.pi) * x * np.exp(-(x**2) / 2)
    return np.asarray(inside)


def density(radius: float, length: Array) -> Array:
    """Derivative of `content` by the radius [1/m]."""
    x = radius / length
    return np.asarray(np.sqrt(2 / np.pi) * x**2 * np.exp(-(x**2) / 2) / length)


def largest_radius(covariance: Array) -> float:
    """Largest R95 of points with covariances (g, 3, 3), asked of those that can have it [m]."""
    u = np.sqrt(np.trace(covariance, axis1=1, axis2=2))
    first = distance_radius(covariance[np.argmax(u)][None])[0]
    # no shape has more over u than a line
    most = coverage_factor(1, 0.95) * u * (1 + SPARE)
    return float(distance_radius(covariance[most >= first]).max())


def radius_over(covariance: ArrayLike, weights: ArrayLike, probability: float = 0.95) -> float:
    """Radius that holds the error of a point drawn from several with this probability [m].

    Parameters
    ----------
    covariance : (N, 3, 3) array_like
        Of each point about its stated place [m^2].
    weights : (N,) array_like
        How often each is drawn, summing to one.
    probability : float
        Content over all of them: of some points alone it may hold less.

    References
    ----------
    sum of w_t P(|e_t| <= R) = p, e_t ~ N(0, S_t), solved for R.
    """
    require_probability(probability)
    S, w = check("n 3 3, n", covariance=covariance, weights=weights)
    length, weight = spread_over_directions(S)
    longest = np.sqrt(np.linalg.eigvalsh(S)[:, -1])
    # a line is held by the least factor, a ball by the largest
    low = coverage_factor(1, probability) * float(longest.min()) * (1 - SPARE)
    high = coverage_factor(3, probability) * float(longest.max()) * (1 + SPARE)

    radius = float(np.sqrt(w @ np.trace(S, axis1=1, axis2=2))) * coverage_factor(1, probability)
    while high - low > EXACT * high:
        held = float(w @ (content(radius, length) @ weight)) - probability
        slope = float(w @ (density(radius, length) @ weight))
        low, high = (radius, high) if held < 0 else (low, radius)
        step = held / slope if slope > 0 else np.inf
        if abs(step) < EXACT * radius:
            break
        # Newton's step where it stays between the ends, else their middle
        radius = radius - step if low < radius - step < high else (low + high) / 2
    return radius


def least_content(factor: float) -> float:
    """Least probability that a ball of `factor` times u_3D holds, whatever the region's shape.

    For a factor of 2 it is 95.45 %, of a line; a round region has 99.26 % there.

    References
    ----------
    Of quadratic forms of given mean, equal weights on 1, 2 or 3 axes are extreme: Szekely & Bakirov
    2003.
    """
    axes = np.arange(1, 4)
    return float(chdtr(axes, axes * factor**2).min())


def _principal(S: Array, d: Array) -> tuple[Array, Array]:
    """Standard deviations (N, 3) along the principal axes, thinnest first, and means in them."""
    values, axes = np.linalg.eigh(S)
    sd = np.sqrt(np.maximum(values, 0.0))
    if not (sd[:, 2] > 0).all():
        raise refuse(
            "covariance", code="A3", message="a point has no variance at all",
            allowed="at least one direction in which it scatters",
        )  # fmt: skip
    return np.maximum(sd, THINNEST * sd[:, 2:]), (d[:, None, :] @ axes)[:, 0]


def _nodes(half: Array, center: Array, sd: Array) -> tuple[Array, Array]:
    """Places and weights (..., K) of a normal density over [-half, half], where it is not nil."""
    nodes, weights = roots_legendre(NODES)
    some = half > 0
    whole = np.where(some, half, 1.0)
    edges = [np.arcsin(np.clip((center + s * FAR * sd) / whole, -1, 1)) for s in (-1, 1)]
    middle, span = (edges[1] + edges[0]) / 2, (edges[1] - edges[0]) / 2
    t = middle + span * nodes
    x = half * np.sin(t)
    density = np.exp(-(((x - center) / sd) ** 2) / 2) / (sd * np.sqrt(2 * np.pi))
    return x, np.where(some, span * weights * half * np.cos(t) * density, 0.0)
