"""A scenario's records, each made once and kept as soon as it is whole; then derived files."""

import json
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from calib.errors import CalibError, MachineError, refuse
from testbed.engines.engine import Alone, Engine
from testbed.engines.kit import Kit
from testbed.engines.piece import Piece
from testbed.progress import Clock, Progress
from testbed.run.cut import Pieces, all_pieces, cut_names, cut_together, sliced_cuts
from testbed.run.derive import Derive, Played
from testbed.run.steps import Steps
from testbed.scenario.hashes import record_hash
from testbed.scenario.scenario import Scenario
from testbed.store import layout, npz
from testbed.store.npz import (
    DONE,
    FAILED,
    Content,
    Failure,
    record_bytes,
    record_content,
    record_from,
    to_bytes,
)
from testbed.store.run_folder import RunFolder
from testbed.studies.protocol import Record, Records, Study, Task
from testbed.versions import all_versions, own_version

if TYPE_CHECKING:
    from testbed.robots.robot import Robot

LOST = "give the `truebed run` command again with --resume"
"""The way to a record that is not there."""


class Work:
    """One scenario being played: the records made or kept so far."""

    def __init__(
        self,
        scenario: Scenario,
        robot: "Robot",
        studies: Iterable[Study],
        derive: Derive,
        *,
        engine: Engine | None = None,
        progress: Progress | None = None,
        folder: RunFolder | None = None,
        only_stored: bool = False,
    ) -> None:
        self.scenario, self.robot, self.studies = scenario, robot, tuple(studies)
        self.folder = folder
        self.only_stored = only_stored
        """Compute nothing: a record that is not there is an error."""
        self.planned: dict[str, tuple[Study, Record]] = {
            record.key: (study, record)
            for study in self.studies
            for record in study.records(scenario)
        }
        self._steps = Steps(record for _, record in self.planned.values())
        self.failed: dict[str, str] = {}
        self.kept: list[str] = []
        self._derive = derive
        self._progress = progress or (lambda *_: None)
        self._values: dict[str, object] = {}
        self._making: list[str] = []
        self._pieces = Pieces(engine or Alone())
        self._clock = Clock()

    def make(self, order: Iterable[str] | None = None) -> Records:
        """Make every record, in any order; one that fails is counted with its reason."""
        keys = tuple(self.planned) if order is None else tuple(order)
        if sorted(keys) != sorted(self.planned):
            raise refuse(
                "order", keys, f"each of {', '.join(self.planned)} once", code="C41",
                message=f"order is {', '.join(keys)}",
            )  # fmt: skip
        for key in keys:
            self._ensure(key)
        return Records(self._values, self.failed)

    def _ensure(self, key: str) -> None:
        """Have the record `key`: in memory, from disk, or made now after those it needs."""
        if key in self._values or key in self.failed:
            return
        study, record = self.planned[key]
        spec = record_hash(record.reads, self.robot, key)
        stored: object = None
        if self.folder and self.only_stored:
            stored = self._required(self.folder, record, spec)
        elif self.folder:
            kept = self._stays(record)
            stored = self.folder.read_record(key, record.kind, spec, kept=kept)
            if isinstance(stored, Failure) and record.cut is not None:
                stored = None  # its pieces tell whether it fails still
        if stored is None:
            stored = self._make(study, record, spec)
        else:
            self.kept.append(key)
        if isinstance(stored, Failure):
            self.failed[key] = stored.reason
        else:
            self._values[key] = stored

    def _make(self, study: Study, record: Record, spec: str) -> object:
        """Compute one record, keep it, and hand over what a later reader would read."""
        key = record.key
        if key in self._making:
            raise RuntimeError(f"{key} asks for itself: {' -> '.join([*self._making, key])}")
        if record.cut is None:
            self._report(key)
        self._making.append(key)
        try:
            with self._clock.step(key):
                for other in record.needs:
                    self._ensure(other)
                data, status = self._computed(study, record, spec)
        finally:
            self._making.pop()
        if self.folder:
            self.folder.write_record(key, data)
        seconds = round(self._clock.seconds[key], 3)
        self.event("record", key=key, status=status, seconds=seconds)
        # read back: what follows sees the same bits, whether this was made now or kept
        if isinstance(data, bytes):
            return record_from(data, key, record.kind, spec)
        assert self.folder is not None  # only there a record stays in its file
        del data
        return self._required(self.folder, record, spec)

    def _required(self, folder: RunFolder, record: Record, spec: str) -> object:
        """A record that must be there."""
        kept = self._stays(record)
        return folder.require_record(record.key, record.kind, spec, fix=LOST, kept=kept)

    def _stays(self, record: Record) -> bool:
        """Whether a record has so many robots that its figures stay in its file.

        One that others are made from is looked at too often.
        """
        large = self.folder is not None and record.cut is not None and record.cut.single
        return large and not any(record.key in other.needs for _, other in self.planned.values())

    def _computed(self, study: Study, record: Record, spec: str) -> tuple[bytes | Content, str]:
        """The file of one record; a failure that is a result of the study is a record too."""
        key = record.key
        try:
            whole = self._whole(study, record)
            status = FAILED if isinstance(whole, Failure) else DONE
            single = record.cut is not None and record.cut.single
            content = record_content(key, whole, spec, single=single)
            return content if self._stays(record) else to_bytes(*content), status
        except MachineError:
            raise
        except MemoryError as error:
            raise MachineError(
                f"{key} needs more memory than there is",
                code="F10",
                field=key,
                fix="close other programs, then go on with --resume",
            ) from error
        except CalibError as error:
            if record.vital:
                raise
            return record_bytes(key, Failure(str(error)), spec), FAILED

    def _whole(self, study: Study, record: Record) -> object:
        """One record, played now or joined from its pieces."""
        kit = self._kit(study, record)
        if record.cut is None:
            return study.play(self.scenario, Task(study.name, (record.key,)), kit.needed)
        cut = record.cut.name
        pieces = all_pieces(self.planned, cut, self.robot)
        if self._steps.played.get(cut) != len(pieces):  # no other record of the cut was made before
            self._play(cut, kit, pieces)
        return self._pieces.joined(self.folder, kit, record, pieces)

    def _kit(self, study: Study, record: Record) -> Kit:
        """What a record is made from, once that is there."""
        needed = Records(
            {key: self._values[key] for key in record.needs if key in self._values},
            {key: self.failed[key] for key in record.needs if key in self.failed},
        )
        return Kit(self.scenario, self.robot, study, needed)

    def _play(self, cut: str, kit: Kit, pieces: Sequence[Piece]) -> None:
        """Have some pieces of a cut, and say how far that is."""
        with self._clock.step(cut):
            for done in self._pieces.have(self.folder, kit, pieces):
                self._steps.played[cut] = done
                if done < len(pieces):
                    self._report(cut)

    def play_slice(self, number: int, count: int) -> tuple[int, dict[str, str]]:
        """Play every `count`-th piece, from `number`: how many those are, and why parts failed.

        Records that the pieces need are made, no others.
        """
        mine: dict[str, tuple[Piece, ...]] = {}
        before = 0
        for cut in sliced_cuts(self.planned):
            pieces = all_pieces(self.planned, cut, self.robot)
            mine[cut] = pieces[(number - 1 - before) % count :: count]
            before += len(pieces)
        firsts = {cut: next(iter(cut_together(self.planned, cut))) for cut in mine}
        needed = [self.planned[key][1] for key in self._below(firsts.values())]
        self._steps.keep_slice(needed, {cut: len(pieces) for cut, pieces in mine.items()})
        failures: dict[str, str] = {}
        for cut, pieces in mine.items():
            study, record = self.planned[firsts[cut]]
            for key in record.needs:
                self._ensure(key)
            self._play(cut, self._kit(study, record), pieces)
            failures |= self._pieces.failures(self.folder, pieces)
        self._progress("", self.steps, self.steps)
        self.event("slice", number=number, count=count, failed=sorted(failures))
        return sum(map(len, mine.values())), failures

    def _below(self, keys: Iterable[str]) -> set[str]:
        """All records that some need, and what those need."""
        needs = {other for key in keys for other in self.planned[key][1].needs}
        return needs | self._below(needs) if needs else needs

    def derive(self, names: Iterable[str]) -> Records:
        """Write derived files from the records, each whole or not at all."""
        if self.folder is None:
            raise RuntimeError("nothing to write to")
        records = self.make()
        played = Played(self.scenario, self.robot, self.studies, records)
        for name in names:
            self._report(name)
            with self._clock.step(name):
                self._write(name, played, self.folder)
            self._steps.wrote()
            self.event("wrote", file=name, seconds=round(self._clock.seconds[name], 3))
        self._progress("", self.steps, self.steps)
        if not self.only_stored:
            self._write_timing(self.folder)
        return records

    def _write(self, name: str, played: Played, folder: RunFolder) -> None:
        """Write one derived file."""
        data = self._derive(name, played)
        if name == layout.RESULT:
            document = npz.strict_json(data)
            failed = dict(sorted(self.failed.items()))
            data = npz.pretty_json({**document, "failed": failed, "truebed": own_version()})
        folder.write(name, data)

    @property
    def steps(self) -> int:
        """Records, pieces of those that are cut, and derived files in all."""
        return self._steps.total(files=self.folder is not None)

    def _report(self, name: str) -> None:
        """Report what begins now."""
        finished = (self.planned[key][1] for key in (*self._values, *self.failed))
        self._progress(name, self._steps.done(finished), self.steps)

    def processors(self, folder: RunFolder) -> dict[str, int]:
        """How many of all pieces each kind of processor has played."""
        cuts = cut_names(self.planned)
        pieces = (one for cut in cuts for one in all_pieces(self.planned, cut, self.robot))
        return self._pieces.processors(folder, pieces)

    def _write_timing(self, folder: RunFolder) -> None:
        """How long each step took; no number of the result depends on it."""
        seconds = {name: round(value, 3) for name, value in self._clock.seconds.items()}
        document = {
            "wall_s": seconds,
            "total_s": round(sum(seconds.values()), 3),
            "peak_memory_mb": self._clock.memory,
            "kept": self.kept,
            "versions": all_versions(),
        }
        folder.write(layout.TIMING, npz.pretty_json(document))

    def event(self, what: str, **details: Any) -> None:
        """One line of the log."""
        if self.folder is not None:
            now = datetime.now(UTC).isoformat(timespec="milliseconds")
            line = json.dumps({"time": now, "event": what, **details}, ensure_ascii=False)
            self.folder.log(line.encode() + b"\n")
