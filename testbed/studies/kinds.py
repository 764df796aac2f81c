"""A study of robots of several kinds: one record per kind, its parts in modules of its folder."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar, cast

from testbed.laboratory.truth.setting import Setting
from testbed.report.page import Section
from testbed.scenario.hashes import goal_part, part, shared_part, truth_part
from testbed.scenario.scenario import Scenario
from testbed.store.quantities import Quantity, below
from testbed.studies.many_robots import ManyRobots, cut_of, kind_of, of_each_kind, played_keys
from testbed.studies.protocol import Answer, Record, Records, Task
from testbed.studies.trial.records import Campaign, Trial, campaign_of
from testbed.studies.trial.study import SETTING

if TYPE_CHECKING:
    from testbed.recording.story import Chapter

MOST_PUBLISHED = 10_000
"""Robots of a kind whose figures arrays.npz repeats."""


class OfOneKind(Protocol):
    """The record of robots of one kind."""

    @property
    def truth(self) -> str:
        """Preset of the robots."""


R = TypeVar("R", bound=OfOneKind)


@dataclass(frozen=True, slots=True)
class KindsStudy(Generic[R]):
    """The poses of the first trial on robots of several kinds, played in blocks of robots.

    All kinds of a block are one piece of work: robot k of every kind meets the same poses.

    What is particular stands in modules of the study's folder, imported when they are used: `play`
    has ``play_robots``, of several kinds, and ``gather``, `summary` has ``published`` and
    ``published_arrays``, `report` has ``answer`` and ``section``, `recording` has ``chapter``. All
    but those of `play` are called only where some kind of robots was played.
    """

    settings: type[ManyRobots]
    """Its table."""
    record: type[R]
    """Class of its records."""

    @property
    def name(self) -> str:
        """That of its table."""
        return self.settings.table

    @property
    def keys(self) -> tuple[str, ...]:
        """One per kind of robot."""
        return self.settings.keys

    def of(self, campaign: Campaign) -> tuple[R, ...]:
        """Its records, one per kind in the order of the scenario; none if the study is off."""
        return of_each_kind(campaign.records, campaign.scenario.table(self.settings), self.record)

    def records(self, scenario: Scenario) -> tuple[Record, ...]:
        """One record per kind of robot.

        It depends on no other kind and on no other trial than the first, but for when the robot is
        measured again: after the poses of the largest trial.
        """
        table, trials = scenario.table(self.settings), scenario.trial
        reads = {
            **shared_part(scenario),
            **part(scenario, "identification"),
            "trial": part(scenario, "trial")["trial"][0],
            "poses": [trial.poses for trial in trials],
            **goal_part(scenario),
        }
        keys = played_keys(table)
        truths = {key: truth_part(table.truth_of(scenario, kind_of(key))) for key in keys}
        own = part(scenario, self.name)[self.name]
        needs, less = (SETTING, trials[0].name), {k: v for k, v in own.items() if k != "robots"}
        cut = cut_of(self.name, table.robots, reads | {self.name: less | {"truths": truths}})
        return tuple(
            Record(key, self.record, reads | {self.name: own | {"truths": truth}}, needs, cut)
            for key, truth in truths.items()
        )

    def play(self, scenario: Scenario, task: Task, needed: Records) -> object:
        """Some robots of each kind."""
        setting, trial = needed.get(SETTING, Setting), needed.get(scenario.trial[0].name, Trial)
        kinds = {kind_of(key): key for key in task.keys}
        found = self._part("play").play_robots(scenario, setting, tuple(kinds), trial, task.block)
        return {key: found[kind] for kind, key in kinds.items()}

    def gather(self, scenario: Scenario, key: str, parts: Sequence[Any]) -> object:
        """The robots of all pieces."""
        return self._part("play").gather(parts)

    def answer(self, scenario: Scenario, records: Records) -> Answer | None:
        """The answer over all kinds of robots."""
        campaign = campaign_of(scenario, records)
        return cast(Answer, self._part("report").answer(campaign)) if self.of(campaign) else None

    def results(self, scenario: Scenario, records: Records) -> Sequence[Quantity]:
        """Figures of every kind of robot."""
        studies = self.of(campaign_of(scenario, records))
        return below(self.name, self._part("summary").published(studies)) if studies else ()

    def arrays(self, scenario: Scenario, records: Records) -> Sequence[Quantity]:
        """What each robot gave, where those are not so many that their records must do."""
        found: list[Quantity] = []
        if scenario.table(self.settings).robots > MOST_PUBLISHED:
            return found
        for study in self.of(campaign_of(scenario, records)):
            arrays = self._part("summary").published_arrays(study)
            found += below(f"{self.name}/{study.truth}", arrays)
        return found

    def sections(self, scenario: Scenario, records: Records, *, first: bool) -> Sequence[Section]:
        """The answer at length."""
        campaign = campaign_of(scenario, records)
        return (self._part("report").section(campaign),) if self.of(campaign) else ()

    def recording(self, scenario: Scenario, records: Records) -> Sequence["Chapter"]:
        """One chapter."""
        campaign = campaign_of(scenario, records)
        return (self._part("recording").chapter(campaign),) if self.of(campaign) else ()

    def _part(self, name: str) -> Any:
        """A module of its folder."""
        return import_module(f"testbed.studies.{self.name}.{name}")
