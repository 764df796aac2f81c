"""An arm and a tracker of another kind, to judge what the project states; numpy alone.

It shares no line, no frame and no formula with the packages: kinematics are products of
exponentials about the screws of the home pose, geometry is wrong by small motions between them,
and statics are moments of point masses about the joints, brought to rest by iteration. What it
measures leaves through measurement files. Lengths are in m, angles in rad, leading axes batches.

References
----------
Lynch & Park, Modern Robotics, 2017, section 4.1 (product of exponentials); geometry of the Staubli
TX60 from Wen et al. 2022, Table 3.
"""

from dataclasses import dataclass, field

import numpy as np

# axes of the TX60 at home and points on them, in the frame where axes 1 and 2 meet
AXES = np.array([[0, 0, 1], [0, 1, 0], [0, 1, 0], [0, 0, 1], [0, 1, 0], [0, 0, 1.0]])
POINTS = np.array(
    [[0, 0, 0], [0, 0, 0], [0, 0, 0.29], [0, 0.02, 0.29], [0, 0.02, 0.6], [0, 0.02, 0.6]]
)
FLANGE = np.array([0, 0.02, 0.67])
LIMITS = np.radians([[-180, 180], [-127, 127], [-142, 142], [-270, 270], [-122, 132], [-270, 270]])
BOX = np.array([[-0.2, 0.7], [-0.6, 0.6], [-0.2, 0.6]])
"""Where poses are drawn: the paper's workspace [m]."""
MASSES = np.array([12.0, 11, 8, 5, 1.5, 0.5])
CENTERS = np.array(
    [
        [0, 0, -0.1],
        [0, 0.12, 0.15],
        [0, 0.03, 0.33],
        [0, 0.02, 0.48],
        [0, 0.02, 0.6],
        [0, 0.02, 0.64],
    ]
)
GRAVITY = np.array([0, 0, -9.81])
STATION = np.array([2.4, -1.6, 0.5])
JOINT_SD = 14.5e-6
"""Repeatability of every joint [rad]."""
KINDS = ("sag", "waves", "fast", "play", "bearings", "lengths")
SIZED_AT = 200
"""Poses over which a misfit is sized, after the best geometry there."""


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
            bend = new + load[..., None] * AXES
        T = self._frames(at, bend)[1][:, -1]
        p = (T @ np.append(FLANGE + self.tool, 1.0))[:, :3]
        return p * (1 + self.growth * np.sin(q[:, :1])), T[:, :3, :3]

    def _frames(self, q, bend):
        """Motions from home of the joints (m, 6, 4, 4), and of bodies and tool (m, 7, 4, 4)."""
        T = np.broadcast_to(self._wrong(0, np.zeros(3)), (len(q), 4, 4))
        joints, bodies = [], []
        for i in range(6):
            axis = q[:, i, None] * AXES[i]
            T = T @ motion(axis, np.zeros(3), POINTS[i])
            T = T @ motion(bend[:, i], np.zeros(3), POINTS[i])
            joints.append(T)
            T = T @ self._wrong(i + 1, POINTS[i])
            bodies.append(T)
        bodies.append(T @ self._wrong(7, FLANGE))
        return np.stack(joints, axis=1), np.stack(bodies, axis=1)

    def _wrong(self, k, about):
        return motion(self.wrong[k, :3], self.wrong[k, 3:], about)

    def _moments(self, q, bend):
        """Gravity's torque (m, 6) about each axis, and its moment (m, 6, 3) across, home axes."""
        joints, bodies = self._frames(q, bend)
        centers = np.concatenate([CENTERS, (FLANGE + self.tool)[None]])
        masses = np.append(MASSES, self.payload)
        places = np.stack(
            [(bodies[:, k] @ np.append(centers[k], 1.0))[:, :3] for k in range(7)], axis=1
        )
        torque, across = np.zeros((len(q), 6)), np.zeros((len(q), 6, 3))
        for i in range(6):
            about = (joints[:, i] @ np.append(POINTS[i], 1.0))[:, :3]
            moment = np.cross(places[:, i:] - about[:, None], masses[i:, None] * GRAVITY).sum(1)
            home = (np.swapaxes(joints[:, i, :3, :3], 1, 2) @ moment[..., None])[..., 0]
            torque[:, i] = home @ AXES[i]
            across[:, i] = home - torque[:, i, None] * AXES[i]
        return torque, across


def candidates(rng, n):
    """Joints (n, 6) drawn within limits whose flange lies in the box."""
    plain, found = ForeignArm(), np.zeros((0, 6))
    while len(found) < n:
        q = rng.uniform(LIMITS[:, 0], LIMITS[:, 1], (4 * n, 6))
        p = plain._frames(q, np.zeros((len(q), 6, 3)))[1][:, -1] @ np.append(FLANGE, 1.0)
        inside = ((p[:, :3] > BOX[:, 0]) & (p[:, :3] < BOX[:, 1])).all(axis=1)
        found = np.concatenate([found, q[inside]])
    return found[:n]


def unheld(arm, q):
    """Root mean square per axis [m] of what the best geometry over q leaves of an arm's error."""
    at_home = np.zeros((8, 6))
    p, _ = ForeignArm().poses(q)
    columns = []
    for k in np.ndindex(8, 6):
        step = at_home.copy()
        step[k] = 1e-6
        columns.append((ForeignArm(wrong=step).poses(q)[0] - p).ravel() / 1e-6)
    error = (arm.poses(q)[0] - p).ravel()
    A = np.stack(columns, axis=1)
    left = error - A @ np.linalg.lstsq(A, error, rcond=1e-9)[0]
    return float(np.sqrt((left**2).mean()))


def true_arm(rng, kind="rigid", size=0.0, payload=0.0):
    """A robot wrong by 0.1 deg and 0.3 mm everywhere, with a misfit of `size` [m] per axis.

    The misfit is sized without the geometry, whose own error bends it by parts in a thousand.
    """
    parts = {}
    gain = np.exp(0.3 * rng.normal(size=6)) * np.array([0.5, 1, 1.5, 3, 4, 6])
    if kind == "sag":
        parts["compliance"] = gain * np.array([0, 1, 1, 1, 1, 0.0])
    elif kind == "bearings":
        parts["bearings"] = gain
    elif kind == "play":
        parts["play"] = np.abs(rng.normal(size=6))
    elif kind == "lengths":
        parts["growth"] = 1.0
    elif kind in ("waves", "fast"):
        orders = (1, 2) if kind == "waves" else tuple(rng.integers(3, 90, 2))
        parts["waves"] = tuple(
            (i, int(k), rng.normal() / (1 + n), rng.uniform(0, 2 * np.pi))
            for i in range(6)
            for n, k in enumerate(orders)
        )
    elif kind != "rigid":
        raise ValueError(kind)

    def of_scale(scale, **more):
        """The arm with all parts of its misfit times a scale."""
        sized = {
            name: tuple((i, k, scale * a, f) for i, k, a, f in part)
            if name == "waves"
            else scale * part
            for name, part in parts.items()
        }
        return ForeignArm(**sized, **more)

    scale = 0.0
    if size and kind != "rigid":
        q, small = candidates(rng, SIZED_AT), 1e-6
        scale = small * size / unheld(of_scale(small), q)
    wrong = rng.normal(size=(8, 6)) * np.array([np.radians(0.1)] * 3 + [0.3e-3] * 3)
    return of_scale(scale, wrong=wrong, payload=payload)


@dataclass(frozen=True)
class ForeignTracker:
    """A station that reads range and two angles, and the target's rotation, with its faults."""

    noise: float = 1.0
    """Factor on what it states."""
    range_offset: float = 0.0
    """[m]."""
    scale: float = 0.0
    """Part of the range."""
    encoder: tuple = (0.0, 0.0)
    """Once per turn in azimuth, twice in elevation [m across the beam]."""
    centering: tuple = (0.0, 0.0, 0.0)
    """Of the target in its nest, axes of the tool [m]."""
    memory: float = 0.0
    """Rows over which all of its noise is remembered; 0 for none."""
    turned: float = 0.3
    """Of the station about the vertical: its frame is not the robot's [rad]."""

    @property
    def frame(self):
        """(4, 4) pose of the station in the frame of the robot."""
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = turn(np.array([0, 0, self.turned])), STATION
        return T

    def stated(self, p):
        """Standard deviations of range and across [m], and of rotation [rad], at points (m, 3)."""
        r = np.linalg.norm(p - STATION, axis=1)
        return 3.2e-6 + 0.15e-6 * r, 3.9e-6 + 1.5e-6 * r, np.full(len(p), np.radians(2.5e-3))

    def read(self, arm, q, rng):
        """Positions (m, 3) [m] and quaternions (m, 4) w first, in the frame of the station."""
        p, R = arm.poses(q + JOINT_SD * rng.normal(size=q.shape))
        p = p + R @ np.array(self.centering)
        d = (p - STATION) @ self.frame[:3, :3]
        r = np.linalg.norm(d, axis=1)
        along, across, rotation = self.stated(p)
        e = self._noise(len(q), rng) * self.noise
        beam = d / r[:, None]
        az, el = np.arctan2(d[:, 1], d[:, 0]), np.arcsin(beam[:, 2])
        level = np.stack([-np.sin(az), np.cos(az), np.zeros(len(q))], axis=1)
        up = np.cross(beam, level)
        seen = d + (along * e[:, 0] + self.range_offset + self.scale * r)[:, None] * beam
        seen += (across * e[:, 1] + self.encoder[0] * np.sin(az))[:, None] * level
        seen += (across * e[:, 2] + self.encoder[1] * np.sin(2 * el))[:, None] * up
        turned = turn(rotation[:, None] * self.noise * rng.normal(size=(len(q), 3)))
        return seen, quaternions(turned @ self.frame[:3, :3].T @ R)

    def _noise(self, m, rng):
        """Standard normal numbers (m, 3), all of them remembered where there is a memory."""
        e = rng.normal(size=(m, 3))
        if not self.memory:
            return e
        keep = np.exp(-1 / self.memory)
        for k in range(1, m):
            e[k] = keep * e[k - 1] + np.sqrt(1 - keep**2) * e[k]
        return e


def quaternions(R):
    """Quaternions (m, 4), w first, of rotations (m, 3, 3), by eigenvectors (Bar-Itzhack)."""
    K = np.zeros((len(R), 4, 4))
    K[:, 0, 0] = np.trace(R, axis1=1, axis2=2)
    K[:, 1:, 1:] = R + np.swapaxes(R, 1, 2) - K[:, 0, 0, None, None] * np.eye(3)
    K[:, 0, 1:] = np.stack(
        [R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1
    )
    K[:, 1:, 0] = K[:, 0, 1:]
    return np.linalg.eigh(K)[1][:, :, 3]


HEADER = (
    "pose_id,split,"
    + ",".join(f"q{i}_deg" for i in range(1, 7))
    + ",x_mm,y_mm,z_mm,qw,qx,qy,qz,ux_mm,uy_mm,uz_mm"
)


def write_campaign(folder, arm, tracker, rng, train, held_out):
    """session.toml and poses.csv of one visit in random order; joints (m, 6) and (n, 6)."""
    q = np.concatenate([train, held_out])
    order = rng.permutation(len(q))
    words = np.array(["identify"] * len(train) + ["test"] * len(held_out))
    p, rotation = tracker.read(arm, q[order], rng)
    along, across, turned = tracker.stated(arm.poses(q[order])[0])
    # one number for every axis, as a device prints it: between the beam and across
    u = np.sqrt((along**2 + 2 * across**2) / 3)
    lines = [HEADER]
    for k, row in enumerate(order):
        cells = [*np.degrees(q[row]), *(1e3 * p[k]), *rotation[k], *[1e3 * u[k]] * 3]
        lines.append(f"{row},{words[row]}," + ",".join(repr(float(c)) for c in cells))
    (folder / "poses.csv").write_text("\n".join(lines) + "\n")
    (folder / "session.toml").write_text(
        'robot = "staubli_tx60"\n\n[joints]\nfile = "poses.csv"\nsource = "commanded"\n\n'
        '[frames]\nfile = "poses.csv"\n\n'
        f"[uncertainty]\nrotation_mdeg = {1e3 * float(np.degrees(turned[0]))!r}\n"
    )
    return folder / "session.toml"
