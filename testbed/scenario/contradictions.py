"""What two tables of a scenario may not say together."""

import re

from calib.information.criteria.named import NEEDS_GOALS
from testbed.scenario.checks import default_contradictions
from testbed.scenario.plan import plan_contradictions
from testbed.scenario.scenario import RESERVED, Scenario
from testbed.scenario.tracker import tracker_contradictions
from testbed.scenario.truth import truth_contradictions


def contradictions(scenario: Scenario) -> list[str]:
    """Sentences, one per contradiction between the tables of a scenario; empty if it is sound."""
    # records of one study per kind of robot stand under its name
    taken = (*RESERVED, *(key for table in scenario.tables.values() for key in table.keys))
    reserved = dict.fromkeys(re.sub(r"\..*", ".*", name) for name in taken)
    point = scenario.tracker.measures == "point"
    names = [trial.name for trial in scenario.trial]
    found = [
        f'[[trial]] name "{name}" is used {names.count(name)} times; rename all but one'
        for name in dict.fromkeys(names)
        if names.count(name) > 1
    ]
    for trial in scenario.trial:
        place = f'[[trial]] "{trial.name}"'
        if trial.name in taken:
            found.append(
                f"{place} has a reserved name; not one of {', '.join(reserved)}; rename it"
            )
        if trial.poses > scenario.pool.size:
            found.append(
                f"{place} poses is {trial.poses}; [pool] size is {scenario.pool.size}; "
                "choose fewer poses or a larger pool"
            )
        if trial.rows == "paper" and trial.criterion in NEEDS_GOALS:
            found.append(
                f'{place} criterion is "{trial.criterion}" and rows is "paper"; unweighted rows '
                "know no noise, so they tell no uncertainty of the tool point; "
                'write rows = "whitened"'
            )
        if trial.rows == "paper" and point:
            found.append(
                f'{place} rows is "paper", which needs full poses; [tracker] measures is "point"; '
                'write rows = "whitened"'
            )
    if not point and any(scenario.tracker.reflector_mm):
        found.append(
            '[tracker] reflector_mm is set, but measures is "pose"; '
            'write measures = "point" or remove reflector_mm'
        )
    if point and "paper" in scenario.identification.estimators:
        found.append(
            '[identification] estimators has "paper", which needs full poses; '
            '[tracker] measures is "point"; write estimators = ["whitened"]'
        )
    if point and scenario.studies.paper_budget:
        found.append(
            '[studies] paper_budget needs full poses; [tracker] measures is "point"; '
            "write paper_budget = false"
        )
    if point and scenario.studies.tool_point:
        found.append(
            "[studies] tool_point is about the tool origin, which is not seen where [tracker] "
            'measures is "point"; write tool_point = false'
        )
    if scenario.studies.paper_budget and "paper" not in scenario.identification.estimators:
        found.append(
            '[studies] paper_budget needs the paper\'s estimator; write estimators = ["whitened", '
            '"paper"] or paper_budget = false'
        )
    if scenario.studies.paper_budget and all(t.method == "random" for t in scenario.trial):
        found.append(
            "[studies] paper_budget compares an optimal set with random ones, and every [[trial]] "
            'is random; write method = "detmax" in one, or paper_budget = false'
        )
    found += [
        f"[{table}] {key} is 1; 0 skips it, and a spread needs at least 2; write {key} = 0 or more "
        "than 1"
        for table, key, value in (
            ("uncertainty", "replications", scenario.uncertainty.replications),
            ("studies", "random_sets", scenario.studies.random_sets),
            ("studies", "population", scenario.studies.population),
        )
        if value == 1
    ]
    if len(set(scenario.identification.estimators)) < len(scenario.identification.estimators):
        found.append("[identification] estimators names one twice; remove the copy")
    found += default_contradictions(scenario)
    poses = {f'[[trial]] "{trial.name}"': trial.poses for trial in scenario.trial}
    poses["[test]"] = scenario.test.poses
    found += truth_contradictions(scenario.truth)
    found += tracker_contradictions(scenario.tracker, poses)
    for table in scenario.tables.values():
        found += table.contradictions(scenario)
    return found + plan_contradictions(scenario.plan)
