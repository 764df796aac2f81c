"""Ladders of what follows the rows: approach, reported torques, gears, and the warmth of the arm.

Each is offered only where rows say what it needs, and says in words why where it is not.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from calib.arrays import Array, Bool
from calib.geometry.bodies import Z
from calib.geometry.gravity import Weight, weight_of
from calib.geometry.joint_errors import NO_JOINT, JointErrors, JointTerm, Wave
from calib.geometry.model import RobotModel
from calib.identification.levels import Ladder, Level
from calib.information.sizes import GROWTH, usual_sizes
from calib.measurement.observations import Measurements

EXPANSION = {"steel": 12e-6, "aluminium": 23e-6}
"""Expansion of what links are made of [1/K]."""
STEADY = 1e-3
"""A temperature or torque that moves by no more does not change [K, N m]."""
ALIKE = 1e-3
"""Phases of a wave that differ by no more are the same [rad]."""
OTHER_UNIT = 50.0
"""Reported torques so many times those of gravity, or so many times less, are in another unit:
masses that nobody states are guessed to about a factor of three."""
HEAVY = 0.1
"""Joints are compared where gravity pulls by more than this part of its largest torque."""


@dataclass(frozen=True, slots=True, eq=False)
class RowTerms:
    """What is known of rows for terms that follow them."""

    gear: tuple[tuple[float, ...], ...] = ()
    """(n,) waves a turn that each drive may leave; empty where nobody states any."""
    expansion: float = EXPANSION["steel"]
    """Of the links, about which the prior lies [1/K]."""
    current: bool = False
    """Whether drives report currents [A] instead of torques."""
    unsaid: Mapping[str, str] = field(default_factory=dict)
    """Ladder to the reason why its rows are silent, where more is known than that."""
    weight: Weight | None = None
    """What loads the joints, which reported torques are judged by; guessed by default."""


NOTHING_KNOWN = RowTerms()
UNUSUAL = Level("none", usual=True)
"""Nothing, and so in the model that is shown where nobody asked for more."""


def row_ladders(
    nominal: RobotModel,
    measurements: Measurements,
    known: RowTerms = NOTHING_KNOWN,
) -> tuple[Ladder, ...]:
    """Ladders of approach, torque, gear and lengths.

    Parameters
    ----------
    nominal : RobotModel
        What terms are added to.
    measurements : Measurements
        What is identified from: its rows say what can be offered.
    known : RowTerms, optional
        What else is known of them.
    """
    return (
        _approach(nominal, measurements, known),
        _torque(nominal, measurements, known),
        _gear(nominal, measurements, known),
        _lengths(nominal, measurements, known),
    )


def _ladder(
    name: str,
    nominal: RobotModel,
    terms: list[JointTerm],
    why: list[str],
    mean: float = 0.0,
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
    """Half the play of each joint that comes from both sides."""
    side = measurements.conditions.approach
    if side is None or not side.any():
        unsaid = known.unsaid.get("approach", "the order of the poses is not known")
        return _ladder("approach", nominal, [], [unsaid])
    both = (side > 0).any(axis=0) & (side < 0).any(axis=0)
    why = [f"joint {i + 1} always comes from one side" for i in np.flatnonzero(~both)]
    terms = [_on_joint(nominal, f"approach{i + 1}", i, "approach") for i in np.flatnonzero(both)]
    return _ladder("approach", nominal, terms, why)


def _torque(nominal: RobotModel, measurements: Measurements, known: RowTerms) -> Ladder:
    """What each joint gives way under the torque that its drive reports."""
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
    """Whether torques cannot be those of the arm in N m, in words; empty if they can."""
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
    """A pair of waves at every stated order."""
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
    """Sine and cosine of a wave at any number of waves a turn of one joint."""
    weights = tuple(order * float(k == joint) for k in range(n_joints))
    return (
        JointTerm(f"gear{joint + 1}.sin{order:g}", joint, "sin", weights),
        JointTerm(f"gear{joint + 1}.cos{order:g}", joint, "cos", weights),
    )


def _on_grid(q: Array, order: float) -> bool:
    """Whether a wave has no more than two phases at joint values (m,): no pair can be told."""
    turn = np.exp(1j * order * (q - q[0]))
    return bool((np.abs(turn**2 - 1) < 2 * ALIKE).all())


def _lengths(nominal: RobotModel, measurements: Measurements, known: RowTerms) -> Ladder:
    """All lengths of a warm arm."""
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
            f"temperature moves by {span:.2g} K, {1e6 * effect:.2g} um at the tip, below the noise"
        )
        return _ladder("lengths", nominal, [], [why])
    n = nominal.chain.n_joints
    term = JointTerm("lengths", NO_JOINT, "lengths", (0,) * n, float(warmth.mean()))
    return _ladder("lengths", nominal, [term], [], known.expansion)


def _on_joint(
    nominal: RobotModel, name: str, joint: int | np.integer, wave: Wave, reference: float = 0.0
) -> JointTerm:
    """A term of one joint that follows what rows say of the same joint."""
    weights = tuple(int(k == joint) for k in range(nominal.chain.n_joints))
    return JointTerm(name, int(joint), wave, weights, reference)
