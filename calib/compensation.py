"""Targets changed so that the real robot does what the nominal one was meant to do.

A program means the poses that the nominal model gives: T = f0(q). The robot, as identified, goes to
f(q) instead. Two ways out:

* **Joint targets.** The controller passes joints on, so it is given other joints: q' with
  f(q') = f0(q), found by inverting the identified model from q. To first order
  q' = q - J^-1 (f(q) - f0(q)); the inversion goes on until nothing is left.
* **Cartesian targets.** The controller turns poses into joints with its nominal model, which stays
  as it is: given T', it goes to q' with f0(q') = T'. So with f(q') = T the pose to give it is
  T' = f0(q').

An arm of fewer than six joints cannot take the pose of another one, however little they differ: it
is brought to the position, and as near to the rotation as its joints then allow.

Both models must speak of the same world and the same tool: give `nominal` the base and the tool in
which the program is meant. What the identified base moved against it is compensated too.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Bool, check, frozen
from calib.errors import refuse
from calib.geometry.inverse import SINGULAR_CONDITION, Inverse, InverseStatus, inverse_kinematics
from calib.geometry.inverse_search import joint_condition
from calib.geometry.model import RobotModel
from calib.geometry.operating import AS_USUAL, OperatingConditions
from calib.geometry.parameters import CHARACTERISTIC_LENGTH
from calib.kinds import checked_kinds
from calib.measurement.accuracy import position_errors, rotation_errors
from calib.shown import ResultTable, Shown

LARGEST = np.radians(5.0)
"""A correction that moves a joint farther than this comes from a nearly singular posture [rad, and
that times 0.3 m]."""
UNLIMITED = 1e3
"""Farther than any joint goes for a correction [rad, m]."""


class _Corrected(Shown):
    """Targets with a status each."""

    __slots__ = ()
    status: tuple[InverseStatus, ...]

    @property
    def corrected(self) -> Bool:
        """(m,) whether the target is corrected without reserve."""
        return np.array([one == "reached" for one in self.status], dtype=np.bool_)

    @property
    def sentences(self) -> tuple[str, ...]:
        """What is to be looked at, in words; one sentence per kind of trouble."""
        return status_sentences(self.status, "target")


@dataclass(frozen=True, slots=True, eq=False)
class Correction(_Corrected):
    """Joint targets that make the identified robot go where the nominal one was meant to."""

    q: Array
    """(m, n) corrected joint targets inside the limits; where `corrected` is false the nearest
    posture, which may lie far away: keep the given target there [rad, m]."""
    step: Array
    """(m, n) corrected minus given [rad, m]."""
    position_error: Array
    """(m,) what is left, by the identified model [m]."""
    rotation_error: Array
    """(m,) what is left [rad]; of fewer than six joints more than nothing, though "reached"."""
    position_before: Array
    """(m,) how far the identified model is off at the given targets [m]."""
    rotation_before: Array
    """(m,) the same of the angle [rad]."""
    status: tuple[InverseStatus, ...]
    """(m,) "reached", or why the target needs a look: "singular" (corrected, but a joint moves far
    for it or the posture is nearly singular), "limits", "out of reach"."""
    condition: Array
    """(m,) of the joint Jacobian, the larger one before and after the correction."""

    def __repr__(self) -> str:
        left = f"{1e6 * self.position_error.max(initial=0.0):.3g} um"
        return f"Correction({self.corrected.sum()} of {len(self.q)} targets, largest rest: {left})"

    def tables(self) -> dict[str, ResultTable]:
        """``targets``: corrected joints, what is left and what there was [m, rad]."""
        joints = {f"q{k + 1}": q for k, q in enumerate(self.q.T)}
        off = {"before_m": self.position_before, "left_m": self.position_error}
        return {"targets": ResultTable({**joints, **off, "status": self.status})}


@dataclass(frozen=True, slots=True, eq=False)
class PoseCorrection(_Corrected):
    """Cartesian targets for a controller that keeps its nominal model."""

    T: Array
    """(m, 4, 4) what the controller is to be given [m]."""
    q: Array
    """(m, n) the joints it then takes [rad, m]."""
    q_before: Array
    """(m, n) the joints it takes for the target as it was [rad, m]."""
    position_error: Array
    """(m,) how far the identified robot then is from the wanted pose [m]."""
    rotation_error: Array
    """(m,) the same of the angle [rad]."""
    status: tuple[InverseStatus, ...]
    """(m,) as in `Correction`."""
    condition: Array
    """(m,) as in `Correction`."""

    def __repr__(self) -> str:
        return f"PoseCorrection({self.corrected.sum()} of {len(self.q)} targets)"


@checked_kinds
def compensate(
    nominal: RobotModel,
    identified: RobotModel,
    q: ArrayLike,
    limits: ArrayLike | None = None,
    at: OperatingConditions = AS_USUAL,
) -> Correction:
    """Joint targets at which the identified robot has the poses that the nominal one has at `q`.

    Parameters
    ----------
    nominal : RobotModel
        What the program was written for.
    identified : RobotModel
        What the robot is, joint errors included.
    q : (m, n) array_like
        Joint targets of the program [rad, m].
    limits : (n, 2) array_like, optional
        Lower and upper joint limits [rad, m]; none by default. No joint is moved by whole turns
        into them.
    at : OperatingConditions, optional
        Under which the identified robot goes to the targets, one row for each.

    Examples
    --------
    >>> from calib.geometry.chain import Chain
    >>> nominal = RobotModel(Chain([[0, 0, 0.3, 0, 0]]))
    >>> identified = RobotModel(Chain([[0.01, 0, 0.3, 0, 0]]))
    >>> compensate(nominal, identified, [[0.5]]).q.round(12).tolist()
    [[0.49]]
    """
    _same_joints(nominal, identified)
    n = nominal.chain.n_joints
    (q,) = check(f"m {n}", q=q)
    if limits is None:
        # wide about the targets: several turns are no limit
        low, high = (end(axis=0, initial=0.0) for end in (q.min, q.max))
        limits = np.column_stack([low - UNLIMITED, high + UNLIMITED])
    T = nominal.poses(q)
    found = inverse_kinematics(
        identified, T, q, limits, whole_turns=False, position_first=few_joints(identified), at=at
    )
    here = identified.poses(q, at)
    condition = np.maximum(found.condition, joint_condition(identified, q, at))
    return Correction(
        q=found.q,
        step=frozen(found.q - q),
        position_error=found.position_error,
        rotation_error=found.rotation_error,
        position_before=frozen(position_errors(T, here)),
        rotation_before=frozen(rotation_errors(T, here)),
        status=_statuses(identified, found, found.q - q, condition),
        condition=frozen(condition),
    )


@checked_kinds
def corrected_poses(
    nominal: RobotModel,
    identified: RobotModel,
    T: ArrayLike,
    seeds: ArrayLike,
    limits: ArrayLike,
    at: OperatingConditions = AS_USUAL,
) -> PoseCorrection:
    """Cartesian targets that bring the identified robot to `T` through the nominal controller.

    Parameters
    ----------
    nominal : RobotModel
        The controller's own model, which turns its targets into joints.
    identified : RobotModel
        What the robot is, joint errors included.
    T : (m, 4, 4) array_like
        Poses T_world_tool that the program wants [m].
    seeds : (m, n) or (m, s, n) array_like
        Near which joints the controller reaches them: its configuration [rad, m].
    limits : (n, 2) array_like
        Lower and upper joint limits [rad, m].
    at : OperatingConditions, optional
        Under which the identified robot goes to the targets.

    Notes
    -----
    An arm of seven joints reaches T' in many ways, and only its maker knows which one it takes;
    the answer holds for the posture nearest to the one it takes for T. Joint targets leave no
    choice.
    """
    _same_joints(nominal, identified)
    few = few_joints(nominal)
    meant = inverse_kinematics(nominal, T, seeds, limits, position_first=few)
    found = inverse_kinematics(
        identified, T, meant.q, limits, whole_turns=False, position_first=few, at=at
    )
    condition = np.maximum(found.condition, meant.condition)
    reached = _statuses(identified, found, found.q - meant.q, condition)
    # a pose the nominal arm cannot take is no target of its program
    status = tuple(
        first if first in ("limits", "out of reach") else then
        for first, then in zip(meant.status, reached, strict=True)
    )
    return PoseCorrection(
        T=frozen(nominal.poses(found.q)),
        q=found.q,
        q_before=meant.q,
        position_error=found.position_error,
        rotation_error=found.rotation_error,
        status=status,
        condition=frozen(condition),
    )


def few_joints(model: RobotModel, held: int = 0) -> bool:
    """Whether an arm, less joints that are `held`, has too few to take any pose near its own."""
    return model.chain.n_joints - held < 6


def turned_sentences(
    model: RobotModel, status: Sequence[str], left: Array, held: int = 0
) -> tuple[str, ...]:
    """What rotation (m,) [rad] an arm leaves whose joints are few, less those that are `held`."""
    reached = np.array([one == "reached" for one in status], dtype=np.bool_)
    if not few_joints(model, held) or not reached.any():
        return ()
    n = model.chain.n_joints - held
    most, free = np.degrees(left[reached].max()), "free " * bool(held)
    return (
        f"an arm of {n} {free}joint{'s' if n > 1 else ''} cannot turn its tool in every way: "
        "targets are reached with the tool point, and of the rotation up to "
        f"{most:.2g} deg is left",
    )


WORDS: Mapping[str, str] = {
    "singular": "corrected in a nearly singular posture, where a small turn of the tool takes a "
    "large move of the joints; look at the corrected joints, or move the target",
    "limits": "reached only outside the joint limits; the nearest posture inside is given",
    "out of reach": "not reached by the identified robot in a posture near the given one; the "
    "nearest posture is given",
}


def status_sentences(
    status: Sequence[str],
    noun: str,
    words: Mapping[str, str] = WORDS,
    *,
    names: Sequence[str] = (),
) -> tuple[str, ...]:
    """One sentence for each kind of trouble, with the rows it concerns: `names`, else from 1."""
    names = names or [str(k + 1) for k in range(len(status))]
    said = []
    for outcome, meaning in words.items():
        rows = [name for name, one in zip(names, status, strict=True) if one == outcome]
        if rows:
            listed = ", ".join(rows[:10]) + (" ..." if len(rows) > 10 else "")
            many = len(rows) > 1
            said.append(
                f"{len(rows)} of {len(status)} {noun}s {'are' if many else 'is'} {meaning} "
                f"({noun}{'s' if many else ''} {listed})"
            )
    return tuple(said)


def _statuses(
    model: RobotModel, found: Inverse, step: Array, condition: Array
) -> tuple[InverseStatus, ...]:
    """Status of each correction: near singular postures even a reached target is named."""
    unit = np.where(model.chain.prismatic, CHARACTERISTIC_LENGTH, 1.0)
    far = (np.abs(step) > LARGEST * unit).any(axis=1) | (condition > SINGULAR_CONDITION)
    return tuple(
        "singular" if one == "reached" and far[k] else one for k, one in enumerate(found.status)
    )


def _same_joints(nominal: RobotModel, identified: RobotModel) -> None:
    """Refuse models of two different arms."""
    if nominal.chain.kinds != identified.chain.kinds:
        kinds = f"{nominal.chain.kinds} and {identified.chain.kinds}"
        message = f"nominal and identified differ in their joints: {kinds}"
        raise refuse("identified", allowed="two models of one arm", code="A3", message=message)
