"""Joint values as a controller counts them, J, and those of the arm, q = C J.

Inside the program all joint values are those of the arm's chain (q). Joints of the controller (J)
occur in what people read, write and send: tables, lists and programs. Both are linear in each
other, so that a straight move of one is a straight move of the other.
"""

from dataclasses import dataclass, field

import numpy as np

from calib.arrays import Array, Bool, Index, frozen

BEYOND = 1e-6
"""Distance by which a value has to exceed a limit to be outside; also used in reading [rad, m]."""
UNLIMITED = 1e9
"""A limit beyond every joint [rad, m]."""


def _none() -> Array:
    """Empty matrix (0, 0) of a controller that counts as the arm does."""
    return frozen(np.zeros((0, 0)))


@dataclass(frozen=True, slots=True, eq=False)
class Controller:
    """How a controller counts the joints of an arm of n joints; by default as the arm does."""

    statements: tuple[str, ...] = ()
    """Equations of the robot's file, such as ``q3 = J3 + J2``."""
    stated: tuple[int, ...] = ()
    """Joint of each equation, from 0."""
    matrix: Array = field(default_factory=_none)
    """(n, n) C, joints of the arm from those of the controller; radians and meters."""
    inverse: Array = field(default_factory=_none)
    """(n, n) its inverse."""
    held: tuple[int, ...] = ()
    """Joints, from 0, that follow others and that the controller does not count: J is zero."""
    limits: Array = field(default_factory=_none)
    """(n, 2) lower and upper limits of its own joints; `UNLIMITED` if not stated [rad, m]."""

    @property
    def plain(self) -> bool:
        """Whether it counts the joints as the arm does."""
        return not self.statements

    def to_arm(self, J: Array) -> Array:
        """Joints (..., n) of the arm from those of the controller [rad, m]."""
        return J if self.plain else _times(self.matrix, J)

    def of_arm(self, q: Array) -> Array:
        """Joints (..., n) of the controller from those of the arm [rad, m]."""
        if self.plain:
            return q
        J = _times(self.inverse, q)
        J[..., list(self.held)] = 0.0
        return J

    def counted(self, n: int) -> Index:
        """Joints, from 0, of an arm of n that the controller counts."""
        return np.setdiff1d(np.arange(n), self.held)

    def read(self, columns: Array, n: int) -> Array:
        """Joints (..., n) of the arm from those (..., k) that the controller counts [rad, m]."""
        if not self.held:
            return self.to_arm(columns)
        J = np.zeros((*columns.shape[:-1], n))
        J[..., self.counted(n)] = columns
        return self.to_arm(J)

    def written(self, q: Array) -> Array:
        """Joints (..., k) that the controller counts, from those (..., n) of the arm [rad, m]."""
        return self.of_arm(q)[..., self.counted(q.shape[-1])] if self.held else self.of_arm(q)

    def holding(self, q: Array) -> Array:
        """Joints (..., n) of the arm, with held joints where the others hold them [rad, m]."""
        return self.to_arm(self.of_arm(q)) if self.held else q

    def beyond(self, q: Array, margin: Array | float = -BEYOND) -> Bool:
        """Whether (..., n) joints of the controller are nearer than a margin to their own limits.

        `q` (..., n) are joint values of the arm [rad, m]. A held joint counts as beyond if it is
        not where the others hold it.
        """
        if self.plain:
            return np.zeros(q.shape, dtype=np.bool_)
        J, (lower, upper) = _times(self.inverse, q), self.limits.T
        out: Bool = (lower + margin > J) | (upper - margin < J)
        held = list(self.held)
        out[..., held] = np.abs(J[..., held]) > BEYOND
        return out

    def allows(self, q: Array) -> Bool:
        """Whether (...,) the controller can bring the arm to joints q (..., n)."""
        return np.asarray(~self.beyond(q).any(axis=-1))

    def farthest(self, limits: Array) -> float:
        """Bound of all joints of the controller inside limits (n, 2) of the arm [rad, m]."""
        most = np.abs(limits).max(axis=1)
        return float((most if self.plain else np.abs(self.inverse) @ most).max())

    @property
    def sentence(self) -> str:
        """How joints are counted, in words; empty if as the arm does."""
        if self.plain:
            return ""
        return f"joints are counted as the controller does: {', '.join(self.statements)}"


AS_THE_ARM = Controller()


def _times(matrix: Array, values: Array) -> Array:
    """Values (..., n) times a matrix (n, n); values with identity rows keep every bit."""
    out = np.array(values, dtype=np.float64)
    for i in np.flatnonzero((matrix != np.eye(len(matrix))).any(axis=1)):
        terms = np.flatnonzero(matrix[i])
        out[..., i] = sum(matrix[i, k] * values[..., k] for k in terms)
    return out
