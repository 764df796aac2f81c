"""Several visits of one virtual TX60: another base and tool each time, one set of links."""

from dataclasses import replace
from functools import cache

import numpy as np

from calib.geometry.frames import exp_so3, step_transform
from tests.testbed.files.made import ROBOT, Made, columns, csv, made

NOISE, TURN = 17.5e-6, 2e-4
HEAD = f"""
robot = "staubli_tx60"
[frames]
euler = "XYZ"
[uncertainty]
position_um = {NOISE * 1e6:g}
rotation_mdeg = {np.degrees(TURN) * 1e3:.6g}
joint_repeatability = "included"
"""


@cache
def place(k: int):
    """Base and tool (4, 4) of place k: meters and decimeters apart."""
    rng = np.random.default_rng(100 + k)
    far = np.concatenate([rng.uniform(-3, 3, 3), rng.uniform(-2, 2, 3)])
    near = np.concatenate([rng.uniform(-0.15, 0.15, 3), rng.uniform(-2, 2, 3)])
    return step_transform(far), step_transform(near)


@cache
def visit(k: int, m: int, *, base: int | None = None, tool: int | None = None, seed: int = 0):
    """Poses of visit k, with the base and tool of others where they are named."""
    rng = np.random.default_rng([seed, k, m])
    chain = replace(
        made().truth.chain,
        T_world_base=place(k if base is None else base)[0],
        T_flange_tool=place(k if tool is None else tool)[1],
    )
    truth = replace(made().truth, chain=chain)
    lower, upper = ROBOT.limits.T
    q = rng.uniform(0.8 * lower, 0.8 * upper, (m, len(lower)))
    return _seen(q, truth, rng)


def measured(data: Made, seed: int) -> Made:
    """The same joints measured by new noise."""
    return _seen(data.q, data.truth, np.random.default_rng(seed))


def _seen(q, truth, rng) -> Made:
    """Joints with the noisy poses that a robot takes there."""
    T, m = truth.poses(q), len(q)
    T[:, :3, :3] = exp_so3(TURN * rng.standard_normal((m, 3))) @ T[:, :3, :3]
    T[:, :3, 3] += NOISE * rng.standard_normal((m, 3))
    return Made(q, T, truth)


def table(data, **more) -> str:
    """The CSV of a visit."""
    return csv(columns(data) | {"euler": ["XYZ"] * len(data.q)} | more)


def session(name: str, *lines: str) -> str:
    """One [[session]] whose file is NAME.csv."""
    return "\n".join(["[[session]]", f'name = "{name}"', f'file = "{name}.csv"', *lines, ""])


def written(folder, visits, *sessions: str, head: str = HEAD):
    """A folder of CSVs by name, and its session.toml."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, data in visits.items():
        (folder / f"{name}.csv").write_text(data if isinstance(data, str) else table(data))
    (folder / "session.toml").write_text(head + "\n".join(sessions))
    return folder
