"""The paper's uncertainty budget, and the Monte Carlo of its tool point, on one robot."""

import numpy as np

from calib.arrays import Array, Index
from calib.identification.identify import identify
from calib.uncertainty.monte_carlo import distance_spread, point_spread
from calib.uncertainty.wen2022_budget import (
    LOCATION_POSES,
    POSE_NUMBERS,
    best_budget,
    location_regions,
    random_budget,
)
from testbed.laboratory.truth.laboratory import Laboratory, Setting, open_laboratory
from testbed.scenario.scenario import Scenario
from testbed.streams import stream
from testbed.studies.protocol import Records
from testbed.studies.trial.records import Trial
from testbed.studies.wen2022.paper import PARAMETERS, table3
from testbed.studies.wen2022.records import PAPER_BUDGET, PaperBudget, ToolPointStudy

RANDOM_BUDGET_POSES = 50
"""Poses of the random set whose repeats give u_r (Wen et al. 2022)."""


def paper_estimates(bench: Laboratory, sets: list[Index], *names: str) -> Array:
    """Steps (k, f) of the paper's estimator, one visit of each pose set."""
    parameters = bench.free("paper")
    return np.array(
        [
            identify(
                bench.setting.nominal,
                bench.measure_pool(chosen, *names, repeat=k),
                parameters,
                mode="paper",
            ).step
            for k, chosen in enumerate(sets)
        ]
    )


def paper_budget_study(scenario: Scenario, setting: Setting, needed: Records) -> PaperBudget:
    """The paper's contributors: repeats, number of poses, location; best set against random.

    References
    ----------
    Wen et al. 2022, eqs. (7) to (9).
    """
    bench, n = open_laboratory(scenario, setting), len(setting.pool_q)
    names = bench.free("paper").free_names
    trial = needed.get(next(t.name for t in scenario.trial if t.method != "random"), Trial)
    best_repeats = next(e.repeated for e in trial.estimates if e.mode == "paper")
    rng = stream(scenario.seed, "paper_budget", "sets")
    one = rng.choice(n, min(RANDOM_BUDGET_POSES, n), replace=False)
    regions = location_regions(setting.pool_nominal[:, :3, 3])
    local = [
        rng.choice(members, min(LOCATION_POSES, len(members)), replace=False)
        for members in (np.flatnonzero(regions == region) for region in range(4))
    ]
    sized = [rng.choice(n, min(size, n), replace=False) for size in POSE_NUMBERS]
    repeats = [one] * scenario.uncertainty.repeats
    best = best_budget(best_repeats)
    random = random_budget(
        paper_estimates(bench, repeats, "paper_budget", "repeats"),
        paper_estimates(bench, sized, "paper_budget", "pose_number"),
        paper_estimates(bench, local, "paper_budget", "location"),
    )
    return PaperBudget(
        names=names,
        best_repeatability=best.repeatability,
        repeatability=random.repeatability,
        pose_number=random.pose_number,
        location=random.location,
        best=best.combined,
        random=random.combined,
    )


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
    m = len(q)
    return ToolPointStudy(
        source=tuple(sources),
        distance_sd=np.array([s.standard for s in spreads]).reshape(-1, m),
        distance_range=np.array([s.extremes[0] - s.mean[0] for s in spreads]).reshape(-1, 2),
        spread=np.array([s.axis_standard for s in spreads]).reshape(-1, m, 3),
        trial=trial.name,
        covariance=full.covariance,
        linear=full.linear,
        draws=draws,
    )
