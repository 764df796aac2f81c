"""The robot in MuJoCo: tool poses, collisions and line of sight of any chain at given joints.

Joints go in one at a time: for a handful of microseconds a pose, a plain loop over one `MjData` is
as fast as MuJoCo's batches are on one thread, and ten times faster on the thirty poses of a trial.
"""

import logging
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Bool, check
from calib.geometry.chain import Chain, joint_vectors
from calib.geometry.frames import slide, transform
from testbed import assets
from testbed.laboratory.cell import Obstacle
from testbed.laboratory.collisions import FLOOR, ROBOT_BIT, ROOM_FLOOR, add_floor, add_obstacle
from testbed.robots.catalog import Robot
from testbed.robots.meshes.files import check_meshes

SEEN = np.array([1, 1, 1, 0, 0, 0], dtype=np.uint8)
"""Groups of geoms that rays meet: not what collides only, which stands for what is drawn."""
TOUCH = 1e-3
"""A ray that ends within this share of the target's distance has reached the target."""


class Contacts(NamedTuple):
    """What the robot hits."""

    itself: Bool
    """(m,) two parts of the robot overlap, the base and the probe included."""
    floor: Bool
    """(m,) a part reaches below the floor."""
    obstacle: Bool
    """(m,) a moving part overlaps an obstacle; the base may stand in one, such as a table."""


class Simulator:
    """A chain as a MuJoCo body tree, with the hulls and drawings of a robot hung on it.

    Parameters
    ----------
    robot : Robot or None
        Whose parts collide and block the view; None for bare kinematics: nothing collides.
    chain : Chain
        Geometry of the bodies: the robot's nominal one, or any other with as many joints.
    obstacles : sequence of Obstacle
        What else stands in the cell, fixed to the world.
    clearance : float
        Moving parts nearer than this to the floor or an obstacle count as touching it; the base
        stands on the floor and may touch both [m].

    Notes
    -----
    Holds one `MjData`, so an instance must not be shared between threads.
    """

    def __init__(
        self,
        robot: Robot | None,
        chain: Chain,
        obstacles: Sequence[Obstacle] = (),
        *,
        clearance: float = 0.0,
    ) -> None:
        import mujoco

        from testbed.robots.write.mjcf import build_spec, compile_spec

        mujoco.set_mju_user_warning(log_warning)
        if robot is not None and not robot.folder.resolve().is_relative_to(assets.models()):
            check_meshes(*(visual.file for visual in robot.visuals))
        spec = build_spec(chain, robot)
        if robot is not None:
            T_world_floor = chain.T_world_base @ slide(0.0, 0.0, robot.base_offset)
            add_floor(spec, FLOOR, T_world_floor, clearance)
            if robot.mounting_height is not None:
                place = chain.T_world_base[:3, 3] - [0.0, 0.0, robot.mounting_height]
                add_floor(spec, ROOM_FLOOR, slide(*place), clearance)
        for obstacle in obstacles:
            add_obstacle(spec, obstacle, clearance, hulls=bool(robot and robot.primitives))
        self._chain = chain
        self.obstacles = tuple(obstacles)
        self._model = compile_spec(spec, robot)
        self._data = mujoco.MjData(self._model)
        self._tool = self._model.site("tool").id
        self._carrier = int(self._model.site_bodyid[self._tool])
        planes = self._model.geom_type == int(mujoco.mjtGeom.mjGEOM_PLANE)
        self._floors = np.flatnonzero(planes).tolist()
        """The floor, and that of the room where the base hangs above it; as MuJoCo numbers them."""
        mujoco.mj_kinematics(self._model, self._data)

    def _surroundings(self) -> list[int]:
        """The floors and the obstacles, as MuJoCo numbers them."""
        return [*self._floors, *(self._model.geom(one.name).id for one in self.obstacles)]

    def _standing(self, q: Array) -> Iterator[int]:
        """Let the robot stand at each row of q (m, n) in turn; yields the row."""
        import mujoco

        model, data = self._model, self._data
        place, move = data.qpos, mujoco.mj_kinematics
        for k, joints in enumerate(q):
            place[:] = joints
            move(model, data)
            yield k

    def _colliding(self, q: Array) -> Iterator[int]:
        """The same, with the contacts found."""
        import mujoco

        model, data, meet = self._model, self._data, mujoco.mj_collision
        for k in self._standing(q):
            meet(model, data)
            yield k

    def poses(self, q: ArrayLike, *, growth: Array | None = None) -> Array:
        """Tool poses T_world_tool (m, 4, 4) at joint values q (m, n) [rad, m].

        `growth` (m,) is how much longer the links are at each pose, as a share; once it is given,
        give it always: the model keeps the last geometry.
        """
        import mujoco

        from testbed.robots.write.mjcf import set_geometry

        q = joint_vectors(self._chain, q)
        position, rotation = np.empty((len(q), 3)), np.empty((len(q), 9))
        model, data, tool = self._model, self._data, self._tool
        for k, joints in enumerate(q):
            if growth is not None:
                set_geometry(model, grown(self._chain, float(growth[k])))
            data.qpos[:] = joints
            mujoco.mj_kinematics(model, data)
            position[k], rotation[k] = data.site_xpos[tool], data.site_xmat[tool]
        return transform(rotation.reshape(-1, 3, 3), position)

    def contacts(self, q: ArrayLike) -> Contacts:
        """What the robot hits at joint values q (m, n) [rad, m], meshes taken as convex hulls."""
        q = joint_vectors(self._chain, q)
        itself, floor, obstacle = np.zeros((3, len(q)), dtype=bool)
        data, ground = self._data, set(self._floors)
        obstacles = set(self._surroundings()) - ground
        for k in self._colliding(q):
            if data.ncon:
                pairs = [set(pair) for pair in data.contact.geom.tolist()]
                below, beside = (
                    [not some.isdisjoint(pair) for pair in pairs] for some in (ground, obstacles)
                )
                itself[k] = not all(map(max, below, beside))
                floor[k], obstacle[k] = any(below), any(beside)
        return Contacts(itself, floor, obstacle)

    def collides(self, q: ArrayLike) -> Bool:
        """Whether (m,) the robot hits itself, the floor or an obstacle at q (m, n) [rad, m]."""
        q = joint_vectors(self._chain, q)
        return np.array([self._data.ncon > 0 for _ in self._colliding(q)], dtype=bool)

    def hit_word(self, q: Array) -> str:
        """What the robot hits at one posture q (n,) that collides."""
        _, floor, obstacle = (bool(hit[0]) for hit in self.contacts(q[None]))
        return "an obstacle" if obstacle else "the floor" if floor else "itself"

    def clearances(self, q: ArrayLike, *, most: float) -> Array:
        """Distance (m,) from the moving parts to the floor and the obstacles at q (m, n) [m].

        Of meshes the convex hulls, negative where they overlap, `most` where nothing is nearer.
        """
        import mujoco

        q = joint_vectors(self._chain, q)
        out = np.full(len(q), most)
        model, data, around = self._model, self._data, self._surroundings()
        moves = model.body_weldid[model.geom_bodyid] > 0
        parts = np.flatnonzero(moves & ((model.geom_contype & ROBOT_BIT) > 0))
        for k in self._standing(q):
            for part in parts:
                for other in around:
                    found = mujoco.mj_geomDistance(model, data, part, other, most, None)
                    out[k] = min(out[k], found)
        return out

    def above_floor(self, point: ArrayLike) -> float:
        """How far a point (3,) of the world lies above the floor; infinite without a floor [m]."""
        (point,) = check("3", point=point)
        heights = [
            self._data.geom_xmat[floor].reshape(3, 3)[:, 2] @ (point - self._data.geom_xpos[floor])
            for floor in self._floors
        ]
        return float(min(heights, default=np.inf))

    def travel_bounds(self) -> Array:
        """How far any point of the robot can move per unit of each joint (n,) [m/rad or 1].

        For a turning joint the largest distance of a part's point beyond it from its axis, the arm
        taken as stretched and every part as its bounding ball: a bound, never too small. Sliding
        joints beyond count with their full limits.
        """
        model, n = self._model, len(self._chain.kinds)
        first = int(model.jnt_bodyid[0])
        far = np.zeros(n)
        for body in range(n):
            own = model.geom_bodyid == first + body
            ends = [*(np.linalg.norm(model.geom_pos[own], axis=1) + model.geom_rbound[own])]
            if body == n - 1:
                ends.append(np.linalg.norm(model.site_pos[self._tool]))
            far[body] = max(ends, default=0.0)
        # radius of all that hangs on a body, seen from its origin, inner bodies last
        for body in range(n - 2, -1, -1):
            arm = np.linalg.norm(model.body_pos[first + body + 1])
            if self._chain.kinds[body + 1] == "prismatic":
                arm += np.abs(model.jnt_range[body + 1]).max()
            far[body] = max(far[body], arm + far[body + 1])
        slides = self._chain.prismatic.astype(bool)
        return np.where(slides, 1.0, far)

    def sees(self, q: ArrayLike, station: ArrayLike, target_offset: ArrayLike) -> Bool:
        """Whether (m,) a straight line from the station reaches the target.

        The body that carries the target is transparent: the target is a part of it, and its own
        surface would end every ray. All other bodies, the base, the floor and the obstacles block.
        Nothing is seen from below the floor, which stops rays from above only.

        Parameters
        ----------
        q : (m, n) array_like
            Joint values [rad, m].
        station : (3,) array_like
            Where the beam starts, in the world [m].
        target_offset : (3,) array_like
            Target in the tool frame [m].
        """
        import mujoco

        q = joint_vectors(self._chain, q)
        start, offset = check("3, 3", station=station, target_offset=target_offset)
        out = np.zeros(len(q), dtype=bool)
        if self.above_floor(start) < 0:
            return out
        model, data, carrier, ray = self._model, self._data, self._carrier, mujoco.mj_ray
        origin, axes = data.site_xpos[self._tool], data.site_xmat[self._tool].reshape(3, 3)
        hit = np.zeros(1, dtype=np.int32)
        for k in self._standing(q):
            beam = origin + axes @ offset - start
            # the answer is in units of the beam's own length; negative: nothing met
            share = ray(model, data, start, beam, SEEN, 1, carrier, hit)
            out[k] = share < 0 or share > 1 - TOUCH
        return out


def grown(chain: Chain, share: float) -> Chain:
    """The chain with the lengths d and a of its links larger by a share."""
    return replace(chain, links=chain.links * [1.0, 1.0 + share, 1.0 + share, 1.0, 1.0])


def log_warning(message: str) -> None:
    """Send a MuJoCo warning to the log; its own way is a file in the current folder.

    Must not raise: MuJoCo calls this from C++ and would end the process.
    """
    logging.getLogger(__name__).warning("MuJoCo: %s", message)
