"""Straight joint moves: how long they take, whether they are free, and ways around what blocks."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Bool, Index, frozen
from testbed.laboratory.simulator import Simulator
from testbed.robots.controller import AS_THE_ARM, BEYOND, Controller

RESOLUTION = 0.010
"""No point of the robot moves farther than this between two tested postures of a move [m]."""
VIAS = 40
"""Postures tried as a single stop on the way around, the quickest first."""
NEAR = 8
"""Postures from which a straight move is tried to another one."""
NODES = 3000
"""Postures a search tree may grow to before a way around is given up."""
STRIDE = 0.30
"""Longest branch of a search tree: way of the farthest point of the robot [m]."""
PATIENCE = 1_000_000
"""Postures tested for moves that stay blocked before no more ways around are looked for."""
CHUNK = 64
Tree = tuple[list[Array], list[int]]
"""Postures of a search, and which of them each one grew from; -1 for the root."""


def travel_times(q_from: ArrayLike, q_to: ArrayLike, speeds: Array) -> Array:
    """Time (...) of joint moves at constant speed, the slowest joint deciding [s].

    Acceleration is not modeled: it belongs into the settling time.

    Parameters
    ----------
    q_from, q_to : (..., n) array_like
        Ends of the moves [rad, m].
    speeds : (n,) array
        Joint speeds of the moves [rad/s, m/s].

    Examples
    --------
    >>> travel_times([0.0, 0.0], [1.0, -3.0], np.array([1.0, 2.0])).item()
    1.5
    """
    return np.asarray((np.abs(np.asarray(q_to) - np.asarray(q_from)) / speeds).max(axis=-1))


def times_between(q: Array, speeds: Array) -> Array:
    """`travel_times` (m, m) between every two of the postures q (m, n) [s].

    Joint by joint: never m x m x n numbers at once, which of thousands of postures are gigabytes.
    """
    out, apart = (np.zeros((len(q), len(q))) for _ in range(2))
    for joint, speed in zip(q.T, speeds, strict=True):
        np.subtract.outer(joint, joint, out=apart)
        np.abs(apart, out=apart)
        apart /= speed
        np.maximum(out, apart, out=out)
    return out


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """How the robot gets from one posture to another."""

    via: Array
    """(k, n) postures in between, none for a straight move [rad, m]."""
    time: float
    """Of all its moves; infinite if no way was found [s]."""

    @property
    def found(self) -> bool:
        """Whether there is a way."""
        return bool(np.isfinite(self.time))


class Mover:
    """Finds ways between postures of one robot in one cell.

    Parameters
    ----------
    simulator : Simulator
        Of the robot with the cell's obstacles.
    limits : (n, 2) array
        Joint limits, between which a way around is searched [rad, m].
    speeds : (n,) array
        Joint speeds of the moves [rad/s, m/s].
    controller : Controller
        What holds joints, and has limits of its own; between two postures that it allows it allows
        all.
    """

    def __init__(
        self,
        simulator: Simulator,
        limits: Array,
        speeds: Array,
        controller: Controller = AS_THE_ARM,
    ) -> None:
        self._simulator, self._limits, self.speeds = simulator, limits, speeds
        self._controller = controller
        self._bounds = simulator.travel_bounds()
        self.tested = 0
        """Postures tested for collision so far."""
        self.in_vain = 0
        """Those of them for ways around that were not found."""

    @property
    def patient(self) -> bool:
        """Whether ways around are still worth looking for."""
        return self.in_vain < PATIENCE

    def reach(self, step: Array) -> Array:
        """Largest way (...) of any point of the robot in joint steps (..., n) [m]."""
        return np.asarray(np.abs(step) @ self._bounds)

    def is_free(self, start: Array, end: Array) -> bool:
        """Whether nothing is hit on the straight joint move between two postures (n,).

        Tested at both ends and in between, so densely that between two tests no point of the robot
        moves more than `RESOLUTION`: nothing can be cut deeper than half of that unseen.
        """
        n = max(int(np.ceil(self.reach(end - start) / RESOLUTION)), 1)
        # coarse first: a blocked move is found out after a few tests
        order = spread(n + 1)
        for first in range(0, n + 1, CHUNK):
            share = order[first : first + CHUNK, None] / n
            self.tested += len(share)
            if self._simulator.collides(start + share * (end - start)).any():
                return False
        return True

    def way(
        self,
        start: Array,
        end: Array,
        vias: Array,
        rng: np.random.Generator,
        *,
        around: bool = True,
    ) -> Way:
        """The straight move if it is free; else by one of `vias` (k, n); else searched for.

        Without `around` no more than the straight move is tested.
        """
        if self.is_free(start, end):
            return self._way(start, end, vias[:0])
        if not around:
            return Way(frozen(vias[:0]), np.inf)
        before = self.tested
        there, on = (travel_times(vias, one, self.speeds) for one in (start, end))
        for k in np.argsort(there + on, kind="stable")[:VIAS]:
            via = vias[k]
            if there[k] and on[k] and self.is_free(start, via) and self.is_free(via, end):
                return self._way(start, end, self._shortened(start, via[None], end))
        found = self._search(start, end, rng)
        if found is None:
            self.in_vain += self.tested - before
            return Way(frozen(vias[:0]), np.inf)
        return self._way(start, end, self._shortened(start, found, end))

    def leads_to(self, q: Array, known: Array) -> Bool:
        """Postures (N,) of q (N, n) that a free straight move leads to from one of `known` (k, n).

        Of each the `NEAR` nearest ones are tried.
        """
        found = np.zeros(len(q), dtype=np.bool_)
        for i, here in enumerate(q):
            nearest = np.argsort(self.reach(known - here), kind="stable")[:NEAR]
            found[i] = any(self.is_free(known[k], here) for k in nearest)
        return found

    def _way(self, start: Array, end: Array, via: Array) -> Way:
        """A way with its time."""
        stops = np.vstack([start, via, end])
        return Way(frozen(via), float(travel_times(stops[:-1], stops[1:], self.speeds).sum()))

    def _shortened(self, start: Array, via: Array, end: Array) -> Array:
        """Stops (k, n) pulled towards the straight line and left out where that stays free."""
        stops = [start, *via, end]
        k = 1
        while k < len(stops) - 1:
            if self.is_free(stops[k - 1], stops[k + 1]):
                del stops[k]
                continue
            middle = (stops[k - 1] + stops[k + 1]) / 2
            for share in (0.75, 0.5, 0.25):  # how far towards the middle
                nearer = stops[k] + share * (middle - stops[k])
                if self.is_free(stops[k - 1], nearer) and self.is_free(nearer, stops[k + 1]):
                    stops[k] = nearer
                    break
            k += 1
        return np.array(stops[1:-1]).reshape(-1, len(start))

    def _search(self, start: Array, end: Array, rng: np.random.Generator) -> Array | None:
        """Stops (k, n) of a way between two free postures, from two trees that grow together.

        References
        ----------
        Kuffner & LaValle 2000, RRT-Connect.
        """
        if self._simulator.collides(np.stack([start, end])).any():
            return None
        trees: tuple[Tree, Tree] = ([start], [-1]), ([end], [-1])
        for turn in range(NODES):
            tree, other = trees[turn % 2], trees[1 - turn % 2]
            aim = self._controller.holding(np.asarray(rng.uniform(*self._limits.T)))
            new = self._grow(tree, aim, 1) if self._inside(aim) else -1
            if new < 0:
                continue
            met = self._grow(other, tree[0][new], NODES)
            if met >= 0 and np.array_equal(other[0][met], tree[0][new]):
                there, back = (_branch(tree, new), _branch(other, met))
                whole = [*there[::-1], *back[1:]]
                return np.array(whole[1:-1] if turn % 2 == 0 else whole[-2:0:-1])
            if sum(len(nodes) for nodes, _ in trees) > NODES:
                break
        return None

    def _inside(self, q: Array) -> bool:
        """Whether a posture (n,) is inside the limits of arm and controller."""
        low, high = self._limits.T
        inside = (q >= low - BEYOND) & (q <= high + BEYOND)
        return bool(inside.all() and self._controller.allows(q))

    def _grow(self, tree: Tree, aim: Array, most: int) -> int:
        """Grow a tree towards a posture by at most so many branches; the node reached, or -1."""
        nodes, parents = tree
        nearest = int(np.argmin(self.reach(np.array(nodes) - aim)))
        for k in range(most):
            here = nodes[nearest]
            way = float(self.reach(aim - here))
            if way == 0.0:
                return nearest
            new = aim if way <= STRIDE else here + (STRIDE / way) * (aim - here)
            if not self.is_free(here, new):
                return nearest if k else -1
            nodes.append(new)
            parents.append(nearest)
            nearest = len(nodes) - 1
        return nearest


def _branch(tree: Tree, k: int) -> list[Array]:
    """Nodes from the k-th one back to the root."""
    nodes, parents = tree
    out = []
    while k >= 0:
        out.append(nodes[k])
        k = parents[k]
    return out


def spread(n: int) -> Index:
    """The numbers 0 ... n-1 with each prefix spread over the whole range: both ends, then halves.

    Examples
    --------
    >>> spread(5)
    array([0, 4, 2, 1, 3])
    """
    bits = max((n - 1).bit_length(), 1)
    reversed_bits = np.zeros(1 << bits, dtype=np.int64)
    for bit in range(bits):
        reversed_bits |= ((np.arange(1 << bits) >> bit) & 1) << (bits - 1 - bit)
    inner = reversed_bits[(reversed_bits > 0) & (reversed_bits < n - 1)]
    return np.concatenate([[0, n - 1], inner])[:n] if n > 1 else np.zeros(1, dtype=np.int64)
