"""[reexamined]: the protocol of Wen et al. 2022 on many robots of several kinds and pools."""

from typing import Annotated, ClassVar

from pydantic import Field

from testbed.robots.robot import Robot
from testbed.scenario.laboratory import At960Tracker
from testbed.scenario.scenario import Scenario, StudyTable
from testbed.scenario.tables import PAPER_SET
from testbed.strict import Fault
from testbed.studies.many_robots import (
    TRUTHS,
    TruthName,
    keys_of,
    table_contradictions,
    truths_faults,
)

SETS_KEY = "reexamined.sets"
"""Record of the pools and the pose sets chosen from them, which all kinds of robots share."""
FEWEST_POSES = 100
"""Poses of a pool below which its four regions are too poor to calibrate in each."""


class ReexaminedSettings(StudyTable):
    """[reexamined]: every trial's kind of set, chosen anew from each of several pools."""

    table: ClassVar[str] = "reexamined"
    keys: ClassVar[tuple[str, ...]] = (SETS_KEY, *keys_of("reexamined"))

    robots: Annotated[int, Field(ge=0, le=10_000)] = 0
    """Virtual robots of each kind; 0 skips the study."""
    pools: Annotated[int, Field(ge=1, le=1000)] = 12
    """Pools, each with designed sets and held-out poses of its own; each meets as many robots."""
    truths: Annotated[tuple[TruthName, ...], Field(min_length=1, max_length=len(TRUTHS))] = (
        "rigid",
        "wen2022",
    )
    """Kinds of robots: presets of [truth] as they ship, whatever this scenario's [truth] says."""

    def contradictions(self, scenario: Scenario) -> list[str]:
        """Sentences, one per contradiction with itself or other tables."""
        found = table_contradictions(self, scenario)
        if not self.robots:
            return found
        if self.robots > 1 and self.robots % self.pools:
            nearest = max(1, round(self.robots / self.pools)) * self.pools
            found.append(
                f"[reexamined] robots is {self.robots} and pools is {self.pools}; every pool "
                f"meets as many robots; write robots = {nearest}"
            )
        if isinstance(scenario.tracker, At960Tracker) and scenario.tracker.systematic:
            found.append(
                "[reexamined] asks what the paper's statements hold, which know no systematic "
                "part; [tracker] systematic is true; write systematic = false, or robots = 0"
            )
        if not any(trial.method == "detmax" and trial.rows == "paper" for trial in scenario.trial):
            found.append(
                "[reexamined] plays the protocol of the paper, and no [[trial]] chooses its set as "
                'there; write method = "detmax" and rows = "paper" in one, or robots = 0'
            )
        if scenario.pool.size < FEWEST_POSES:
            found.append(
                f"[pool] size is {scenario.pool.size}; [reexamined] calibrates in each quarter of "
                f"the pool; write size = {FEWEST_POSES} or more"
            )
        return found

    def faults(self, scenario: Scenario, robot: Robot) -> list[Fault]:
        """Faults of kinds of robots that this one cannot be; it needs the paper's free set."""
        found = truths_faults(scenario, robot, self)
        if self.robots and PAPER_SET not in robot.free_sets:
            found.append(
                Fault(
                    ("reexamined", "robots"),
                    f"[reexamined] robots is {self.robots}, but {robot.name} has no free set "
                    f'"{PAPER_SET}", the numbers that the paper identifies',
                    fix="write robots = 0",
                    value=self.robots,
                )
            )
        return found


TABLE = ReexaminedSettings
