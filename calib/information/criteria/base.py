"""Interface of every criterion: a value, a figure to read, exact gains, and the best moves."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from calib.arrays import Array, Bool
from calib.information.observability import IndexName


class Move(NamedTuple):
    """One pose to add to, or to drop from, a set."""

    place: int
    """Index in the pool (add) or among the chosen (drop); -1 if none reaches the floor."""
    gain: float
    """Change of the value."""
    evaluated: int
    """Number of sets evaluated exactly to find it."""


class Swap(NamedTuple):
    """One pose of a set exchanged for one of the pool."""

    leaving: int
    """Index in the list of chosen poses; -1 if there is none."""
    entering: int
    """Index in the pool."""
    gain: float
    """Change of the value."""
    evaluated: int
    """Number of sets evaluated exactly to find it."""


class Pool:
    """Candidate blocks (N, r, p), the same rows in pages (r, N, p), and their squares (N,)."""

    def __init__(self, blocks: Array) -> None:
        self.blocks = blocks
        self.pages = np.ascontiguousarray(np.moveaxis(blocks, 1, 0))  # sums over r are fast
        self.squares = np.einsum("jrk,jrk->j", blocks, blocks)

    def __len__(self) -> int:
        return len(self.blocks)


@dataclass(frozen=True, slots=True, eq=False)
class Criterion(ABC):
    """An objective of the information matrix M (p, p), in scaled columns; larger is better.

    M is the information of all poses counted, with any prior precision; it is trusted to be
    symmetric and finite, and positive definite where gains are asked of D, A, V or G.
    """

    name: str
    """As asked for, such as ``"V"`` or ``"O1"``."""

    unit: ClassVar[str]
    """Unit of the figure."""
    index: ClassVar[IndexName | None]
    """The observability index that the figure is, or None."""
    larger_is_better: ClassVar[bool]
    """Whether the figure grows with a better set; the value always does."""

    @property
    def n_numbers(self) -> int | None:
        """Number p that it was made for; None if it takes any."""
        return None

    @abstractmethod
    def value(self, M: Array) -> Array:
        """Objective (...,) of information matrices M (..., p, p); larger is better."""

    @abstractmethod
    def figure(self, M: Array, n_poses: int) -> float:
        """Figure for people to read, from information M (p, p) of `n_poses` poses."""

    @abstractmethod
    def rises(self, value: float, before: float) -> bool:
        """Whether `value` exceeds `before` by more than rounding, so that searches never cycle."""

    @abstractmethod
    def add(self, M: Array, blocks: Array) -> Array:
        """Gains (N,) by adding each of the blocks (N, r, p) to M (p, p)."""

    @abstractmethod
    def drop(self, M: Array, blocks: Array) -> Array:
        """Gains (k,) by taking each block (k, r, p) out of M.

        None is positive for D, A, E, and V and G of the noise alone.
        """

    @abstractmethod
    def swap(self, M: Array, leaving: Array, entering: Array) -> Array:
        """Gains (k, N) by exchanging blocks (k, r, p) of the set for others (N, r, p)."""

    @abstractmethod
    def best_add(self, M: Array, pool: Pool, allowed: Bool, floor: float = -np.inf) -> Move:
        """Best pose to add of those `allowed` (N,); of equal ones the lowest index.

        The result is that of brute force. Sets whose value stays below `floor` may be skipped.
        """

    @abstractmethod
    def best_drop(self, M: Array, blocks: Array) -> Move:
        """Best of the blocks (k, r, p) of a set to take out; of equal ones the lowest index."""


@dataclass(frozen=True, slots=True, eq=False)
class Certifiable(Criterion):
    """A criterion whose value is concave in M, or increasing in one that is: bounds can be proven.

    For weights w >= 0 on the pool and M(w) = M0 + sum w_j B_j'B_j, `dual` gives a matrix S; with
    top = tr(S M0) + the m largest tr(S B_j'B_j), no set of m poses has a value above `ceiling`.
    """

    sharpness: ClassVar[tuple[float, ...]]
    """Orders k of the smooth approximations of a maximum or minimum, in turn; (1,) without one."""

    slack: ClassVar[float] = 1.0
    """Factor on the tolerance of a relaxation; larger where the bound cannot be reached."""

    def value_bounded(self, M: Array) -> Array:
        """Value (...,) that the ceiling converges to: that of this criterion, or an upper bound."""
        return self.value(M)

    @abstractmethod
    def dual(self, M: Array, sharpness: float) -> Array:
        """Dual matrix S (p, p), positive semidefinite, at M."""

    @abstractmethod
    def ceiling(self, M: Array, S: Array, top: float) -> float:
        """Largest value of any set for which tr(S M*) <= top."""

    @abstractmethod
    def with_rounding(self, bound: float, M: Array) -> float:
        """A bound from M (p, p), widened by the rounding of M."""

    @abstractmethod
    def exponent(self, sharpness: float) -> float:
        """Power of tr(S B_j'B_j) in the multiplicative update of weights."""

    @abstractmethod
    def efficiency(self, value: float, bound: float, p: int) -> float:
        """Lower bound, 0 to 1, on the figure relative to the best possible (D: on det^(1/p))."""

    @abstractmethod
    def figure_of_value(self, value: float, p: int, n_poses: int) -> float:
        """Figure that corresponds to a value."""
