"""Fit of the springs of one model to the rows of one robot.

It takes the steps of `calib.identification.evidence.spring_products.lowest`, with the same results
but for the order of sums.
"""

from typing import Any

import numpy as np

from calib.kernels.compiled import array_in, array_out, compiled, part


@part
def _solved(A: Any, L: Any, force: Any, x: Any) -> bool:
    """Solve A x = force by a Cholesky factor, whose transpose goes to L; false if there is none."""
    s = len(force)
    for j in range(s):
        for i in range(j, s):
            L[j, i] = A[j, i]
    for j in range(s):
        if not L[j, j] > 0.0:
            return False
        d = 1.0 / np.sqrt(L[j, j])
        for i in range(j, s):
            L[j, i] *= d
        for k in range(j + 1, s):
            c = L[j, k]
            for i in range(k, s):
                L[k, i] -= c * L[j, i]
    for j in range(s):
        x[j] = force[j]
    for j in range(s):
        x[j] /= L[j, j]
        for i in range(j + 1, s):
            x[i] -= L[j, i] * x[j]
    for j in range(s - 1, -1, -1):
        found = x[j]
        for i in range(j + 1, s):
            found -= L[j, i] * x[i]
        x[j] = found / L[j, j]
    return True


@part
def _newton(H: Any, bend: Any, force: Any, L: Any, steps: Any) -> int:
    """Number of steps found: Newton's if there is one, and Gauss-Newton's; L is the factor of H."""
    first = 1 if _solved(H + bend, L, force, steps[0]) else 0
    _solved(H, L, force, steps[first])
    return first + 1


@part
def _dot(a: Any, b: Any) -> float:
    found = 0.0
    for k in range(len(a)):
        found += float(a[k] * b[k])
    return found


@part
def _factors(x: Any, gives: Any, weighs: Any, give: Any, more: Any) -> None:
    """Fill the compliance (p,) of each spring and the factors (1 + f,) of its loads."""
    p = len(gives)
    for i in range(p):
        give[i] = gives[i] * x[i]
    more[0] = 1.0
    for c in range(len(weighs)):
        more[1 + c] = weighs[c] * x[p + c]


@part
def _bent(
    x: Any, gives: Any, weighs: Any, columns: Any, loads: Any, give: Any, more: Any, each: Any,
    h: Any,
) -> None:  # fmt: skip
    """Fill the change h (6 m,) of rows by numbers x, and the loads `each` (m p,) of springs."""
    m, _, p = columns.shape
    _factors(x, gives, weighs, give, more)
    np.dot(loads, more, each)
    for k in range(m):
        for r in range(6):
            found = 0.0
            for i in range(p):
                found += columns[k, r, i] * (each[k * p + i] * give[i])
            h[6 * k + r] = found


@compiled(
    array_in(3), array_in(2), array_in(2), array_in(1), array_in(1), array_in(1), array_in(1),
    array_out(1), array_out(2), array_out(1),
)  # fmt: skip
def springs_of_rows(
    columns: Any, loads: Any, spent: Any, v: Any, gives: Any, weighs: Any, limits: Any,
    x: Any, H: Any, found: Any,
) -> None:  # fmt: skip
    """Numbers of springs that minimize the loss of n = 6 m rows.

    Parameters
    ----------
    columns : (m, 6, p) array
        Columns of the springs' bends.
    loads : (m p, 1 + f) array
        Load of each spring at each pose, by the stated moments and per free moment or tilt.
    spent : (k, n) array
        Y; the inverse covariance of the rows is S = 1 - Y'Y.
    v : (n,) array
        S times the rows.
    gives, weighs : (p,), (f,) array
        Compliance at a number of one for each spring, and prior sd of each moment or tilt.
    limits : (4,) array
        Most steps; predicted drop of the loss below which the fit ends; sum of squares below which
        it ends early, if the predicted drop is below the fourth limit.
    x : (p + f,) array
        Receives the numbers, in units of their prior sd.
    H : (p + f, p + f) array
        Receives the Gauss-Newton matrix of half the loss at the end.
    found : (2,) array
        Receives the change of the loss, and the log determinant of H.
    """
    m, _, p = columns.shape
    n, f, told = 6 * m, len(weighs), len(spent)
    s = p + f
    D, W = np.empty((n, s)), np.empty((told, s))
    bend, L, steps = np.zeros((s, s)), np.zeros((s, s)), np.empty((2, s))
    own, force, each, pushed = np.empty((s, s)), np.empty(s), np.empty(m * p), np.empty(p)
    give, more, left = np.empty(p), np.empty(1 + f), np.empty(n)
    h, t, tried = np.zeros((3, n)), np.zeros((3, told)), np.empty((2, s))
    weighed = np.empty((m * p, f))
    for k in range(m * p):
        for c in range(f):
            weighed[k, c] = loads[k, 1 + c] * weighs[c]
    x[:] = 0.0
    loss, share = 0.0, 1.0
    for step in range(int(limits[0]) + 1):
        _factors(x, gives, weighs, give, more)
        np.dot(loads, more, each)
        for k in range(m):
            for r in range(6):
                row = D[6 * k + r]
                for i in range(p):
                    row[i] = columns[k, r, i] * (each[k * p + i] * gives[i])
                row[p:] = 0.0
                for i in range(p):
                    c0 = columns[k, r, i] * give[i]
                    per = weighed[k * p + i]
                    for c in range(f):
                        row[p + c] += c0 * per[c]
        np.dot(spent, D, W)
        np.dot(D.T, D, H)
        np.dot(W.T, W, own)
        H -= own
        for i in range(s):
            H[i, i] += 1.0
        np.dot(spent.T, t[2], left)
        for k in range(n):
            left[k] += v[k] - h[2, k]
        np.dot(D.T, left, force)
        for i in range(s):
            force[i] -= x[i]
        bend[:] = 0.0
        for k in range(m):
            pushed[:] = 0.0
            for r in range(6):
                for i in range(p):
                    pushed[i] += left[6 * k + r] * columns[k, r, i]
            for i in range(p):
                push = pushed[i] * gives[i]
                for c in range(f):
                    bend[i, p + c] -= push * weighed[k * p + i, c]
        for i in range(p):
            for c in range(p, s):
                bend[c, i] = bend[i, c]
        ways = _newton(H, bend, force, L, steps)
        promised = _dot(steps[0], force)
        if step == int(limits[0]) or promised < limits[1]:
            break
        if promised < limits[3] and _dot(left, left) < limits[2]:
            break
        moved = -1
        while share > limits[1]:
            least, best = np.inf, 0
            for way in range(ways):
                for i in range(s):
                    tried[way, i] = x[i] + share * steps[way, i]
                _bent(tried[way], gives, weighs, columns, loads, give, more, each, h[way])
                np.dot(spent, h[way], t[way])
                new = _dot(h[way], h[way]) - _dot(t[way], t[way]) - 2.0 * _dot(v, h[way])
                new += _dot(tried[way], tried[way])
                if new < least:
                    least, best = new, way
            if least < loss:
                moved = best
                break
            share /= 2.0
        if moved < 0:
            break
        x[:], h[2], t[2] = tried[moved], h[moved], t[moved]
        loss, share = least, min(1.0, 2.0 * share)
    found[0] = loss
    found[1] = 0.0
    for i in range(s):
        found[1] += 2.0 * np.log(L[i, i])
