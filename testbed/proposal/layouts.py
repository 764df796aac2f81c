"""Possible columns of joints and readings in rows without a header."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from testbed.proposal.data import Found
from testbed.proposal.sizes import signed
from testbed.proposal.transforms import BLOCKS, Block

Names = tuple[str, ...]
SCATTER = 0.2
"""What uncertainties of coordinates do not exceed, in millimeters or in meters."""
VARIES = 0.01
"""Part of the largest distance by which distances differ at least: else the arm stood still."""
FEWEST_EACH = 10
"""Rows of each number that may be a target: a base and a tool, 9 numbers, fit fewer by chance."""


@dataclass(frozen=True, slots=True)
class Layout:
    """Columns in one interpretation of the rows, by their numbers from 1."""

    name: str
    """Name, equal for joints and readings that belong together."""
    joints: Names = ()
    position: Names = ()
    rotation: Names = ()
    said: tuple[str, ...] = ()
    """Assumption on the order of numbers, if they are not separate columns."""
    target: str = ""
    """Column of whole numbers that may say which of several targets each row saw."""
    distance: str = ""
    """Column of distances from one fixed point, as of a draw wire."""


def layouts(look: Found, n: int) -> Iterator[Layout]:
    """Possible columns of joints, position and rotation in rows without a header."""
    for skip in (0, 1):
        left, at = look.width - skip, look.names + skip
        if left == n:
            yield Layout("joints", joints=_names(at, n))
        if (sent := left - n - 3) in (3, 6, 7):  # where it was sent, then where it was seen
            for name, q, p in (
                ("joints first", _names(at, n), _names(at + n + sent, 3)),
                ("joints last", _names(at + sent + 3, n), _names(at + sent, 3)),
            ):
                yield Layout(f"both {skip} seen {name}", q, p)
        for turns in (0, 3, 4):
            if left == 3 + turns:
                yield Layout("readings", (), _names(at, 3), _names(at + 3, turns))
            if left in (n + 3 + turns, n + 6 + turns):
                yield Layout(
                    f"both {skip} {turns} joints first",
                    _names(at, n), _names(at + n, 3), _names(at + n + 3, turns),
                )  # fmt: skip
                yield Layout(
                    f"both {skip} {turns} joints last",
                    _names(at + 3 + turns, n), _names(at, 3), _names(at + 3, turns),
                )  # fmt: skip
        if left > 7 or (left == 6 and _is_scatter(look, at + 3)):
            # what stands behind a place is not known
            yield Layout("readings", (), _names(at, 3))
        if left > n:  # or behind the joints: those of other axes
            yield Layout("joints", joints=_names(at, n))
            if target := _coded(look, at + n):
                yield Layout("joints", joints=_names(at, n), target=target)
        if left == n + 4 and (target := _coded(look, at + n)):
            yield Layout(
                f"both {skip} joints, target", _names(at, n), _names(at + n + 1, 3), target=target
            )
        if left == n + 1:
            for order, begin, k in (("first", at, at + n), ("last", at + 1, at)):
                if _is_distance(look, k):
                    (one,) = _names(k, 1)
                    yield Layout(f"both {skip} distance {order}", _names(begin, n), distance=one)
        for block in BLOCKS:
            if left == block.size and block.fits(_numbers(look, at, block)):
                yield _of_block("readings", block, at, ())
            if left in (n + block.size, n + block.size + 3):
                for order, begin, joints in (
                    ("first", at + n, at), ("last", at, at + block.size)
                ):  # fmt: skip
                    if block.fits(_numbers(look, begin, block)):
                        name = f"both {skip} {block.words} joints {order}"
                        yield _of_block(name, block, begin, _names(joints, n))


def _is_scatter(look: Found, at: int) -> bool:
    """Whether three columns are no angles, but small and never negative, as of uncertainties."""
    numbers = signed(look, _names(at, 3))
    return bool(((numbers >= 0) & (numbers < SCATTER)).all())


def _is_distance(look: Found, k: int) -> bool:
    """Whether the column behind `k` others may be distances: above zero, no count, unlike."""
    numbers = signed(look, _names(k, 1))[0]
    numbers = numbers[np.isfinite(numbers)]  # a missed one is no reason
    if len(numbers) < 2 or (numbers <= 0).any():
        return False
    counts = len(np.unique(np.diff(numbers))) == 1
    return bool(not counts and np.ptp(numbers) > VARIES * numbers.max())


def _names(start: int, count: int) -> Names:
    """Numbers of some columns, from 1."""
    return tuple(str(start + k + 1) for k in range(count))


def _coded(look: Found, k: int) -> str:
    """Name of the column behind `k` others, if it holds whole numbers that come again and again."""
    (name,) = _names(k, 1)
    count = Counter(look.column(name))
    again = len(count) > 1 and min(count.values()) >= FEWEST_EACH
    return name if again and all(code.isascii() and code.isdigit() for code in count) else ""


def _numbers(look: Found, at: int, block: Block) -> Array:
    """Numbers (m, size) of the columns of a block."""
    return signed(look, _names(at, block.size)).T


def _of_block(name: str, block: Block, at: int, q: Names) -> Layout:
    """A layout with a transform."""
    columns = _names(at, block.size)
    said = f"readings: columns {columns[0]} to {columns[-1]}, taken as {block.words}"
    place, turn = (tuple(columns[k] for k in own) for own in (block.place, block.turn))
    return Layout(name, q, place, turn, (said,))
