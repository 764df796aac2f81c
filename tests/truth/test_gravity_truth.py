"""Torques of gravity against MuJoCo's recursive Newton-Euler, on shipped arms and random chains."""

import numpy as np
import pytest

from calib.arrays import Array
from calib.geometry.gravity import Weight, moments_of
from testbed.robots.catalog import load_robot
from testbed.robots.placements import placements, quaternion_wxyz
from testbed.robots.write.mjcf import build_spec
from tests.calib.geometry.bent import random_arm

pytestmark = pytest.mark.truth
KINDS = {
    "slides among seven": ("revolute", "prismatic", *("revolute",) * 2, "prismatic", "revolute"),
    "turns alone": ("revolute",) * 4,
    "a gantry": ("prismatic",) * 3,
}


def simulated(weight: Weight, q: Array, bends: Array) -> Array:
    """Torques (m, n, 3) that gravity puts on joints and on two hinges across each, at rest."""
    import mujoco

    chain = weight.chain
    spec, n = build_spec(chain), chain.n_joints
    spec.option.gravity = chain.T_world_base[:3, :3] @ weight.gravity
    for i, (mass, *first) in enumerate(weight.moments):
        body = spec.body(f"link{i + 1}")
        body.mass, body.ipos = mass, np.array(first) / mass
        for axis, name in (([1, 0, 0], "x"), ([0, 1, 0], "y")):
            body.add_joint(name=f"{name}{i}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis)
            body.joints[-1].armature = 1e-2
    flange = placements(chain).flange
    load = spec.body(f"link{n}").add_body(name="payload", pos=flange[:3, 3])
    load.quat = quaternion_wxyz(flange[:3, :3])
    load.mass, load.ipos = weight.payload[0], weight.payload[1:] / weight.payload[0]
    load.inertia, load.explicitinertial = np.full(3, 1e-3), True
    model = spec.compile()
    data, names = mujoco.MjData(model), [(f"x{i}", f"y{i}", f"joint{i + 1}") for i in range(n)]
    at = np.array([[model.joint(name).qposadr[0] for name in row] for row in names])
    out = np.empty(bends.shape)
    for k, angles in enumerate(bends):
        data.qpos[at] = angles + np.outer(q[k], [0.0, 0.0, 1.0])
        mujoco.mj_forward(model, data)
        out[k] = -data.qfrc_bias[at]
    return out


@pytest.mark.parametrize("arm", ["staubli_tx60", "universal_ur10", "kuka_iiwa7", *KINDS])
def test_torques_are_those_of_the_simulator_at_rest(arm):
    rng = np.random.default_rng(sum(map(ord, arm)))
    if arm in KINDS:
        chain, n = random_arm(rng, KINDS[arm]), len(KINDS[arm])
        moments = moments_of(rng.uniform(1, 10, n), rng.normal(0, 0.2, (n, 3)))
        q, gravity = rng.uniform(-2, 2, (40, n)), rng.normal(size=3) * 5
    else:
        robot = load_robot(arm)
        chain, moments = robot.model.chain, moments_of(robot.masses, robot.centers)
        q, gravity = rng.uniform(*robot.limits.T, (40, len(moments))), [0.0, 0.0, -9.81]
    weight = Weight(chain, moments, moments_of([2.0], [[0.02, -0.01, 0.05]])[0], gravity)
    for bends in (np.zeros((*q.shape, 3)), rng.normal(0, 0.1, (*q.shape, 3))):
        judge = simulated(weight, q, bends)
        off = np.abs(weight.torques(q, bends=bends) - judge).max()
        # rounding of some tens of products, as a share of the largest torque
        assert off <= 1e-12 * np.abs(judge).max()
