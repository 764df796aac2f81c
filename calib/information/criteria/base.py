"""What every criterion offers: a value, a figure to read, exact gains, and the best moves."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from calib.arrays import Array, Bool
from calib.information.observability import IndexName


class Move(NamedTuple):
    """One pose to add to, or to drop from, a set."""

    place: int
    """Place in the pool (add) or among the chosen (drop); -1 if none reaches the floor."""
    gain: float
    """What it adds to the value."""
    evaluated: int
    """Sets evaluated exactly to find it."""


class Swap(NamedTuple):
    """One pose of a set exchanged for one of the pool."""

    leaving: int
    """Place in the list of chosen poses; -1 if there is none."""
    entering: int
    """Place in the pool."""
    gain: float
    """What it adds to the value."""
    evaluated: int
    """Sets evaluated exactly to find it."""


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
    """A number of the information matrix M (p, p), in scaled columns, that a good set makes large.

    M is the information of all poses counted, with any prior precision; it is trusted to be
    symmetric and finite, and positive definite where gains are asked of D, A, V or G.
    """

    name: str
    """As asked for, such as ``"V"`` or ``"O1"``."""

    unit: ClassVar[str]
    """Unit of the figure."""
    index: ClassVar[IndexName | None]
    """The observability index that the figure is, if it is one."""
    larger_is_better: ClassVar[bool]
    """Whether the figure grows with a better set; the value always does."""

    @property
    def n_numbers(self) -> int | None:
        """Numbers that it is made for; None if any will do."""
        return None

    @abstractmethod
    def value(self, M: Array) -> Array:
        """Objective (...,) of information matrices M (..., p, p); larger is better."""

    @abstractmethod
    def figure(self, M: Array, n_poses: int) -> float:
        """What people read, of information M (p, p) from `n_poses` poses."""

    @abstractmethod
    def rises(self, value: float, before: float) -> bool:
        """Whether a value is higher by more than rounding; ties would cycle."""

    @abstractmethod
    def add(self, M: Array, blocks: Array) -> Array:
        """Gains (N,) by adding each of the blocks (N, r, p) to M (p, p)."""

    @abstractmethod
    def drop(self, M: Array, blocks: Array) -> Array:
        """Gains (k,), none positive for O1, A, V, G, E, by taking each block (k, r, p) out of M."""

    @abstractmethod
    def swap(self, M: Array, leaving: Array, entering: Array) -> Array:
        """Gains (k, N) by exchanging blocks (k, r, p) of the set for others (N, r, p)."""

    @abstractmethod
    def best_add(self, M: Array, pool: Pool, allowed: Bool, floor: float = -np.inf) -> Move:
        """Best pose of those `allowed` (N,) to add; ties to the lowest place, as by brute force.

        Sets whose value stays below `floor` may be passed over.
        """

    @abstractmethod
    def best_drop(self, M: Array, blocks: Array) -> Move:
        """Best of the blocks (k, r, p) of a set to take out; ties to the lowest place."""


@dataclass(frozen=True, slots=True, eq=False)
class Certifiable(Criterion):
    """A criterion whose value is concave in M, or increasing in one that is: bounds can be proven.

    For weights w >= 0 on the pool and M(w) = M0 + sum w_j B_j'B_j, `dual` gives a matrix S; with
    top = tr(S M0) + the m largest tr(S B_j'B_j), no set of m poses has a value above `ceiling`.
    """

    sharpness: ClassVar[tuple[float, ...]]
    """Orders k of the smooth stand-ins for a maximum or minimum, in turn; (1,) where there is none.
    """

    slack: ClassVar[float] = 1.0
    """Factor on the tolerance of a relaxation: larger where sets stay away from their bound."""

    def value_bounded(self, M: Array) -> Array:
        """Value (...,) that the ceiling comes down to: this one's, or one that is never below."""
        return self.value(M)

    @abstractmethod
    def dual(self, M: Array, sharpness: float) -> Array:
        """Matrix S (p, p), positive semidefinite: the weight of a unit of information, at M."""

    @abstractmethod
    def ceiling(self, M: Array, S: Array, top: float) -> float:
        """Largest value of any set for which tr(S M*) <= top."""

    @abstractmethod
    def with_rounding(self, bound: float, M: Array) -> float:
        """A bound from M (p, p) with room for the rounding that M carries."""

    @abstractmethod
    def exponent(self, sharpness: float) -> float:
        """Power of tr(S B_j'B_j) by which weights follow it."""

    @abstractmethod
    def efficiency(self, value: float, bound: float, p: int) -> float:
        """Part of the best possible figure (D: of det^(1/p)) that is certain, in 0 to 1."""

    @abstractmethod
    def figure_of_value(self, value: float, p: int, n_poses: int) -> float:
        """Figure that belongs to a value."""
