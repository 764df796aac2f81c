"""A tracker of another kind, its faults, and the measurement files it writes; numpy alone."""

from dataclasses import dataclass, replace

import numpy as np

from tests.truth.foreign import turn

STATION = np.array([2.4, -1.6, 0.5])
"""In the axes of the robot's base [m]."""
JOINT_SD = 14.5e-6
"""Repeatability of every joint [rad]."""
CONSTANTS_SD = {
    "range_offset": np.array([2.5e-6 / np.sqrt(3)]),
    "scale": np.array([0.2e-6]),
    "encoder": np.full(4, 1 / np.sqrt(2)),
    "centering": np.full(3, 2.5e-6),
    "angles": np.full(3, np.radians(0.005) / np.sqrt(3)),
}
"""Standard deviations of what a station gets wrong in all readings alike; fields of the tracker."""
ENCODER = (7.5e-6, 3e-6)
"""Size of the encoders' errors across the beam: constant [m], per metre of range."""
STATED_CONSTANTS = """
[uncertainty.systematic]
range_offset_um = 1.4433756729740645
scale_um_per_m = 0.2
encoder_amplitude_um = [7.5, 3.0]
target_offset_um = 2.5
target_turn_mdeg = 2.886751345948129
station_mm = [0, 0, 0]
"""
"""The same in a session whose coordinates are those of the station."""


@dataclass(frozen=True)
class ForeignTracker:
    """A station that reads range and two angles, and the target's rotation, with its faults."""

    noise: float = 1.0
    """Factor on what it states."""
    range_offset: np.ndarray | float = 0.0
    """[m]."""
    scale: np.ndarray | float = 0.0
    """Part of the range."""
    encoder: np.ndarray | tuple = (0.0, 0.0, 0.0, 0.0)
    """Sine and cosine of the azimuth, and of twice the elevation, in sizes of `ENCODER`."""
    centering: np.ndarray | tuple = (0.0, 0.0, 0.0)
    """Of the target in its nest, axes of the tool [m]."""
    angles: np.ndarray | tuple = (0.0, 0.0, 0.0)
    """Of the target in its nest, about axes of the tool [rad]."""
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
        """Positions (m, 3) [m] and rotations (m, 3, 3), in the frame of the station."""
        p, R = arm.poses(q + JOINT_SD * rng.normal(size=q.shape))
        along, across, rotation = self.stated(p)
        e = self._noise(len(q), rng) * self.noise
        seen, R = self.shown(p, R, np.stack([along, across, across], axis=1) * e)
        return seen, turn(rotation[:, None] * self.noise * rng.normal(size=(len(q), 3))) @ R

    def shown(self, p, R, error=0.0):
        """What it shows of poses in the frame of the robot, errors (m, 3) in those of the beam."""
        p = p + R @ np.array(self.centering)
        d = (p - STATION) @ self.frame[:3, :3]
        r = np.linalg.norm(d, axis=1)
        beam = d / r[:, None]
        az, el = np.arctan2(d[:, 1], d[:, 0]), np.arcsin(beam[:, 2])
        level = np.stack([-np.sin(az), np.cos(az), np.zeros(len(p))], axis=1)
        up = np.cross(beam, level)
        size, (a, b, c, f) = ENCODER[0] + ENCODER[1] * r, self.encoder
        own = [
            self.range_offset + self.scale * r,
            size * (a * np.sin(az) + b * np.cos(az)),
            size * (c * np.sin(2 * el) + f * np.cos(2 * el)),
        ]
        whole = np.stack(own, axis=1) + error
        seen = d + (whole[:, :, None] * np.stack([beam, level, up], axis=1)).sum(axis=1)
        return seen, self.frame[:3, :3].T @ R @ turn(np.array(self.angles))

    def _noise(self, m, rng):
        """Standard normal numbers (m, 3), all of them remembered where there is a memory."""
        e = rng.normal(size=(m, 3))
        if not self.memory:
            return e
        keep = np.exp(-1 / self.memory)
        for k in range(1, m):
            e[k] = keep * e[k - 1] + np.sqrt(1 - keep**2) * e[k]
        return e


def with_constants(tracker, rng):
    """The tracker with errors of its own, drawn from what it states of them."""
    drawn = {name: sd * rng.normal(size=len(sd)) for name, sd in CONSTANTS_SD.items()}
    drawn["range_offset"] = rng.uniform(-2.5e-6, 2.5e-6, 1)
    drawn["angles"] = np.radians(0.005) * rng.uniform(-1, 1, 3)
    return replace(tracker, **drawn)


def shared_columns(tracker, arm, q):
    """Readings' derivative (m, 6, 12) by its constants, each in its own sd, frame of the robot."""
    p, R = arm.poses(q)
    tracker = replace(tracker, **{name: 0 * sd for name, sd in CONSTANTS_SD.items()})
    frame, columns = tracker.frame[:3, :3], []
    plain, plain_R = tracker.shown(p, R)
    for name, sd in CONSTANTS_SD.items():
        for k in range(len(sd)):
            step = 1e-2 * sd * np.eye(len(sd))[k]
            seen, turned = replace(tracker, **{name: step}).shown(p, R)
            d = turned @ np.swapaxes(plain_R, 1, 2)
            w = np.stack(
                [d[:, 2, 1] - d[:, 1, 2], d[:, 0, 2] - d[:, 2, 0], d[:, 1, 0] - d[:, 0, 1]]
            )
            both = np.concatenate([(seen - plain) @ frame.T, (w.T / 2) @ frame.T], axis=1)
            columns.append(both / 1e-2)
    return np.stack(columns, axis=2)


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


JOINTS = ",".join(f"q{i}_deg" for i in range(1, 7))
HEADER = f"pose_id,split,{JOINTS},x_mm,y_mm,z_mm,qw,qx,qy,qz,ux_mm,uy_mm,uz_mm,payload_kg"


def write_program(folder, q, payload):
    """program.csv of targets (m, 6) at which so much is carried [kg]."""
    rows = [",".join(map(repr, [*map(float, row), payload])) for row in np.degrees(q)]
    (folder / "program.csv").write_text("\n".join([f"{JOINTS},payload_kg", *rows]) + "\n")
    return folder / "program.csv"


def write_campaign(folder, arm, tracker, rng, train, held_out, settings=""):
    """session.toml and poses.csv of one visit in random order; joints (m, 6) and (n, 6)."""
    q = np.concatenate([train, held_out])
    order = rng.permutation(len(q))
    words = np.array(["identify"] * len(train) + ["test"] * len(held_out))
    p, R = tracker.read(arm, q[order], rng)
    rotation = quaternions(R)
    along, across, turned = tracker.stated(arm.poses(q[order])[0])
    # one number for every axis, as a device prints it: between the beam and across
    u = np.sqrt((along**2 + 2 * across**2) / 3)
    lines = [HEADER]
    for k, row in enumerate(order):
        cells = [*np.degrees(q[row]), *(1e3 * p[k]), *rotation[k], *[1e3 * u[k]] * 3, arm.payload]
        lines.append(f"{row},{words[row]}," + ",".join(repr(float(c)) for c in cells))
    (folder / "poses.csv").write_text("\n".join(lines) + "\n")
    (folder / "session.toml").write_text(
        'robot = "staubli_tx60"\n\n[joints]\nfile = "poses.csv"\nsource = "commanded"\n\n'
        '[frames]\nfile = "poses.csv"\n\n'
        f"[uncertainty]\nrotation_mdeg = {1e3 * float(np.degrees(turned[0]))!r}\n{settings}"
    )
    return folder / "session.toml"
