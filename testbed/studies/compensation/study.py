"""The loop closed: commanded poses corrected and measured again, ISO 9283 before and after."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from testbed.report.page import Section
from testbed.scenario.scenario import Scenario
from testbed.store.quantities import Quantity
from testbed.studies.compensation.records import CompensationStudy, compensation_of
from testbed.studies.compensation.settings import CompensationSettings
from testbed.studies.many_robots import records_of_kinds, robots_of_kind
from testbed.studies.protocol import Answer, Record, Records, Task
from testbed.studies.trial.records import campaign_of

if TYPE_CHECKING:
    from testbed.recording.story import Chapter


class CompensationStudies:
    """What a calibration is worth to a program, before and after its targets are corrected."""

    name = "compensation"
    settings = CompensationSettings
    keys = CompensationSettings.keys

    def records(self, scenario: Scenario) -> tuple[Record, ...]:
        """One record per kind of robot."""
        return records_of_kinds(scenario, scenario.table(CompensationSettings), CompensationStudy)

    def play(self, scenario: Scenario, task: Task, needed: Records) -> object:
        """Some robots of one kind."""
        from testbed.studies.compensation.play import play_robots

        table = scenario.table(CompensationSettings)
        return play_robots(*robots_of_kind(scenario, table, task, needed))

    def gather(self, scenario: Scenario, key: str, parts: Sequence[Any]) -> object:
        """The robots of all pieces."""
        from testbed.studies.compensation.play import gather

        return gather(parts)

    def answer(self, scenario: Scenario, records: Records) -> Answer | None:
        """On which kinds of robots the corrected program is better, and by how much."""
        from testbed.studies.compensation import report

        campaign = campaign_of(scenario, records)
        return report.answer(campaign) if compensation_of(campaign) else None

    def results(self, scenario: Scenario, records: Records) -> Sequence[Quantity]:
        """Figures of ISO 9283 per kind of robot."""
        from testbed.studies.compensation.summary import published

        return published(compensation_of(campaign_of(scenario, records)))

    def arrays(self, scenario: Scenario, records: Records) -> Sequence[Quantity]:
        """What each robot gave."""
        from testbed.studies.compensation.summary import published_arrays

        return published_arrays(compensation_of(campaign_of(scenario, records)))

    def sections(self, scenario: Scenario, records: Records, *, first: bool) -> Sequence[Section]:
        """The answer at length."""
        from testbed.studies.compensation.report import compensation_section

        section = compensation_section(campaign_of(scenario, records))
        return () if section is None else (section,)

    def recording(self, scenario: Scenario, records: Records) -> Sequence["Chapter"]:
        """One chapter."""
        from testbed.studies.compensation import recording

        return recording.chapters(compensation_of(campaign_of(scenario, records)), scenario)


STUDY = CompensationStudies()
