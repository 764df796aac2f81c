"""The ground study: the laboratory set up, every pose set measured, identified and judged."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from calib.information.criteria import NEEDS_GOALS
from testbed.laboratory.truth.setting import Setting
from testbed.report.glossary import glossary_section
from testbed.report.page import Section
from testbed.scenario.hashes import goal_part, part, shared_part
from testbed.scenario.scenario import Scenario
from testbed.store.quantities import Quantity
from testbed.studies.protocol import Answer, Record, Records, Task
from testbed.studies.trial.bending.records import Ways
from testbed.studies.trial.records import Trial, campaign_of
from testbed.studies.trial.set_records import PoseCountStudy, RandomSetsStudy
from testbed.studies.trial.statement.records import Validation
from testbed.units import plain

if TYPE_CHECKING:
    from testbed.recording.story import Chapter

SETTING, VALIDATION, MOTION = "setting", "validation", "motion"
POSE_COUNT, RANDOM_SETS = "pose_count", "random_sets"


class TrialStudy:
    """How good each pose set is on this robot, and what may be stated of it."""

    name = "trial"
    settings = None
    keys = (SETTING, VALIDATION, MOTION, POSE_COUNT, RANDOM_SETS)

    def records(self, scenario: Scenario) -> tuple[Record, ...]:
        """The laboratory, the held-out visit, how an arm moves, trials, indices of random sets."""
        shared = shared_part(scenario)
        fitted = shared | part(scenario, "identification", "uncertainty")
        everything = campaign_part(scenario)
        found = [
            Record(SETTING, Setting, shared, vital=True),
            Record(VALIDATION, Validation, shared, needs=(SETTING,)),
        ]
        if scenario.truth.motion:
            found.append(Record(MOTION, Ways, shared, needs=(SETTING,)))
        hashed = part(scenario, "trial")["trial"]
        for trial, settings in zip(scenario.trial, hashed, strict=True):
            reads = fitted | {"trial": settings}
            if trial.criterion in NEEDS_GOALS:
                reads |= goal_part(scenario)
            found.append(Record(trial.name, Trial, reads, needs=(SETTING, VALIDATION)))
        if scenario.studies.pose_count:
            found.append(Record(POSE_COUNT, PoseCountStudy, everything, needs=(SETTING,)))
        if scenario.studies.random_sets:
            needs = (SETTING, *(trial.name for trial in scenario.designed))
            found.append(Record(RANDOM_SETS, RandomSetsStudy, everything, needs=needs))
        return tuple(found)

    def play(self, scenario: Scenario, task: Task, needed: Records) -> object:
        """One record; random numbers come from streams named after it."""
        from testbed.studies.trial import play, random_sets

        if task.key == SETTING:
            return play.campaign_setting(scenario)
        setting = needed.get(SETTING, Setting)
        if task.key == VALIDATION:
            return play.validation_visit(scenario, setting)
        if task.key == MOTION:
            from testbed.studies.trial.bending.play import moved

            return moved(scenario, setting)
        if task.key == POSE_COUNT:
            return random_sets.pose_count_study(scenario, setting)
        if task.key == RANDOM_SETS:
            return random_sets.random_sets_study(scenario, setting, needed)
        return play.play_trial(scenario, setting, needed.get(VALIDATION, Validation), task.key)

    def gather(self, scenario: Scenario, key: str, parts: Sequence[Any]) -> object:
        """Every record is one piece."""
        return parts[0]

    def answer(self, scenario: Scenario, records: Records) -> Answer | None:
        """The verdict on the first trial: the answer where no other study asks."""
        from testbed.studies.trial.advice import next_step
        from testbed.studies.trial.decisions import decided_in_words
        from testbed.studies.trial.report_accuracy import (
            accuracy_is_not_belief,
            distributions,
            headline_table,
        )
        from testbed.studies.trial.verdict import trial_verdict

        campaign = campaign_of(scenario, records)
        step = next_step(campaign) + decided_in_words(campaign)
        picture = partial(distributions, campaign.trials[:1])
        verdict = trial_verdict(campaign)
        more = plain(accuracy_is_not_belief(campaign))
        verdict = replace(verdict, sentence=f"{verdict.sentence} {more}".rstrip())
        return Answer(verdict, headline_table(campaign), step, picture)

    def results(self, scenario: Scenario, records: Records) -> Sequence[Quantity]:
        """Pool, truth, and the headline of every trial."""
        from testbed.studies.trial.results import published

        return published(campaign_of(scenario, records))

    def arrays(self, scenario: Scenario, records: Records) -> Sequence[Quantity]:
        """Poses, truth, and what every estimate gave."""
        from testbed.studies.trial.results import published_arrays

        return published_arrays(campaign_of(scenario, records))

    def sections(self, scenario: Scenario, records: Records, *, first: bool) -> Sequence[Section]:
        """What is believed, errors, intervals, designs, numbers and the secret."""
        from testbed.studies.trial import report_accuracy, report_design, report_parameters
        from testbed.studies.trial.bending.report import bending_section
        from testbed.studies.trial.decisions import decision_section
        from testbed.studies.trial.report_secret import secret_section

        campaign = campaign_of(scenario, records)
        bends = bending_section(campaign)
        if bends is not None and not first:  # the question is about many robots, not about this one
            bends = replace(bends, on_paper=False)
        found = (
            report_accuracy.accuracy_section(
                campaign, None if first else report_accuracy.headline_table(campaign)
            ),
            report_accuracy.belief_section(campaign),
            decision_section(campaign),
            report_design.design_section(campaign),
            secret_section(campaign),
            bends,
            report_parameters.parameter_section(campaign) if first else None,
            glossary_section(),
        )
        return tuple(section for section in found if section is not None)

    def recording(
        self, scenario: Scenario, records: Records, trial: str | None = None
    ) -> Sequence["Chapter"]:
        """Select, measure, identify, evaluate: one trial, or the first, by its first estimator.

        And how the arm comes to a pose, if it moves.
        """
        from testbed.robots.catalog import load_robot
        from testbed.studies.trial.bending.recording import move_chapter
        from testbed.studies.trial.recording import chapters
        from testbed.studies.trial.recording_cell import show

        campaign = campaign_of(scenario, records)
        asked = campaign.trials[0] if trial is None else records.get(trial, Trial)
        shown, motion = show(campaign, asked), campaign.motion
        found = chapters(shown, campaign.random_sets)
        if motion is None:
            return found
        return (*found, move_chapter(shown, motion, load_robot(scenario.robot)))


def campaign_part(scenario: Scenario) -> dict[str, Any]:
    """What a record reads that depends on everything but names and titles."""
    tables = part(scenario, "identification", "uncertainty", "studies", "budget", "trial")
    return shared_part(scenario) | tables | goal_part(scenario)


STUDY = TrialStudy()
