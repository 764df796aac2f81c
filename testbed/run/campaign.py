"""The straight line from a scenario to a campaign: which records there are and how each is made.

A record depends on the scenario, its own key and the records it asks for; its random numbers come
from streams named after it, so records can be made in any order.
"""

from collections.abc import Callable
from typing import Any

from testbed.laboratory.truth.laboratory import Setting
from testbed.scenario.read import Scenario
from testbed.studies.compensation.records import CompensationStudy
from testbed.studies.compensation.settings import COMPENSATION_KEYS, compensation_keys
from testbed.studies.coverage.records import CoverageStudy
from testbed.studies.coverage.settings import COVERAGE_KEYS
from testbed.studies.trial.records import (
    Campaign,
    PaperBudget,
    PopulationStudy,
    PoseCountStudy,
    RandomSetsStudy,
    ToolPointStudy,
    Trial,
)
from testbed.studies.trial.statement.records import Validation
from testbed.studies.wen2022.records import PoolSets, Reexamined
from testbed.studies.wen2022.settings import REEXAMINED_KEYS, SETS_KEY, reexamined_keys

SETTING, VALIDATION = "setting", "validation"
POSE_COUNT, RANDOM_SETS = "pose_count", "random_sets"
PAPER_BUDGET, TOOL_POINT, POPULATION = "paper_budget", "tool_point", "population"

Get = Callable[[str], Any]


def record_keys(scenario: Scenario) -> tuple[str, ...]:
    """Keys of all records of a scenario, in the order in which they are usually made."""
    studies = scenario.studies
    wanted = (
        (POSE_COUNT, studies.pose_count),
        (RANDOM_SETS, studies.random_sets > 0),
        (PAPER_BUDGET, studies.paper_budget),
        (TOOL_POINT, studies.tool_point),
        (POPULATION, studies.population > 0),
    )
    return (
        SETTING,
        VALIDATION,
        *(trial.name for trial in scenario.trial),
        *(key for key, on in wanted if on),
        *coverage_keys(scenario),
        *reexamined_keys(scenario.reexamined),
        *compensation_keys(scenario.compensation),
    )


def coverage_keys(scenario: Scenario) -> tuple[str, ...]:
    """Keys of the coverage study, one per kind of robot; none if it is off."""
    coverage = scenario.coverage
    return tuple(f"coverage.{truth}" for truth in coverage.truths if coverage.robots)


def record_type(key: str) -> type:
    """Class of the record stored under `key`."""
    types: dict[str, type] = dict.fromkeys(COVERAGE_KEYS, CoverageStudy) | {
        **dict.fromkeys(REEXAMINED_KEYS, Reexamined),
        **dict.fromkeys(COMPENSATION_KEYS, CompensationStudy),
        SETS_KEY: PoolSets,
        SETTING: Setting,
        VALIDATION: Validation,
        POSE_COUNT: PoseCountStudy,
        RANDOM_SETS: RandomSetsStudy,
        PAPER_BUDGET: PaperBudget,
        TOOL_POINT: ToolPointStudy,
        POPULATION: PopulationStudy,
    }
    return types.get(key, Trial)


def compute(scenario: Scenario, key: str, get: Get) -> Any:
    """Make one record; `get` hands over another record by key, making it first if need be."""
    from testbed.laboratory.goal import goals_of, wants_goals
    from testbed.laboratory.truth.laboratory import make_setting, open_laboratory
    from testbed.studies.compensation.play import compensation_study
    from testbed.studies.coverage.play import coverage_study
    from testbed.studies.pose_sets.play import population_study
    from testbed.studies.trial.play import play_trial
    from testbed.studies.trial.validation import validation_visit
    from testbed.studies.wen2022 import one_robot as studies
    from testbed.studies.wen2022.play import reexamined_study
    from testbed.studies.wen2022.pools import pool_sets_study

    if key == SETTING:
        made = make_setting(scenario)
        if wants_goals(scenario):
            goals_of(
                open_laboratory(scenario, made)
            )  # a goal out of reach is refused before any trial
        return made
    setting = get(SETTING)
    if key == VALIDATION:
        return validation_visit(scenario, setting)
    if key == POSE_COUNT:
        return studies.pose_count_study(scenario, setting)
    if key == RANDOM_SETS:
        return studies.random_sets_study(scenario, setting, get)
    if key == PAPER_BUDGET:
        return studies.paper_budget_study(scenario, setting, get)
    if key == POPULATION:
        return population_study(scenario, setting, get)
    if key == TOOL_POINT:
        return studies.tool_point_study(scenario, setting, get)
    if key in COVERAGE_KEYS:
        return coverage_study(scenario, setting, COVERAGE_KEYS[key], get)
    if key in COMPENSATION_KEYS:
        return compensation_study(scenario, setting, COMPENSATION_KEYS[key], get)
    if key == SETS_KEY:
        return pool_sets_study(scenario, setting)
    if key in REEXAMINED_KEYS:
        return reexamined_study(scenario, setting, REEXAMINED_KEYS[key], get)
    return play_trial(scenario, setting, get(VALIDATION), key)


def gather(scenario: Scenario, get: Get) -> Campaign:
    """The whole campaign from its records."""
    keys = record_keys(scenario)

    def optional(key: str) -> Any:
        return get(key) if key in keys else None

    random_sets = optional(RANDOM_SETS)
    return Campaign(
        scenario=scenario,
        setting=get(SETTING),
        validation=get(VALIDATION),
        trials=tuple(get(trial.name) for trial in scenario.trial),
        pose_count=optional(POSE_COUNT),
        random_sets=random_sets.sets if random_sets else (),
        paper_budget=optional(PAPER_BUDGET),
        tool_point=optional(TOOL_POINT),
        population=optional(POPULATION),
        coverage=tuple(get(key) for key in coverage_keys(scenario)),
        pool_sets=optional(SETS_KEY),
        reexamined=tuple(get(key) for key in reexamined_keys(scenario.reexamined)[1:]),
        compensation=tuple(get(key) for key in compensation_keys(scenario.compensation)),
    )
