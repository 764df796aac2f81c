"""A robot's joint origins for ROS: values for xacro, and the calibration file of UR's drivers.

Every origin is a shift and three turns about fixed axes (roll, pitch, yaw) from one joint's frame
to the next; the joint then turns about, or slides along, its own z. Modified Denavit-Hartenberg
numbers (Craig) are a special case. Formats: `kinematics` of franka_description, and
`kinematics_params` of ur_description, whose tool0 is the frame of joint 6.
"""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from calib.arrays import Array
from calib.errors import one_line
from calib.geometry.chain import Chain, forward
from calib.geometry.frames import inverse, rot_x, rot_y, rot_z, slide, transform
from testbed.robots.placements import (
    agreement,
    difference,
    joint_motion,
    link_poses,
    proof_joints,
    require_agreement,
    rpy,
)
from testbed.robots.robot import Robot

ORIGINS, KINEMATICS = "joint_origins.yaml", "kinematics_params.yaml"
KEYS = ("x", "y", "z", "roll", "pitch", "yaw")
UR_LINKS = ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
UR_ROLL = np.radians([0.0, 90.0, 90.0, 90.0, 180.0, 90.0])
"""How the frames of UR's joints are turned about x, seen from the base, all joints at zero."""
NEAR = np.radians(3.0)
"""Largest angle between an axis and that of a UR arm for the arm to be of that kind [rad]."""
MEET = 0.02
"""Largest distance of axes that meet in a UR arm [m]."""
HASH = "calib_to_be_taken_from_your_controller"
PROOFS = 65
ROUNDING = 1e-15
"""Rounding error of a zero after products of rotations [m, rad]."""


def ros_files(robot: Robot) -> dict[str, tuple[str, str]]:
    """Text of each file, and the result of its test in words; UR's only for an arm of that kind.

    Raises
    ------
    RuntimeError
        A file does not have the robot's poses: a defect of this program.
    """
    chain = robot.model.chain
    links = [f"joint{k + 1}" for k in range(chain.n_joints + 1)]
    origins = joint_origins(chain)
    lines = [
        f"# Joint origins of {one_line(robot.title)}, each in the frame of the joint before;",
        "# m and rad, roll, pitch and yaw about fixed axes x, y, z. A joint turns about its own z.",
        f"# {links[-1]} is fixed: the flange. Modified Denavit-Hartenberg (Craig) is the special",
        "# case of x, roll, and z along the turned axis.",
        f"# The base in the world: {_numbers(chain.T_world_base)}",
        f"# The tool in the flange: {_numbers(chain.T_flange_tool)}",
    ]
    for name, T in zip(links, origins, strict=True):
        lines += [f"{name}:", "  kinematic:", *_entry(T, "    ")]
    found = {ORIGINS: "\n".join(lines) + "\n"}
    ends = {ORIGINS: (chain.T_world_base, chain.T_flange_tool)}
    own = ur_frames(chain)
    if own is not None:
        base, frames = own
        steps = [inverse(a) @ b for a, b in zip([base, *frames[:-1]], frames, strict=True)]
        tip = forward(chain, np.zeros((1, 6)))[0]
        ends[KINEMATICS] = base, inverse(frames[-1]) @ tip
        lines = [
            f"# Kinematics of {one_line(robot.title)} for ur_description and UR's drivers;",
            "# m and rad. shoulder stands in base_link_inertia, the controller's base; tool0 is",
            "# the frame of wrist_3. This file holds neither base nor tool:",
            f"# base_link_inertia in the world: {_numbers(base)}",
            f"# the tool in tool0: {_numbers(ends[KINEMATICS][1])}",
            "# The hash is made by a controller of its own calibration, and cannot be made here:",
            "# put that of your robot there (ur_calibration gives it), or the driver says that it",
            "# differs. The controller itself goes on moving by its own calibration.",
            "kinematics:",
        ]
        for name, T in zip(UR_LINKS, steps, strict=True):
            lines += [f"  {name}:", *_entry(T, "    ")]
        found[KINEMATICS] = "\n".join([*lines, f"  hash: {HASH}"]) + "\n"
    return {name: (text, _proven(robot, name, text, ends[name])) for name, text in found.items()}


def joint_origins(chain: Chain) -> list[Array]:
    """Frames (n + 1) of (4, 4), each in the one before, from the base to the flange.

    References
    ----------
    Craig, Introduction to Robotics, 3.4: Rx(alpha) Tx(a) Rz(theta) Tz(d), with alpha and a of the
    link before; beta turns between them.
    """
    found, carry = [], np.eye(4)
    for theta, d, a, alpha, beta in chain.links:
        found.append(carry @ slide(0.0, 0.0, d) @ rot_z(theta))
        carry = slide(a, 0.0, 0.0) @ rot_x(alpha) @ rot_y(beta)
    return [*found, carry]


def ur_frames(chain: Chain) -> tuple[Array, Array] | None:
    """The base (4, 4) and joint frames (6, 4, 4) as UR's drivers have them; None for other arms.

    Each frame lies on its own axis, x turned as little as may be from UR's; its origin where axes
    meet, or nearest to the frame before. The base is the chain's, or that turned by half a turn, as
    a URDF has it.
    """
    if chain.kinds != ("revolute",) * 6:
        return None
    at = link_poses(chain, np.zeros((1, 6)))[0, 1:]
    points, axes = at[:, :3, 3], at[:, :3, 2]
    for half in (0.0, np.pi):
        base = chain.T_world_base @ rot_z(half)
        plain = [base[:3, :3] @ rot_x(roll)[:3, :3] for roll in UR_ROLL]
        if all(R[:, 2] @ z > np.cos(NEAR) for R, z in zip(plain, axes, strict=True)):
            break
    else:
        return None
    tip = forward(replace(chain, T_flange_tool=np.eye(4)), np.zeros((1, 6)))[0, :3, 3]
    ends = [(0, 1), (1, 0), None, (3, 4), (4, 5), None]
    origins: list[Array] = []
    for k, pair in enumerate(ends):
        if pair is None:  # nearest to the frame before, or to the flange
            there = tip if k == 5 else origins[-1]
            origins.append(points[k] + axes[k] * (axes[k] @ (there - points[k])))
            continue
        one, other = _nearest(points, axes, *pair)
        if np.linalg.norm(one - other) > MEET:
            return None
        origins.append(one)
    frames = []
    for R, z, p in zip(plain, axes, origins, strict=True):
        x = R[:, 0] - z * (z @ R[:, 0])
        x /= np.linalg.norm(x)
        frames.append(transform(np.stack([x, np.cross(z, x), z], axis=1), p))
    return base, np.array(frames)


def _nearest(points: Array, axes: Array, i: int, j: int) -> tuple[Array, Array]:
    """The points (3,) of axes i and j that lie nearest to each other."""
    (p, u), (r, v) = ((points[k], axes[k]) for k in (i, j))
    (s, t), *_ = np.linalg.lstsq(np.stack([u, -v], axis=1), r - p, rcond=None)
    return p + s * u, r + t * v


def _entry(T: Array, indent: str) -> list[str]:
    """One origin, a line for each number, with every digit."""
    values = np.array([*T[:3, 3], *rpy(T)])
    values = np.where(np.abs(values) < ROUNDING, 0.0, values).tolist()
    return [f"{indent}{key}: {value!r}" for key, value in zip(KEYS, values, strict=True)]


def _numbers(T: Array) -> str:
    """One origin on a line."""
    return ", ".join(line.strip() for line in _entry(T, ""))


def _proven(robot: Robot, name: str, text: str, ends: tuple[Array, Array]) -> str:
    """How well a file, read again, has the robot's poses between its base and its tool."""
    read = read_origins(text)
    q = proof_joints(robot.limits, PROOFS)
    T = np.tile(ends[0], (len(q), 1, 1))
    for k, step in enumerate(read):
        T = T @ step
        if k < robot.model.chain.n_joints:
            T = T @ joint_motion(robot.model.chain, k, q[:, k])
    position, rotation = difference(T @ ends[1], forward(robot.model.chain, q))
    require_agreement(name, position, rotation)
    return agreement(name, position, rotation) + (
        " in the convention of UR's drivers; the hash of a controller cannot be made here"
        if name == KINEMATICS
        else ", as joint origins for xacro"
    )


def read_origins(text: str) -> Sequence[Array]:
    """The origins (4, 4) of a file, as a driver reads them."""
    body = "\n".join(line.partition("#")[0] for line in text.splitlines())
    found = []
    for place in re.split(r"(?=\bx: )", body)[1:]:
        number = {key: float(re.search(rf"\b{key}: (\S+)", place)[1]) for key in KEYS}  # type: ignore[index]  # every entry has all six
        x, y, z, roll, pitch, yaw = (number[key] for key in KEYS)
        turned = Rotation.from_euler("xyz", [roll, pitch, yaw]).as_matrix()
        found.append(transform(turned, np.array([x, y, z])))
    return found
