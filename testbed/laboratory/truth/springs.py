"""The arm that gives way: sprung joints and links in MuJoCo, solved to static equilibrium.

Each axis has the commanded hinge and after it one sprung hinge about the same axis (the drive) and
two across it (bearing and link), so six axes have eighteen elastic angles. No time passes: the
springs' angles are iterated until they carry the weight, x = tau(q, x) / k.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array
from calib.errors import InputError, refuse
from calib.geometry.chain import Chain, joint_vectors
from calib.geometry.frames import transform
from testbed.laboratory.simulator import grown
from testbed.laboratory.truth.terms import Springs
from testbed.robots.catalog import body_name
from testbed.robots.placements import placements, quaternion_wxyz
from testbed.robots.write.mjcf import build_spec, compile_spec, set_geometry

SETTLED = 1e-15
"""Largest last step of an elastic angle at rest [rad]."""
MOST = 100
"""Steps after which springs count as too soft to carry the arm."""
BENT = np.radians(1.0)
"""An arm that gives way farther is no robot arm, or a unit is wrong [rad]."""
BALL = 1e-3
"""Inertia of a payload over its mass: a ball of a few centimetres; rest does not depend on it
[m^2]."""
ARMATURE = 1e-2
"""Keeps hinges about one axis apart; rest does not depend on it [kg m^2]."""


class ElasticArm:
    """Tool poses of a sprung arm at rest.

    Parameters
    ----------
    chain : Chain
        True geometry; all joints turn.
    springs : Springs
        Masses, stiffnesses, payload and gravity.

    Notes
    -----
    Holds one `MjData`, so an instance must not be shared between threads.
    """

    def __init__(self, chain: Chain, springs: Springs) -> None:
        import mujoco

        self._chain, self.springs = chain, springs
        self._model = model = compile_spec(elastic_spec(chain, springs))
        self._data = mujoco.MjData(model)
        n = chain.n_joints
        self._driven = places(model, [f"joint{i + 1}" for i in range(n)])
        names = elastic_names(n, bearings=len(springs.bearing) > 0)
        self._elastic = places(model, names)
        self._stiffness = stiffnesses(springs)
        self._tool = model.site("tool").id

    @property
    def model(self) -> Any:
        """The compiled `mujoco.MjModel`; hinges ``joint1`` ..., ``drive1``, ``bend1x`` ..."""
        return self._model

    def poses(
        self, q: ArrayLike, *, growth: Array | None = None, payload: Array | None = None
    ) -> Array:
        """Tool poses T_world_tool (m, 4, 4) at rest at commanded joints q (m, n) [rad].

        `growth` (m,) is how much longer the links are at each pose, as a share, `payload` (m,) what
        hangs on the flange there instead of the usual [kg].
        """
        return self._rest(q, growth, payload)[0]

    def deflections(self, q: ArrayLike) -> Array:
        """Elastic angles (m, k) at rest: per joint the drive, then across x and y [rad]."""
        return self._rest(q, None, None)[1]

    def bends(self, q: ArrayLike) -> Array:
        """The same as bends (m, n, 3) about x, y and z of every joint [rad]."""
        return as_bends(self.deflections(q), self._chain.n_joints)

    def _rest(
        self, q: ArrayLike, growth: Array | None, payload: Array | None
    ) -> tuple[Array, Array]:
        """Poses (m, 4, 4) and elastic angles (m, k) at rest."""
        q = joint_vectors(self._chain, q)
        position, rotation = np.empty((len(q), 3)), np.empty((len(q), 9))
        angles = np.empty((len(q), len(self._elastic)))
        usual = self.springs.payload
        for k, joints in enumerate(q):
            if growth is not None:
                self._grow(float(growth[k]))
            # each time: what hung before may have stayed where the springs gave way
            hang(self._model, usual if payload is None else float(payload[k]))
            angles[k] = self._settle(joints, k)
            position[k] = self._data.site_xpos[self._tool]
            rotation[k] = self._data.site_xmat[self._tool]
        return transform(rotation.reshape(-1, 3, 3), position), angles

    def _settle(self, joints: Array, row: int) -> Array:
        """Elastic angles (k,) that carry the weight at commanded joints (n,)."""
        self._data.qpos[self._driven] = joints
        stands = np.zeros(len(self._elastic))
        angles = sag(self._model, self._data, self._elastic, self._stiffness, stands)
        if angles is None:
            raise gives_way(row, self._stiffness)
        return angles

    def _grow(self, share: float) -> None:
        """Let the links be longer by a share."""
        chain = grown(self._chain, share)
        set_geometry(self._model, chain)
        self._model.body("payload").pos[:] = placements(chain).flange[:3, 3]


def sag(model: Any, data: Any, hinges: Any, stiffness: Array, stands: Array) -> Array | None:
    """Angles (k,) by which sprung hinges give way at rest, from where they stand unloaded (k,).

    None where the springs cannot carry the weight. Nothing may move in `data`.
    """
    import mujoco

    torque, angles = np.zeros(model.nv), np.zeros(len(hinges))
    for _ in range(MOST):
        data.qpos[hinges] = stands + angles
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_rne(model, data, 0, torque)  # nothing moves: what holds the weight
        step = -torque[hinges] / stiffness - angles
        angles = angles + step
        if not np.abs(angles).max() < BENT:
            break
        if np.abs(step).max() < SETTLED:
            return np.asarray(angles)
    return None


def gives_way(row: int, stiffness: Array, lower: str = "payload_kg") -> InputError:
    """The error of springs that do not carry the arm at a row of joints; what to `lower`."""
    message = f"the sprung arm gives way at q[{row}] by more than {np.degrees(BENT):g} deg"
    allowed = "springs that carry the arm and its payload"
    fix = f"raise drive_nm_per_mrad and bearing_nm_per_mrad, or lower {lower}"
    key, value = "truth.drive_nm_per_mrad", float(stiffness.min() / 1e3)
    return refuse(key, value, allowed, code="S37", message=message, fix=fix)


def as_bends(angles: Array, n_joints: int) -> Array:
    """Bends (..., n, 3) about x, y, z of every joint, of the angles (..., k) of sprung hinges."""
    each = angles.reshape(*angles.shape[:-1], n_joints, -1)
    out = np.zeros((*each.shape[:-1], 3))
    out[..., [2, 0, 1][: each.shape[-1]]] = each  # a drive, then its bearing if that is sprung
    return out


def stiffnesses(springs: Springs) -> Array:
    """(k,) of the sprung hinges, joint by joint [N m/rad]."""
    bearing = [springs.bearing] * 2 if len(springs.bearing) else []
    return np.stack([springs.drive, *bearing], axis=-1).ravel()


def elastic_names(n_joints: int, *, bearings: bool) -> list[str]:
    """Names of the sprung hinges, joint by joint."""
    across = ("bend{}x", "bend{}y") if bearings else ()
    return [name.format(i + 1) for i in range(n_joints) for name in ("drive{}", *across)]


def elastic_spec(chain: Chain, springs: Springs) -> Any:
    """Body tree of a sprung arm as a `mujoco.MjSpec`, payload and gravity included."""
    import mujoco

    spec = loaded_spec(chain, springs)
    for i in range(chain.n_joints):
        body = spec.body(body_name(i + 1))
        body.joints[0].armature = ARMATURE
        hinges = [("drive{}", [0, 0, 1], springs.drive[i])]
        if len(springs.bearing):
            hinges += [
                ("bend{}x", [1, 0, 0], springs.bearing[i]),
                ("bend{}y", [0, 1, 0], springs.bearing[i]),
            ]
        for name, axis, stiffness in hinges:
            body.add_joint(
                name=name.format(i + 1),
                type=mujoco.mjtJoint.mjJNT_HINGE,
                axis=axis,
                stiffness=[stiffness, 0, 0],  # MuJoCo 4: a polynomial
                armature=ARMATURE,
            )
    return spec


def loaded_spec(chain: Chain, springs: Springs) -> Any:
    """Body tree of an arm with its masses, payload and gravity, still without springs."""
    spec = build_spec(chain)
    spec.option.gravity = springs.gravity
    for i in range(chain.n_joints):
        body = spec.body(body_name(i + 1))
        body.mass, body.ipos, body.inertia = (
            springs.masses[i],
            springs.centers[i],
            springs.inertias[i],
        )
    flange = placements(chain).flange
    load = spec.body(body_name(chain.n_joints)).add_body(name="payload", pos=flange[:3, 3])
    load.quat = quaternion_wxyz(flange[:3, :3])
    load.mass, load.ipos = springs.payload, springs.payload_center
    load.inertia, load.explicitinertial = np.full(3, BALL * springs.payload), True
    return spec


def hang(model: Any, payload: float) -> None:
    """Hang another mass [kg] on the flange of a compiled arm, at the same place."""
    load = model.body("payload")
    load.mass[:], load.inertia[:] = payload, BALL * payload


def places(model: Any, names: list[str]) -> Any:
    """Where hinges stand in qpos; every joint is a hinge or slide, so also in qvel."""
    return np.array([int(model.joint(name).qposadr[0]) for name in names])
