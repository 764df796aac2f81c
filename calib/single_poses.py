"""Fast forward kinematics of one posture at a time, in compiled code and with few checks."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, frozen
from calib.errors import refuse
from calib.geometry.model import RobotModel
from calib.kinds import checked_kinds
from calib.shown import Shown


@dataclass(frozen=True, slots=True, eq=False)
class SinglePoses(Shown):
    """A robot model compiled for single postures; for many at once `RobotModel.poses` is faster.

    Examples
    --------
    >>> from calib import Chain, RobotModel
    >>> robot = SinglePoses.of(RobotModel(Chain([[0, 0.3, 0.1, 0, 0]])))
    >>> robot.pose(np.array([0.0]))[:3, 3]
    array([0.1, 0. , 0.3])
    """

    links: Array
    """(n, 8) theta, d, a, cos and sin of alpha, cos and sin of beta, 1 if prismatic [rad, m]."""
    frames: Array
    """(2, 16) T_world_base and T_flange_tool, by rows [m]."""
    terms: Array
    """(k, n + 3) joint, coefficient, 1 for cosine, and n weights of each joint term."""

    def __repr__(self) -> str:
        return f"SinglePoses({len(self.links)} joints)"

    @classmethod
    @checked_kinds
    def of(cls, model: RobotModel) -> "SinglePoses":
        """Compile a model; the first call of a process takes half a second.

        Where numba is not installed the same loop is interpreted, at some 50 us a pose.

        Raises
        ------
        InputError
            A3: the model has springs, or terms that depend on operating conditions.
        """
        import calib.kernels.single_pose  # noqa: F401  # compiled now, not at the first pose

        errors, chain = model.joint_errors, model.chain
        if errors.springs is not None or not all(term.is_wave for term in errors.terms):
            raise refuse(
                "model", code="A3",
                message="this model has springs, or terms that are no waves of its joints",
                allowed="a chain, with waves of its joint values at most",
                fix="take the poses from the robot model itself",
            )  # fmt: skip
        theta, d, a, alpha, beta = chain.links.T
        links = [
            theta, d, a, np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta), chain.prismatic,
        ]  # fmt: skip
        terms = [
            [term.joint, coefficient, term.wave == "cos", *term.weights]
            for term, coefficient in zip(errors.terms, errors.coefficients, strict=True)
        ]
        return cls(
            frozen(np.stack(links, axis=1)),
            frozen(np.stack([chain.T_world_base.ravel(), chain.T_flange_tool.ravel()])),
            frozen(np.array(terms, dtype=np.float64).reshape(-1, chain.n_joints + 3)),
        )

    def pose(self, q: Array) -> Array:
        """Tool pose T_world_tool (4, 4) [m] at joint values q (n,) [rad, m].

        Raises
        ------
        InputError
            A1: q is no float64 array of n values. Whether they are finite is not checked.
        """
        from calib.kernels.single_pose import single_pose

        if not isinstance(q, np.ndarray) or q.dtype != np.float64:
            raise refuse("q", code="A1", message="q is not an array of floats",
                         fix="numpy.asarray(q, dtype=float)")  # fmt: skip
        if q.shape != (len(self.links),):
            wanted, n = f"{len(self.links)} joint values", q.size if q.ndim == 1 else q.shape
            message = f"q has {n} values" if q.ndim == 1 else f"q has shape {n}"
            raise refuse("q", n, wanted, code="A1", message=message)
        if not q.flags.c_contiguous:
            q = q.copy()  # a column of a table
        T = np.zeros((4, 4))
        T[3, 3] = 1.0
        single_pose(self.links, self.frames, self.terms, q, np.empty(len(self.links)), T)
        return T
