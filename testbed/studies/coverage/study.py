"""Whether the stated uncertainty holds: many robots of each kind, calibrated and judged."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from testbed.report.page import Section
from testbed.scenario.scenario import Scenario
from testbed.store.quantities import Quantity
from testbed.studies.coverage.records import CoverageStudy, coverage_of
from testbed.studies.coverage.settings import CoverageSettings
from testbed.studies.many_robots import records_of_kinds, robots_of_kind
from testbed.studies.protocol import Answer, Record, Records, Task
from testbed.studies.trial.records import campaign_of

if TYPE_CHECKING:
    from testbed.recording.story import Chapter


class CoverageStudies:
    """Which stated uncertainty holds the true error, on which kind of robot."""

    name = "coverage"
    settings = CoverageSettings
    keys = CoverageSettings.keys

    def records(self, scenario: Scenario) -> tuple[Record, ...]:
        """One record per kind of robot."""
        return records_of_kinds(scenario, scenario.table(CoverageSettings), CoverageStudy)

    def play(self, scenario: Scenario, task: Task, needed: Records) -> object:
        """Some robots of one kind."""
        from testbed.studies.coverage.play import play_robots

        table = scenario.table(CoverageSettings)
        return play_robots(*robots_of_kind(scenario, table, task, needed))

    def gather(self, scenario: Scenario, key: str, parts: Sequence[Any]) -> object:
        """The robots of all pieces."""
        from testbed.studies.coverage.play import gather

        return gather(parts)

    def answer(self, scenario: Scenario, records: Records) -> Answer | None:
        """Where the model-based region keeps its promise, and what does instead."""
        from testbed.studies.coverage import report

        campaign = campaign_of(scenario, records)
        return report.answer(campaign) if coverage_of(campaign) else None

    def results(self, scenario: Scenario, records: Records) -> Sequence[Quantity]:
        """Shares of points inside, with intervals."""
        from testbed.studies.coverage.summary import published

        return published(coverage_of(campaign_of(scenario, records)))

    def arrays(self, scenario: Scenario, records: Records) -> Sequence[Quantity]:
        """What each robot gave."""
        from testbed.studies.coverage.summary import published_arrays

        return published_arrays(coverage_of(campaign_of(scenario, records)))

    def sections(self, scenario: Scenario, records: Records, *, first: bool) -> Sequence[Section]:
        """The answer at length."""
        from testbed.studies.coverage.report import coverage_section

        section = coverage_section(campaign_of(scenario, records))
        return () if section is None else (section,)

    def recording(self, scenario: Scenario, records: Records) -> Sequence["Chapter"]:
        """One chapter."""
        from testbed.studies.coverage import recording

        return recording.chapters(coverage_of(campaign_of(scenario, records)))


STUDY = CoverageStudies()
