"""Which pose set is best: every trial's set on many further robots, against random ones."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from testbed.laboratory.truth.setting import Setting
from testbed.report.page import Section
from testbed.scenario.scenario import Scenario
from testbed.store.quantities import Quantity
from testbed.studies.many_robots import cut_of
from testbed.studies.pose_sets.compare import POPULATION, PopulationStudy, has_contest, published
from testbed.studies.protocol import Answer, Record, Records, Task
from testbed.studies.trial.records import Trial, campaign_of
from testbed.studies.trial.study import SETTING, campaign_part

if TYPE_CHECKING:
    from testbed.recording.story import Chapter


class PoseSetsStudy:
    """Whether chosen pose sets beat random ones of their size, robot by robot."""

    name = "pose_sets"
    settings = None
    keys = (POPULATION,)

    def records(self, scenario: Scenario) -> tuple[Record, ...]:
        """One record on all robots; none where [studies] population is 0."""
        if not scenario.studies.population:
            return ()
        needs = (SETTING, *(trial.name for trial in scenario.trial))
        reads, robots = campaign_part(scenario), scenario.studies.population
        less = {k: v for k, v in reads["studies"].items() if k != "population"}
        cut = cut_of(POPULATION, robots, reads | {"studies": less})
        return (Record(POPULATION, PopulationStudy, reads, needs, cut),)

    def play(self, scenario: Scenario, task: Task, needed: Records) -> object:
        """Every trial's set on some robots, one visit each."""
        from testbed.studies.pose_sets.play import play_robots

        trials = [needed.get(trial.name, Trial) for trial in scenario.trial]
        setting = needed.get(SETTING, Setting)
        return {task.key: play_robots(scenario, setting, trials, task.block)}

    def gather(self, scenario: Scenario, key: str, parts: Sequence[Any]) -> object:
        """The robots of all pieces."""
        from testbed.studies.pose_sets.play import gather

        return gather(parts)

    def answer(self, scenario: Scenario, records: Records) -> Answer | None:
        """How many sets beat random ones, where many sets are compared."""
        from testbed.studies.pose_sets import report

        campaign = campaign_of(scenario, records)
        return report.answer(campaign) if has_contest(campaign) else None

    def results(self, scenario: Scenario, records: Records) -> Sequence[Quantity]:
        """Errors over many robots."""
        return published(campaign_of(scenario, records))

    def arrays(self, scenario: Scenario, records: Records) -> Sequence[Quantity]:
        """None."""
        return ()

    def sections(self, scenario: Scenario, records: Records, *, first: bool) -> Sequence[Section]:
        """The comparison, or where few sets were played what each is worth on many robots."""
        from testbed.studies.pose_sets.report import pose_sets_section
        from testbed.studies.pose_sets.report_population import population_section

        campaign = campaign_of(scenario, records)
        make = pose_sets_section if has_contest(campaign) else population_section
        section = make(campaign)
        return () if section is None else (section,)

    def recording(self, scenario: Scenario, records: Records) -> Sequence["Chapter"]:
        """None."""
        return ()


STUDY = PoseSetsStudy()
