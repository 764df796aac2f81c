"""Ladders of backlash, torques, gear waves, expansion and travel, by what rows state.

Each is offered only if the rows state what it needs; if not, it says why in words.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from calib.arrays import Array, Bool
from calib.geometry.bodies import Z
from calib.geometry.gravity import Weight, weight_of
from calib.geometry.joint_errors import NO_JOINT, JointErrors, JointTerm, Wave
from calib.geometry.model import RobotModel
from calib.geometry.parameters import CHARACTERISTIC_LENGTH, PER_METER, SCALE_OF
from calib.identification.levels import Ladder, Level
from calib.information.sizes import GROWTH, usual_sizes
from calib.measurement.observations import Measurements
from calib.shown import length_words

EXPANSION = {"steel": 12e-6, "aluminium": 23e-6}
"""Thermal expansion of materials of links [1/K]."""
STEADY = 1e-3
"""A temperature [K] or torque [N m] whose range is no larger counts as constant."""
STILL = 1e-6
"""A slide whose travel is no larger never moves [m]."""
ALIKE = 1e-3
"""Phases of a wave that differ by no more count as equal [rad]."""
OTHER_UNIT = 50.0
"""Reported torques larger or smaller than those of gravity by this factor are in another unit;
unknown masses are assumed to within a factor of about three."""
HEAVY = 0.1
"""Torques are compared at joints whose gravity torque exceeds this part of the largest one."""


@dataclass(frozen=True, slots=True, eq=False)
class RowTerms:
    """Facts about a robot and its rows that terms of operating conditions need."""

    gear: tuple[tuple[float, ...], ...] = ()
    """(n,) orders, in waves per revolution, of the waves of each drive; empty if none is stated."""
    expansion: float = EXPANSION["steel"]
    """Thermal expansion of the links, the mean of its prior [1/K]."""
    current: bool = False
    """Whether drives report currents [A] instead of torques."""
    unsaid: Mapping[str, str] = field(default_factory=dict)
    """Reason, by name of the ladder, why the rows do not state what it needs."""
    weight: Weight | None = None
    """Gravity load of the arm, to judge reported torques by; assumed masses by default."""


NOTHING_KNOWN = RowTerms()
UNUSUAL = Level("none", usual=True)
"""The empty level, which is also that of the extended model if the climb takes none."""


def row_ladders(
    nominal: RobotModel, measurements: Measurements, known: RowTerms = NOTHING_KNOWN
) -> tuple[Ladder, ...]:
    """Ladders of approach, torque, gear and lengths, and of the travel of an arm with slides.

    Parameters
    ----------
    nominal : RobotModel
        Model that terms are added to.
    measurements : Measurements
        Training rows, whose conditions decide what can be offered.
    known : RowTerms, optional
        Further facts that the terms need.
    """
    offered = (
        _approach(nominal, measurements, known),
        _torque(nominal, measurements, known),
        _gear(nominal, measurements, known),
        _lengths(nominal, measurements, known),
    )
    slides = nominal.chain.prismatic.any()
    return (*offered, travel_ladder(nominal, measurements.q)) if slides else offered


def _ladder(
    name: str, nominal: RobotModel, terms: list[JointTerm], why: list[str], mean: float = 0.0
) -> Ladder:
    """A ladder of one level, with the terms that the model does not have yet."""
    has = set(nominal.joint_errors.names)
    new = tuple(term for term in terms if term.name not in has)
    if terms and not new:
        why = [*why, "the model has it already"]
    errors = JointErrors(new)
    sd = usual_sizes(errors, nominal.chain.kinds)
    level = Level(name, errors, sd, mean=np.full(len(new), mean))
    said = tuple(f"{name}: {each}" for each in why)
    return Ladder(name, (UNUSUAL, level) if new else (UNUSUAL,), said)


def _approach(nominal: RobotModel, measurements: Measurements, known: RowTerms) -> Ladder:
    """Ladder of half the backlash of each joint that is approached from both sides."""
    side = measurements.conditions.approach
    if side is None or not side.any():
        unsaid = known.unsaid.get("approach", "the order of the poses is not known")
        return _ladder("approach", nominal, [], [unsaid])
    both = (side > 0).any(axis=0) & (side < 0).any(axis=0)
    why = [f"joint {i + 1} always comes from one side" for i in np.flatnonzero(~both)]
    terms = [_on_joint(nominal, f"approach{i + 1}", i, "approach") for i in np.flatnonzero(both)]
    return _ladder("approach", nominal, terms, why)


def _torque(nominal: RobotModel, measurements: Measurements, known: RowTerms) -> Ladder:
    """Ladder of the compliance of each joint under the torque that its drive reports."""
    load = measurements.conditions.torque
    if load is None:
        why = known.unsaid.get("torque", "the file has no such columns")
        return _ladder("torque", nominal, [], [why])
    odd = "" if known.current else _in_other_unit(nominal, measurements, known.weight)
    if odd:
        return _ladder("torque", nominal, [], [odd])
    moves = np.ptp(load, axis=0) > STEADY
    what = "current" if known.current else "torque"
    still = [f"joint {i + 1}: the {what} never changes" for i in np.flatnonzero(~moves)]
    usual, largest = load.mean(axis=0), np.abs(load).max(axis=0)
    some = np.flatnonzero(moves)
    terms = [_on_joint(nominal, f"torque{i + 1}", i, "torque", float(usual[i])) for i in some]
    sized = [replace(t, share=1 / float(largest[t.joint])) for t in terms]
    return _ladder("torque", nominal, sized, still)


def _in_other_unit(nominal: RobotModel, measurements: Measurements, weight: Weight | None) -> str:
    """Sentence on why reported torques cannot be in N m; empty if they can."""
    at, load = measurements.conditions, measurements.conditions.torque
    assert load is not None  # asked for only where there are some
    own = weight_of(nominal.chain) if weight is None else weight
    torques = own.torques(measurements.q, payload=at.moments)[:, :, Z]
    pull = np.sqrt(np.square(torques).mean(axis=0))
    heavy: Bool = pull > HEAVY * pull.max(initial=0.0)
    if not heavy.any():
        return ""
    reported = np.sqrt(np.square(load[:, heavy]).mean(axis=0))
    if not reported.any():
        return ""
    ratio = float(np.median(reported[reported > 0] / pull[heavy][reported > 0]))
    if 1 / OTHER_UNIT < ratio < OTHER_UNIT:
        return ""
    joint = int(np.argmax(np.where(heavy, pull, 0.0)))
    most = float(np.sqrt(np.square(load[:, joint]).mean()))
    return (
        f"joint {joint + 1} reports about {most:.2g} N m where gravity asks for about "
        f"{pull[joint]:.2g} N m: they are in another unit"
    )


def _gear(nominal: RobotModel, measurements: Measurements, known: RowTerms) -> Ladder:
    """Ladder of a sine and a cosine at every stated order of a drive."""
    if not any(known.gear):
        return _ladder("gear", nominal, [], ["no ratio or order is stated"])
    terms: list[JointTerm] = []
    why = []
    for i, orders in enumerate(known.gear):
        if orders and nominal.chain.kinds[i] == "prismatic":
            why.append(f"joint {i + 1} does not turn")
            continue
        for order in orders:
            if _on_grid(measurements.q[:, i], order):
                why.append(
                    f"joint {i + 1}, {order:g} waves a turn: all its values lie on a grid of "
                    f"{360 / order:.4g} deg, or of half of it"
                )
                continue
            terms += gear_terms(nominal.chain.n_joints, i, order)
    return _ladder("gear", nominal, terms, why)


def gear_terms(n_joints: int, joint: int, order: float) -> tuple[JointTerm, JointTerm]:
    """Sine and cosine terms of one joint at any order, in waves per revolution."""
    weights = tuple(order * float(k == joint) for k in range(n_joints))
    return (
        JointTerm(f"gear{joint + 1}.sin{order:g}", joint, "sin", weights),
        JointTerm(f"gear{joint + 1}.cos{order:g}", joint, "cos", weights),
    )


def _on_grid(q: Array, order: float) -> bool:
    """Whether a wave has at most two phases at joint values (m,), too few for sine and cosine."""
    turn = np.exp(1j * order * (q - q[0]))
    return bool((np.abs(turn**2 - 1) < 2 * ALIKE).all())


def _lengths(nominal: RobotModel, measurements: Measurements, known: RowTerms) -> Ladder:
    """Ladder of the thermal expansion of all lengths."""
    warmth = measurements.conditions.temperature
    if warmth is None:
        unsaid = known.unsaid.get("lengths", "the file gives no temperature")
        return _ladder("lengths", nominal, [], [unsaid])
    span = float(np.ptp(warmth))
    if span <= STEADY:
        why = f"the temperature never changes ({warmth[0]:.4g} degC)"
        return _ladder("lengths", nominal, [], [why])
    reach = float(np.abs(nominal.chain.links[:, 1:3]).sum())
    effect = (known.expansion + GROWTH) * span * reach
    position = np.diagonal(measurements.covariance[:, :3, :3], axis1=1, axis2=2)
    noise = float(np.sqrt(np.median(position[:, 0])))
    if effect < noise:
        why = (
            f"temperature moves by {span:.2g} K, {length_words(effect)} at the tip, below the noise"
        )
        return _ladder("lengths", nominal, [], [why])
    n = nominal.chain.n_joints
    term = JointTerm("lengths", NO_JOINT, "lengths", (0,) * n, float(warmth.mean()))
    return _ladder("lengths", nominal, [term], [], known.expansion)


def travel_ladder(nominal: RobotModel, q: Array) -> Ladder:
    """Ladder of the scale of every slide that moves in joints q (m, n): by which part too far."""
    terms, why = [], []
    for i in np.flatnonzero(nominal.chain.prismatic).tolist():
        if np.ptp(q[:, i]) <= STILL:
            why.append(f"joint {i + 1} never moves")
            continue
        weights = tuple(PER_METER * float(k == i) for k in range(nominal.chain.n_joints))
        share = 1 / (PER_METER * CHARACTERISTIC_LENGTH)
        terms.append(JointTerm(f"{SCALE_OF}{i + 1}", i, "sin", weights, share=share))
    return _ladder("travel", nominal, terms, why)


def _on_joint(
    nominal: RobotModel, name: str, joint: int | np.integer, wave: Wave, reference: float = 0.0
) -> JointTerm:
    """A term of one joint, linear in the condition of the same joint."""
    weights = tuple(int(k == joint) for k in range(nominal.chain.n_joints))
    return JointTerm(name, int(joint), wave, weights, reference)
