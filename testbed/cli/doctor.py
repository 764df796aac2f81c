"""Is this machine sound: three kinematics that must agree on every shipped robot."""

from dataclasses import dataclass

import numpy as np

from calib.geometry.chain import forward
from calib.geometry.frames import log_so3
from testbed.robots.catalog import load_robot, robot_names
from testbed.streams import stream

POSES = 1000
LIMIT = 1e-10
"""Largest difference allowed [m or rad]; float64 leaves about 1e-15 per metre of arm and joint."""


@dataclass(frozen=True, slots=True)
class Agreement:
    """How well other kinematics agree with MDH on one robot."""

    robot: str
    other: str
    position: float
    """Largest difference over the poses [m]."""
    rotation: float
    """Largest difference over the poses [rad]."""

    @property
    def good(self) -> bool:
        """Whether the difference is rounding only."""
        return max(self.position, self.rotation) < LIMIT


def check_kinematics(poses: int = POSES) -> list[Agreement]:
    """MDH against MuJoCo and against the shipped URDF, on random joints of each robot."""
    from testbed.laboratory.simulator import Simulator
    from testbed.robots.describe.urdf import describe_urdf
    from testbed.robots.describe.xml_gate import FileOptions

    found = []
    for name in robot_names():
        robot = load_robot(name)
        lower, upper = robot.limits.T
        q = stream(0, "doctor", name).uniform(lower, upper, (poses, len(lower)))
        mdh = forward(robot.model.chain, q)
        others = {
            "MuJoCo": Simulator(None, robot.model.chain).poses(q),
            "URDF": forward(describe_urdf(robot.folder / f"{name}.urdf", FileOptions()).chain, q),
        }
        for other, T in others.items():
            turn = log_so3(mdh[:, :3, :3] @ np.swapaxes(T[:, :3, :3], 1, 2))
            found.append(
                Agreement(
                    name,
                    other,
                    float(np.linalg.norm(mdh[:, :3, 3] - T[:, :3, 3], axis=1).max()),
                    float(np.linalg.norm(turn, axis=1).max()),
                )
            )
    return found
