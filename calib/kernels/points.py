"""Moments of tool points over many draws, postures side by side; see `calib.kernels.compiled`."""

from typing import Any

import numpy as np
from numba import types

from calib.kernels.compiled import array_in, array_out, compiled


@compiled(
    array_in(3), array_in(2), array_in(2), array_in(2),
    array_in(2), array_in(2), array_in(2), array_in(2),
    array_in(1, types.int64), array_in(1, types.boolean), types.boolean, array_in(2), array_out(2),
)  # fmt: skip
def point_sums(
    links: Any,
    tool: Any,
    base: Any,
    terms: Any,
    cosine: Any,
    sine: Any,
    slide: Any,
    basis: Any,
    joint: Any,
    turns: Any,
    base_moves: Any,
    nominal: Any,
    sums: Any,
) -> None:
    """Add, over M draws, the first and second moments of the tool points about `nominal`.

    Parameters
    ----------
    links : (n, 8, M) array
        Per link and draw: cos, sin of the step of theta; step of d; a; cos, sin of alpha; cos, sin
        of beta [m].
    tool : (3, M) array
        Tool point in the flange [m].
    base : (12, M) array
        Rows of the base rotation, then its origin; not read unless `base_moves`.
    terms : (k, M) array
        Steps of the coefficients of the joint terms [rad or m].
    cosine, sine, slide : (n, N) array
        Of each joint at each posture, nominal; slide along the axis, d included [m].
    basis : (k, N) array
        Values of the joint terms.
    joint : (k,) array of int
        Joint of each term.
    turns : (n,) array of bool
        Whether the joint is revolute.
    base_moves : bool
        Whether the base differs between draws; else all is in base coordinates.
    nominal : (3, N) array
        Point that deviations are counted from [m].
    sums : (9, N) array
        Receives the sums of x y z, xx yy zz, xy xz yz of the deviations [m, m^2].
    """
    M, n, N = links.shape[2], links.shape[0], cosine.shape[1]
    x, y, z, w = np.empty(N), np.empty(N), np.empty(N), np.empty(N)
    s0, s1, s2, s3, s4 = sums[0], sums[1], sums[2], sums[3], sums[4]
    s5, s6, s7, s8 = sums[5], sums[6], sums[7], sums[8]
    n0, n1, n2 = nominal[0], nominal[1], nominal[2]
    for m in range(M):
        x[:] = tool[0, m]
        y[:] = tool[1, m]
        z[:] = tool[2, m]
        for i in range(n - 1, -1, -1):
            ct, st, d, a = links[i, 0, m], links[i, 1, m], links[i, 2, m], links[i, 3, m]
            ca, sa, cb, sb = links[i, 4, m], links[i, 5, m], links[i, 6, m], links[i, 7, m]
            C, S, along = cosine[i], sine[i], slide[i]
            if sb != 0.0 or cb != 1.0:
                for k in range(N):
                    t = cb * x[k] + sb * z[k]
                    z[k] = cb * z[k] - sb * x[k]
                    x[k] = t
            used = False
            for t_index in range(joint.shape[0]):
                if joint[t_index] == i and terms[t_index, m] != 0.0:
                    value, row = terms[t_index, m], basis[t_index]
                    if not used:
                        w[:] = 0.0
                        used = True
                    for k in range(N):
                        w[k] += value * row[k]
            for k in range(N):
                u = x[k] + a
                v = ca * y[k] - sa * z[k]
                z[k] = sa * y[k] + ca * z[k]
                c = ct * C[k] - st * S[k]
                s = ct * S[k] + st * C[k]
                x[k] = c * u - s * v
                y[k] = s * u + c * v
            for k in range(N):
                z[k] += d + along[k]
            if used and turns[i]:
                for k in range(N):
                    q = w[k] * w[k]
                    c = 1.0 - q / 2 * (1.0 - q / 12 * (1.0 - q / 30 * (1.0 - q / 56)))
                    s = w[k] * (1.0 - q / 6 * (1.0 - q / 20 * (1.0 - q / 42 * (1.0 - q / 72))))
                    u = c * x[k] - s * y[k]
                    y[k] = s * x[k] + c * y[k]
                    x[k] = u
            elif used:
                for k in range(N):
                    z[k] += w[k]
        if base_moves:
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
        # separate short loops: many pointers in one loop would stay scalar
        for k in range(N):
            s0[k] += x[k]
            s1[k] += y[k]
            s2[k] += z[k]
        for k in range(N):
            s3[k] += x[k] * x[k]
            s4[k] += y[k] * y[k]
        for k in range(N):
            s5[k] += z[k] * z[k]
            s6[k] += x[k] * y[k]
        for k in range(N):
            s7[k] += x[k] * z[k]
            s8[k] += y[k] * z[k]
