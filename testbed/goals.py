"""The goal of a scenario's trials: where the tool point counts, the same as that of a plan."""

from calib.information.criteria.named import NEEDS_GOALS
from calib.information.goals import Goals, goal_matrix
from testbed.planning.bench import open_plan_bench
from testbed.planning.goal import goal_of
from testbed.scenario import Scenario
from testbed.setting import PROBED_POSES, Bench


def goals_of(bench: Bench) -> Goals:
    """Goals of [plan.goal], a box like the pool's unless told otherwise, in the kept numbers.

    Its poses come from the stream ``"plan", "goal"``: none is a held-out pose, none a candidate.

    Raises
    ------
    InputError
        The goal is out of reach, or moves with something that no pose of the pool shows.
    """
    laboratory = open_plan_bench(bench.scenario)
    goal = goal_of(laboratory)
    laboratory.check_seen(bench.setting.pool_q[:PROBED_POSES], goal.q, goal.point)
    return goal_matrix(
        bench.setting.nominal, goal.q, bench.kept(), weights=goal.weights, target=goal.point
    )


def wants_goals(scenario: Scenario) -> bool:
    """Whether any record of a campaign asks for the goal."""
    needed = any(trial.criterion in NEEDS_GOALS for trial in scenario.trial)
    return needed or scenario.studies.population > 0
