"""Which pose set is best: the record of every trial's set on many robots, and the study."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from calib.arrays import Array
from testbed.laboratory.truth.laboratory import Setting
from testbed.report.page import Section
from testbed.scenario.scenario import Scenario
from testbed.store.quantities import Quantity
from testbed.studies.many_robots import block_of, pieces_of
from testbed.studies.protocol import Answer, Record, Records, Task
from testbed.studies.trial.records import Campaign, Trial, campaign_of
from testbed.studies.trial.study import SETTING, campaign_part

if TYPE_CHECKING:
    from testbed.recording.story import Chapter

POPULATION = "population"


@dataclass(frozen=True, slots=True, eq=False)
class PopulationStudy:
    """Every trial's pose set on many virtual robots, each measured once: the robot is the unit."""

    trials: tuple[str, ...]
    """(s,) names."""
    mean_error: Array
    """(s, e, R) mean held-out position error against the truth, per trial, estimator, robot [m]."""
    rms_error: Array
    """(s, e, R) root mean square of the same [m]."""
    stated_u: Array
    """(s, e, R) root mean square over held-out poses of the stated 3-D u [m]."""
    inside: Array
    """(s, e, R) share of held-out points inside their stated 95 % region."""
    before: Array
    """(R,) mean held-out error of the nominal model [m]."""
    goal_u: Array
    """(s, R) RMS tool-point u over the goal that the set promised, from the nominal model [m]."""


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
        reads, pieces = campaign_part(scenario), pieces_of(scenario.studies.population)
        return (Record(POPULATION, PopulationStudy, reads, needs=needs, pieces=pieces),)

    def play(self, scenario: Scenario, task: Task, needed: Records) -> object:
        """Every trial's set on some robots, one visit each."""
        from testbed.studies.pose_sets.play import play_robots

        trials = [needed.get(trial.name, Trial) for trial in scenario.trial]
        robots = block_of(scenario.studies.population, task.piece)
        return play_robots(scenario, needed.get(SETTING, Setting), trials, robots)

    def gather(self, scenario: Scenario, key: str, parts: Sequence[Any]) -> object:
        """The robots of all pieces."""
        from testbed.studies.pose_sets.play import gather

        return gather(parts)

    def answer(self, scenario: Scenario, records: Records) -> Answer | None:
        """How many sets beat random ones, where many sets are compared."""
        from testbed.studies.pose_sets import report
        from testbed.studies.pose_sets.compare import has_contest

        campaign = campaign_of(scenario, records)
        return report.answer(campaign) if has_contest(campaign) else None

    def results(self, scenario: Scenario, records: Records) -> Sequence[Quantity]:
        """Errors over many robots."""
        from testbed.studies.pose_sets.compare import published

        return published(campaign_of(scenario, records))

    def arrays(self, scenario: Scenario, records: Records) -> Sequence[Quantity]:
        """None."""
        return ()

    def sections(self, scenario: Scenario, records: Records, *, first: bool) -> Sequence[Section]:
        """The comparison, or where few sets were played what each is worth on many robots."""
        from testbed.studies.pose_sets.compare import has_contest
        from testbed.studies.pose_sets.report import pose_sets_section
        from testbed.studies.pose_sets.report_population import population_section

        campaign = campaign_of(scenario, records)
        make = pose_sets_section if has_contest(campaign) else population_section
        section = make(campaign)
        return () if section is None else (section,)

    def recording(self, scenario: Scenario, records: Records) -> Sequence["Chapter"]:
        """None."""
        return ()


def population_of(campaign: Campaign) -> PopulationStudy | None:
    """Every trial's set on many robots; None if nobody asked."""
    return campaign.records.find(POPULATION, PopulationStudy)


STUDY = PoseSetsStudy()
