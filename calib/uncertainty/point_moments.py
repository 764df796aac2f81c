"""Mean and covariance of tool points from very many draws: compiled, streamed, in parallel."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, check, frozen
from calib.errors import InputError
from calib.geometry.frames import exp_so3
from calib.geometry.model import RobotModel
from calib.information.propagation import point_uncertainty
from calib.uncertainty.batches import in_chunks
from calib.uncertainty.covariance import covariance_factor
from calib.uncertainty.tool_point import Postures, postures, tool_points

CHUNK = 10_000
"""Draws per chunk, each with its own random stream; part of what fixes the bits of a result."""
PASS = 500
"""Draws in flight at once: their arrays then stay in the cache."""
LARGEST_TERM = 0.05
"""Largest turn [rad] by a step of the joint terms that the compiled loop takes, which has a series
for it; draws with a larger one go through numpy."""
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


@dataclass(frozen=True, slots=True, eq=False)
class PointMoments:
    """Scatter of the tool point at N postures over all draws, beside linear propagation."""

    draws: int
    """M."""
    nominal: Array
    """(N, 3) tool point of the model itself, in the world [m]."""
    mean: Array
    """(N, 3) plain mean of the draws minus nominal [m]."""
    covariance: Array
    """(N, 3, 3) plain sample covariance [m^2]."""
    linear: Array
    """(N, 3, 3) J C J' [m^2]."""
    shift: Array
    """(N, 3) mean minus nominal, with the mean of the linear part of the same draws removed [m]."""
    controlled: Array
    """(N, 3, 3) linear + plain - sample covariance of the linear part of the same draws [m^2].

    The expectation of that part is known exactly: a control variate, with nothing estimated.
    """

    @property
    def point(self) -> Array:
        """(N,) u_3D from the controlled covariance [m]."""
        return point_uncertainty(self.controlled)


def point_moments(
    model: RobotModel,
    q: ArrayLike,
    covariance: ArrayLike,
    rng: np.random.Generator,
    *,
    draws: int = 1_000_000,
    threads: int = 1,
) -> PointMoments:
    """Propagate the distribution of the parameters to the tool point, exactly, by Monte Carlo.

    Each draw moves all numbers with their full covariance; each posture of each draw goes through
    the whole chain. Only sums are kept: memory does not grow with the draws.

    Parameters
    ----------
    model : RobotModel
        Robot whose numbers are the means.
    q : (N, n) array_like
        Commanded joint values [rad, m].
    covariance : (P, P) array_like
        Of the full parameter vector, zero for fixed numbers [m, rad].
    rng : numpy.random.Generator
        Source of the draws; each chunk has its own child stream.
    draws : int
        M, at least 2.
    threads : int
        At work side by side; the result does not depend on it.

    References
    ----------
    JCGM 101:2008, clause 7; linear result as control variate.
    """
    if draws < 2:
        raise InputError(
            f"draws is {draws}", code="A3", field="draws", value=draws, allowed="2 or more"
        )
    (covariance,) = check(f"{model.n_numbers} {model.n_numbers}", covariance=covariance)
    L = covariance_factor(covariance)
    moving = np.flatnonzero(L.any(axis=1))
    L = np.ascontiguousarray(L[np.ix_(moving, moving)])
    at = postures(model, q)
    T, J = model.poses_and_jacobian(q)
    nominal, slope = T[:, :3, 3], J[:, :3, moving]
    f = len(moving)
    import calib.kernels.points  # noqa: F401  # compiled before threads start

    def work(stream: np.random.Generator, count: int) -> tuple[Array, Array, Array]:
        sums, first, second = np.zeros((9, len(nominal))), np.zeros(f), np.zeros((f, f))
        for done in range(0, count, PASS):
            normal = stream.standard_normal((min(PASS, count - done), f)).T
            sums += chunk_sums(at, moving, L @ normal, nominal)
            first += normal.sum(axis=1)
            second += normal @ normal.T
        return sums, first, second

    parts = in_chunks(work, rng, draws, size=CHUNK, threads=threads)
    sums, first, second = (sum(column) for column in zip(*parts, strict=True))
    mean = np.asarray(sums)[:3].T / draws
    plain = (_matrices(np.asarray(sums)[3:]) / draws - _outer(mean)) * (draws / (draws - 1))
    # the linear part of the same draws, from their own two moments
    center = np.asarray(first) / draws
    scatter = (np.asarray(second) / draws - np.outer(center, center)) * (draws / (draws - 1))
    root = slope @ L
    turned = np.swapaxes(root, -1, -2)
    linear = root @ turned
    return PointMoments(
        draws,
        frozen(nominal),
        frozen(mean),
        frozen(plain),
        frozen(linear),
        frozen(mean - root @ center),
        frozen(linear + plain - root @ scatter @ turned),
    )


def chunk_sums(at: Postures, moving: Index, steps: Array, nominal: Array) -> Array:
    """Sums (9, N) of x y z, xx yy zz, xy xz yz over steps (f, M), about points (N, 3) in the world.

    `moving` (f,) says which of the P numbers the steps are of; inputs are trusted.
    """
    from calib.kernels.points import point_sums

    model = at.model
    chain, n, M = model.chain, model.chain.n_joints, steps.shape[1]
    rows = {int(number): steps[row] for row, number in enumerate(moving)}
    k, first = len(model.joint_errors.terms), 12 + 5 * n
    origin = nominal.T
    terms = _gathered(rows, first, k, M)
    bound = np.zeros(n)
    if k:
        per_term = np.abs(terms).max(axis=1) * np.abs(at.basis).max(axis=1)
        np.add.at(bound, model.joint_errors.joints, per_term)
    if bound.max(initial=0.0) > LARGEST_TERM:
        full = np.zeros((M, model.n_numbers))
        full[:, moving] = steps.T
        e = tool_points(at, full) - origin[:, None, :]
        return np.stack([*e.sum(axis=1), *(np.einsum("mn,mn->n", e[i], e[j]) for i, j in PAIRS)])
    T = chain.T_flange_tool
    tool = T[:3, 3, None] + T[:3, :3] @ _gathered(rows, 6 + 5 * n, 3, M)
    R, p = chain.T_world_base[:3, :3], chain.T_world_base[:3, 3]
    base, base_moves = np.zeros((12, 0)), bool(rows.keys() & range(6))
    if base_moves:
        frame = _gathered(rows, 0, 6, M)
        turned = R @ exp_so3(frame[3:].T)
        base = np.concatenate([turned.reshape(M, 9).T, R @ frame[:3] + p[:, None]])
    else:  # all is done in base coordinates and turned at the end
        origin = R.T @ (origin - p[:, None])
    sums = np.zeros((9, at.cosine.shape[1]))
    point_sums(
        link_rows(at, rows, M), tool, np.ascontiguousarray(base), terms,
        *(np.ascontiguousarray(part) for part in (at.cosine, at.sine, at.slide, at.basis)),
        np.array(model.joint_errors.joints, dtype=np.int64), chain.prismatic == 0,
        base_moves, np.ascontiguousarray(origin), sums,
    )  # fmt: skip
    if base_moves or np.array_equal(R, np.eye(3)):
        return sums
    second = R @ _matrices(sums[3:]) @ R.T
    return np.stack([*(R @ sums[:3]), *(second[:, i, j] for i, j in PAIRS)])


def link_rows(at: Postures, rows: dict[int, Array], draws: int) -> Array:
    """What `kernels.point_sums` needs of each link and draw (n, 8, M), from steps by number."""
    links = at.model.chain.links
    out = np.zeros((len(links), 8, draws))
    for i, (_, _, a, alpha, beta) in enumerate(links):
        own = [rows.get(6 + 5 * i + column) for column in range(5)]
        for nominal, step, to in ((0.0, own[0], 0), (alpha, own[3], 4), (beta, own[4], 6)):
            if step is None:
                out[i, to], out[i, to + 1] = np.cos(nominal), np.sin(nominal)
            else:
                angle = nominal + step
                np.cos(angle, out=out[i, to])
                np.sin(angle, out=out[i, to + 1])
        out[i, 2] = 0.0 if own[1] is None else own[1]
        out[i, 3] = a if own[2] is None else a + own[2]
    return out


def _gathered(rows: dict[int, Array], first: int, count: int, draws: int) -> Array:
    """Steps (count, M) of consecutive numbers; zero where one does not move."""
    out = np.zeros((count, draws))
    for k in range(count):
        if first + k in rows:
            out[k] = rows[first + k]
    return out


def _matrices(sums: Array) -> Array:
    """Symmetric matrices (N, 3, 3) from xx yy zz xy xz yz (6, N)."""
    return np.moveaxis(sums[[[0, 3, 4], [3, 1, 5], [4, 5, 2]]], -1, 0)


def _outer(v: Array) -> Array:
    """Outer products (N, 3, 3)."""
    return v[:, :, None] * v[:, None, :]
