"""Arms of another kind, to judge what the project states; numpy alone.

They share no line, no frame and no formula with the packages: kinematics are products of
exponentials about the screws of the home pose, geometry is wrong by small motions between them,
and statics are moments of point masses about the joints, brought to rest by iteration. Lengths are
in m, angles in rad, leading axes batches.

References
----------
Lynch & Park, Modern Robotics, 2017, section 4.1 (product of exponentials); geometry of the Staubli
TX60 from Wen et al. 2022, Table 3, of the UR5 from its maker's public table.
"""

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

GRAVITY = np.array([0, 0, -9.81])
SIZED_AT = 200
"""Poses over which a misfit is sized, after the best geometry there."""


@dataclass(frozen=True, eq=False)
class Body:
    """An arm as it is drawn, in the axes of its base, all joints at zero."""

    axes: np.ndarray
    """(6, 3) of the joints."""
    points: np.ndarray
    """(6, 3) on them [m]."""
    flange: np.ndarray
    """(3,) its center [m]."""
    limits: np.ndarray
    """(6, 2) [rad]."""
    box: np.ndarray
    """(3, 2) where the flange stands while it is measured [m]."""
    masses: np.ndarray
    """(6,) [kg]."""
    centers: np.ndarray
    """(6, 3) [m]."""


TX60 = Body(
    axes=np.array([[0, 0, 1], [0, 1, 0], [0, 1, 0], [0, 0, 1], [0, 1, 0], [0, 0, 1.0]]),
    points=np.array(
        [[0, 0, 0], [0, 0, 0], [0, 0, 0.29], [0, 0.02, 0.29], [0, 0.02, 0.6], [0, 0.02, 0.6]]
    ),
    flange=np.array([0, 0.02, 0.67]),
    limits=np.radians(
        [[-180, 180], [-127, 127], [-142, 142], [-270, 270], [-122, 132], [-270, 270]]
    ),
    box=np.array([[-0.2, 0.7], [-0.6, 0.6], [-0.2, 0.6]]),
    masses=np.array([12.0, 11, 8, 5, 1.5, 0.5]),
    centers=np.array(
        [
            [0, 0, -0.1],
            [0, 0.12, 0.15],
            [0, 0.03, 0.33],
            [0, 0.02, 0.48],
            [0, 0.02, 0.6],
            [0, 0.02, 0.64],
        ]
    ),
)
"""Axes 1 and 2 meet at the origin; the box is the paper's workspace."""
UR5 = Body(
    axes=np.array([[0, 0, 1], [0, -1, 0], [0, -1, 0], [0, -1, 0], [0, 0, -1], [0, -1, 0.0]]),
    points=np.array(
        [
            [0, 0, 0],
            [0, 0, 0.089159],
            [-0.425, 0, 0.089159],
            [-0.81725, 0, 0.089159],
            [-0.81725, -0.10915, 0],
            [-0.81725, 0, -0.005491],
        ]
    ),
    flange=np.array([-0.81725, -0.19145, -0.005491]),
    limits=np.radians([[-180, 180], [-180, 0], [-150, 150], [-180, 180], [-180, 180], [-180, 180]]),
    box=np.array([[-0.6, 0.6], [-0.6, 0.6], [0.0, 0.7]]),
    masses=np.array([3.7, 8.393, 2.33, 1.219, 1.219, 0.188]),
    centers=np.array(
        [
            [0, -0.026, 0.087],
            [-0.2125, -0.11, 0.089],
            [-0.575, -0.02, 0.089],
            [-0.817, -0.1, 0.07],
            [-0.817, -0.11, 0.0],
            [-0.817, -0.17, -0.005],
        ]
    ),
)
KINDS = ("sag", "waves", "mixture", "fast", "play", "bearings", "lengths")
EVERYWHERE = ("y", -np.inf, np.inf)
PLACES = {
    "same": (EVERYWHERE, EVERYWHERE),
    "half": (("y", 0.05, np.inf), ("y", -np.inf, -0.05)),
    "joint 1": (("turned", -np.inf, 0.8), ("turned", 1.2, np.inf)),
    "elbow": (("elbow", 0.7, np.inf), ("elbow", -np.inf, -0.7)),
    "low": (("z", -np.inf, 0.2), ("z", 0.35, np.inf)),
}
"""Where a robot is calibrated, and where it is used."""


def turn(vector):
    """Rotations (..., 3, 3) of rotation vectors (..., 3)."""
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    K = np.zeros((*vector.shape, 3))
    K[..., 2, 1], K[..., 0, 2], K[..., 1, 0] = np.moveaxis(vector, -1, 0)
    K -= np.swapaxes(K, -1, -2)
    return np.eye(3) + np.sinc(angle / np.pi) * K + np.sinc(angle / 2 / np.pi) ** 2 / 2 * K @ K


def motion(turned, shifted, about):
    """Motions (..., 4, 4) that turn by a vector about a point, then shift."""
    T = np.zeros((*np.broadcast_shapes(turned.shape, shifted.shape, about.shape)[:-1], 4, 4))
    R = turn(np.broadcast_to(turned, (*T.shape[:-2], 3)))
    T[..., :3, :3], T[..., 3, 3] = R, 1.0
    T[..., :3, 3] = about - (R @ np.broadcast_to(about, R.shape[:-1])[..., None])[..., 0] + shifted
    return T


@dataclass(frozen=True)
class ForeignArm:
    """One true robot: its geometry, and what no geometric number describes."""

    body: Body = TX60
    wrong: np.ndarray = field(default_factory=lambda: np.zeros((8, 6)))
    """(8, 6) small turns [rad] and shifts [m] of the base, after each joint, and of the tool."""
    tool: np.ndarray = field(default_factory=lambda: np.array([0.03, -0.02, 0.09]))
    """Target in the axes of the flange at home [m]."""
    compliance: np.ndarray = field(default_factory=lambda: np.zeros(6))
    """(6,) turn of each joint under the torque of gravity about it [rad/(N m)]."""
    bearings: np.ndarray = field(default_factory=lambda: np.zeros(6))
    """(6,) turn of each joint under the moment across its axis [rad/(N m)]."""
    waves: tuple = ()
    """(joint, order, amplitude [rad], phase [rad]) of what gears and encoders leave."""
    play: np.ndarray = field(default_factory=lambda: np.zeros(6))
    """(6,) half the backlash; the sign of gravity's torque decides the side [rad]."""
    growth: float = 0.0
    """Lengths grow by this times the sine of joint 1: the load of the day."""
    payload: float = 0.0
    """Mass at the target [kg]."""

    def poses(self, q):
        """Position (m, 3) of the target and rotation (m, 3, 3) of the flange."""
        at = q + sum(
            (a * np.sin(k * q[:, i] + phase))[:, None] * np.eye(6)[i]
            for i, k, a, phase in self.waves
        )
        bend = np.zeros((len(q), 6, 3))
        yields = self.compliance.any() or self.bearings.any() or self.play.any()
        for _ in range(4 if yields else 0):  # a bend changes its own moments by a part in 1e4
            torque, across = self._moments(at, bend)
            slack = self.play * np.tanh(torque / 0.05)
            load = self.compliance * torque + slack
            new = self.bearings[:, None] * across
            bend = new + load[..., None] * self.body.axes
        T = self._frames(at, bend)[1][:, -1]
        p = (T @ np.append(self.body.flange + self.tool, 1.0))[:, :3]
        return p * (1 + self.growth * np.sin(q[:, :1])), T[:, :3, :3]

    def _frames(self, q, bend):
        """Motions from home of the joints (m, 6, 4, 4), and of bodies and tool (m, 7, 4, 4)."""
        T = np.broadcast_to(self._wrong(0, np.zeros(3)), (len(q), 4, 4))
        joints, bodies = [], []
        for i, (axis, point) in enumerate(zip(self.body.axes, self.body.points, strict=True)):
            T = T @ motion(q[:, i, None] * axis, np.zeros(3), point)
            T = T @ motion(bend[:, i], np.zeros(3), point)
            joints.append(T)
            T = T @ self._wrong(i + 1, point)
            bodies.append(T)
        bodies.append(T @ self._wrong(7, self.body.flange))
        return np.stack(joints, axis=1), np.stack(bodies, axis=1)

    def _wrong(self, k, about):
        return motion(self.wrong[k, :3], self.wrong[k, 3:], about)

    def _moments(self, q, bend):
        """Gravity's torque (m, 6) about each axis, and its moment (m, 6, 3) across, home axes."""
        joints, bodies = self._frames(q, bend)
        centers = np.concatenate([self.body.centers, (self.body.flange + self.tool)[None]])
        masses = np.append(self.body.masses, self.payload)
        places = np.stack(
            [(bodies[:, k] @ np.append(centers[k], 1.0))[:, :3] for k in range(7)], axis=1
        )
        torque, across = np.zeros((len(q), 6)), np.zeros((len(q), 6, 3))
        for i, (axis, point) in enumerate(zip(self.body.axes, self.body.points, strict=True)):
            about = (joints[:, i] @ np.append(point, 1.0))[:, :3]
            moment = np.cross(places[:, i:] - about[:, None], masses[i:, None] * GRAVITY).sum(1)
            home = (np.swapaxes(joints[:, i, :3, :3], 1, 2) @ moment[..., None])[..., 0]
            torque[:, i] = home @ axis
            across[:, i] = home - torque[:, i, None] * axis
        return torque, across


def candidates(rng, n, body=TX60, part=EVERYWHERE):
    """Joints (n, 6) drawn within limits whose flange lies in the box, of some part of it."""
    plain, found = ForeignArm(body), np.zeros((0, 6))
    what, low, high = part
    while len(found) < n:
        q = rng.uniform(body.limits[:, 0], body.limits[:, 1], (4 * n, 6))
        bodies = plain._frames(q, np.zeros((len(q), 6, 3)))[1]
        p = (bodies[:, -1] @ np.append(body.flange, 1.0))[:, :3]
        inside = ((p > body.box[:, 0]) & (p < body.box[:, 1])).all(axis=1)
        value = {"y": p[:, 1], "z": p[:, 2], "turned": np.abs(q[:, 0]), "elbow": q[:, 2]}[what]
        found = np.concatenate([found, q[inside & (low < value) & (value < high)]])
    return found[:n]


def held_by_geometry(q, body=TX60):
    """Points (m, 3) of the arm as drawn, and axes (3 m, r) of all that geometry can change."""
    p, columns = ForeignArm(body).poses(q)[0], []
    for k in np.ndindex(8, 6):
        step = np.zeros((8, 6))
        step[k] = 1e-6
        columns.append((ForeignArm(body, wrong=step).poses(q)[0] - p).ravel() / 1e-6)
    U, s, _ = np.linalg.svd(np.stack(columns, axis=1), full_matrices=False)
    return p, U[:, s > 1e-7 * s[0]]


def unheld(arm, q, geometry=None):
    """Root mean square per axis [m] of what the best geometry over q leaves of an arm's error."""
    p, U = held_by_geometry(q, arm.body) if geometry is None else geometry
    error = (arm.poses(q)[0] - p).ravel()
    left = error - U @ (U.T @ error)
    return float(np.sqrt((left**2).mean()))


@lru_cache
def _sizing(body):
    """Poses at which every misfit of a body is sized, and what geometry does there."""
    q = candidates(np.random.default_rng(5), SIZED_AT, body)
    return q, held_by_geometry(q, body)


def misfit(rng, kind):
    """What is wrong beside geometry, of no size yet: fields of `ForeignArm`."""
    gain = np.exp(0.3 * rng.normal(size=6)) * np.array([0.5, 1, 1.5, 3, 4, 6])
    if kind == "sag":
        return {"compliance": gain * np.array([0, 1, 1, 1, 1, 0.0])}
    if kind == "bearings":
        return {"bearings": gain}
    if kind == "play":
        return {"play": np.abs(rng.normal(size=6))}
    if kind == "lengths":
        return {"growth": 1.0}
    if kind in ("waves", "fast"):
        orders = (1, 2) if kind == "waves" else tuple(rng.integers(3, 90, 2))
        return {
            "waves": tuple(
                (i, int(k), rng.normal() / (1 + n), rng.uniform(0, 2 * np.pi))
                for i in range(6)
                for n, k in enumerate(orders)
            )
        }
    raise ValueError(kind)


def times(scale, parts):
    """All parts of a misfit times a scale."""
    return {
        name: tuple((i, k, scale * a, f) for i, k, a, f in part)
        if name == "waves"
        else scale * part
        for name, part in parts.items()
    }


def sized(parts, size, body):
    """A misfit of a size [m] per axis after the best geometry.

    It is sized without the geometry, whose own error bends it by parts in a thousand, and where it
    is small: all but play are linear, and play is in its own size.
    """
    q, geometry = _sizing(body)
    small = 1e-6
    return times(small * size / unheld(ForeignArm(body, **times(small, parts)), q, geometry), parts)


def true_arm(rng, kind="rigid", size=0.0, payload=0.0, body=TX60, **more):
    """A robot wrong by 0.1 deg and 0.3 mm everywhere, with a misfit of `size` [m] per axis.

    A mixture sags, and has waves of low and of high order, a third of the variance each.
    """
    parts = {}
    if kind == "mixture":
        for one in ("sag", "waves", "fast"):
            found = sized(misfit(rng, one), 1e-6, body)
            if "waves" in found:
                found["waves"] += parts.get("waves", ())
            parts |= found
    elif kind != "rigid":
        parts = misfit(rng, kind)
    parts = sized(parts, size, body) if parts and size else {}
    wrong = rng.normal(size=(8, 6)) * np.array([np.radians(0.1)] * 3 + [0.3e-3] * 3)
    return ForeignArm(body, wrong=wrong, payload=payload, **parts, **more)
