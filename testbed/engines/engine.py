"""What an engine is, and the one that needs no other process."""

from collections.abc import Iterator, Sequence
from typing import Protocol

from testbed.engines.kit import Kit
from testbed.engines.piece import Piece, played


class Engine(Protocol):
    """Plays pieces in any order and hands over the file of each as it comes.

    It keeps nothing: a run that is stopped has what was handed over.
    """

    def play(self, kit: Kit, pieces: Sequence[Piece]) -> Iterator[tuple[Piece, bytes | str]]:
        """The file of every piece, once, or why it was given up."""

    def close(self) -> None:
        """End all that it began."""


class Alone:
    """The process itself, one piece after the other."""

    def play(self, kit: Kit, pieces: Sequence[Piece]) -> Iterator[tuple[Piece, bytes | str]]:
        """The file of every piece, in their order."""
        for piece in pieces:
            yield piece, played(kit.study, kit.scenario, piece, kit.needed)

    def close(self) -> None:
        """Nothing was begun."""
