"""Records that are played in pieces: each piece once, kept as it comes, and joined in order."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from testbed.engines.engine import Engine
from testbed.engines.kit import Kit
from testbed.engines.piece import Piece, failed, pieces_of
from testbed.store.codec import narrowed
from testbed.store.npz import Failure
from testbed.store.pieces import StoredPiece, piece_from
from testbed.store.run_folder import RunFolder
from testbed.studies.protocol import Record, Study

if TYPE_CHECKING:
    from testbed.robots.robot import Robot


def cut_together(planned: Mapping[str, tuple[Study, Record]], name: str) -> dict[str, Record]:
    """The records that come from the pieces of one cut, by key."""
    return {
        key: record
        for key, (_, record) in planned.items()
        if record.cut is not None and record.cut.name == name
    }


def cut_names(planned: Mapping[str, tuple[Study, Record]]) -> list[str]:
    """All cuts, in the order of their records."""
    return list(dict.fromkeys(one.cut.name for _, one in planned.values() if one.cut))


def sliced_cuts(planned: Mapping[str, tuple[Study, Record]]) -> list[str]:
    """Those whose pieces go to slices: no other piece needs their records."""
    needed = {key for _, one in planned.values() if one.cut for key in one.needs}
    return [name for name in cut_names(planned) if not needed & {*cut_together(planned, name)}]


def all_pieces(
    planned: Mapping[str, tuple[Study, Record]], name: str, robot: "Robot"
) -> tuple[Piece, ...]:
    """The pieces of one cut, in their order."""
    records = cut_together(planned, name)
    return pieces_of(planned[next(iter(records))][0], records, robot)


class Pieces:
    """The pieces of work of one scenario, in its folder or in memory."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._memory: dict[str, bytes] = {}

    def have(self, folder: RunFolder | None, kit: Kit, pieces: Sequence[Piece]) -> Iterator[int]:
        """Play what is missing; how many there are, from those kept to all."""
        missing = [piece for piece in pieces if not self._played(folder, piece)]
        done = len(pieces) - len(missing)
        yield done
        for piece, found in self._engine.play(kit, missing):
            data = failed(piece, found) if isinstance(found, str) else found
            if folder:
                folder.write_piece(piece.name, data)
            else:
                self._memory[piece.name] = data
            done += 1
            yield done

    def joined(
        self, folder: RunFolder | None, kit: Kit, record: Record, pieces: Sequence[Piece]
    ) -> object:
        """The record from its parts; the first of them that failed is its `Failure`."""

        def read(piece: Piece) -> object:
            stored = self._stored(folder, piece)
            if stored is None:
                raise RuntimeError(f"{piece.name} is lost")
            part = stored.part(record.key, record.kind)
            if isinstance(part, Failure):
                raise _FailedError(part)
            return narrowed(part) if piece.single else part

        parts: Sequence[object] = _Parts(read, pieces)
        try:
            if not pieces[0].single:
                parts = list(parts)
            if len(parts) == 1:
                return parts[0]
            return kit.study.gather(kit.scenario, record.key, parts)
        except _FailedError as error:
            return error.failure

    def failures(self, folder: RunFolder | None, pieces: Sequence[Piece]) -> dict[str, str]:
        """Why parts of pieces failed, by the names of both."""
        return {
            f"{piece.name} {key}": reason
            for piece in pieces
            if (stored := self._stored(folder, piece)) is not None
            for key, reason in stored.failures.items()
        }

    def processors(self, folder: RunFolder, pieces: Iterable[Piece]) -> dict[str, int]:
        """How many pieces each kind of processor has played."""
        stored = (self._stored(folder, piece) for piece in pieces)
        known = (one.processor for one in stored if one is not None and one.played)
        return dict(sorted(Counter(known).items()))

    def _played(self, folder: RunFolder | None, piece: Piece) -> bool:
        """Whether a piece was kept that somebody has played."""
        stored = self._stored(folder, piece)
        return stored is not None and stored.played

    def _stored(self, folder: RunFolder | None, piece: Piece) -> StoredPiece | None:
        """A piece that was kept; None if there is none that can be used."""
        if folder:
            return folder.read_piece(piece.name, piece.spec)
        data = self._memory.get(piece.name)
        return None if data is None else piece_from(data, piece.name, piece.spec)


@dataclass(frozen=True, slots=True)
class _Parts(Sequence[object]):
    """Parts of a record of very many robots: each is read when it is asked for."""

    read: Callable[[Piece], object]
    pieces: Sequence[Piece]

    def __len__(self) -> int:
        return len(self.pieces)

    def __getitem__(self, at: Any) -> Any:
        return self.read(self.pieces[at])


class _FailedError(Exception):
    """A part of a record failed."""

    def __init__(self, failure: Failure) -> None:
        super().__init__(failure.reason)
        self.failure = failure
