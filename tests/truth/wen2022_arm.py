"""The arm of Wen et al. 2022 and its two estimators once more; numpy, nothing of the project.

It shares no line with the package: frames are carried from the base to the tool (there from the
tool to the base), a Jacobian column is a plain cross product, and all calibrations of a study go
through one Gauss-Newton iteration side by side. Lengths are in m and angles in rad, leading axes
are batches. A link is Rz(q + theta) Tz(d) Tx(a) Rx(alpha) Ry(beta); equations are the paper's.
"""

import numpy as np

COLUMNS = ("theta", "d", "a", "alpha", "beta")
"""Of a link, in the order in which it moves what follows."""
HELD = {"d2", "beta1", "beta3", "beta4", "beta5", "beta6"}
"""Link numbers that the paper does not identify."""
NAMES = tuple(f"{c}{i}" for i in range(1, 7) for c in COLUMNS if f"{c}{i}" not in HELD)
PLACES = tuple((int(name[-1]) - 1, COLUMNS.index(name[:-1])) for name in NAMES)
"""(link, column) of the paper's 24 numbers."""
LENGTH = np.array([name[:-1] in {"d", "a"} for name in NAMES])
TABLE3 = {
    "best": "4 1 15 9 2 5  27 50 9 4 5  7 6 78 3 6 18  6 4 10 15 7 9  3",
    "random": "36 9 133 49 67 77  220 568 154 87 79  90 140 719 52 74 149  18 11 112 109 70 89  36",
}
"""u printed [1e-4 deg or mm], all theta, then all d, a, alpha and beta."""


def table3(column):
    """One column u (24,) of the paper's Table 3 [m or rad]."""
    by_letter = sorted(range(len(NAMES)), key=lambda k: COLUMNS.index(NAMES[k][:-1]))
    u = np.empty(len(NAMES))
    u[by_letter] = [float(digits) * 1e-4 for digits in TABLE3[column].split()]
    return u * np.where(LENGTH, 1e-3, np.pi / 180)


def turned(first, second, angle):
    """Two axes of a frame after a turn about its third one."""
    c, s = np.cos(angle)[..., None], np.sin(angle)[..., None]
    return c * first + s * second, c * second - s * first


def forward(links, q, base=None, tool=None, *, slopes=False):
    """Position (..., 3) and rotation (..., 3, 3) of the tool; with `slopes` also J (..., 6, 24).

    `links` (..., 6, 5) and `q` (..., 6) are broadcast; J has rows [dp; dr] in world axes.
    """
    base, tool = (np.eye(4) if T is None else T for T in (base, tool))
    shape = np.broadcast_shapes(links.shape[:-2], q.shape[:-1])
    x, y, z, p = (np.broadcast_to(base[:3, k], (*shape, 3)) for k in range(4))
    axes = {}
    for i in range(6):
        theta, d, a, alpha, beta = np.moveaxis(links[..., i, :], -1, 0)
        axes[i, 0] = z, p
        x, y = turned(x, y, q[..., i] + theta)
        axes[i, 1] = z, None
        p = p + d[..., None] * z
        axes[i, 2] = x, None
        p = p + a[..., None] * x
        axes[i, 3] = x, p
        y, z = turned(y, z, alpha)
        axes[i, 4] = y, p
        z, x = turned(z, x, beta)
    R = np.stack([x, y, z], axis=-1)
    p = p + R @ tool[:3, 3]
    R = R @ tool[:3, :3]
    if not slopes:
        return p, R
    J = np.zeros((*shape, 6, len(PLACES)))
    for k, place in enumerate(PLACES):
        axis, origin = axes[place]
        if origin is None:
            J[..., :3, k] = axis
        else:
            J[..., :3, k] = np.cross(axis, p - origin)
            J[..., 3:, k] = axis
    return p, R, J


def moved(links, step):
    """Links (..., 6, 5) after steps (..., 24) of the paper's numbers."""
    shape = np.broadcast_shapes(links.shape, (*step.shape[:-1], 6, 5))
    links = np.broadcast_to(links, shape).copy()
    for k, (i, column) in enumerate(PLACES):
        links[..., i, column] += step[..., k]
    return links


def rotation_of(vector):
    """Exp of rotation vectors (..., 3)."""
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    K = np.cross(vector[..., None, :], -np.eye(3))
    # sin t / t and (1 - cos t) / t^2, finite at zero
    return np.eye(3) + np.sinc(angle / np.pi) * K + np.sinc(angle / 2 / np.pi) ** 2 / 2 * K @ K


def vector_of(R):
    """Log of small rotations (..., 3, 3)."""
    skew = np.stack([R[..., k, j] - R[..., j, k] for j, k in ((1, 2), (2, 0), (0, 1))], -1) / 2
    sine = np.linalg.norm(skew, axis=-1, keepdims=True)
    return skew / np.sinc(np.arcsin(sine) / np.pi)


def paper_rows(p, R, J):
    """Derivative (..., m, 12, 24) of the columns n, o, a and of p [mm] (paper, eq. 4)."""
    turns = [
        np.cross(J[..., 3:, :], R[..., :, k, None], axisa=-2, axisb=-2, axisc=-2) for k in range(3)
    ]
    return np.concatenate([*turns, 1e3 * J[..., :3, :]], axis=-2)


def paper_system(p, R, J, position, rotation, _):
    """Residual and rows of the unweighted estimator: 12 a pose, in 1 and mm (paper, eqs. 3-5)."""
    columns = np.swapaxes(rotation - R, -1, -2)
    r = np.concatenate([columns.reshape(*columns.shape[:-2], 9), 1e3 * (position - p)], axis=-1)
    return r, paper_rows(p, R, J)


def whitened_system(p, R, J, position, rotation, covariance):
    """Residual and rows, 6 a pose, each divided by the stated noise."""
    e = vector_of(rotation @ np.swapaxes(R, -1, -2))
    t = np.linalg.norm(e, axis=-1)[..., None, None]
    E = np.cross(e[..., None, :], -np.eye(3))
    # inverse right Jacobian of the residual angle; the last term as a series, t is a millirad
    bend = 1 / 12 + t**2 / 720
    inverse = np.eye(3) + E / 2 + bend * (E @ E)
    rows = np.concatenate([J[..., :3, :], inverse @ J[..., 3:, :]], axis=-2)
    r = np.concatenate([position - p, e], axis=-1)
    L = np.linalg.cholesky(covariance)
    return np.linalg.solve(L, r[..., None])[..., 0], np.linalg.solve(L, rows)


SYSTEMS = {"paper": paper_system, "whitened": whitened_system}


def calibrate(
    links, q, position, rotation, mode, *, covariance=None, base=None, tool=None, most=30
):
    """Steps (k, 24) of k calibrations, each from m poses, by plain Gauss-Newton from nominal.

    Parameters
    ----------
    links : (6, 5) array
        Nominal robot.
    q : (k, m, 6) array
        Joints of each set [rad].
    position, rotation : (k, m, 3) and (k, m, 3, 3) arrays
        Measured tool poses.
    mode : {"paper", "whitened"}
        Estimator.
    covariance : (k, m, 6, 6) or (6, 6) array
        Stated noise of a pose [m^2, m rad, rad^2]; only for "whitened".

    Until no number of any set moves by more than 1e-12 m or rad.
    """
    step = np.zeros((len(q), len(PLACES)))
    for _ in range(most):
        here = forward(moved(links, step)[:, None], q, base, tool, slopes=True)
        r, A = SYSTEMS[mode](*here, position, rotation, covariance)
        A, r = A.reshape(len(q), -1, len(PLACES)), r.reshape(len(q), -1, 1)
        size = np.linalg.norm(A, axis=1)
        # triangular factor of scaled columns: normal equations would square the condition
        Q, U = np.linalg.qr(A / size[:, None])
        change = np.linalg.solve(U, np.swapaxes(Q, 1, 2) @ r)[..., 0] / size
        step = step + change
        if np.abs(change).max() < 1e-12:
            return step
    raise RuntimeError(f"{mode}: not settled after {most} steps")


def distances(one, other):
    """Mean distance (k,) between points (k, m, 3)."""
    return np.linalg.norm(one - other, axis=-1).mean(axis=-1)


def judged(links, step, q, position, test_q, test_position, *, base=None, tool=None):
    """Mean errors (k, 2) on the own poses as measured and on the held-out points [m].

    The paper's Tables 1 and 2 for k calibrations; a step of zero gives the columns "before".
    """
    found = moved(links, step)[:, None]
    own, _ = forward(found, q, base, tool)
    held_out, _ = forward(found, test_q, base, tool)
    return np.stack([distances(own, position), distances(held_out, test_position)], axis=-1)


def indices(links, q, *, base=None, tool=None):
    """Indices (k, 2) O1 and O2 of sets q (k, m, 6): rows and columns in mm and rad (eq. 6)."""
    A = paper_rows(*forward(links, q, base, tool, slopes=True)) * np.where(LENGTH, 1e-3, 1.0)
    sigma = np.linalg.svd(A.reshape(len(q), -1, len(PLACES)), compute_uv=False)
    size = np.exp(np.log(sigma).mean(axis=-1)) / np.sqrt(q.shape[1])
    return np.stack([size, sigma[:, -1] / sigma[:, 0]], axis=-1)


def calibrated_sets(
    links, q, position, rotation, covariance, test_q, test_position, *, base=None, tool=None
):
    """What the figures of random sets show: O1 and O2 (k, 2), and by estimator errors (k, 2).

    The k sets may have visits of their own; arrays as in `calibrate` and `judged`. Under "before"
    are the errors of the nominal robot.
    """
    arm = {"base": base, "tool": tool}
    found = {"index": indices(links, q, **arm)}
    steps = {"before": np.zeros((len(q), len(PLACES)))}
    for mode in SYSTEMS:
        steps[mode] = calibrate(links, q, position, rotation, mode, covariance=covariance, **arm)
    for mode, step in steps.items():
        found[mode] = judged(links, step, q, position, test_q, test_position, **arm)
    return found


def tool_cloud(links, u, q, rng, draws, *, base=None, tool=None):
    """Tool points (M, t, 3) minus nominal, and |P| (M, t), of M robots, each number on its own."""
    step = rng.standard_normal((draws, len(PLACES))) * u
    cloud = np.stack([forward(moved(links, step), pose, base, tool)[0] for pose in q], axis=1)
    at, _ = forward(links, q, base, tool)
    return cloud - at, np.linalg.norm(cloud, axis=-1)
