"""Which postures are known to be connected by free ways, and which were searched for in vain."""

from collections.abc import Iterator

import numpy as np


class Islands:
    """Postures in islands: ways lead to every one of the same island, in both directions.

    A search in vain between two islands holds for all of their postures, so that it is made once
    and not for every pair.

    Parameters
    ----------
    n : int
        Postures; at first each one is an island.

    Examples
    --------
    >>> islands = Islands(4)
    >>> islands.join(0, 1)
    >>> islands.part(1, 2)
    >>> islands.apart(0, 2), islands.apart(0, 3)
    (True, False)
    """

    def __init__(self, n: int) -> None:
        self._island = np.arange(n)
        self._apart = np.zeros((n, n), dtype=bool)

    def apart(self, a: int, b: int) -> bool:
        """Whether a way between the islands of two postures was searched for in vain."""
        return bool(self._apart[a, b])

    def pairs(self, *, apart: bool) -> Iterator[tuple[int, int]]:
        """Pairs of postures, the smaller number first: those that are apart, or all."""
        for a, among in enumerate(self._apart):
            others = np.flatnonzero(among[a + 1 :]) if apart else np.arange(len(among) - a - 1)
            yield from ((a, int(other) + a + 1) for other in others)

    def join(self, a: int, b: int) -> None:
        """There is a way between two postures."""
        both = (self._island == self._island[a]) | (self._island == self._island[b])
        parted = self._apart[both].any(axis=0)
        self._island[both] = self._island[a]
        self._apart[both], self._apart[:, both] = parted, parted[:, None]
        self._apart[np.ix_(both, both)] = False

    def part(self, a: int, b: int) -> None:
        """No way was found between two postures; nothing new if ways lead around by others."""
        here, there = self._island == self._island[a], self._island == self._island[b]
        if not here[b]:
            self._apart |= np.outer(here, there) | np.outer(there, here)
