"""The arm that moves: motors drive it through springs against friction, and MuJoCo plays the time.

Each motor follows its path exactly. A spring and a damper lie between it and its link, which has
mass and dry friction; where bearings are sprung, two hinges across the axis follow. The arm comes
along the end of its way, stops, swings out, and is looked at after a dwell: no closed form is asked
for what friction and haste leave.
"""

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array
from calib.errors import refuse
from calib.geometry.chain import Chain, joint_vectors
from calib.geometry.frames import transform
from testbed.laboratory.simulator import grown, log_warning
from testbed.laboratory.truth.moving_spec import hinge_names, moving_spec
from testbed.laboratory.truth.springs import BENT, gives_way, hang, places, sag, stiffnesses
from testbed.laboratory.truth.terms import Approach, Springs
from testbed.robots.write.mjcf import compile_spec, set_geometry
from testbed.scenario.truth import PEAK

STEP = 1e-3
"""Of the integration; a tenth of it moves the tool by 0.5 um on average, 1.5 um at 95 % [s]."""
CHORDS = 16
"""Parts of a way in which the path of the tool is measured."""
POSTURES = 200
"""Postures over which the inertia that a damper is made for is averaged."""
LONGEST = 60.0
"""An approach that takes longer comes from a speed in another unit [s]."""
LOADS = "payload_kg, friction_nm or speed_deg_s"
"""What bends the springs of an arm that moves."""
KEPT = 50_000
"""Approaches that are remembered: most visits of a pose come the same way."""


class MovingArm:
    """Tool poses of an arm that has come to its poses, with friction and what still swings.

    Parameters
    ----------
    chain : Chain
        True geometry; all joints turn.
    springs : Springs
        Masses, stiffnesses, payload and gravity.
    motion : Approach
        How it comes and how long it waits; friction and damping.
    step : float
        Of the integration [s].

    Notes
    -----
    Every approach starts at rest on its springs, without friction, and takes a whole number of
    equal steps, so that it does not depend on what was played before. Holds one `MjData`, so an
    instance must not be shared between threads.

    References
    ----------
    Todorov, MuJoCo: implicit-in-velocity integration, friction as a constraint; the solver's
    noslip iterations keep dry friction from creeping.
    """

    def __init__(
        self, chain: Chain, springs: Springs, motion: Approach, *, step: float = STEP
    ) -> None:
        import mujoco

        mujoco.set_mju_user_warning(log_warning)
        self._chain, self.springs, self.motion, self._step = chain, springs, motion, step
        self._model = model = compile_spec(moving_spec(chain, springs, motion, step))
        set_geometry(model, chain)  # as it is after a pose of an arm that has grown, to the bit
        self._data = mujoco.MjData(model)
        n, bearings = chain.n_joints, len(springs.bearing) > 0
        self._driven = places(model, [f"joint{i + 1}" for i in range(n)])
        self._elastic = places(model, hinge_names(n, bearings=bearings))
        self._drives = np.arange(n) * (3 if bearings else 1)
        self._stiffness = stiffnesses(springs)
        self._tool = model.site("tool").id
        damping = 2 * motion.damping * np.sqrt(self._stiffness * self._inertias())
        model.dof_damping[self._elastic] = damping
        model.dof_damping[self._driven] = 0.0  # the actuator's own: MuJoCo calls it a bias
        model.actuator_biasprm[:, 2] = -damping[self._drives]
        self._played = lru_cache(KEPT)(self._play)

    @property
    def model(self) -> Any:
        """The compiled `mujoco.MjModel`; hinges ``joint1``, ``bend1x``, ``bend1y`` ..."""
        return self._model

    def poses(
        self,
        q: ArrayLike,
        *,
        travel: Array,
        scatter: Array | None = None,
        growth: Array | None = None,
        payload: Array | None = None,
    ) -> Array:
        """Tool poses T_world_tool (m, 4, 4) after the dwell, each pose an approach of its own.

        Parameters
        ----------
        q : (m, n) array_like
            Where the motors stop [rad].
        travel : (m, n) array
            How far each has come, of which the last part is played [rad].
        scatter : (m, n) array, optional
            By how much each stops elsewhere: some millidegrees, which leave the bends alone [rad].
        growth : (m,) array, optional
            How much longer the links are, as a share; that leaves the bends alone too.
        payload : (m,) array, optional
            What hangs on the flange instead of the usual [kg].
        """
        q = joint_vectors(self._chain, q)
        (angles,) = self.deflections(q, travel, (self.motion.dwell,), payload)
        return self.bent(q if scatter is None else q + scatter, angles, growth)

    def looks(self, q: ArrayLike, travel: Array, dwells: tuple[float, ...]) -> Array:
        """Tool poses (d, m, 4, 4) of the same approaches after rising dwells (d,) [s]."""
        q = joint_vectors(self._chain, q)
        return np.array([self.bent(q, one) for one in self.deflections(q, travel, dwells)])

    def bent(self, q: Array, angles: Array, growth: Array | None = None) -> Array:
        """Tool poses (m, 4, 4) with the motors at q (m, n) and the springs at `angles` (m, k)."""
        import mujoco

        position, rotation = np.empty((len(q), 3)), np.empty((len(q), 9))
        model, data = self._model, self._data
        for k, (stopped, bent) in enumerate(zip(q, angles, strict=True)):
            if growth is not None:
                set_geometry(model, grown(self._chain, float(growth[k])))
            data.qpos[self._elastic] = bent
            data.qpos[self._driven] += stopped
            mujoco.mj_kinematics(model, data)
            position[k], rotation[k] = data.site_xpos[self._tool], data.site_xmat[self._tool]
        if growth is not None:
            set_geometry(model, self._chain)
        return transform(rotation.reshape(-1, 3, 3), position)

    def deflections(
        self, q: ArrayLike, travel: Array, dwells: tuple[float, ...], payload: Array | None = None
    ) -> Array:
        """Angles (d, m, k) of the springs after rising dwells (d,) [s], as `ElasticArm` has them.

        In rad; per joint its drive, then across x and y. The others are as in `poses`.
        """
        q = joint_vectors(self._chain, q)
        steps = np.ceil(self.durations(q, travel) / self._step).astype(int)
        waits = tuple(round(dwell / self._step) for dwell in dwells)
        out = np.empty((len(dwells), len(q), len(self._elastic)))
        for k, (goal, way) in enumerate(zip(q, self._last_part(travel), strict=True)):
            load = self.springs.payload if payload is None else float(payload[k])
            angles = self._played(goal.tobytes(), way.tobytes(), int(steps[k]), waits, load)
            if angles is None:
                raise gives_way(k, self._stiffness, LOADS)
            out[:, k] = angles
        return out

    def durations(self, q: Array, travel: Array) -> Array:
        """How long the approaches (m,) take: no joint and no tool is too fast in them [s]."""
        import mujoco

        motion, data, ways = self.motion, self._data, self._last_part(travel)
        seconds = PEAK * (np.abs(ways) / motion.speeds).max(axis=1)
        for k in range(len(q)) if motion.tool_speed else ():
            places = np.empty((CHORDS + 1, 3))
            mujoco.mj_resetData(self._model, data)
            for c in range(CHORDS + 1):
                data.qpos[self._driven] = q[k] - ways[k] * (c / CHORDS)
                mujoco.mj_kinematics(self._model, data)
                places[c] = data.site_xpos[self._tool]
            length = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
            seconds[k] = max(seconds[k], PEAK * length / motion.tool_speed)
        if (seconds > LONGEST).any():
            row, key, value = int(seconds.argmax()), "truth.speed_mm_s", motion.tool_speed * 1e3
            message = f"the approach to q[{row}] takes {seconds[row]:.3g} s"
            allowed, fix = f"at most {LONGEST:g} s", "raise speed_deg_s and speed_mm_s"
            raise refuse(key, value, allowed, code="S37", message=message, fix=fix)
        return np.asarray(seconds)

    def approach(self, q: Array, travel: Array) -> Array:
        """What the motors do on one approach (s, n) to joints q (n,), from its start on [rad]."""
        steps = int(np.ceil(self.durations(q[None], travel[None])[0] / self._step))
        left = 1 - np.arange(steps + 1)[:, None] / max(steps, 1)
        return np.asarray(q - self._last_part(travel[None]) * _to_go(left))

    def _last_part(self, travel: Array) -> Array:
        """What is played of each way (m, n): the joint that goes farthest moves by `approach`."""
        far = np.abs(travel).max(axis=1, keepdims=True)
        share = np.minimum(1.0, self.motion.approach / np.where(far > 0, far, 1.0))
        return np.asarray(travel * share)

    def _play(
        self, goal: bytes, way: bytes, steps: int, waits: tuple[int, ...], payload: float
    ) -> Array | None:
        """Angles (d, k) of the springs at a goal after so many steps; None if they give way."""
        import mujoco

        hang(self._model, payload)

        model, data, end, last = self._model, self._data, np.frombuffer(goal), np.frombuffer(way)
        if not self._stand(end - last):
            return None
        for k in range(1, steps + 1):
            left = 1 - k / steps
            data.ctrl[:] = end - last * _to_go(left)
            mujoco.mj_step(model, data)
        data.ctrl[:] = end
        out, waited = np.empty((len(waits), len(self._elastic))), 0
        for k, wait in enumerate(waits):
            mujoco.mj_step(model, data, wait - waited)
            out[k], waited = data.qpos[self._elastic], wait
        out[:, self._drives] -= end
        return out if np.abs(out).max() < BENT else None  # also not where it is no number

    def follow(self, path: Array, *, every: int = 1) -> Array:
        """Angles (s // every, k) of the springs, as in `deflections`, while the motors move [rad].

        They take one row of their `path` (s, n) in each step, from rest at the first; said is what
        follows upon every so many rows.
        """
        import mujoco

        out = np.empty((len(path) // every, len(self._elastic)))
        hang(self._model, self.springs.payload)
        stands = self._stand(path[0])
        for k, motors in enumerate(path if stands else ()):
            self._data.ctrl[:] = motors
            mujoco.mj_step(self._model, self._data)
            if (k + 1) % every == 0:
                out[k // every] = self._data.qpos[self._elastic]
        out[:, self._drives] -= path[every - 1 :: every][: len(out)]
        if not stands or not np.abs(out).max() < BENT:
            raise gives_way(0, self._stiffness, LOADS)
        return out

    def _stand(self, motors: Array) -> bool:
        """Put the arm at rest on its springs, with no friction yet; whether they carry it."""
        import mujoco

        model, data = self._model, self._data
        mujoco.mj_resetData(model, data)
        data.qpos[self._driven] = data.ctrl[:] = motors
        stands = data.qpos[self._elastic]
        angles = sag(model, data, self._elastic, self._stiffness, stands)
        if angles is not None:
            data.qpos[self._elastic] = stands + angles
        return angles is not None

    def _inertias(self) -> Array:
        """Inertia (k,) that each sprung hinge feels, the mean over postures all around [kg m^2]."""
        import mujoco

        model, data = self._model, self._data
        turns = np.random.default_rng(0).uniform(-np.pi, np.pi, (POSTURES, self._chain.n_joints))
        full, felt = np.empty((model.nv, model.nv)), np.zeros(len(self._elastic))
        for q in turns:
            data.qpos[self._driven] = q
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_crb(model, data)
            mujoco.mj_fullM(model, data, full)
            felt += np.diag(full)[self._elastic] / POSTURES
        return felt


def _to_go(left: Any) -> Any:
    """Share of a quintic move, from rest to rest, that lies ahead; as `left` is of its time."""
    return left**3 * (10 - 15 * left + 6 * left * left)
