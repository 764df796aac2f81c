"""Tool points of many perturbed robots, postures side by side: their deviations and moments.

The tool point is transformed from tip to base. Cosines of postures and of nominal angles are given;
those of steps come from a series, so that the loops call no trigonometric function.
"""

from typing import Any

import numpy as np

from calib.kernels.compiled import array_in, array_out, compiled, part


@part
def _stepped(C: float, S: float, steps: Any, cosine: Any, sine: Any) -> None:
    """Cosines and sines (M,) of an angle after steps (M,), from those of the angle."""
    for m in range(steps.shape[0]):
        w = steps[m]
        q = w * w
        c = 1.0 - q / 2 * (1.0 - q / 12 * (1.0 - q / 30 * (1.0 - q / 56)))
        s = w * (1.0 - q / 6 * (1.0 - q / 20 * (1.0 - q / 42 * (1.0 - q / 72))))
        cosine[m] = C * c - S * s
        sine[m] = S * c + C * s


@part
def _turn(x: Any, y: Any, c: float, s: float) -> None:
    """Rows of coordinates after a turn that takes the axis of x towards that of y."""
    for k in range(x.shape[0]):
        u = c * x[k] - s * y[k]
        y[k] = s * x[k] + c * y[k]
        x[k] = u


@part
def _turn_each(x: Any, y: Any, w: Any) -> None:
    """The same with a small angle w (N,) for each posture [rad]."""
    for k in range(x.shape[0]):
        q = w[k] * w[k]
        c = 1.0 - q / 2 * (1.0 - q / 12 * (1.0 - q / 30 * (1.0 - q / 56)))
        s = w[k] * (1.0 - q / 6 * (1.0 - q / 20 * (1.0 - q / 42 * (1.0 - q / 72))))
        u = c * x[k] - s * y[k]
        y[k] = s * x[k] + c * y[k]
        x[k] = u


@part
def _add_products(to: Any, a: Any, b: Any) -> None:
    """Add the elementwise product of two rows to a third."""
    for k in range(to.shape[0]):
        to[k] += a[k] * b[k]


@compiled(
    array_in(2), array_in(3), array_in(2), array_in(2), array_in(3), array_in(1, "int64"),
    array_in(3), array_in(2), array_in(1, "boolean"), array_out(3), array_out(2),
)  # fmt: skip
def points(
    links: Any,
    steps: Any,
    tool: Any,
    base: Any,
    shifts: Any,
    shifted: Any,
    postures: Any,
    nominal: Any,
    turns: Any,
    out: Any,
    sums: Any,
) -> None:
    """Tool points of M draws at N postures minus `nominal`, and their first and second moments.

    Parameters
    ----------
    links : (n, 6) array
        a [m]; cosine and sine of alpha and of beta; 1 where beta is used. d is in `postures`.
    steps : (n, 5, M) array
        Steps of theta, d, a, alpha, beta [rad, m].
    tool : (3, M) array
        Tool point in the flange [m].
    base : (12, M) array
        Rows of the rotation of the base, then its origin [m]; (12, 0) where it is the world.
    shifts : (j, M, N) array
        Small additions of joint terms to a joint [rad, m].
    shifted : (n,) array of int
        Index into `shifts` for each joint; -1 for none.
    postures : (n, 3, N) array
        Cosine and sine of the nominal turn of each joint, its slide with d [m].
    nominal : (3, N) array
        Points that are subtracted [m].
    turns : (n,) array of bool
        Whether the joint is revolute.
    out : (3, M, N) array
        Receives the deviations [m].
    sums : (9, N) array
        Sums over draws of x y z, xx yy zz, xy xz yz are added to it [m, m^2].
    """
    n, M, N = links.shape[0], tool.shape[1], nominal.shape[1]
    parts = np.empty((n, 6, M))
    for i in range(n):
        _stepped(1.0, 0.0, steps[i, 0], parts[i, 0], parts[i, 1])
        _stepped(links[i, 1], links[i, 2], steps[i, 3], parts[i, 2], parts[i, 3])
        _stepped(links[i, 3], links[i, 4], steps[i, 4], parts[i, 4], parts[i, 5])
    n0, n1, n2 = nominal[0], nominal[1], nominal[2]
    for m in range(M):
        x, y, z = out[0, m], out[1, m], out[2, m]
        x[:] = tool[0, m]
        y[:] = tool[1, m]
        z[:] = tool[2, m]
        for i in range(n - 1, -1, -1):
            if links[i, 5] != 0.0:
                _turn(z, x, parts[i, 4, m], parts[i, 5, m])
            a, d = links[i, 0] + steps[i, 2, m], steps[i, 1, m]
            ca, sa, ct, st = parts[i, 2, m], parts[i, 3, m], parts[i, 0, m], parts[i, 1, m]
            C, S, along = postures[i, 0], postures[i, 1], postures[i, 2]
            rise = d + along[0] if turns[i] else 0.0
            for k in range(N):
                u = x[k] + a
                v = ca * y[k] - sa * z[k]
                z[k] = sa * y[k] + ca * z[k] + rise
                c = ct * C[k] - st * S[k]
                s = ct * S[k] + st * C[k]
                x[k] = c * u - s * v
                y[k] = s * u + c * v
            if not turns[i]:
                for k in range(N):
                    z[k] += d + along[k]
            if shifted[i] >= 0:
                w = shifts[shifted[i], m]
                if turns[i]:
                    _turn_each(x, y, w)
                else:
                    for k in range(N):
                        z[k] += w[k]
        if base.shape[1] > 0:
            b = base[:, m]
            for k in range(N):
                u = b[0] * x[k] + b[1] * y[k] + b[2] * z[k] + b[9]
                v = b[3] * x[k] + b[4] * y[k] + b[5] * z[k] + b[10]
                z[k] = b[6] * x[k] + b[7] * y[k] + b[8] * z[k] + b[11]
                x[k] = u
                y[k] = v
        for k in range(N):
            x[k] -= n0[k]
            y[k] -= n1[k]
            z[k] -= n2[k]
        # separate short loops: the compiler does not vectorize one with many pointers
        for i in range(3):
            own, total = out[i, m], sums[i]
            for k in range(N):
                total[k] += own[k]
            _add_products(sums[3 + i], own, own)
        _add_products(sums[6], x, y)
        _add_products(sums[7], x, z)
        _add_products(sums[8], y, z)
