"""What an engine is, and the one that needs no other process."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from testbed.engines.piece import Piece, played
from testbed.scenario.scenario import Scenario
from testbed.studies.protocol import Records, Study


@dataclass(frozen=True, slots=True, eq=False)
class Kit:
    """All that the pieces of one cut need to be played."""

    scenario: Scenario
    study: Study
    needed: Records


class Engine(Protocol):
    """Plays pieces in any order and hands over the file of each as it comes.

    It keeps nothing: a run that is stopped has what was handed over.
    """

    def play(self, kit: Kit, pieces: Sequence[Piece]) -> Iterator[tuple[Piece, bytes]]:
        """The file of every piece, once."""


class Alone:
    """The process itself, one piece after the other."""

    def play(self, kit: Kit, pieces: Sequence[Piece]) -> Iterator[tuple[Piece, bytes]]:
        """The file of every piece, in their order."""
        for piece in pieces:
            yield piece, played(kit.study, kit.scenario, piece, kit.needed)
