"""Where a statement applies: how much of what no model holds reaches the target there.

A calibration absorbs part of an error that it has no number for. Where the held-out poses stand it
was proven how much is left; elsewhere more may be left. Two numbers see it coming, pose by pose,
from the kinematics alone: transfer, of errors of the joints and the foot, and leverage, of noise.
"""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import LATER, Array, Bool, Index, Labels, check, frozen
from calib.errors import refuse
from calib.geometry.joint_errors import JointErrors, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.operating import AS_USUAL, OperatingConditions
from calib.geometry.parameters import Parameters
from calib.identification.identify import Identification
from calib.identification.joint_models import extended_model
from calib.information.propagation import propagated
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.measurement.tool_target import ToolTarget
from calib.shown import Shown
from calib.uncertainty.frames.inner_datum import InnerDatum, best_motion
from calib.uncertainty.held_out import first_of_pose
from calib.uncertainty.statement.gain import estimator_gain, untold
from calib.uncertainty.statement.steps import ON_STEP, steps_of

WARNED, REFUSED = 4.0, 9.0
"""Transfer or leverage above which a target is at the edge, and above which it is outside."""
BEYOND = np.radians(10.0)
"""How far a joint may leave its range over the held-out poses [rad]."""
BEYOND_SLIDE = 0.05
"""The same for a slide [m]."""
MOST_OUTSIDE = 0.25
"""Share of a set's poses outside above which the statement does not reach the set as a whole."""


@dataclass(frozen=True, slots=True, eq=False)
class Applicability(Shown):
    """Whether a statement reaches N targets."""

    transfer: Array
    """(N,) g: what is left there of errors that the model cannot hold, over its mean at the
    held-out poses; the larger of joints and foot."""
    leverage: Array
    """(N,) h: variance of the target from the noise, over its mean at the held-out poses."""
    beyond: Bool
    """(N, n) joints further than `BEYOND` outside their range over the held-out poses, or between
    the steps at which all poses stood."""

    def __repr__(self) -> str:
        counts = {word: int((self.place == word).sum()) for word in ("inside", "edge", "outside")}
        return f"Applicability({', '.join(f'{n} {word}' for word, n in counts.items() if n)})"

    @property
    def growth(self) -> Array:
        """(N,) factor of the misfit's variance: transfer, never below one."""
        return np.maximum(1.0, self.transfer)

    @property
    def place(self) -> Labels:
        """(N,) "inside", "edge" (warned, the region grown), or "outside" (no region)."""
        worst = np.maximum(self.transfer, self.leverage)
        place = np.where((worst > WARNED) | self.beyond.any(axis=1), "edge", "inside")
        return np.asarray(np.where(worst > REFUSED, "outside", place), np.str_)

    @property
    def reaches(self) -> bool:
        """Whether at most `MOST_OUTSIDE` lies outside; each target inside has its region anyway."""
        return bool((self.place == "outside").mean() <= MOST_OUTSIDE) if len(self.place) else True


@dataclass(frozen=True, slots=True, eq=False)
class Proven:
    """Where a calibration was proven: what other places are compared with."""

    wide: RobotModel
    """The identified model with joint terms that it has no numbers for, all zero."""
    columns: Annotated[Index, "k"]
    """(k,) their columns in its derivative."""
    own: Annotated[Index, "P"]
    """(P,) the columns of the identified model's numbers."""
    up: Annotated[Array, 3]
    """(3,) upwards, in the axes of the base."""
    target: ToolTarget
    """The point of the tool that is stated."""
    absorbed: Annotated[Array, "P", "k + 1"]
    """(P, k + 1) how the estimate follows a unit of each term, and of a foot that yields."""
    covariance: Annotated[Array, "P", "P"]
    """(P, P) of all numbers, from the noise, and what no reading tells of them."""
    usual: Annotated[Array, 3]
    """(3,) means over the held-out poses: what is left of the terms, of the foot, of the noise."""
    low: Annotated[Array, "n"]
    """(n,) least joint values over the held-out poses [rad, m]."""
    high: Annotated[Array, "n"]
    """(n,) largest."""
    step: Annotated[Array, "n"]
    """(n,) step, from `low`, that all values of the joint keep; zero where they keep none [rad, m].
    """
    datum: Annotated[InnerDatum | None, LATER] = None
    """The frame in which points are stated, where no reading shows where the base stands."""
    of_terms: Annotated[InnerDatum | None, LATER] = None
    """The same frame by what is left of a unit of each term, and of the foot."""

    @property
    def room(self) -> Array:
        """(n,) how far each joint may leave its range over the held-out poses [rad, m]."""
        return np.where(self.wide.chain.prismatic > 0, BEYOND_SLIDE, BEYOND)

    def applies(self, q: ArrayLike, at: OperatingConditions = AS_USUAL) -> Applicability:
        """Whether the statement reaches joints q (N, n) [rad, m] under some conditions."""
        (q,) = check(f"N {len(self.low)}", q=q)
        of_terms, of_foot, leverage = over_usual(self.left(q, at), self.usual)
        room = self.room
        return Applicability(
            frozen(np.maximum(of_terms, of_foot)),
            frozen(leverage),
            frozen((q < self.low - room) | (q > self.high + room) | self.between(q), np.bool_),
        )

    def between(self, q: Array) -> Bool:
        """(N, n) joints that stand between the steps that all poses kept."""
        steps = (q - self.low) / np.where(self.step > 0, self.step, np.inf)
        return np.asarray(np.abs(steps - np.round(steps)) > ON_STEP)

    def own_rows(self, q: Array) -> Array:
        """Derivative (N, 3, P) of the stated point by the numbers of the model."""
        T, J = self.wide.poses_and_jacobian(q, AS_USUAL)
        rows = self.target.positions_and_rows(self.wide, T, J)[1]
        return np.asarray(rows[:, :, self.own])

    def left(
        self, q: Array, at: OperatingConditions = AS_USUAL, absorbed: Array | None = None
    ) -> Array:
        """(3, N) variance of the target left by a unit of every term, by the foot, by the noise."""
        position, own, G = self._moved(q, at, absorbed)
        if self.datum is not None and self.of_terms is not None:
            own = self.datum.relative(position, own)
            G = self.of_terms.relative(position, G)
        noise = propagated(own, self.covariance).trace(axis1=1, axis2=2)
        return np.stack([(G[..., :-1] ** 2).sum((1, 2)), (G[..., -1] ** 2).sum(1), noise])

    def _moved(
        self, q: Array, at: OperatingConditions = AS_USUAL, absorbed: Array | None = None
    ) -> tuple[Array, Array, Array]:
        """Points (N, 3) [m], (N, 3, P) by numbers, (N, 3, k + 1) left of terms by `absorbed`."""
        T, J = self.wide.poses_and_jacobian(q, at)
        position, rows = self.target.positions_and_rows(self.wide, T, J)
        own = rows[:, :, self.own]
        G = unheld(self.wide, self.columns, self.up, q, rows)
        follows = self.absorbed if absorbed is None else absorbed
        G -= np.tensordot(own, follows, 1)  # in place: another layout rounds sums otherwise
        return position, own, G

    def seen_from(self, datum: InnerDatum, poses: Measurements, q: Array) -> "Proven":
        """The same in the frame that fits points at some poses best; usual at joints q (N, n)."""
        position, _, G = self._moved(poses.q, poses.conditions)
        motion = best_motion(position - datum.center, G)
        seen = replace(self, datum=datum, of_terms=replace(datum, motion=frozen(motion)))
        return replace(seen, usual=frozen(seen.left(q).mean(axis=1)))


def proven_at(
    identification: Identification,
    train: Measurements,
    q: ArrayLike,
    *,
    target: ArrayLike | ToolTarget = (0.0, 0.0, 0.0),
    datum: InnerDatum | None = None,
) -> Proven:
    """What a calibration was proven at, to ask where else it applies.

    Parameters
    ----------
    identification : Identification
        From `train`.
    train : Measurements
        What was identified from.
    q, target
        As in `proven_by`.
    datum : InnerDatum, optional
        Of the poses identified from, if points are stated in that frame.
    """
    proven = proven_by(
        identification.model,
        identification.parameters,
        estimator_gain(identification, train),
        identification.full_covariance,
        train,
        q,
        target=target,
    )
    open_root = untold(identification, train, proven.own_rows(np.asarray(q, dtype=np.float64)))
    whole = frozen(proven.covariance + open_root @ open_root.T)
    stood = np.concatenate([train.q, np.asarray(q, dtype=np.float64)])
    proven = replace(proven, covariance=whole, step=steps_of(stood, proven.wide.chain.prismatic))
    if datum is not None:
        proven = proven.seen_from(datum, first_of_pose(train), np.asarray(q, dtype=np.float64))
    return proven


def over_usual(left: Array, usual: Array) -> Array:
    """What is left (..., 3, N) of terms, foot and noise, over its means (..., 3).

    What has no effect counts as zero: there are no terms where no joint turns.
    """
    return np.asarray(left / np.where(usual > 0, usual, np.inf)[..., None])


def proven_by(
    model: RobotModel,
    parameters: Parameters,
    gain: Array,
    covariance: Array,
    train: Measurements,
    q: ArrayLike,
    *,
    target: ArrayLike | ToolTarget = (0.0, 0.0, 0.0),
    up: ArrayLike = (0.0, 0.0, 1.0),
) -> Proven:
    """What an estimate is proven at, made already or only planned.

    Parameters
    ----------
    model : RobotModel
        Identified; of a plan the nominal one.
    parameters : Parameters
        Its free numbers.
    gain : (m, f, 6) array
        F: how they follow each row of `train` [m, rad].
    covariance : (P, P) array
        Of all numbers, from the noise [m, rad].
    train : Measurements
        Rows it comes from; their readings play no part.
    q : (n, j) array_like
        Joints of the held-out poses [rad, m].
    target : (3,) array_like or ToolTarget
        Point in the tool frame that is stated [m], or a reflector of the model.
    up : (3,) array_like
        Upwards in the axes of the base: a foot yields under the weight of the arm.

    References
    ----------
    G(q) = B(q) - J(q) F B(train); g = tr(G G') over its mean. B: every wave of a joint that the
    model has no number for, and apart from these the turn of the arm about its foot by p x up.
    """
    (q, up) = check("m j, 3", q=q, up=up)
    if not len(q):
        raise refuse(
            "q", code="A3", message="no held-out pose says where this was proven",
            allowed="one pose or more",
        )  # fmt: skip
    wide = lacking(model)
    held = np.isin(wide.names, model.names)
    columns, own = np.flatnonzero(~held), np.flatnonzero(held)
    seen = predict(wide, train)
    B = unheld(wide, columns, up, train.q, seen.rows)
    absorbed = np.zeros((model.n_numbers, B.shape[2]))
    absorbed[parameters.free_index] = np.einsum("mfe,mek->fk", gain, B)
    here = Proven(
        wide, frozen(columns, np.int64), frozen(own, np.int64), up, ToolTarget.of(target),
        frozen(absorbed), frozen(covariance), np.ones(3), frozen(q.min(axis=0)),
        frozen(q.max(axis=0)), frozen(np.zeros(q.shape[1])),
    )  # fmt: skip
    return replace(here, usual=frozen(here.left(q).mean(axis=1)))


def unheld(wide: RobotModel, columns: Index, up: Array, q: Array, rows: Array) -> Array:
    """Columns (m, r, k + 1) of rows (m, r, P) for what no number holds: waves, then the foot."""
    return unheld_columns(wide, columns, up, wide.poses(q)[:, :3, 3], rows)


def unheld_columns(wide: RobotModel, columns: Index, up: Array, p: Array, rows: Array) -> Array:
    """The same where the poses stand at points p (m, 3) of the world."""
    base = wide.chain.T_world_base
    p = (p - base[:3, 3]) @ base[:3, :3]  # in the axes of the base
    foot = rows[:, :, 3:6] @ np.cross(p, up)[:, :, None]
    return np.concatenate([rows[:, :, columns], foot], axis=2)


def lacking(model: RobotModel) -> RobotModel:
    """The model with joint errors beyond it: gravity and two waves, or where it has these, more.

    None where all joints slide: slides have no waves.
    """
    # whatever tool it carries: the closed form of gravity is that of the arm
    wide, order = extended_model(model, replace(model.chain, T_flange_tool=np.eye(4))), 3
    turning = [kind == "revolute" for kind in model.chain.kinds]
    while any(turning) and len(wide.names) == len(model.names):
        known = set(wide.joint_errors.names)
        more = [t for t in harmonic_terms(model.chain.n_joints, (order,)) if turning[t.joint]]
        added = JointErrors(tuple(t for t in more if t.name not in known))
        wide, order = replace(wide, joint_errors=wide.joint_errors.joined(added)), order + 1
    return wide
