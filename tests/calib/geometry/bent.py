"""What the tests of arms that give way share: chains of both kinds of joints, composed slowly."""

import numpy as np

from calib.arrays import Array
from calib.geometry.chain import Chain
from calib.geometry.frames import exp_so3, transform
from tests.calib.geometry.test_chain import LINK, X, Y, Z, elementary

SLIDING = ("revolute", "prismatic", "revolute", "revolute", "prismatic", "revolute")


def random_arm(rng: np.random.Generator, kinds: tuple[str, ...] = SLIDING) -> Chain:
    """A chain of random numbers, its base tilted anyhow."""
    base, tool = (
        transform(exp_so3(rng.normal(size=3)), rng.normal(size=3)) for _ in range(2)
    )  # fmt: skip
    return Chain(rng.uniform(-1, 1, (len(kinds), 5)), kinds, base, tool)


def composed_bodies(chain: Chain, q: Array, bends: Array) -> Array:
    """Body frames (n + 1, 4, 4) of one pose, flange last, factor by factor; also if complex."""
    T, found = chain.T_world_base, []
    for row, kind, value, (b_x, b_y, b_z) in zip(chain.links, chain.kinds, q, bends, strict=True):
        turn = elementary("turn", Z, row[0] + (value + b_z if kind == "revolute" else 0.0))
        shift = elementary("slide", Z, value + b_z if kind == "prismatic" else 0.0)
        T = T @ turn @ shift @ elementary("turn", X, b_x) @ elementary("turn", Y, b_y)
        found.append(T)
        for (shape, axis), number in zip(LINK[1:], row[1:], strict=True):
            T = T @ elementary(shape, axis, number)
    return np.array([*found, T])
