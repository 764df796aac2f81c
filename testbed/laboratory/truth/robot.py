"""The true robot: drawn in secret around the nominal one, and played by MuJoCo."""

from dataclasses import dataclass, field
from functools import partial, reduce
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array
from calib.errors import refuse
from calib.geometry.bodies import Z, bent_forward
from calib.geometry.chain import Chain, chain_names, joint_vectors
from calib.geometry.joint_errors import JointErrors
from calib.geometry.model import RobotModel
from calib.geometry.operating import OperatingConditions
from testbed.laboratory.bench import joint_repeatability
from testbed.laboratory.simulator import Simulator
from testbed.laboratory.truth.springs import ElasticArm
from testbed.laboratory.truth.terms import Approach, Springs, Thermal, UnmodelledTerms, backlash
from testbed.laboratory.truth.waves import (
    encoder,
    gear,
    gravity,
    harmonics,
    high_harmonics,
    mdeg,
    per_joint,
    transmission,
)
from testbed.names import choice_of
from testbed.robots.catalog import Robot
from testbed.scenario.laboratory import TruthSettings
from testbed.scenario.truth import require_truth
from testbed.streams import stream

if TYPE_CHECKING:
    from testbed.laboratory.truth.moving import MovingArm

LINKS = "links"
"""Value of `perturb` that means every link number."""


@dataclass(frozen=True, slots=True, eq=False)
class TrueRobot:
    """What stands in the laboratory."""

    model: RobotModel
    """Geometry and joint errors [m, rad]."""
    joint_repeatability: Array
    """(n,) standard deviation of each joint at each approach [rad or m]."""
    unmodelled: UnmodelledTerms = field(default_factory=UnmodelledTerms)
    """Backlash, thermal growth, springs and motion, which `model` cannot hold."""
    _simulator: "Simulator | ElasticArm | MovingArm | None" = field(
        init=False, repr=False, default=None
    )

    @property
    def simulator(self) -> "Simulator | ElasticArm | MovingArm":
        """The same geometry as a MuJoCo body tree, sprung where the arm gives way.

        It is built where it is asked for first.
        """
        if self._simulator is None:
            object.__setattr__(self, "_simulator", _arm(self.model.chain, self.unmodelled))
        assert self._simulator is not None
        return self._simulator

    def poses(
        self,
        q: ArrayLike,
        *,
        rng: np.random.Generator | None = None,
        normal: Array | None = None,
        time: Array | None = None,
        previous: Array | None = None,
        moves: Array | None = None,
        payload: Array | None = None,
    ) -> Array:
        """True tool poses T_world_tool (m, 4, 4) at commanded joints q (m, n) [rad, m].

        Each row is one approach. Without `rng` or `normal` the joints stop where their errors put
        them; with it every approach also has its own joint repeatability.

        Parameters
        ----------
        q : (m, n) array_like
            Commanded joints [rad, m].
        rng : Generator, optional
            Joint repeatability of each approach.
        normal : (m, n) array, optional
            Its standard normal numbers, where they are drawn already.
        time : (m,) array, optional
            Since the start of the campaign; a cold robot by default [s].
        previous : (m, n) array, optional
            Where each move came from; all joints at zero by default [rad, m].
        moves : (m, n) array, optional
            Direction of each joint's last move, 1, -1, or 0 if there was none; by default that of
            this one.
        payload : (m,) array, optional
            What hangs on a sprung arm instead of the usual [kg].
        """
        q = joint_vectors(self.model.chain, q)
        before = np.zeros_like(q) if previous is None else previous
        last = np.sign(q - before) if moves is None else moves
        met = OperatingConditions(approach=last)  # play that its maker states
        reached, scatter = q + self.model.joint_errors.of_terms(q, met), np.zeros_like(q)
        if self.unmodelled.backlash is not None:
            reached = reached + self.unmodelled.backlash.offsets(q, last)
        if rng is not None:
            normal = rng.standard_normal(q.shape)
        if normal is not None:
            scatter = normal * self.joint_repeatability
        growth = None
        if self.unmodelled.thermal is not None:
            growth = self.unmodelled.thermal.growth(np.zeros(len(q)) if time is None else time)
        errors = self.model.joint_errors
        if errors.springs is not None:  # those that its maker states
            bends = errors.springs.bends(q, errors.of_springs)
            bends[:, :, Z] += reached + scatter - q
            return bent_forward(self.model.chain, q, bends, growth)
        if isinstance(self.simulator, Simulator):
            return self.simulator.poses(reached + scatter, growth=growth)
        if isinstance(self.simulator, ElasticArm):
            return self.simulator.poses(reached + scatter, growth=growth, payload=payload)
        return self.simulator.poses(
            reached, travel=q - before, scatter=scatter, growth=growth, payload=payload
        )


def _arm(chain: Chain, terms: UnmodelledTerms) -> "Simulator | ElasticArm | MovingArm":
    """What plays a geometry: rigid, at rest on its springs, or in motion."""
    if terms.springs is None:
        return Simulator(None, chain)
    if terms.motion is None:
        return ElasticArm(chain, terms.springs)
    from testbed.laboratory.truth.moving import MovingArm

    return MovingArm(chain, terms.springs, terms.motion)


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
    require_truth(robot, truth)
    nominal = robot.model.chain
    chain = nominal.moved(
        geometry_step(robot, truth, stream(seed, "truth", "geometry"))
        + frame_step(nominal.n_joints, truth, stream(seed, "truth", "frames"))
    )
    errors = [robot.model.joint_errors]
    if any(truth.gravity_mdeg):
        errors.append(gravity(nominal, mdeg(truth.gravity_mdeg)))
    for name, amplitude, drawn in (
        ("harmonics", truth.harmonic_mdeg, harmonics),
        ("high harmonics", truth.high_harmonic_mdeg, high_harmonics),
        (
            "transmission",
            truth.transmission_mdeg,
            partial(transmission, orders=truth.transmission_waves),
        ),
        ("encoder", truth.encoder_mdeg, partial(encoder, periods=truth.encoder_periods)),
        ("gear", truth.gear_mdeg, partial(gear, ratio=truth.gear_ratio)),
    ):
        if np.any(amplitude):
            size = per_joint(nominal, amplitude)
            errors.append(drawn(nominal, size, stream(seed, "truth", name)))
    model = RobotModel(chain, reduce(JointErrors.joined, errors))
    return TrueRobot(model, joint_repeatability(robot, truth), unmodelled_terms(robot, truth))


def unmodelled_terms(robot: Robot, truth: TruthSettings) -> UnmodelledTerms:
    """Backlash, thermal growth, springs and motion of a scenario; no random numbers are drawn."""
    chain, play, warmth, springs, motion = robot.model.chain, None, None, None, None
    if np.any(truth.backlash_mdeg):
        width = np.where(chain.prismatic, 0.0, per_joint(chain, truth.backlash_mdeg))
        play = backlash(robot, truth, width / 2)
    if truth.thermal_k:
        warmth = Thermal(truth.thermal_k, truth.thermal_h * 3600, truth.thermal_um_per_m_k * 1e-6)
    if truth.drive_nm_per_mrad:
        springs = Springs(
            robot.masses,
            robot.centers,
            robot.inertias,
            np.array(truth.drive_nm_per_mrad) * 1e3,
            np.array(truth.bearing_nm_per_mrad) * 1e3,
            truth.payload_kg,
            np.array(truth.payload_center_mm) / 1e3,
            payloads=np.array(truth.payloads_kg),
        )
    if truth.motion:
        motion = Approach(
            np.minimum(np.radians(truth.speed_deg_s), robot.speeds),
            truth.speed_mm_s / 1e3,
            np.radians(truth.approach_deg),
            truth.dwell_s,
            np.broadcast_to(np.asarray(truth.friction_nm, dtype=np.float64), (chain.n_joints,)),
            truth.damping,
        )
    return UnmodelledTerms(play, warmth, springs, motion)


def geometry_step(robot: Robot, truth: TruthSettings, rng: np.random.Generator) -> Array:
    """Normal errors (12 + 5 n,) of the perturbed numbers, zero for all others [m, rad]."""
    model = robot.model
    sd = np.where(model.is_length, truth.length_sd_mm / 1e3, np.radians(truth.angle_sd_deg))
    letters = np.array([name.rstrip("0123456789") for name in model.names])
    sd[np.isin(letters, ("alpha", "beta"))] *= truth.twist_share
    sd[letters == "d"] *= truth.offset_share
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
    if isinstance(perturb, str) and perturb in robot.free_sets:
        return frozenset(robot.free_sets[perturb])
    if isinstance(perturb, str):
        known = tuple(dict.fromkeys((LINKS, *robot.free_sets)))
        message = f'[truth] perturb = "{perturb}" is no free set of {robot.name}'
        wrong, allowed = [perturb], f"{', '.join(known)}, or a list of names"
    else:
        wrong = [name for name in perturb if name not in known]
        message = f'[truth] perturb has "{"".join(wrong[:1])}", no number of {robot.name}'
        allowed = f"names such as {known[0]}, {known[6]}, {known[-1]}"
    if wrong:
        fix = choice_of(wrong[0], known)
        raise refuse("truth.perturb", wrong[0], allowed, code="S37", message=message, fix=fix)
    return frozenset(perturb)


def frame_step(n_joints: int, truth: TruthSettings, rng: np.random.Generator) -> Array:
    """Normal errors of the base and tool frames, zero for the links (12 + 5 n,) [m, rad]."""
    sd = np.repeat([truth.frame_sd_mm / 1e3, np.radians(truth.frame_sd_deg)], 3)
    base, tool = rng.standard_normal((2, 6)) * sd
    return np.concatenate([base, np.zeros(5 * n_joints), tool])
