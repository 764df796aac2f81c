"""MuJoCo models: a chain built, edited in place and written; a compiled model seen as an arm."""

import logging
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from calib.arrays import Array
from calib.errors import InputError, refuse
from calib.geometry.chain import Chain
from calib.geometry.frames import slide, transform
from testbed.robots.foreign import foreign
from testbed.robots.meshes.files import read_mesh
from testbed.robots.placements import placements, quaternion_wxyz
from testbed.robots.robot import Robot, body_name, reflector_frames
from testbed.robots.write.mjcf_parts import add_part, placed


def build_spec(chain: Chain, robot: Robot | None = None, *, plain_boxes: bool = False) -> Any:
    """Body tree of any chain as a `mujoco.MjSpec`: revolute and prismatic, all 12 + 5 n numbers.

    Bodies ``base`` (fixed) and ``link1`` ... ``linkn`` stand in the world, joints ``joint1`` ...,
    sites ``flange`` and ``tool`` in the last body; a joint's qpos is its commanded value.

    Parameters
    ----------
    chain : Chain
        Nominal or perturbed geometry.
    robot : Robot, optional
        Gives limits, masses, parts and collision exclusions; without it bodies are bare. Meshes
        that collide are tested as convex hulls.
    plain_boxes : bool
        Whether boxes are MuJoCo boxes, as in files for others. For collision tests they are hulls
        of their corners instead: MuJoCo's own tests of boxes do not find a capsule inside a box,
        nor every box that is nearer than a clearance.

    Returns
    -------
    mujoco.MjSpec
        Compile it with `compile_spec`, which keeps the model editable.
    """
    import mujoco

    spec = mujoco.MjSpec()
    spec.modelname = robot.name if robot else "chain"
    spec.compiler.degree = False  # degrees are the default
    spec.compiler.savecompiled = False  # the compiled form is written with six digits
    frames, flange, tool = placements(chain)
    base = spec.worldbody.add_body(name=body_name(0), **placed(chain.T_world_base))
    bodies = [base]
    parent = spec.worldbody
    for i, frame in enumerate(frames):
        parent = parent.add_body(name=body_name(i + 1), **placed(frame))
        slides = chain.kinds[i] == "prismatic"
        joint = parent.add_joint(
            name=f"joint{i + 1}",
            type=mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE,
            axis=[0, 0, 1],
        )
        if robot:
            joint.range, joint.limited = robot.limits[i], mujoco.mjtLimited.mjLIMITED_TRUE
        parent.mass = robot.masses[i] if robot else 1.0
        parent.ipos = robot.centers[i] if robot else np.zeros(3)
        parent.inertia = robot.inertias[i] if robot else np.full(3, 0.01)
        parent.explicitinertial = True
        bodies.append(parent)
    parent.add_site(name="flange", **placed(flange))
    parent.add_site(name="tool", **placed(tool))
    if robot:
        spec.modelfiledir = str(robot.folder.resolve())
        for part in robot.parts:
            add_part(spec, bodies[part.link], part, robot.folder, plain_boxes)
        for first, second in robot.exclusions:
            spec.add_exclude(bodyname1=first, bodyname2=second)
    return spec


def compile_spec(spec: Any, robot: Robot | None = None) -> Any:
    """Compile to a `mujoco.MjModel` whose sites may be edited in place.

    Raises
    ------
    InputError
        R9, R10: MuJoCo cannot use a mesh of the robot; names the file.
    """
    if robot is None:
        model = spec.compile()
    else:
        with foreign("MuJoCo", where=str(robot.folder), told=partial(_refusal, robot)):
            model = spec.compile()
    free_sites(model)
    return model


def _refusal(robot: Robot, error: Exception) -> InputError:
    """MuJoCo's error for a robot, with the file of the part that it names."""
    said = " ".join(str(error).split())
    for visual in robot.visuals:
        if f"'{visual.name}'" in said:
            read_mesh(visual.file)  # which tells more
            where = str(visual.file)
            message = f"MuJoCo cannot use it as part {visual.name}: {said[:200]}"
            return refuse("file", code="R10", message=message, where=where)
    return refuse(
        "file", code="R10", message=f"MuJoCo refuses it: {said[:200]}", where=str(robot.folder)
    )


def set_geometry(model: Any, chain: Chain) -> None:
    """Rewrite the geometry of a compiled model (`build_spec`) in place: no recompilation."""
    frames, flange, tool = placements(chain)
    free_sites(model)
    T = np.stack([chain.T_world_base, *frames, flange, tool])
    place, turn = T[:, :3, 3], quaternion_wxyz(T[:, :3, :3])
    for i in range(len(frames) + 1):
        k = model.body(body_name(i)).id
        model.body_pos[k], model.body_quat[k] = place[i], turn[i]
    for i, name in ((-2, "flange"), (-1, "tool")):
        k = model.site(name).id
        model.site_pos[k], model.site_quat[k] = place[i], turn[i]


def always_touching(robot: Robot, q: Array) -> tuple[tuple[str, str], ...]:
    """Pairs of bodies whose shapes touch at every one of the joint values q (m, n) [rad, m]."""
    import mujoco

    model = compile_spec(build_spec(robot.model.chain, robot), robot)
    data = mujoco.MjData(model)
    common: set[tuple[int, int]] | None = None
    for row in q:
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        pairs = {(int(a), int(b)) for a, b in np.sort(model.geom_bodyid[data.contact.geom], axis=1)}
        common = pairs if common is None else common & pairs
        if not common:
            return ()
    return tuple((model.body(a).name, model.body(b).name) for a, b in sorted(common or ()))


def mjcf_text(robot: Robot, *, comment: str = "") -> str:
    """The geometry of a robot as MJCF text, every digit kept, mesh paths relative to its folder.

    Reflectors are sites beside those of flange and tool.
    """
    chain = robot.model.chain
    spec = build_spec(chain, robot, plain_boxes=True)
    last, tool = spec.body(body_name(chain.n_joints)), placements(chain).tool
    for reflector, name in zip(robot.reflectors, reflector_frames(robot), strict=True):
        last.add_site(name=name, **placed(tool @ slide(*reflector.place)))
    compile_spec(spec, robot)
    head = f"<!-- {comment.replace('--', '-')} -->\n" if comment else ""
    return head + str(spec.to_xml())


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


def stated_frame(model: Any, frame: tuple[int, int]) -> Array:
    """Pose (4, 4) of a body or site in what it is fixed to, as its file has it [m]."""
    import mujoco

    k, what = (frame[1], "site") if frame[1] >= 0 else (frame[0], "body")
    R = np.empty(9)
    mujoco.mju_quat2Mat(R, getattr(model, f"{what}_quat")[k])
    return transform(R.reshape(3, 3), getattr(model, f"{what}_pos")[k].copy())


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
