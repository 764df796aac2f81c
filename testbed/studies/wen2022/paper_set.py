"""Choice of the pose set of a scenario that stands for the paper's optimal one."""

from testbed.scenario.scenario import Scenario
from testbed.scenario.tables import TrialSettings
from testbed.studies.wen2022.paper import POSE_NUMBER, TABLE3_INDEX


def by_paper(trial: TrialSettings) -> bool:
    """Whether a set is chosen as in the paper: DETMAX on an index of unweighted rows."""
    return trial.method == "detmax" and trial.rows == "paper"


def is_paper_set(trial: TrialSettings) -> bool:
    """Whether a set is chosen as the one of Table 3 was, whatever its size."""
    return by_paper(trial) and trial.criterion == TABLE3_INDEX


def designed_trials(scenario: Scenario) -> tuple[str, ...]:
    """Names of the designed trials, the one that stands for the paper's set first.

    That is the set of 29 poses that DETMAX chose by O2 in unweighted rows; if there is none, one by
    O2 of another size, else one by another index as in the paper, else the first designed one.
    The others follow in the order of the scenario.
    """

    def distance(trial: TrialSettings) -> tuple[bool, bool, bool]:
        """Sort key: differences of a set from the paper's, the most important first."""
        sized = trial.poses == POSE_NUMBER[TABLE3_INDEX]
        return not by_paper(trial), not is_paper_set(trial), not (is_paper_set(trial) and sized)

    designed = scenario.designed
    if not designed:
        return ()
    first = min(designed, key=distance)
    return (first.name, *(trial.name for trial in designed if trial is not first))


def tool_trials(scenario: Scenario) -> tuple[str, ...]:
    """Trials whose full covariance is propagated to the tool: designed ones, or else the first."""
    return designed_trials(scenario) or (scenario.trial[0].name,)


def stand_in(scenario: Scenario) -> str:
    """Why the first of `designed_trials` is not the paper's set; empty if it is."""
    designed = designed_trials(scenario)
    if not designed or is_paper_set(scenario.trial_named(designed[0])):
        return ""
    return (
        f"No trial chooses its set by {TABLE3_INDEX} as the paper's optimal set was chosen (method "
        f'"detmax", rows "paper"); {designed[0]} stands for it.'
    )
