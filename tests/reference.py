"""What tests share: a TX60 written down by hand (not read from models/), pools, free sets."""

import numpy as np

from calib.arrays import Array
from calib.geometry.chain import Chain, forward
from calib.geometry.model import RobotModel

DEG = np.pi / 180
UM = 1e-6

# Wen et al. 2022, Table 3: theta deg, d mm, a mm, alpha deg, beta deg
TX60_LINKS = np.array(
    [
        [0, 0, 0, -90, 0],
        [-90, 0, 290, 0, 0],
        [90, 20, 0, 90, 0],
        [0, 310, 0, -90, 0],
        [0, 0, 0, 90, 0],
        [0, 70, 0, 0, 0],
    ]
) * [DEG, 1e-3, 1e-3, DEG, DEG]
TX60_LIMITS = DEG * np.array(
    [[-180, 180], [-127.5, 127.5], [-142.5, 142.5], [-270, 270], [-122.5, 132.5], [-270, 270]]
)
SIGMA_POSITION, SIGMA_ROTATION = 17.5 * UM, 0.011 * DEG
"""Noise per axis of the `paper` tracker preset [m], [rad]."""

WEN24 = tuple(
    f"{column}{i}"
    for i in range(1, 7)
    for column in ("theta", "d", "a", "alpha", "beta")
    if f"{column}{i}" not in {"d2", "beta1", "beta3", "beta4", "beta5", "beta6"}
)
"""The paper's 24 parameters in chain order."""
BASE6 = tuple(f"base.{axis}" for axis in ("x", "y", "z", "rx", "ry", "rz"))
TOOL6 = tuple(f"tool.{axis}" for axis in ("x", "y", "z", "rx", "ry", "rz"))
READABLE30 = (
    *BASE6,
    *("a1", "alpha1", "theta2", "a2", "alpha2", "beta2", "theta3", "d3", "a3", "alpha3"),
    *("theta4", "d4", "a4", "alpha4", "theta5", "d5", "a5", "alpha5"),
    *TOOL6,
)
"""The 30 identifiable numbers of a TX60 in readable form."""


def tx60() -> RobotModel:
    """Nominal TX60, base at the intersection of axes 1 and 2, tool at the flange."""
    return RobotModel(Chain(TX60_LINKS))


def pool_r(n: int = 1000, seed: int = 5) -> Array:
    """Joints (n, 6) [rad] of the reference pool R (seed 5, n = 1000) and goal set G (seed 99)."""
    rng, chain, found = np.random.default_rng(seed), Chain(TX60_LINKS), []
    while sum(map(len, found)) < n:
        q = rng.uniform(TX60_LIMITS[:, 0], TX60_LIMITS[:, 1], (4 * n, 6))
        p = forward(chain, q)[:, :3, 3]
        found.append(q[(np.abs(p - [0.25, 0, 0.2]) < [0.45, 0.6, 0.4]).all(1)])
    return np.concatenate(found)[:n]


def rigid_truth(rng: np.random.Generator) -> RobotModel:
    """A purely geometric true robot: preset `rigid`, 0.02 deg and 0.12 mm on the paper's 24."""
    model = tx60()
    step = np.zeros(model.n_numbers)
    for name in WEN24:
        k = model.names.index(name)
        step[k] = rng.normal() * (0.12e-3 if model.is_length[k] else 0.02 * DEG)
    return model.moved(step)
