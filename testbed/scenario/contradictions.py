"""What the tables of a scenario may not say together: sentences, one per contradiction."""

import re
from collections.abc import Iterator

from calib.information.criteria import NEEDS_GOALS
from testbed.bounds import LENGTH_SD, shown
from testbed.scenario.fixtures import fixture_contradictions
from testbed.scenario.laboratory import SYSTEMATIC, At960Tracker
from testbed.scenario.planning import MAX_STATIONS, BoxGoal, ListGoal, PathGoal, PlanSettings
from testbed.scenario.scenario import RESERVED, Scenario
from testbed.scenario.tables import BudgetSettings, IdentificationSettings, TrialSettings
from testbed.scenario.truth import truth_contradictions
from testbed.units import counted

MOST_ROUNDS = 100
"""Times that nests are measured between two poses."""
MOST_CALIBRATED = 1000
"""Random sets of a size that are calibrated: about 15 s on one core, and a rank to one in 1000."""


def contradictions(scenario: Scenario) -> Iterator[str]:
    """Contradictions in and between the tables of a scenario; none if it is sound."""
    yield from _of_trials(scenario)
    yield from _of_points(scenario)
    yield from _of_paper_budget(scenario)
    for table, key, value in (
        ("uncertainty", "replications", scenario.uncertainty.replications),
        ("studies", "random_sets", scenario.studies.random_sets),
        ("studies", "population", scenario.studies.population),
    ):
        if value == 1:
            yield (
                f"[{table}] {key} is 1; 0 skips it, and a spread needs at least 2; write {key} = 0 "
                "or more than 1"
            )
    yield from _of_identification(scenario.identification)
    yield from truth_contradictions(scenario.truth, scenario.tracker.pose_s)
    yield from _of_tracker(scenario)
    if scenario.fixtures is not None:
        yield from fixture_contradictions(scenario, scenario.fixtures)
    for settings in scenario.tables.values():
        yield from settings.contradictions(scenario)
    yield from _of_plan(scenario.plan)


def _of_trials(scenario: Scenario) -> Iterator[str]:
    """Contradictions of trials with each other, with the pool and with what is measured."""
    names = [trial.name for trial in scenario.trial]
    for name in dict.fromkeys(names):
        if names.count(name) > 1:
            yield f'[[trial]] name "{name}" is used {names.count(name)} times; rename all but one'
    # records of one study per kind of robot stand under its name
    taken = (*RESERVED, *(key for one in scenario.tables.values() for key in one.keys))
    reserved = dict.fromkeys(re.sub(r"\..*", ".*", name) for name in taken)
    for trial in scenario.trial:
        place = f'[[trial]] "{trial.name}"'
        if trial.name in taken:
            yield f"{place} has a reserved name; not one of {', '.join(reserved)}; rename it"
        if trial.poses > scenario.pool.size:
            yield (
                f"{place} poses is {trial.poses}; [pool] size is {scenario.pool.size}; "
                "choose fewer poses or a larger pool"
            )
        yield from _of_detmax(trial, place, scenario.pool.size - trial.poses)
        if trial.rows == "paper" and trial.criterion in NEEDS_GOALS:
            yield (
                f'{place} criterion is "{trial.criterion}" and rows is "paper"; unweighted rows '
                "ignore the noise, so they give no uncertainty of the tool point; "
                'write rows = "whitened"'
            )
        if trial.rows == "paper" and scenario.tracker.measures == "point":
            yield (
                f'{place} rows is "paper", which needs full poses; [tracker] measures is "point"; '
                'write rows = "whitened"'
            )


def _of_points(scenario: Scenario) -> Iterator[str]:
    """Contradictions of what else asks for full poses, or for points, with what is measured."""
    if scenario.tracker.measures == "pose":
        if any(scenario.tracker.reflector_mm):
            yield (
                '[tracker] reflector_mm is set, but measures is "pose"; '
                'write measures = "point" or remove reflector_mm'
            )
        return
    if "paper" in scenario.identification.estimators:
        yield (
            '[identification] estimators has "paper", which needs full poses; '
            '[tracker] measures is "point"; write estimators = ["whitened"]'
        )
    if scenario.studies.paper_budget:
        yield (
            '[studies] paper_budget needs full poses; [tracker] measures is "point"; '
            "write paper_budget = false"
        )
    if scenario.studies.tool_point:
        yield (
            "[studies] tool_point is about the tool origin, which is not seen where [tracker] "
            'measures is "point"; write tool_point = false'
        )


def _of_paper_budget(scenario: Scenario) -> Iterator[str]:
    """Contradictions of the paper's budget with estimators, trials, [budget] and random sets."""
    if not scenario.studies.paper_budget:
        return
    if "paper" not in scenario.identification.estimators:
        yield (
            '[studies] paper_budget needs the paper\'s estimator; write estimators = ["whitened", '
            '"paper"] or paper_budget = false'
        )
    if not scenario.designed:
        yield (
            "[studies] paper_budget compares an optimal set with random ones, and every [[trial]] "
            'is random; write method = "detmax" in one, or paper_budget = false'
        )
    yield from of_budget(scenario)
    yield from _of_calibrated_sets(scenario)


def _of_detmax(trial: TrialSettings, place: str, others: int) -> Iterator[str]:
    """Contradictions of a trial's swaps with its poses, and with the others of the pool."""
    most, usual = min(trial.poses, others), TrialSettings.model_fields["detmax"].default
    for k, name in ((1, "b"), (2, "c")):
        swaps = trial.detmax[k]
        # the paper's own shrink with a small set
        if trial.method == "detmax" and 0 < most < swaps != usual[k]:
            yield (
                f"{place} detmax swaps {name} = {counted(swaps, 'pose')} of {trial.poses} for "
                f"others of the pool, which has {others}; write at most {most}"
            )


def _of_calibrated_sets(scenario: Scenario) -> Iterator[str]:
    """More random sets than it is worth to calibrate: their indices cost little, their fits do."""
    sets = scenario.studies.random_sets
    if sets > MOST_CALIBRATED:
        yield (
            f"[studies] random_sets is {sets}, and paper_budget calibrates each by two estimators "
            f"for every designed [[trial]], {2 * sets * len(scenario.designed)} fits here; at most "
            f"{MOST_CALIBRATED} are calibrated; write random_sets = {MOST_CALIBRATED}, or "
            "paper_budget = false"
        )


def of_budget(scenario: Scenario) -> Iterator[str]:
    """Contradictions in [budget], and of its regions with the pool's box."""
    budget, pool = scenario.budget, scenario.pool
    sizes = budget.pose_numbers
    if len(set(sizes)) < len(sizes):
        yield "[budget] pose_numbers has a size twice; remove the copy"
    usual = BudgetSettings()
    for key in ("poses", "pose_numbers", "location_poses") if scenario.studies.paper_budget else ():
        asked = getattr(budget, key)
        largest = max(asked) if isinstance(asked, tuple) else asked
        # the paper's own sizes shrink with a small pool
        if largest > pool.size and asked != getattr(usual, key):
            yield (
                f"[budget] {key} asks for {largest} poses; the pool has {pool.size}; choose at "
                "most so many, or enlarge [pool] size"
            )
    for axis, border, center, side in zip(
        "xy", budget.location_border_mm, pool.box_center_mm, pool.box_size_mm, strict=False
    ):
        low, high = center - side / 2, center + side / 2
        if not low < border < high:
            yield (
                f"[budget] location_border_mm has {axis} = {border:g}; the pool's box lies between "
                f"{low:g} and {high:g} mm there, so that two of four regions would be empty; "
                "choose a border inside the box"
            )


def _of_identification(settings: IdentificationSettings) -> Iterator[str]:
    """Contradictions in [identification]: keys of the default estimator where it is not played."""
    if len(set(settings.estimators)) < len(settings.estimators):
        yield "[identification] estimators contains a name twice; remove the copy"
    keys = {
        "model": settings.model != "geometric",
        "loss": settings.loss != "squared",
        "prior": settings.prior is not None,
    }
    for key, given in keys.items():
        if given and "whitened" not in settings.estimators:
            yield (
                f"[identification] {key} belongs to the default estimator, and estimators has "
                f'"paper" only; add "whitened" or remove {key}'
            )


def _of_tracker(scenario: Scenario) -> Iterator[str]:
    """Contradictions of [tracker] with the poses of each visit."""
    tracker = scenario.tracker
    poses = {f'[[trial]] "{trial.name}"': trial.poses for trial in scenario.trial}
    for name, count in (poses | {"[test]": scenario.test.poses}).items():
        if isinstance(tracker, At960Tracker) and tracker.outliers + tracker.missed >= count:
            yield (
                f"[tracker] outliers is {tracker.outliers} and missed is {tracker.missed}; "
                f"{name} has {counted(count, 'pose')}; no good shot is left; lower them"
            )
    if isinstance(tracker, At960Tracker) and tracker.pose_s > MOST_ROUNDS * tracker.nests_s:
        yield (
            f"[tracker] nests_s is {tracker.nests_s:g} and pose_s is {tracker.pose_s:g}; the nests "
            f"are measured {MOST_ROUNDS} times between two poses at most; raise nests_s"
        )
    if isinstance(tracker, At960Tracker) and tracker.systematic:
        sizes = SYSTEMATIC if tracker.measures == "pose" else SYSTEMATIC[:-1]
        numbers = [getattr(tracker, key) for key in sizes]
        largest = max(max(size) if isinstance(size, tuple) else size for size in numbers)
        if largest < (least := shown(LENGTH_SD.least, "um")):
            yield (
                f"[tracker] systematic is true, which changes no reading: none of "
                f"{', '.join(sizes)} is {least:g} or more; raise one, or write systematic = false"
            )


def _of_plan(plan: PlanSettings) -> Iterator[str]:
    """Contradictions in [plan]."""
    if plan.poses and plan.target_um:
        yield (
            f"[plan] poses is {plan.poses} and target_um is {plan.target_um:g}; one decides; "
            "remove the other"
        )
    if not plan.poses and not plan.target_um:
        yield (
            "[plan] needs poses, 1 or more, or target_um, above 0, which finds their number; write "
            "one of them"
        )
    if plan.target_um and plan.criterion not in ("V", "G"):
        yield (
            f'[plan] criterion is "{plan.criterion}"; target_um needs "V" or "G", '
            'which know the goal; write criterion = "V"'
        )
    if plan.target_um and plan.method in ("random", "best_of_random"):
        yield (
            f'[plan] method is "{plan.method}", which does not look for the fewest poses that '
            'reach target_um; write method = "exchange" or poses'
        )
    if plan.measured and plan.stations.given:
        yield (
            "[plan] measured and [plan.stations] contradict each other: poses measured from one "
            "station do not count at another, where the robot's base has to be found anew; remove "
            "[plan.stations] and write where they were measured from as [tracker] station_mm"
        )
    if plan.stations.grid and plan.stations.list_mm:
        yield "[plan.stations] has list_mm and grid; remove one"
    if plan.stations.grid:
        across, deep, high = plan.stations.grid.count
        if across * deep * high > MAX_STATIONS:
            yield (
                f"[plan.stations.grid] count makes {across * deep * high} stations; at most "
                f"{MAX_STATIONS}; choose smaller counts"
            )
    if not isinstance(plan.goal, BoxGoal):
        yield from _of_goal(plan.goal)


def _of_goal(goal: ListGoal | PathGoal) -> Iterator[str]:
    """Contradictions in a goal given pose by pose."""
    if bool(goal.joints_deg) == bool(goal.tool_mm_deg):
        both = "both" if goal.joints_deg else "neither of"
        yield f"[plan.goal] has {both} joints_deg and tool_mm_deg; give one of them"
        return
    count = len(goal.joints_deg or goal.tool_mm_deg)
    key = "joints_deg" if goal.joints_deg else "tool_mm_deg"
    if isinstance(goal, PathGoal) and count < 2:
        yield f"[plan.goal] {key} has 1 entry; a path has two corners or more; add one"
    wanted = count - isinstance(goal, PathGoal)
    if goal.weights and len(goal.weights) != wanted:
        yield (
            f"[plan.goal] weights has {len(goal.weights)} entries; there must be {wanted}, "
            f"one per {'line' if isinstance(goal, PathGoal) else 'pose'}; correct the list"
        )
