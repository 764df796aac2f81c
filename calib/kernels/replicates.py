"""The gradient of many fits, 32 replicates side by side.

The number 32 is written out, since loops of constant length compile to vector instructions.
"""

from typing import Any

import numpy as np

from calib.kernels.compiled import array_in, array_out, compiled, part


@part
def _small(w: float) -> tuple[float, float]:
    """Cosine and sine of a small angle, to 1e-16 within 0.05 rad."""
    q = w * w
    c = 1.0 - q / 2 * (1.0 - q / 12 * (1.0 - q / 30 * (1.0 - q / 56)))
    return c, w * (1.0 - q / 6 * (1.0 - q / 20 * (1.0 - q / 42 * (1.0 - q / 72))))


@part
def _turn(S: Any, i: int, j: int, P: Any, c: int) -> None:
    """Axes or vectors in rows i, j of S after a turn; cos, sin in rows c, c + 1 of P."""
    for k in range(32):
        u = P[c, k] * S[i, k] + P[c + 1, k] * S[j, k]
        S[j, k] = P[c, k] * S[j, k] - P[c + 1, k] * S[i, k]
        S[i, k] = u


@part
def _dot(S: Any, to: int, A: Any, a: int, b: int, c: int, V: Any, u: int, v: int, w: int) -> None:
    """Row `to` of S becomes the sum of rows a, b, c of A times rows u, v, w of V."""
    for k in range(32):
        S[to, k] = A[a, k] * V[u, k] + A[b, k] * V[v, k] + A[c, k] * V[w, k]


@part
def _arm(S: Any, to: int, A: Any, arm: int, force: int, r1: int, r2: int) -> None:
    """Add one component of arm x force to row `to`: a[r1] f[r2] - a[r2] f[r1]."""
    for k in range(32):
        S[to, k] += A[arm + r1, k] * S[force + r2, k] - A[arm + r2, k] * S[force + r1, k]


@part
def _add(into: Any, row: int, S: Any, other: int) -> None:
    """Add row `other` of S to a row."""
    for k in range(32):
        into[row, k] += S[other, k]


@part
def _posture(T: Any, par: Any, C: float, D: float, along: float) -> None:
    """Cos and sin of posture plus step, and the slide, of one link."""
    for k in range(32):
        T[0, k] = par[0, k] * C - par[1, k] * D
        T[1, k] = par[0, k] * D + par[1, k] * C
    for k in range(32):
        T[2, k] = par[2, k] + along


@part
def _frames(
    S: Any, turned: Any, links: Any, terms: Any, cosine: Any, sine: Any, slide: Any, basis: Any,
    joint: Any, turns: Any,
) -> None:  # fmt: skip
    """Flange axes (rows 0-8 of S) and origin (9-11) in the base frame, for one posture."""
    S[:12] = 0.0
    S[0] = 1.0
    S[4] = 1.0
    S[8] = 1.0
    for i in range(turns.shape[0]):
        par, T = links[i], turned[i]
        _posture(T, par, cosine[i], sine[i], slide[i])
        # joint terms turn or slide it further
        used = False
        for t in range(joint.shape[0]):
            if joint[t] == i:
                if not used:
                    S[39] = 0.0
                    used = True
                row, value = terms[t], basis[t]
                for k in range(32):
                    S[39, k] += value * row[k]
        if used and turns[i]:
            for k in range(32):
                c, s = _small(S[39, k])
                u = T[0, k] * c - T[1, k] * s
                T[1, k] = T[1, k] * c + T[0, k] * s
                T[0, k] = u
        elif used:
            _add(T, 2, S, 39)
        # Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta)
        for r in range(3):
            _turn(S, r, 3 + r, T, 0)
            for k in range(32):
                S[9 + r, k] += T[2, k] * S[6 + r, k] + par[3, k] * S[r, k]
            _turn(S, 3 + r, 6 + r, par, 4)
            _turn(S, 6 + r, r, par, 6)


@part
def _links(g: Any, S: Any, turned: Any, links: Any, basis: Any, joint: Any, turns: Any) -> None:
    """Transform the wrench (rows 12-17 of S) from base to flange, adding its components to g."""
    n = turns.shape[0]
    for i in range(n):
        par, T, at = links[i], turned[i], 6 + 5 * i
        _add(g, at, S, 17)  # theta
        moment = 17 if turns[i] else 14
        for t in range(joint.shape[0]):
            if joint[t] == i:
                value, into = basis[t], g[12 + 5 * n + t]
                for k in range(32):
                    into[k] += value * S[moment, k]
        _turn(S, 12, 13, T, 0)
        _turn(S, 15, 16, T, 0)
        _add(g, at + 1, S, 14)  # d
        _add(g, at + 2, S, 12)  # a
        for k in range(32):
            S[15, k] += T[2, k] * S[13, k]
            S[16, k] += par[3, k] * S[14, k] - T[2, k] * S[12, k]
            S[17, k] -= par[3, k] * S[13, k]
        _add(g, at + 3, S, 15)  # alpha
        _turn(S, 13, 14, par, 4)
        _turn(S, 16, 17, par, 4)
        _add(g, at + 4, S, 16)  # beta
        _turn(S, 14, 12, par, 6)
        _turn(S, 17, 15, par, 6)


@part
def _tool(S: Any, H: Any) -> None:
    """Tool axes (rows 18-26 of S) and tool point (27-29), in the base frame; tool H (12, 32)."""
    for r in range(3):
        for c in range(3):
            _dot(S, 18 + 3 * r + c, H, c, 3 + c, 6 + c, S, r, 3 + r, 6 + r)
        _dot(S, 27 + r, H, 9, 10, 11, S, r, 3 + r, 6 + r)
        _add(S, 27 + r, S, 9 + r)


@part
def _residual(S: Any, B: Any, observed: Any, offset: Any) -> Any:
    """Residual (rows 30-35 of S) of one observation (12, 32); true if it has a reflector offset."""
    # tool into the world: axes to rows 0-8 (row by row), point into the residual
    for r in range(3):
        for c in range(3):
            _dot(S, 3 * r + c, B, 3 * r, 3 * r + 1, 3 * r + 2, S, 18 + c, 21 + c, 24 + c)
        _dot(S, 39, B, 3 * r, 3 * r + 1, 3 * r + 2, S, 27, 28, 29)
        for k in range(32):
            S[30 + r, k] = observed[r, k] - B[9 + r, k] - S[39, k]
    # reflector away from the tool origin
    o0, o1, o2 = offset[0], offset[1], offset[2]
    lever = o0 != 0.0 or o1 != 0.0 or o2 != 0.0
    if lever:
        for r in range(3):
            x = 3 * r
            for k in range(32):
                S[36 + r, k] = o0 * S[x, k] + o1 * S[x + 1, k] + o2 * S[x + 2, k]
            for k in range(32):
                S[30 + r, k] -= S[36 + r, k]
    # sine of the rotation vector: half the sum of axis x axis observed
    for r in range(3):
        r1, r2 = 3 * ((r + 1) % 3), 3 * ((r + 2) % 3)
        _dot(S, 33 + r, observed, r2 + 3, r2 + 4, r2 + 5, S, r1, r1 + 1, r1 + 2)
        _dot(S, 39, observed, r1 + 3, r1 + 4, r1 + 5, S, r2, r2 + 1, r2 + 2)
        for k in range(32):
            S[33 + r, k] -= S[39, k]
    # arc sine
    for k in range(32):
        u, v, w = 0.5 * S[33, k], 0.5 * S[34, k], 0.5 * S[35, k]
        q = u * u + v * v + w * w
        s = 1.0 + q * (1 / 6 + q * (3 / 40 + q * (5 / 112 + q * (35 / 1152))))
        S[33, k] = s * u
        S[34, k] = s * v
        S[35, k] = s * w
    return lever


@part
def _wrench(S: Any, weight: Any, chi: Any) -> None:
    """Force and torque W r (rows 12-17 of S) in world axes; r'W r is added to chi (32,)."""
    for r in range(6):
        S[12 + r] = 0.0
        for c in range(6):
            W = weight[r, c]
            if W != 0.0:
                for k in range(32):
                    S[12 + r, k] += W * S[30 + c, k]
        for k in range(32):
            chi[k] += S[12 + r, k] * S[30 + r, k]
    # torque <- inverse right Jacobian, transposed, times torque
    for k in range(32):
        x, y, z = S[33, k], S[34, k], S[35, k]
        u, v, w = S[15, k], S[16, k], S[17, k]
        q = x * x + y * y + z * z
        h = 1 / 12 + q * (1 / 720 + q * (1 / 30240))
        c0, c1, c2 = y * w - z * v, z * u - x * w, x * v - y * u
        S[15, k] = u - 0.5 * c0 + h * (y * c2 - z * c1)
        S[16, k] = v - 0.5 * c1 + h * (z * c0 - x * c2)
        S[17, k] = w - 0.5 * c2 + h * (x * c1 - y * c0)


@part
def _to_base(S: Any, B: Any) -> None:
    """The wrench (rows 12-17 of S) in base axes, about the base origin."""
    for r in range(3):
        _dot(S, 39 + r, B, r, 3 + r, 6 + r, S, 12, 13, 14)
        _dot(S, 42 + r, B, r, 3 + r, 6 + r, S, 15, 16, 17)
    S[12:18] = S[39:45]
    for r in range(3):
        _arm(S, 15 + r, S, 27, 12, (r + 1) % 3, (r + 2) % 3)


@compiled(
    array_in(4), array_in(3), array_in(3), array_in(3), array_in(4), array_in(3), array_in(2),
    array_in(2), array_in(2), array_in(2), array_in(2),
    array_in(1, "int64"), array_in(1, "boolean"),
    array_out(3), array_out(2),
)  # fmt: skip
def gradient(
    links: Any, base: Any, tool: Any, terms: Any, observed: Any, weight: Any, offset: Any,
    cosine: Any, sine: Any, slide: Any, basis: Any, joint: Any, turns: Any,
    slope: Any, square: Any,
) -> None:  # fmt: skip
    """J'W r and r'W r of many models, each for its own table, without forming a Jacobian.

    Each pose acts on the tool with the wrench W r. When this is transformed from base to tip
    through the frames of the chain, every entry of J'W r is one of its components.

    Parameters
    ----------
    links : (B, n, 8, 32) array
        Per block, link and replicate: cos, sin of the step of theta; step of d; a; cos, sin of
        alpha; cos, sin of beta [m].
    base, tool : (B, 12, 32) array
        Rows of the rotation, then the origin of base in world and tool in flange [m].
    terms : (B, k, 32) array
        Steps of the coefficients of the joint terms [rad or m].
    observed : (B, m, 12, 32) array
        Position observed [m], then the rotation row by row, in the world.
    weight : (m, 6, 6) array
        Inverse covariance of [position; rotation vector] in world axes.
    offset : (m, 3) array
        Reflector in the tool frame; zero where a pose is measured [m].
    cosine, sine, slide : (m, n) array
        Nominal cosine and sine of each joint at each posture, and its slide [m].
    basis : (m, k) array
        Values of the joint terms.
    joint, turns : (k,) array of int, (n,) array of bool
        Joint of each term; whether the joint is revolute.
    slope : (B, 12 + 5 n + k, 32) array
        Receives J'W r, for every number of the model.
    square : (B, 32) array
        Receives r'W r.

    References
    ----------
    Residual [p_obs - p; Log(R_obs R')]; Sola, Deray, Atchuthan, arXiv 1812.01537, eq. (144).
    """
    n, m = links.shape[1], observed.shape[1]
    # rows of 32: axes x y z 0-8, point 9-11, force 12-14, torque 15-17, tool axes 18-26,
    # point in the base frame 27-29, residual 30-35, reflector arm 36-38, spare 39-44
    S = np.empty((45, 32))
    turned = np.empty((n, 3, 32))  # cos, sin and slide of each link
    for b in range(links.shape[0]):
        g, chi, B, H = slope[b], square[b], base[b], tool[b]
        g[:] = 0.0
        chi[:] = 0.0
        for j in range(m):
            # forward: flange, tool, residual
            _frames(
                S, turned, links[b], terms[b], cosine[j], sine[j], slide[j], basis[j], joint, turns
            )
            _tool(S, H)
            lever = _residual(S, B, observed[b, j], offset[j])
            # backward: wrench at the tool, at the base, along the links, at the flange
            _wrench(S, weight[j], chi)
            if lever:
                for r in range(3):
                    _arm(S, 15 + r, S, 36, 12, (r + 1) % 3, (r + 2) % 3)
            _to_base(S, B)
            for r in range(6):
                _add(g, r, S, 12 + r)
            _links(g, S, turned, links[b], basis[j], joint, turns)
            for r in range(3):
                _arm(S, 15 + r, H, 9, 12, (r + 2) % 3, (r + 1) % 3)
            for r in range(3):
                for half in range(2):
                    x = 12 + 3 * half
                    _dot(S, 39, H, r, 3 + r, 6 + r, S, x, x + 1, x + 2)
                    _add(g, 6 + 5 * n + 3 * half + r, S, 39)
