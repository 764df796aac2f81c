"""Monte Carlo of the tool point on the one robot of the campaign, from the paper's budgets."""

import numpy as np

from calib.arrays import Array
from calib.geometry.model import RobotModel
from calib.uncertainty.monte_carlo import distance_spread, point_spread
from testbed.laboratory.truth.setting import Setting
from testbed.scenario.scenario import Scenario
from testbed.streams import stream
from testbed.studies.protocol import Records
from testbed.studies.trial.records import Trial
from testbed.studies.wen2022.paper import PARAMETERS, TABLE3_BEST, TABLE3_RANDOM, table3
from testbed.studies.wen2022.paper_set import tool_trials
from testbed.studies.wen2022.records import (
    OURS_BEST,
    OURS_RANDOM,
    PAPER_BUDGET,
    PaperBudget,
    ToolPointStudy,
)


def stated(scenario: Scenario, nominal: RobotModel, budget: PaperBudget | None) -> dict[str, Array]:
    """Standard uncertainties (P,) of all numbers, by whose they are; zero where none is stated."""
    sources: dict[str, tuple[tuple[str, ...], Array]] = {}
    if scenario.robot == "staubli_tx60":
        sources[TABLE3_BEST] = (PARAMETERS, table3("u_best"))
        sources[TABLE3_RANDOM] = (PARAMETERS, table3("u_random"))
    if budget is not None:
        sources[OURS_BEST] = (budget.names, budget.best[0])
        sources[OURS_RANDOM] = (budget.names, budget.random)
        for name, u in zip(budget.trials[1:], budget.best[1:], strict=True):
            sources[f"ours, {name}"] = (budget.names, u)
    found = {}
    for source, (names, u) in sources.items():
        found[source] = np.zeros(nominal.n_numbers)
        found[source][[nominal.names.index(name) for name in names]] = u
    return found


def draws_of(seed: int, source: str) -> np.random.Generator:
    """Random numbers behind the draws from one source, from their beginning."""
    return stream(seed, "tool_point", source)


def tool_point_study(scenario: Scenario, setting: Setting, needed: Records) -> ToolPointStudy:
    """Monte Carlo of the tool point at the zero pose and the held-out poses, in both forms."""
    nominal, draws = setting.nominal, scenario.uncertainty.draws
    q = np.vstack([np.zeros((1, setting.test_q.shape[1])), setting.test_q])
    budgeted = scenario.studies.paper_budget
    sources = stated(scenario, nominal, needed.get(PAPER_BUDGET, PaperBudget) if budgeted else None)
    spreads = [
        distance_spread(nominal, q, standard, draws_of(scenario.seed, source), draws=draws)
        for source, standard in sources.items()
    ]
    trials = tool_trials(scenario)
    full = []
    for k, name in enumerate(trials):
        found = needed.get(name, Trial).estimates[0].identification
        rng = stream(scenario.seed, "tool_point", "full", *(() if k == 0 else (name,)))
        full.append(point_spread(found.model, q, found.full_covariance, rng, draws=draws))
    return ToolPointStudy(
        source=tuple(sources),
        distance_sd=np.array([s.standard for s in spreads]).reshape(-1, len(q)),
        distance_range=np.array([s.extremes[0] - s.mean[0] for s in spreads]).reshape(-1, 2),
        spread=np.array([s.axis_standard for s in spreads]).reshape(-1, len(q), 3),
        trials=trials,
        covariance=np.array([one.covariance for one in full]),
        linear=np.array([one.linear for one in full]),
        draws=draws,
    )
