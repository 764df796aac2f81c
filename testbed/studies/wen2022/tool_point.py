"""Monte Carlo of the tool point on the one robot of the campaign, from the paper's budgets."""

import numpy as np

from calib.arrays import Array
from calib.uncertainty.monte_carlo import distance_spread, point_spread
from testbed.laboratory.truth.laboratory import Setting
from testbed.scenario.scenario import Scenario
from testbed.streams import stream
from testbed.studies.protocol import Records
from testbed.studies.trial.records import Trial
from testbed.studies.wen2022.paper import PARAMETERS, table3
from testbed.studies.wen2022.records import PAPER_BUDGET, PaperBudget, ToolPointStudy


def tool_point_study(scenario: Scenario, setting: Setting, needed: Records) -> ToolPointStudy:
    """Monte Carlo of the tool point at the zero pose and the held-out poses, in both forms."""
    nominal, draws = setting.nominal, scenario.uncertainty.draws
    q = np.vstack([np.zeros((1, setting.test_q.shape[1])), setting.test_q])
    sources: dict[str, tuple[tuple[str, ...], Array]] = {}
    if scenario.robot == "staubli_tx60":
        sources["table 3 best"] = (PARAMETERS, table3("u_best"))
        sources["table 3 random"] = (PARAMETERS, table3("u_random"))
    if scenario.studies.paper_budget:
        budget = needed.get(PAPER_BUDGET, PaperBudget)
        sources["ours best"] = (budget.names, budget.best)
        sources["ours random"] = (budget.names, budget.random)
    spreads = []
    for source, (names, u) in sources.items():
        standard = np.zeros(nominal.n_numbers)
        standard[[nominal.names.index(name) for name in names]] = u
        rng = stream(scenario.seed, "tool_point", source)
        spreads.append(distance_spread(nominal, q, standard, rng, draws=draws))
    trial = needed.get(scenario.trial[0].name, Trial)
    identification = trial.estimates[0].identification
    full = point_spread(
        identification.model,
        q,
        identification.full_covariance,
        stream(scenario.seed, "tool_point", "full"),
        draws=draws,
    )
    return ToolPointStudy(
        source=tuple(sources),
        distance_sd=np.array([s.standard for s in spreads]).reshape(-1, len(q)),
        distance_range=np.array([s.extremes[0] - s.mean[0] for s in spreads]).reshape(-1, 2),
        spread=np.array([s.axis_standard for s in spreads]).reshape(-1, len(q), 3),
        trial=trial.name,
        covariance=full.covariance,
        linear=full.linear,
        draws=draws,
    )
