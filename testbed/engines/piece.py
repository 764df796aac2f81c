"""One piece of work as a pure function: what it is called, what it depends on, and its bytes."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from calib.errors import CalibError, MachineError
from testbed.scenario.hashes import record_hash
from testbed.scenario.scenario import Scenario
from testbed.store.npz import Failure
from testbed.store.pieces import NOBODY, piece_bytes, piece_name
from testbed.studies.protocol import Record, Records, Study, Task
from testbed.versions import processor

if TYPE_CHECKING:
    from testbed.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class Piece:
    """A piece of work, by name and by all that decides its numbers."""

    task: Task
    name: str
    """Of its file."""
    spec: str
    """Hash of what it depends on."""
    single: bool = False
    """Whether figures of each robot are kept in float32."""


def pieces_of(study: Study, records: Mapping[str, Record], robot: "Robot") -> tuple[Piece, ...]:
    """All pieces of the records of one cut, in their order."""
    keys = tuple(records)
    cut = records[keys[0]].cut
    assert cut is not None  # only cut records come in pieces
    found = []
    for k in range(cut.count):
        task = Task(study.name, keys, k, cut.block(k))
        reads = {**cut.reads, "piece": [k, len(task.block)]}
        spec = record_hash(reads, robot, cut.name)
        found.append(Piece(task, piece_name(cut.name, k), spec, cut.single))
    return tuple(found)


def played(study: Study, scenario: Scenario, piece: Piece, needed: Records) -> bytes:
    """The file of a piece: the same bytes whoever plays it, when, and how often.

    A part that fails is a result; what the machine lacks is raised.
    """
    parts = _parts(study, scenario, piece.task, needed)
    return piece_bytes(piece.name, parts, piece.spec, processor(), single=piece.single)


def failed(piece: Piece, reason: str) -> bytes:
    """The file of a piece that cannot be played at all; a run that goes on tries it again."""
    parts = dict.fromkeys(piece.task.keys, Failure(reason))
    return piece_bytes(piece.name, parts, piece.spec, NOBODY)


def _parts(
    study: Study, scenario: Scenario, task: Task, needed: Records
) -> dict[str, object | Failure]:
    """The part of each record; where one fails, the others do not."""
    try:
        found = study.play(scenario, task, needed)
        assert isinstance(found, dict)  # the protocol: parts by key
        return found
    except MachineError:
        raise
    except CalibError as error:
        if len(task.keys) == 1:
            return {task.key: Failure(str(error))}
    alone = (replace(task, keys=(key,)) for key in task.keys)
    return {
        key: part for one in alone for key, part in _parts(study, scenario, one, needed).items()
    }
