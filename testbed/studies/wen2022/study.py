"""The paper of Wen et al. 2022: its budget and tool point on one robot, its protocol on many."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from testbed.laboratory.truth.setting import Setting
from testbed.report.page import Section
from testbed.scenario.hashes import goal_part, part, shared_part, truth_part
from testbed.scenario.scenario import Scenario
from testbed.store.quantities import Quantity
from testbed.studies.many_robots import cut_of, kind_of, played_keys, truth_of_kind
from testbed.studies.protocol import Answer, Cut, Record, Records, Task
from testbed.studies.trial.records import campaign_of
from testbed.studies.trial.study import SETTING, campaign_part
from testbed.studies.wen2022.calibrated_sets.records import RANDOM_CALIBRATIONS, RandomCalibrations
from testbed.studies.wen2022.paper_set import designed_trials, tool_trials
from testbed.studies.wen2022.records import (
    PAPER_BUDGET,
    STATEMENTS,
    TOOL_POINT,
    PaperBudget,
    PoolSets,
    Reexamined,
    ToolPointStudy,
)
from testbed.studies.wen2022.settings import SETS_KEY, ReexaminedSettings

if TYPE_CHECKING:
    from testbed.recording.story import Chapter


class Wen2022Study:
    """Which claims of the paper hold, here and on many robots."""

    name = "wen2022"
    settings = ReexaminedSettings
    keys = (PAPER_BUDGET, RANDOM_CALIBRATIONS, TOOL_POINT, *ReexaminedSettings.keys)

    def records(self, scenario: Scenario) -> tuple[Record, ...]:
        """The paper's budget and tool point; its pools and sets, and one record per kind."""
        found, everything = [], campaign_part(scenario)
        designed, budgeted = designed_trials(scenario), scenario.studies.paper_budget
        everything |= {"sets": designed}
        if budgeted:
            needs = (SETTING, *designed)
            found.append(Record(PAPER_BUDGET, PaperBudget, everything, needs=needs))
        if scenario.studies.tool_point:
            needs = (SETTING, *tool_trials(scenario), *((PAPER_BUDGET,) if budgeted else ()))
            found.append(Record(TOOL_POINT, ToolPointStudy, everything, needs=needs))
        if budgeted and scenario.studies.random_sets:
            needs, key = (SETTING, *designed), RANDOM_CALIBRATIONS
            cut = Cut(key, len(designed), 1, everything)
            found.append(Record(key, RandomCalibrations, everything, needs, cut))
        table = scenario.table(ReexaminedSettings)
        if not table.robots:
            return tuple(found)
        reads = shared_part(scenario)
        reads |= part(scenario, "studies", "budget", "trial", "uncertainty")
        reads |= goal_part(scenario)
        cut = cut_of(SETS_KEY, table.pools, reads)
        reads |= {"pools": table.pools}
        found.append(Record(SETS_KEY, PoolSets, reads, (SETTING,), cut))
        judged, needs, keys = {"statements": STATEMENTS}, (SETTING, SETS_KEY), played_keys(table)
        truths = {key: truth_part(truth_of_kind(scenario, kind_of(key))) for key in keys}
        cut = cut_of(table.table, table.robots, reads | judged | {"kinds": truths})
        for key, truth in truths.items():
            kind = reads | judged | {"robots": table.robots, "kind": truth}
            found.append(Record(key, Reexamined, kind, needs, cut))
        return tuple(found)

    def play(self, scenario: Scenario, task: Task, needed: Records) -> object:
        """One record, or some robots; random numbers come from streams named after it."""
        from testbed.studies.wen2022 import budget, play, pools, tool_point
        from testbed.studies.wen2022.calibrated_sets.play import random_calibrations

        setting = needed.get(SETTING, Setting)
        first = task.keys[0]
        if first == PAPER_BUDGET:
            return budget.paper_budget_study(scenario, setting, needed)
        if first == TOOL_POINT:
            return tool_point.tool_point_study(scenario, setting, needed)
        if first == RANDOM_CALIBRATIONS:
            return {first: random_calibrations(scenario, setting, needed, task.piece)}
        if first == SETS_KEY:
            return {first: pools.play_pools(scenario, setting, task.block)}
        sets = needed.get(SETS_KEY, PoolSets)
        return {
            key: play.play_robots(scenario, setting, kind_of(key), sets, task.block)
            for key in task.keys
        }

    def gather(self, scenario: Scenario, key: str, parts: Sequence[Any]) -> object:
        """The designed trials, the pools, or the robots, of all pieces."""
        from testbed.studies.wen2022 import play, pools
        from testbed.studies.wen2022.calibrated_sets import play as sets

        if key == RANDOM_CALIBRATIONS:
            return sets.gather(parts)
        return pools.gather(parts) if key == SETS_KEY else play.gather(parts)

    def answer(self, scenario: Scenario, records: Records) -> Answer | None:
        """Number of claims that hold, if the protocol was played on many robots."""
        from testbed.studies.wen2022 import report

        return report.answer(campaign_of(scenario, records))

    def results(self, scenario: Scenario, records: Records) -> Sequence[Quantity]:
        """The paper's ratios and uncertainties, here and on many robots."""
        from testbed.studies.wen2022.results import published

        return tuple(published(campaign_of(scenario, records)))

    def arrays(self, scenario: Scenario, records: Records) -> Sequence[Quantity]:
        """Arrays over robots and calibrated sets."""
        from testbed.studies.wen2022.results import published_arrays

        return published_arrays(campaign_of(scenario, records))

    def sections(self, scenario: Scenario, records: Records, *, first: bool) -> Sequence[Section]:
        """The claims on many robots; random sets, tool point and the paper's tables on this one."""
        from testbed.studies.wen2022 import report, report_paper, report_tool_point
        from testbed.studies.wen2022.calibrated_sets.report import sets_section
        from testbed.studies.wen2022.claims import examine
        from testbed.studies.wen2022.summary import reexamination_of

        campaign = campaign_of(scenario, records)
        again, examined = reexamination_of(campaign), examine(campaign)
        found = (
            report.reexamined_section(again, examined) if again and examined else None,
            sets_section(campaign),
            report_tool_point.tool_section(campaign),
            report_paper.paper_section(campaign, examined),
        )
        return tuple(section for section in found if section is not None)

    def recording(self, scenario: Scenario, records: Records) -> Sequence["Chapter"]:
        """The clouds of the tool point at the zero pose."""
        from testbed.studies.wen2022.cloud.recording import chapter

        found = chapter(campaign_of(scenario, records))
        return () if found is None else (found,)


STUDY = Wen2022Study()
