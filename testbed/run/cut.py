"""Records that are played in pieces: each piece once, kept as it comes, and joined in order."""

from collections.abc import Iterator, Mapping, Sequence

from testbed.engines.engine import Engine
from testbed.engines.kit import Kit
from testbed.engines.piece import Piece, failed
from testbed.store.npz import Failure
from testbed.store.pieces import StoredPiece, piece_from
from testbed.store.run_folder import RunFolder
from testbed.studies.protocol import Record, Study


def cut_together(planned: Mapping[str, tuple[Study, Record]], name: str) -> dict[str, Record]:
    """The records that come from the pieces of one cut, by key."""
    return {
        key: record
        for key, (_, record) in planned.items()
        if record.cut is not None and record.cut.name == name
    }


def step_of(record: Record) -> str:
    """What progress calls the work on a record: its cut, or itself."""
    return record.cut.name if record.cut else record.key


class Pieces:
    """The pieces of work of one scenario, in its folder or in memory."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._memory: dict[str, bytes] = {}

    def have(self, folder: RunFolder | None, kit: Kit, pieces: Sequence[Piece]) -> Iterator[int]:
        """Play what is missing; how many there are, from those kept to all."""
        missing = [piece for piece in pieces if self._stored(folder, piece) is None]
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
        parts: list[object] = []
        for piece in pieces:
            stored = self._stored(folder, piece)
            if stored is None:
                raise RuntimeError(f"{piece.name} is lost")
            part = stored.part(record.key, record.kind)
            if isinstance(part, Failure):
                return part
            parts.append(part)
        if len(parts) == 1:
            return parts[0]
        return kit.study.gather(kit.scenario, record.key, parts)

    def _stored(self, folder: RunFolder | None, piece: Piece) -> StoredPiece | None:
        """A piece that was kept; None if there is none that can be used."""
        if folder:
            return folder.read_piece(piece.name, piece.spec)
        data = self._memory.get(piece.name)
        return None if data is None else piece_from(data, piece.name, piece.spec)
