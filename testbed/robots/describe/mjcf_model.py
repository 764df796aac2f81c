"""A compiled MuJoCo model seen as an arm: its frames, its joints, its poses."""

import logging
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from calib.arrays import Array
from calib.errors import refuse
from calib.geometry.frames import transform
from testbed.robots.describe.mjcf_gate import Gated


def compiled(gated: Gated, path: Path) -> Any:
    """The model, compiled by MuJoCo; its refusals in our form."""
    import mujoco
    from lxml import etree

    mujoco.set_mju_user_warning(logging.getLogger(__name__).info)
    try:
        etree.cleanup_namespaces(gated.root)
        text = etree.tostring(gated.root, encoding="unicode")
        model = mujoco.MjSpec.from_string(text, assets=gated.assets()).compile()
        free_sites(model)
    except (ValueError, mujoco.FatalError) as error:
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        said = "; ".join(line.rpartition("Error:")[2].strip() for line in lines[:2])
        said = re.sub(r",? (id|line) \d+", "", said).replace("Element", "element")
        code = "R15" if "repeated" in said or "already" in said else "R16"
        message, fix = f"MuJoCo refuses it: {said[:200]}", "check it with MuJoCo's own viewer"
        raise refuse("file", code=code, message=message, fix=fix, where=str(path)) from error
    return model


def mjcf_poses(model: Any, joints: list[int], tip: tuple[int, int], q: Array) -> Array:
    """Poses (m, 4, 4) of a body or site of a compiled model at q (m, n) of these joints [m].

    All other joints stay where the file has them.
    """
    import mujoco

    data = mujoco.MjData(model)
    out = np.empty((len(q), 4, 4))
    for k, row in enumerate(q):
        data.qpos[model.jnt_qposadr[joints]] = row
        mujoco.mj_kinematics(model, data)
        out[k] = pose_of(data, tip)
    return out


def load_mjcf(path: Path) -> Any:
    """A file that this program wrote, and that is trusted, as a `mujoco.MjModel` (MJCF or URDF)."""
    import mujoco

    mujoco.set_mju_user_warning(logging.getLogger(__name__).info)
    model = mujoco.MjModel.from_xml_path(str(path))
    free_sites(model)
    return model


def free_sites(model: Any) -> None:
    """Stop MuJoCo from copying a body's pose to a site that was equal when compiled."""
    import mujoco

    model.site_sameframe[:] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE


def at_zero(model: Any, joints: Iterable[int]) -> Any:
    """`mujoco.MjData` with these joints at zero, all others where the file has them."""
    import mujoco

    data = mujoco.MjData(model)
    data.qpos[model.jnt_qposadr[list(joints)]] = 0.0
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return data


def pose_of(data: Any, frame: tuple[int, int]) -> Array:
    """Pose (4, 4) of a body or a site [m]."""
    body, site = frame
    if site >= 0:
        return transform(data.site_xmat[site].reshape(3, 3), data.site_xpos[site])
    return transform(data.xmat[body].reshape(3, 3), data.xpos[body])


def frames_of(model: Any) -> dict[str, tuple[int, int]]:
    """Body and site (-1: the body itself) of every named frame; a site gives way to a body."""
    named = {model.site(k).name: (int(model.site_bodyid[k]), k) for k in range(model.nsite)}
    named |= {called(model, "body", k): (k, -1) for k in range(1, model.nbody)}
    return {name: frame for name, frame in named.items() if name}


def called(model: Any, what: str, k: int) -> str:
    """Name of a body or joint, or its number."""
    return str(getattr(model, what)(k).name) or f"#{k}"


def joints_to(model: Any, body: int) -> list[int]:
    """Joints from the world to a body."""
    joints: list[int] = []
    while body:
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        joints = [*range(first, first + count), *joints]
        body = int(model.body_parentid[body])
    return joints


def kind_of(model: Any, joint: int) -> str:
    """Kind of a joint in our words, or in MuJoCo's if we have none."""
    import mujoco

    kind = mujoco.mjtJoint(int(model.jnt_type[joint]))
    return {
        mujoco.mjtJoint.mjJNT_HINGE: "revolute",
        mujoco.mjtJoint.mjJNT_SLIDE: "prismatic",
        mujoco.mjtJoint.mjJNT_BALL: "ball",
    }.get(kind, "free")
