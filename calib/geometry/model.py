"""The robot model: a chain, its joint errors, and the fixtures it is measured with."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, check, require_kind
from calib.geometry.bodies import Z, bent_forward
from calib.geometry.chain import Chain, chain_names, forward_of, joint_vectors
from calib.geometry.fixtures import Fixtures
from calib.geometry.jacobian import bent_pose_and_jacobian, joint_columns, pose_and_jacobian
from calib.geometry.joint_errors import JointErrors
from calib.geometry.operating import AS_USUAL, OperatingConditions
from calib.kinds import in_short
from calib.shown import Shown

NO_ERRORS, NO_FIXTURES = JointErrors(), Fixtures()
CONDITIONS = "OperatingConditions of the rows"


class ColumnsApart(NamedTuple):
    """Poses and Jacobian columns of a model before those of joint terms are multiplied out."""

    T: Array
    """(m, 4, 4) tool poses T_world_tool [m]."""
    chain: Array
    """(m, 6, 12 + 5 n) columns of the chain."""
    springs: Array
    """(m, 6, s) columns of the numbers of the springs."""
    turns: Array
    """(m, 6, n) column of each joint value; times b_k it is that of term k."""
    along: Array
    """(m, 6) column of a relative growth of all lengths; zero where no term is of lengths."""


@dataclass(frozen=True, slots=True, eq=False)
class RobotModel(Shown):
    """Geometry and joint errors of a robot, T(q) = forward(chain, q + dq(q)), and its fixtures.

    With springs among the joint errors, joints bend by b(q) about three axes:
    T(q) = bent_forward(chain, q, b(q)).
    """

    chain: Chain
    joint_errors: JointErrors = NO_ERRORS
    fixtures: Fixtures = NO_FIXTURES
    """Reflectors, anchors, stations and tools: they affect what is measured, not the pose."""

    def __post_init__(self) -> None:
        require_kind("chain", self.chain, Chain, "a calib.Chain of the links")
        require_kind("joint_errors", self.joint_errors, JointErrors, "a JointErrors of the terms")
        require_kind("fixtures", self.fixtures, Fixtures, "calib.Fixtures beside it")
        if len(self.joint_errors.coefficients):
            self.joint_errors.require_chain(self.chain)

    def __repr__(self) -> str:
        return f"RobotModel({self.chain.n_joints} joints, {self.n_numbers} numbers)"

    @property
    def names(self) -> tuple[str, ...]:
        """(P,) names of all numbers: base, links, tool, joint terms, fixtures."""
        return (*chain_names(self.chain.n_joints), *self.joint_errors.names, *self.fixtures.names)

    @property
    def is_length(self) -> tuple[bool, ...]:
        """(P,) whether a number is a length [m]; all others are angles [rad]."""
        frame = (True, True, True, False, False, False)
        link = (False, True, True, False, False)
        kinds = (*self.chain.kinds, "none")  # of the term that moves no joint
        terms = tuple(kinds[joint] == "prismatic" for joint in self.joint_errors.joints)
        links = link * self.chain.n_joints
        springs = self.joint_errors.springs
        sprung = springs.is_length if springs else ()
        return (*frame, *links, *frame, *terms, *sprung, *self.fixtures.is_length)

    @property
    def n_numbers(self) -> int:
        """Length P of the full parameter vector."""
        return self.first_fixture + self.fixtures.n_numbers

    @property
    def first_fixture(self) -> int:
        """Index of the first number of the fixtures in the full parameter vector."""
        return self.chain.n_numbers + len(self.joint_errors.coefficients)

    @in_short
    def moved(self, step: ArrayLike) -> "RobotModel":
        """Model after a step (P,) in the order of `names` [m, rad].

        Chain and fixtures move as their own `moved` says; coefficients are added.
        """
        (step,) = check(f"{self.n_numbers}", step=step)
        k, end = self.chain.n_numbers, self.first_fixture
        errors = self.joint_errors
        if end > k:
            errors = replace(errors, coefficients=errors.coefficients + step[k:end])
        return RobotModel(self.chain.moved(step[:k]), errors, self.fixtures.moved(step[end:]))

    def step_to(self, other: "RobotModel") -> Array:
        """Step (P,) [m, rad] to a model of the same terms and fixtures; the inverse of `moved`."""
        require_kind("other", other, RobotModel, "a calib.RobotModel")
        (here, there) = check(
            "k, k", own=self.joint_errors.coefficients, other=other.joint_errors.coefficients
        )
        return np.concatenate(
            [self.chain.step_to(other.chain), there - here, self.fixtures.step_to(other.fixtures)]
        )

    @in_short
    def poses(self, q: ArrayLike, at: OperatingConditions = AS_USUAL) -> Array:
        """Tool poses T_world_tool (m, 4, 4) [m] at commanded joint values q (m, n).

        Parameters
        ----------
        q : (m, n) array_like
            Commanded joint values [rad, m].
        at : OperatingConditions, optional
            Operating conditions, one row per pose.

        Raises
        ------
        InputError
            A1: `q` is no table of n columns, or `at` is for other poses.
        """
        q, errors = joint_vectors(self.chain, q), self.joint_errors
        require_kind("at", at, OperatingConditions, CONDITIONS)
        at.require_rows(*q.shape)
        if errors.springs:
            return bent_forward(self.chain, q, errors.bends(q, at), errors.growth(at))
        if errors.terms:
            q = q + errors.of_terms(q, at)
        return forward_of(self.chain, q, errors.growth(at))

    @in_short
    def poses_and_jacobian(
        self, q: ArrayLike, at: OperatingConditions = AS_USUAL
    ) -> tuple[Array, Array]:
        """Poses (m, 4, 4) [m] and Jacobian (m, 6, P), rows [dp (m); dr (rad)] in world axes.

        Arguments as in `poses`. The columns are derivatives by the numbers of `names`, as `moved`
        takes their step.

        The column of a joint term is the column of its joint value times b_k, exact because the
        offset is linear in the coefficient; a term of lengths has the summed columns of all
        lengths. A number of the springs has the columns of the bends times their derivative by it.
        The columns of the fixtures are zero: no pose depends on them.
        """
        q, errors = joint_vectors(self.chain, q), self.joint_errors
        require_kind("at", at, OperatingConditions, CONDITIONS)
        at.require_rows(*q.shape)
        if not len(errors.coefficients):
            T, own = pose_and_jacobian(self.chain, q)
            if not self.fixtures.n_numbers:
                return T, own
            return T, np.concatenate([own, np.zeros((len(q), 6, self.fixtures.n_numbers))], axis=2)
        basis = errors.basis(q, at)
        apart = self.columns_apart(q, at, basis)
        J = np.zeros((len(q), 6, self.n_numbers))
        first, k = self.chain.n_numbers, len(errors.terms)
        J[:, :, :first] = apart.chain
        terms = J[:, :, first : first + k]
        np.multiply(apart.turns[:, :, errors.joints], basis[:, None, :], out=terms)
        for place in errors.of_lengths:
            terms[:, :, place] = apart.along * basis[:, place, None]
        J[:, :, first + k : self.first_fixture] = apart.springs
        return apart.T, J

    def columns_apart(self, q: Array, at: OperatingConditions, basis: Array) -> "ColumnsApart":
        """Poses and columns from which those of terms are made; `basis` (m, k) are their values."""
        errors, growth = self.joint_errors, self.joint_errors.growth(at)
        moved = errors.moved_by(basis, self.chain.n_joints)
        if errors.springs:
            bends, slopes = errors.springs.bends_and_slopes(q, errors.of_springs, at.moments)
            bends[:, :, Z] += moved
            T, J = bent_pose_and_jacobian(self.chain, q, bends, growth)
            J, bent = np.split(J, [self.chain.n_numbers], axis=2)
            turns, springs = bent[:, :, Z::3], bent[:, :, errors.springs.places] @ slopes
        else:
            T, J = pose_and_jacobian(self.chain, q + moved, growth)
            turns, springs = J[:, :, joint_columns(self.chain)], np.zeros((len(q), 6, 0))
        along = self._along(J) if errors.of_lengths else np.zeros((len(q), 6))
        grow_columns(J, growth)
        return ColumnsApart(T, J, springs, turns, along)

    @in_short
    def poses_and_bends(
        self, q: ArrayLike, at: OperatingConditions = AS_USUAL
    ) -> tuple[Array, Array, Array]:
        """Poses and Jacobian as in `poses_and_jacobian`, and the columns of all bends (m, 6, 3 n).

        The bends are those of each joint about x, y and z, at the bent posture.
        """
        q, errors = joint_vectors(self.chain, q), self.joint_errors
        T, J = self.poses_and_jacobian(q, at)
        bends, growth = errors.bends(q, at), errors.growth(at)
        bent = bent_pose_and_jacobian(self.chain, q, bends, growth)[1]
        return T, J, bent[:, :, self.chain.n_numbers :]

    def term_columns(
        self, errors: JointErrors, J: Array, turns: Array, q: Array, at: OperatingConditions
    ) -> Array:
        """Columns (m, 6, k) of joint terms that this model need not have.

        Parameters
        ----------
        errors : JointErrors
            Joint terms; springs among them play no part.
        J : (m, 6, P) array
            Jacobian of the model, without thermal growth.
        turns : (m, 6, n) array
            Column of each joint value.
        q : (m, n) array
            Joint values [rad, m].
        at : OperatingConditions
            Operating conditions, one row per pose.
        """
        basis = errors.basis(q, at)
        columns = turns[:, :, errors.joints] * basis[:, None, :]
        for k in errors.of_lengths:
            columns[:, :, k] = self._along(J) * basis[:, k, None]
        return columns

    def _along(self, J: Array) -> Array:
        """Column (m, 6) of a relative growth of all d and a, from their columns in J (m, 6, P)."""
        d = 7 + 5 * np.arange(self.chain.n_joints)
        return np.asarray(
            J[:, :, d] @ self.chain.links[:, 1] + J[:, :, d + 1] @ self.chain.links[:, 2]
        )


def grow_columns(J: Array, growth: Array | None) -> None:
    """Scale the columns of d and a of J (m, 6, P) by 1 + growth (m,), in place."""
    if growth is not None:
        for k in (1, 2):
            J[:, :, 6 + k : -6 : 5] *= (1 + growth)[:, None, None]
