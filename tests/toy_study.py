"""A study of another distribution: how far repeated shots of one pose lie apart, on toy robots."""

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from calib.arrays import Array
from testbed.faults import Fault
from testbed.laboratory.truth.setting import Setting
from testbed.recording.chart import Chart, Series
from testbed.recording.story import Chapter
from testbed.recording.timeline import spread
from testbed.report.page import Section, Table, Text, Verdict
from testbed.robots.robot import Robot
from testbed.scenario.hashes import part, shared_part
from testbed.scenario.scenario import Scenario, StudyTable
from testbed.store.quantities import METRE, Quantity
from testbed.streams import stream
from testbed.studies.protocol import Answer, Cut, Record, Records, Task

KEY = "toy.spread"


class ToySettings(StudyTable):
    """[toy]: how many robots, and how many shots of each."""

    table: ClassVar[str] = "toy"
    keys: ClassVar[tuple[str, ...]] = (KEY,)
    totals: ClassVar[tuple[str, ...]] = ("robots",)
    robots: Annotated[int, Field(ge=0, le=100)] = 0
    shots: Annotated[int, Field(ge=2, le=100)] = 5

    def contradictions(self, scenario: Scenario) -> list[str]:
        """More shots than robots are nonsense here."""
        if self.robots and self.shots > 10 * self.robots:
            return [f"[toy] shots is {self.shots}; at most ten per robot; write fewer"]
        return []

    def faults(self, scenario: Scenario, robot: Robot) -> list[Fault]:
        """Every robot will do."""
        return []


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """Spread of the shots of each robot."""

    sd: Array
    """(R,) of the shots [m]."""


class ToyStudy:
    """How far repeated shots lie apart."""

    name = "toy"
    settings = ToySettings
    keys = ToySettings.keys

    def __init__(self) -> None:
        self.played: list[int] = []
        self.interrupted_at: int | None = None

    def records(self, scenario: Scenario) -> tuple[Record, ...]:
        """One record; two robots a piece."""
        robots = scenario.table(ToySettings).robots
        if not robots:
            return ()
        reads = shared_part(scenario) | part(scenario, "toy")
        less = reads | {"toy": {"shots": scenario.table(ToySettings).shots}}
        return (Record(KEY, Spread, reads, ("setting",), Cut("toy", robots, 2, less)),)

    def play(self, scenario: Scenario, task: Task, needed: Records) -> object:
        """Two robots."""
        if task.piece == self.interrupted_at:
            raise KeyboardInterrupt
        time.sleep(float(os.environ.get("TOY_PAUSE", "0")))
        self.played.append(task.piece)
        table = scenario.table(ToySettings)
        size = needed.get("setting", Setting).pool_q.mean()
        draws = [
            stream(scenario.seed, "toy", k).normal(size, 1e-5, table.shots) for k in task.block
        ]
        return {KEY: Spread(np.std(draws, axis=1))}

    def gather(self, scenario: Scenario, key: str, parts: Sequence[Any]) -> Spread:
        """All robots."""
        return Spread(np.concatenate([one.sd for one in parts]))

    def _spread(self, records: Records) -> Spread | None:
        return records.find(KEY, Spread)

    def answer(self, scenario: Scenario, records: Records) -> Answer | None:
        """The mean spread."""
        found = self._spread(records)
        if found is None:
            return None
        said = f"Shots lie {found.sd.mean() * 1e6:.1f} um apart."
        table = Table("Spread", ("robots",), ((str(len(found.sd)),),), "l")
        return Answer(Verdict(True, False, said, (), "✓ toys agree"), table, "Buy more toys.")

    def results(self, scenario: Scenario, records: Records) -> Sequence[Quantity]:
        """The mean spread."""
        found = self._spread(records)
        return () if found is None else [Quantity("toy/mean_um", float(found.sd.mean()), METRE)]

    def arrays(self, scenario: Scenario, records: Records) -> Sequence[Quantity]:
        """Every robot."""
        found = self._spread(records)
        return () if found is None else [Quantity("toy/sd_m", found.sd, METRE)]

    def sections(self, scenario: Scenario, records: Records, *, first: bool) -> Sequence[Section]:
        """One paragraph."""
        words = "first" if first else "beside others"
        return (Section("toy", "Toys", (Text(f"Toys come {words}."),), part="answer"),)

    def recording(self, scenario: Scenario, records: Records) -> Sequence[Chapter]:
        """The spread as a curve."""
        found = self._spread(records)
        if found is None:
            return ()

        curve = Series("sd", found.sd * 1e6, (9, 9, 9))

        motion = spread(len(found.sd), 14)
        return (
            Chapter(
                "toy",
                "toy_robot",
                (1, 2, 3),
                motion,
                ("#### Toys",),
                lambda *_: None,
                charts=(Chart("toy", "sd", (curve,)),),
            ),
        )


STUDY = ToyStudy()
