"""A scenario's records, each made once and kept as soon as it is whole; then derived files."""

import json
from collections.abc import Iterable
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from calib.errors import CalibError, InputError, MachineError
from testbed.disk import atomic_path
from testbed.progress import Clock, Progress
from testbed.scenario.read import STUDY_KEYS, Scenario, record_hash
from testbed.store import layout, npz
from testbed.store.record import DONE, FAILED, Failure, record_bytes, record_from
from testbed.store.run_folder import RunFolder
from testbed.studies.protocol import Stages
from testbed.studies.wen2022.settings import SETS_KEY
from testbed.versions import all_versions, own_version

if TYPE_CHECKING:
    from testbed.robots.catalog import Robot

SETTING = "setting"


class FailedRecordError(CalibError):
    """A record asks for another one that failed."""


class Work:
    """One scenario being played: the records made or kept so far."""

    def __init__(
        self,
        scenario: Scenario,
        robot: "Robot",
        stages: Stages,
        progress: Progress | None = None,
        folder: RunFolder | None = None,
        *,
        only_stored: bool = False,
    ) -> None:
        self.scenario, self.robot, self.stages = scenario, robot, stages
        self.folder = folder
        self.only_stored = only_stored
        """Compute nothing: a record that is not there is an error."""
        self.keys = stages.record_keys(scenario)
        self.failed: dict[str, str] = {}
        self.kept: list[str] = []
        self._progress = progress or (lambda *_: None)
        self._records: dict[str, Any] = {}
        self._making: list[str] = []
        self._clock = Clock()
        self._derived = 0

    def make(self, order: Iterable[str] | None = None) -> None:
        """Make every record, in any order; a trial that fails is counted with its reason."""
        keys = self.keys if order is None else tuple(order)
        if sorted(keys) != sorted(self.keys):
            raise InputError(
                f"order is {', '.join(keys)}",
                code="C41",
                field="order",
                value=keys,
                allowed=f"each of {', '.join(self.keys)} once",
            )
        for key in keys:
            self._record(key)

    def get(self, key: str) -> Any:
        """The record `key`, made first if need be; FailedRecordError if it failed."""
        record = self._record(key)
        if isinstance(record, Failure):
            raise FailedRecordError(f"{key} failed ({record.reason})", code="T1", field=key)
        return record

    def _record(self, key: str) -> Any:
        """The record or failure `key`: in memory, on disk, or made now."""
        if key not in self._records:
            spec = record_hash(self.scenario, self.robot, key)
            kind = self.stages.record_type(key)
            record = self.folder.read_record(key, kind, spec) if self.folder else None
            if record is None:
                record = self._make(key, kind, spec)
            else:
                self.kept.append(key)
            if isinstance(record, Failure):
                self.failed[key] = record.reason
            self._records[key] = record
        return self._records[key]

    def _make(self, key: str, kind: type, spec: str) -> Any:
        """Compute one record, keep it, and hand over what a later reader would read."""
        if self.only_stored:
            raise InputError(
                f"the record {key} is missing or damaged",
                code="D42",
                where=str(self.folder.path) if self.folder else "",
                field=key,
                fix="give the `truebed run` command again with --resume",
            )
        if key in self._making:
            raise RuntimeError(f"{key} asks for itself: {' -> '.join([*self._making, key])}")
        self._tell(key)
        self._making.append(key)
        self._clock.begin(key)
        try:
            data, status = self._computed(key, spec)
        finally:
            seconds = self._clock.end()
            self._making.pop()
        if self.folder:
            self.folder.write_record(key, data)
        self.event("record", key=key, status=status, seconds=round(seconds, 3))
        # read back: what follows sees the same bits, whether this was made now or kept
        return record_from(data, key, kind, spec)

    def _computed(self, key: str, spec: str) -> tuple[bytes, str]:
        """The file of one record; a failure that is a result of the study is a record too."""
        try:
            record = self.stages.compute(self.scenario, key, self.get)
            return record_bytes(key, record, spec), DONE
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
            if key == SETTING:
                raise
            return record_bytes(key, Failure(str(error)), spec), FAILED

    def campaign(self) -> Any:
        """The campaign of all records that did not fail."""
        for key in self.keys:
            self._record(key)
        trials = tuple(trial for trial in self.scenario.trial if trial.name not in self.failed)
        if not trials:
            reasons = "; ".join(f"{key}: {reason}" for key, reason in self.failed.items())
            raise CalibError(f"every trial failed: {reasons}", code="T1", field="trial")
        if not self.failed:
            return self.stages.gather(self.scenario, self.get)
        studies = self.scenario.studies.model_copy(
            update={
                key: 0 if key == "random_sets" else False
                for key in set(STUDY_KEYS) & set(self.failed)
            }
        )
        coverage = self.scenario.coverage
        kinds = tuple(t for t in coverage.truths if f"coverage.{t}" not in self.failed)
        coverage = coverage.model_copy(update={"truths": kinds})
        again = self.scenario.reexamined
        kinds = tuple(t for t in again.truths if f"reexamined.{t}" not in self.failed)
        off = SETS_KEY in self.failed or not kinds
        again = again.model_copy(update={"truths": kinds, **({"robots": 0} if off else {})})
        loop = self.scenario.compensation
        kinds = tuple(t for t in loop.truths if f"compensation.{t}" not in self.failed)
        loop = loop.model_copy(update={"truths": kinds})
        update = {"trial": trials, "studies": studies, "coverage": coverage, "reexamined": again}
        update["compensation"] = loop
        sound = self.scenario.model_copy(update=update)
        return self.stages.gather(sound, self.get)

    def derive(self, names: Iterable[str]) -> Any:
        """Write derived files from the records, each whole or not at all; the campaign."""
        if self.folder is None:
            raise RuntimeError("nothing to write to")
        campaign = self.campaign()
        for name in names:
            self._tell(name)
            self._clock.begin(name)
            try:
                self._derive(name, campaign, self.folder)
            finally:
                seconds = self._clock.end()
            self._derived += 1
            self.event("wrote", file=name, seconds=round(seconds, 3))
        self._progress("", self.steps, self.steps)
        if not self.only_stored:
            self._write_timing(self.folder)
        return campaign

    def _derive(self, name: str, campaign: Any, folder: RunFolder) -> None:
        """Write one derived file."""
        if name == layout.RECORDING:
            with atomic_path(folder.path / name) as temporary:
                self.stages.derive(name, campaign, self.robot, temporary)
            return
        data = self.stages.derive(name, campaign, self.robot, folder.path / name) or b""
        if name == layout.RESULT:
            document = npz.strict_json(data)
            failed = dict(sorted(self.failed.items()))
            data = npz.pretty_json({**document, "failed": failed, "truebed": own_version()})
        folder.write(name, data)

    @property
    def steps(self) -> int:
        """Records and derived files in all."""
        return len(self.keys) + (len(layout.DERIVED) if self.folder else 0)

    def _tell(self, name: str) -> None:
        """Report what begins now."""
        self._progress(name, len(self._records) + self._derived, self.steps)

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
