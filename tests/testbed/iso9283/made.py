"""Virtual cycles of known bias and scatter, as tables; nothing here knows how they are read."""

import numpy as np

CUBE = np.array([900, 0, 700.0]) + np.array(
    [[0, 0, 0], [200, 200, 200], [200, -200, -200], [-200, -200, 200], [-200, 200, -200.0]]
)
"""Five poses [mm]."""
BIAS = np.array([[80, 0, 0], [0, -60, 0], [0, 0, 40], [30, 40, 0], [0, 0, 0.0]])
"""Barycenter less command [um]."""


SESSION = """
name = "acceptance"
[cycles]
file = "cycles.csv"
[paths]
file = "path.csv"
[uncertainty]
position_um = 4
[iso9283]
frame = "robot"
speed_percent = 80
limits_um = {AP = 200, RP = 60}
[conditions]
payload_kg = 5
date = "2026-11-22"
[job]
customer = "A <b>bold</b> one"
[job.instrument]
certificate = "K 1"
valid_until = "2026-01-31"
"""
"""A session of both kinds, with limits and a job sheet."""


def scatter(n, poses, sd, seed=0):
    """Normal errors (poses, n, 3) [um] with exactly this mean zero and this covariance."""
    x = np.random.default_rng(seed).standard_normal((poses, n, 3))
    x -= x.mean(axis=1, keepdims=True)
    for k in range(poses):
        L = np.linalg.cholesky(np.cov(x[k].T))
        x[k] = np.linalg.solve(L, x[k].T).T * sd
    return x


def pose_rows(n=30, sd=10.0, bias=BIAS, commands=CUBE, seed=0, *, cycle_time=20.0, turns=None):
    """Rows (dicts) of n cycles, pose after pose [mm]; turns (poses, n, 3) are extra [deg]."""
    seen = commands[:, None] + (bias[:, None] + scatter(n, len(commands), sd, seed)) * 1e-3
    rows = []
    for c in range(n):
        for k in range(len(commands)):
            row = {"pose_id": f"P{k + 1}", "cycle": c + 1, "time_s": c * cycle_time + k}
            row |= {f"{a}_mm": seen[k, c, i] for i, a in enumerate("xyz")}
            row |= {f"command_{a}_mm": commands[k, i] for i, a in enumerate("xyz")}
            if turns is not None:
                row |= {f"rv{a}_deg": turns[k, c, i] for i, a in enumerate("xyz")}
                row |= {f"command_rv{a}_deg": 0.0 for a in "xyz"}
            rows.append(row)
    return rows


def path_rows(n=10, m=25, shifts=None, off=(0.0, 0.2, 0.0), name="line"):
    """Rows of a straight path along x, each run beside it by its shift (n, 3) and `off` [mm]."""
    shifts = np.zeros((n, 3)) if shifts is None else shifts
    rows = []
    for c in range(n):
        for k in range(m):
            command = np.array([800 + 10.0 * k, -50, 600])
            seen = command + off + shifts[c]
            row = {"path": name, "path_point": k + 1, "cycle": c + 1, "time_s": c * 100 + k}
            row |= {f"{a}_mm": seen[i] for i, a in enumerate("xyz")}
            row |= {f"command_{a}_mm": command[i] for i, a in enumerate("xyz")}
            rows.append(row)
    return rows


def text_of(rows, separator=","):
    """A CSV of rows; columns that a row does not have are empty."""
    head = list(dict.fromkeys(name for row in rows for name in row))
    cells = [
        [v if isinstance(v := row.get(name, ""), str) else f"{v:.12g}" for name in head]
        for row in rows
    ]
    return "\n".join(separator.join(line) for line in [head, *cells]) + "\n"


def dropped(rows, **which):
    """Rows but those with all these values."""
    return [row for row in rows if any(row.get(k) != v for k, v in which.items())]


def changed(rows, change, **which):
    """Rows with other values where all of `which` hold."""
    hit = [all(row.get(k) == v for k, v in which.items()) for row in rows]
    assert any(hit)
    return [row | change if here else row for row, here in zip(rows, hit, strict=True)]
