"""Compensation of robot errors: targets changed so that the real robot reaches the poses intended.

A program intends the poses of the nominal model, T = f0(q); the robot, as identified, goes to f(q).
There are two ways to correct it:

* **Joint targets.** The controller is given q' with f(q') = f0(q), found by inverting the
  identified model from q. To first order q' = q - J^-1 (f(q) - f0(q)); the inversion is iterated
  to convergence.
* **Cartesian targets.** The controller turns a pose T' into joints q' by its nominal model,
  f0(q') = T'. To reach T, solve f(q') = T and give the controller T' = f0(q').

An arm of fewer than six joints rarely reaches a pose of another arm, however similar: it is brought
to the position, and as near to the rotation as its joints then allow. Both models must have the
same world and tool: give `nominal` the base and the tool of the program.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Bool, check, frozen
from calib.correction_words import few_joints, status_sentences
from calib.errors import refuse
from calib.geometry.inverse import SINGULAR_CONDITION, Inverse, InverseStatus, inverse_kinematics
from calib.geometry.inverse_search import joint_condition
from calib.geometry.model import RobotModel
from calib.geometry.operating import AS_USUAL, OperatingConditions
from calib.geometry.parameters import CHARACTERISTIC_LENGTH
from calib.kinds import checked_kinds
from calib.measurement.accuracy import position_errors, rotation_errors
from calib.shown import ResultTable, Shown, length_words

LARGEST = np.radians(5.0)
"""A correction of a joint beyond this counts as nearly singular [rad, or that times 0.3 m]."""
UNLIMITED = 1e3
"""Width of the joint limits around the targets if none are given [rad, m]."""


class _Corrected(Shown):
    """Targets with a status each."""

    __slots__ = ()
    status: tuple[InverseStatus, ...]

    @property
    def corrected(self) -> Bool:
        """(m,) whether the target is corrected without reservation: its status is "reached".

        One that is "singular" is corrected too, and needs a look.
        """
        return np.array([one == "reached" for one in self.status], dtype=np.bool_)

    @property
    def _counted(self) -> str:
        """How many targets are reached, and how many of them need a look."""
        look = self.status.count("singular")
        some = f", {look} of them in a nearly singular posture" * bool(look)
        return f"{int(self.corrected.sum()) + look} of {len(self.status)} targets{some}"

    @property
    def sentences(self) -> tuple[str, ...]:
        """One sentence per kind of trouble, with the targets that need a look."""
        return status_sentences(self.status)


@dataclass(frozen=True, slots=True, eq=False)
class Correction(_Corrected):
    """Joint targets at which the identified robot reaches the poses intended."""

    q: Array
    """(m, n) corrected joint targets inside the limits [rad, m]; where the status is "limits" or
    "out of reach" the nearest posture found, which may be far away: keep the given target there."""
    step: Array
    """(m, n) corrected minus given targets [rad, m]."""
    position_error: Array
    """(m,) position error left, by the identified model [m]."""
    rotation_error: Array
    """(m,) rotation error left [rad]; for fewer than six joints not zero even if "reached"."""
    position_before: Array
    """(m,) position error at the given targets, by the identified model [m]."""
    rotation_before: Array
    """(m,) rotation error at the given targets, by the identified model [rad]."""
    status: tuple[InverseStatus, ...]
    """(m,) "reached", or why the target needs a look: "singular" (corrected, but a joint moves far
    for it or the posture is nearly singular), "limits", "out of reach"."""
    condition: Array
    """(m,) condition number of the joint Jacobian, the larger of before and after correction."""

    def __repr__(self) -> str:
        left = length_words(float(self.position_error.max(initial=0.0)), um=".3g")
        return f"Correction({self._counted}, largest rest: {left})"

    def tables(self) -> dict[str, ResultTable]:
        """``targets``: corrected joints [rad, m], position error before and left [m], status."""
        joints = {f"q{k + 1}": q for k, q in enumerate(self.q.T)}
        off = {"before_m": self.position_before, "left_m": self.position_error}
        return {"targets": ResultTable({**joints, **off, "status": self.status})}


@dataclass(frozen=True, slots=True, eq=False)
class PoseCorrection(_Corrected):
    """Cartesian targets for a controller that keeps its nominal model."""

    T: Array
    """(m, 4, 4) poses T_world_tool to give the controller [m]."""
    q: Array
    """(m, n) joint values that it then takes [rad, m]."""
    q_before: Array
    """(m, n) joint values that it takes for the uncorrected targets [rad, m]."""
    position_error: Array
    """(m,) position error left, by the identified model [m]."""
    rotation_error: Array
    """(m,) rotation error left, by the identified model [rad]."""
    status: tuple[InverseStatus, ...]
    """(m,) as in `Correction`."""
    condition: Array
    """(m,) as in `Correction`."""

    def __repr__(self) -> str:
        return f"PoseCorrection({self._counted})"


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
        Model that the program was written for.
    identified : RobotModel
        Model of the real robot, joint errors included.
    q : (m, n) array_like
        Joint targets of the program [rad, m].
    limits : (n, 2) array_like, optional
        Lower and upper joint limits [rad, m]; none by default. No joint is moved by whole turns
        into them.
    at : OperatingConditions, optional
        Operating conditions of the real robot, one row per target.

    Raises
    ------
    InputError
        A3: the models differ in the kinds of their joints, or limits are swapped; A1: wrong shape.

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
        Model of the controller, which turns its targets into joint values.
    identified : RobotModel
        Model of the real robot, joint errors included.
    T : (m, 4, 4) array_like
        Poses T_world_tool that the program intends [m].
    seeds : (m, n) or (m, s, n) array_like
        Joint values near those that the controller takes: its configuration [rad, m].
    limits : (n, 2) array_like
        Lower and upper joint limits [rad, m].
    at : OperatingConditions, optional
        Operating conditions of the real robot, one row per target.


    Notes
    -----
    An arm of seven joints reaches T' in many postures, and only its controller knows which one it
    takes; the result holds for the one nearest to its posture for T. Joint targets avoid this.
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


def _statuses(
    model: RobotModel, found: Inverse, step: Array, condition: Array
) -> tuple[InverseStatus, ...]:
    """Status of each correction; reached targets near a singular posture become "singular"."""
    unit = np.where(model.chain.prismatic, CHARACTERISTIC_LENGTH, 1.0)
    far = (np.abs(step) > LARGEST * unit).any(axis=1) | (condition > SINGULAR_CONDITION)
    return tuple(
        "singular" if one == "reached" and far[k] else one for k, one in enumerate(found.status)
    )


def _same_joints(nominal: RobotModel, identified: RobotModel) -> None:
    """Raise an `InputError` (A3) if joints of the models differ in kind."""
    if nominal.chain.kinds != identified.chain.kinds:
        kinds = f"{nominal.chain.kinds} and {identified.chain.kinds}"
        message = f"nominal and identified differ in their joints: {kinds}"
        raise refuse("identified", allowed="two models of one arm", code="A3", message=message)
