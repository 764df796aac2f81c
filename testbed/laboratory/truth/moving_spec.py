"""The body tree of an arm that moves: a motor, a spring and a damper behind every joint."""

from typing import Any

from calib.geometry.chain import Chain
from testbed.laboratory.truth.springs import loaded_spec
from testbed.laboratory.truth.terms import Approach, Springs
from testbed.robots.catalog import body_name

RINGING = 1e5
"""Stiffness of a drive over the inertia of its gear: alone it would ring at 50 Hz [1/s^2]."""
BEARING_RINGING = 1e6
"""The same of a bearing, at 160 Hz: with both no step of the integration is too long [1/s^2]."""


def hinge_names(n_joints: int, *, bearings: bool) -> list[str]:
    """Names of the sprung hinges, joint by joint."""
    across = ("bend{}x", "bend{}y") if bearings else ()
    return [name.format(i + 1) for i in range(n_joints) for name in ("joint{}", *across)]


def moving_spec(chain: Chain, springs: Springs, motion: Approach, step: float) -> Any:
    """Body tree of an arm behind driven motors as a `mujoco.MjSpec`, still without dampers."""
    import mujoco

    spec = loaded_spec(chain, springs)
    for i in range(chain.n_joints):
        body, drive = spec.body(body_name(i + 1)), float(springs.drive[i])
        joint = body.joints[0]
        joint.armature, joint.frictionloss = drive / RINGING, motion.friction[i]
        joint.solref_friction, joint.solimp_friction = [2 * step, 1], [0.99, 0.9999, 1e-4, 0.5, 2]
        motor = spec.add_actuator(
            name=f"motor{i + 1}", target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT
        )
        motor.set_to_position(kp=drive)  # drive (ctrl - q): a spring whose other end is the motor
        for name, axis in (("bend{}x", [1, 0, 0]), ("bend{}y", [0, 1, 0])):
            if len(springs.bearing):
                body.add_joint(
                    name=name.format(i + 1),
                    type=mujoco.mjtJoint.mjJNT_HINGE,
                    axis=axis,
                    stiffness=[springs.bearing[i], 0, 0],  # MuJoCo 4: a polynomial
                    armature=springs.bearing[i] / BEARING_RINGING,
                )
    option, disable = spec.option, mujoco.mjtDisableBit
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.timestep = step
    option.disableflags |= disable.mjDSBL_CONTACT | disable.mjDSBL_AUTORESET
    option.iterations, option.tolerance = 20, 0
    option.noslip_iterations = 10  # without them dry friction creeps
    return spec
