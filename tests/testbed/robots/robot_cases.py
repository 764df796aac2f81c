"""Robots and joint vectors the robot tests share."""

from dataclasses import replace

import numpy as np

from calib.geometry.chain import Chain
from calib.geometry.frames import step_transform
from calib.geometry.model import RobotModel
from testbed.robots.catalog import Robot, load_robot

TX60 = load_robot("staubli_tx60")
AGREE = 1e-12
"""Required agreement of independent kinematics [m, 1]; about 5000 roundings of 2e-16."""


def yourdfpy_poses(path, q, tip="tool0"):
    """Tool poses (m, 4, 4) by yourdfpy's scene graph."""
    import yourdfpy

    model = yourdfpy.URDF.load(str(path), load_meshes=False)
    out = []
    for row in q:
        model.update_cfg(row)
        out.append(model.get_transform(tip))
    return np.array(out)


def joint_vectors(count: int = 1000, seed: int = 1, robot: Robot = TX60):
    """Joint vectors inside the limits."""
    rng = np.random.default_rng(seed)
    return rng.uniform(robot.limits[:, 0], robot.limits[:, 1], (count, len(robot.limits)))


def perturbed(count: int = 20, seed: int = 2, size: float = 0.3) -> list[Chain]:
    """The TX60 with all 42 numbers moved by up to `size` [m, rad]."""
    rng = np.random.default_rng(seed)
    nominal = TX60.model.chain
    return [nominal.moved(rng.uniform(-size, size, nominal.n_numbers)) for _ in range(count)]


def slider() -> tuple[Chain, Robot]:
    """A chain with prismatic joints, odd angles, base and tool, and a robot around it."""
    rng = np.random.default_rng(3)
    chain = Chain(
        rng.normal(size=(4, 5)) * 0.5,
        ("prismatic", "revolute", "prismatic", "revolute"),
        step_transform(rng.normal(size=6)),
        step_transform(rng.normal(size=6)),
    )
    robot = replace(
        TX60,
        name="slider",
        model=RobotModel(chain),
        visuals=(),
        exclusions=(),
        **{
            field: getattr(TX60, field)[:4]
            for field in ("limits", "speeds", "masses", "centers", "inertias", "repeatability")
        },
    )
    return chain, robot
