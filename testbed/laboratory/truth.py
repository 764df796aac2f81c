"""The true robot: drawn in secret around the nominal one, and played by MuJoCo."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, check
from calib.errors import InputError
from calib.geometry.chain import Chain, chain_names, forward, joint_vectors
from calib.geometry.joint_errors import JointErrors, gravity_terms, harmonic_terms
from calib.geometry.model import RobotModel
from testbed.laboratory.simulator import Simulator
from testbed.robots.catalog import Robot
from testbed.robots.placements import link_poses
from testbed.robots.strict_toml import did_you_mean
from testbed.scenario import TruthSettings
from testbed.streams import stream

LINKS = "links"
"""Value of `perturb` that means every link number."""
UPRIGHT = np.radians(1.0)
"""An arm this close to upright counts as upright [rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class TrueRobot:
    """What stands in the laboratory."""

    model: RobotModel
    """Geometry and joint errors [m, rad]."""
    joint_repeatability: Array
    """(n,) standard deviation of each joint at each approach [rad or m]."""
    simulator: Simulator = field(init=False, repr=False)
    """The same geometry as a MuJoCo body tree."""

    def __post_init__(self) -> None:
        n = self.model.chain.n_joints
        (sd,) = check(f"{n}", joint_repeatability=self.joint_repeatability)
        if (sd < 0).any():
            raise InputError(
                f"joint_repeatability is {sd.min():g}",
                code="A3",
                field="joint_repeatability",
                value=float(sd.min()),
                allowed="standard deviations are not negative",
            )
        object.__setattr__(self, "joint_repeatability", sd)
        object.__setattr__(self, "simulator", Simulator(None, self.model.chain))

    def poses(self, q: ArrayLike, *, rng: np.random.Generator | None = None) -> Array:
        """True tool poses T_world_tool (m, 4, 4) at commanded joints q (m, n) [rad, m].

        Each row is one approach. Without `rng` the joints stop where their errors put them; with it
        every approach also has its own joint repeatability.
        """
        q = joint_vectors(self.model.chain, q)
        reached = q + self.model.joint_errors.offsets(q)
        if rng is not None:
            reached = reached + rng.standard_normal(q.shape) * self.joint_repeatability
        return self.simulator.poses(reached)


def draw_truth(robot: Robot, truth: TruthSettings, seed: int) -> TrueRobot:
    """Draw the true robot of a scenario.

    Every term has its own stream, and every number of the chain its own place in it: switching one
    term on or off, or perturbing other numbers, never moves the rest.

    Parameters
    ----------
    robot : Robot
        Nominal robot; its own repeatability is used where the scenario leaves it open.
    truth : TruthSettings
        How far the true robot lies from the nominal one.
    seed : int
        Seed of the scenario.

    References
    ----------
    Magnitudes after what fits to measured arms of this size leave behind: 0.02 deg and 0.12 mm of
    geometry, joint sag and gear harmonics of some millidegrees (assumed, not a maker's figures).
    """
    chain = robot.model.chain.moved(
        geometry_step(robot, truth, stream(seed, "truth", "geometry"))
        + frame_step(robot.model.chain.n_joints, truth, stream(seed, "truth", "frames"))
    )
    errors = JointErrors()
    if any(truth.gravity_mdeg):
        errors = joined(errors, gravity(robot.model.chain, mdeg(truth.gravity_mdeg)))
    if truth.harmonic_mdeg:
        rng = stream(seed, "truth", "harmonics")
        errors = joined(errors, harmonics(robot.model.chain, mdeg(truth.harmonic_mdeg), rng))
    return TrueRobot(RobotModel(chain, errors), joint_repeatability(robot, truth))


def mdeg(value: ArrayLike) -> Array:
    """Thousandths of a degree in rad."""
    return np.asarray(np.radians(np.asarray(value, dtype=np.float64) * 1e-3))


def geometry_step(robot: Robot, truth: TruthSettings, rng: np.random.Generator) -> Array:
    """Normal errors (12 + 5 n,) of the perturbed numbers, zero for all others [m, rad]."""
    model = robot.model
    sd = np.where(model.is_length, truth.length_sd_mm / 1e3, np.radians(truth.angle_sd_deg))
    chosen = perturbed_names(robot, truth.perturb)
    mask = np.array([name in chosen for name in model.names])
    # drawn for all numbers, so that a number's error does not depend on which others are chosen
    return np.where(mask, sd * rng.standard_normal(model.n_numbers), 0.0)[: model.chain.n_numbers]


def perturbed_names(robot: Robot, perturb: str | tuple[str, ...]) -> frozenset[str]:
    """Names of the chain numbers that `perturb` stands for: links, a free set, or a list.

    Raises
    ------
    InputError
        If the robot has no such free set, or its chain no such number.
    """
    known = chain_names(robot.model.chain.n_joints)
    if perturb == LINKS:
        return frozenset(known[6:-6])
    if isinstance(perturb, str):
        choices = (LINKS, *robot.free_sets)
        if perturb not in robot.free_sets:
            raise InputError(
                f'[truth] perturb = "{perturb}" is no free set of {robot.name}',
                code="S37",
                field="truth.perturb",
                value=perturb,
                allowed=f"{', '.join(choices)}, or a list of names",
                fix=did_you_mean(perturb, choices),
            )
        return frozenset(robot.free_sets[perturb])
    for name in perturb:
        if name not in known:
            raise InputError(
                f'[truth] perturb has "{name}", no number of {robot.name}',
                code="S37",
                field="truth.perturb",
                value=name,
                allowed=f"names such as {known[0]}, {known[6]}, {known[-1]}",
                fix=did_you_mean(name, known),
            )
    return frozenset(perturb)


def frame_step(n_joints: int, truth: TruthSettings, rng: np.random.Generator) -> Array:
    """Normal errors of the base and tool frames, zero for the links (12 + 5 n,) [m, rad]."""
    sd = np.repeat([truth.frame_sd_mm / 1e3, np.radians(truth.frame_sd_deg)], 3)
    base, tool = rng.standard_normal((2, 6)) * sd
    return np.concatenate([base, np.zeros(5 * n_joints), tool])


def gravity(chain: Chain, amplitudes: Array) -> JointErrors:
    """Sag of joints 2 and 3 with amplitudes g1, g2, g3 [rad]: dq2 = g1 sin q2 + g2 sin(q2+q3), ...

    Raises
    ------
    InputError
        If the arm is not one the closed form holds for; see `is_candle`.
    """
    if not is_candle(chain):
        raise InputError(
            "[truth] gravity_mdeg does not fit this arm",
            code="S37",
            field="truth.gravity_mdeg",
            value=tuple(np.degrees(amplitudes * 1e3).round(9).tolist()),
            allowed="joints 2 and 3 with level parallel axes, and an upright arm at joint zero",
            fix='write gravity_mdeg = [0, 0, 0] or preset = "rigid"',
        )
    return JointErrors(gravity_terms(chain.n_joints), amplitudes)


def is_candle(chain: Chain) -> bool:
    """Whether joints 2 and 3 turn about level parallel axes, and the arm stands upright at zero.

    Only then do the torques of gravity go with sin q2 and sin(q2 + q3).
    """
    if chain.n_joints < 3 or "prismatic" in chain.kinds[1:3]:
        return False
    bodies = link_poses(chain, np.zeros((1, chain.n_joints)))[0]
    slack = np.sin(UPRIGHT)
    axis, shoulder, elbow = bodies[2, :3, 2], bodies[2, :3, 3], bodies[3, :3, 3]
    # opposite axes are out as well: the forearm would lean by q2 - q3
    level = abs(axis[2]) <= slack and axis @ bodies[3, :3, 2] >= np.cos(UPRIGHT)
    for arm in (elbow - shoulder, forward(chain, np.zeros((1, chain.n_joints)))[0, :3, 3] - elbow):
        across = arm - axis * (axis @ arm)  # the part that gravity turns
        level = level and across[2] >= np.cos(UPRIGHT) * np.linalg.norm(across)
    return bool(level)


def harmonics(chain: Chain, amplitude: float | Array, rng: np.random.Generator) -> JointErrors:
    """Gear errors of every revolute joint: dq = h [A sin(q + phi1) + 0.5 B sin(2 q + phi2)].

    A and B are uniform on 0.5 to 1.5, the phases on a full turn, drawn anew for each joint;
    `amplitude` is h [rad].
    """
    n = chain.n_joints
    size = rng.uniform(0.5, 1.5, (n, 2)) * [1.0, 0.5]
    phase = rng.uniform(0.0, 2 * np.pi, (n, 2))
    # A sin(kq + phi) = (A cos phi) sin kq + (A sin phi) cos kq; terms run joint, order, sin, cos
    parts = amplitude * size[..., None] * np.stack([np.cos(phase), np.sin(phase)], axis=-1)
    turning = [kind == "revolute" for kind in chain.kinds for _ in range(4)]
    terms = [term for term, turns in zip(harmonic_terms(n), turning, strict=True) if turns]
    return JointErrors(tuple(terms), parts.ravel()[turning])


def joined(first: JointErrors, second: JointErrors) -> JointErrors:
    """Both sums of joint terms as one."""
    return JointErrors(
        (*first.terms, *second.terms),
        np.concatenate([first.coefficients, second.coefficients]),
    )


def joint_repeatability(robot: Robot, truth: TruthSettings) -> Array:
    """Standard deviation of each joint (n,) [rad or m]; the robot's own where truth says None.

    A number in the scenario is an angle: sliding joints keep their own, or none if it is zero.
    """
    if truth.joint_repeatability_mdeg is None:
        return robot.repeatability
    value = float(mdeg(truth.joint_repeatability_mdeg))
    slides = robot.model.chain.prismatic.astype(bool)
    return np.where(slides, robot.repeatability * bool(value), value)
