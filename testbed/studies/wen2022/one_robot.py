"""Studies beside the trials: number of poses, random sets, the paper's budget, the tool point."""

from collections.abc import Callable
from typing import Any

import numpy as np

from calib.arrays import Array, Index
from calib.design import PoseCount, Problem, pose_count, random_sets
from calib.identification.identify import identify
from calib.information.observability import CRITERIA, Form
from calib.uncertainty.monte_carlo import distance_spread, point_spread
from calib.uncertainty.wen2022_budget import (
    LOCATION_POSES,
    POSE_NUMBERS,
    best_budget,
    location_regions,
    random_budget,
)
from testbed.laboratory.truth.laboratory import Laboratory, Setting, open_laboratory
from testbed.scenario.read import Scenario
from testbed.streams import stream
from testbed.studies.trial.play import criterion_of
from testbed.studies.trial.records import (
    PaperBudget,
    PoseCountStudy,
    RandomSets,
    RandomSetsStudy,
    ToolPointStudy,
    Trial,
)
from testbed.studies.wen2022.paper import PARAMETERS, table3

Get = Callable[[str], Any]
SPARE_POSES = 2
"""Poses beyond the fewest where the curves begin."""
RANDOM_BUDGET_POSES = 50
"""Poses of the random set whose repeats give u_r (Wen et al. 2022)."""


def pose_count_study(scenario: Scenario, setting: Setting) -> PoseCountStudy:
    """Mean index of random sets against their size, in the paper's rows where poses are full."""
    bench = open_laboratory(scenario, setting)
    rows = "paper" if scenario.tracker.measures == "pose" else "whitened"
    blocks = bench.design_blocks(rows)
    largest = min(scenario.studies.pose_count_max, len(blocks))
    # with fewer poses some random sets are singular to rounding, and the printed O5 is infinite
    problem = Problem.of_blocks(blocks, len(blocks), "D")
    sizes = range(problem.fewest + SPARE_POSES, largest + 1)

    def curves(form: Form) -> tuple[PoseCount, ...]:
        rng = stream(scenario.seed, "pose_count")  # the same random sets in every form
        return pose_count(problem, rng, counts=sizes, form=form)

    printed, per_pose = curves("printed"), curves("per_pose")
    return PoseCountStudy(
        counts=printed[0].counts,
        names=CRITERIA,
        mean=np.array([curve.mean for curve in printed]),
        mean_per_pose=np.array([curve.mean for curve in per_pose]),
        spread=np.array([curve.sd for curve in printed]),
        chosen=tuple(curve.chosen for curve in per_pose[:2]),
    )


def random_sets_study(scenario: Scenario, setting: Setting, get: Get) -> RandomSetsStudy:
    """Each designed trial's figure beside that of random sets of the same size."""
    bench, sets = open_laboratory(scenario, setting), []
    for settings in scenario.trial:
        if settings.method == "random":
            continue
        blocks, criterion = bench.design_blocks(settings.rows), criterion_of(bench, settings)
        drawn = random_sets(
            Problem.of_blocks(blocks, settings.poses, criterion),
            stream(scenario.seed, "random_sets", settings.name),
            sets=scenario.studies.random_sets,
        )
        trial: Trial = get(settings.name)
        sets.append(
            RandomSets(
                trial=settings.name,
                criterion=settings.criterion,
                unit=criterion.unit if settings.rows == "whitened" else "1",
                larger_is_better=criterion.larger_is_better,
                n_poses=settings.poses,
                chosen_value=trial.selection.value,
                values=drawn.values,
            )
        )
    return RandomSetsStudy(tuple(sets))


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


def paper_budget_study(scenario: Scenario, setting: Setting, get: Get) -> PaperBudget:
    """The paper's contributors: repeats, number of poses, location; best set against random.

    References
    ----------
    Wen et al. 2022, eqs. (7) to (9).
    """
    bench, n = open_laboratory(scenario, setting), len(setting.pool_q)
    names = bench.free("paper").free_names
    trial: Trial = get(next(t.name for t in scenario.trial if t.method != "random"))
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


def tool_point_study(scenario: Scenario, setting: Setting, get: Get) -> ToolPointStudy:
    """Monte Carlo of the tool point at the zero pose and the held-out poses, in both forms."""
    from testbed.run.campaign import PAPER_BUDGET, record_keys

    nominal, draws = setting.nominal, scenario.uncertainty.draws
    q = np.vstack([np.zeros((1, setting.test_q.shape[1])), setting.test_q])
    sources: dict[str, tuple[tuple[str, ...], Array]] = {}
    if scenario.robot == "staubli_tx60":
        sources["table 3 best"] = (PARAMETERS, table3("u_best"))
        sources["table 3 random"] = (PARAMETERS, table3("u_random"))
    if PAPER_BUDGET in record_keys(scenario):
        budget: PaperBudget = get(PAPER_BUDGET)
        sources["ours best"] = (budget.names, budget.best)
        sources["ours random"] = (budget.names, budget.random)
    spreads = []
    for source, (names, u) in sources.items():
        standard = np.zeros(nominal.n_numbers)
        standard[[nominal.names.index(name) for name in names]] = u
        rng = stream(scenario.seed, "tool_point", source)
        spreads.append(distance_spread(nominal, q, standard, rng, draws=draws))
    trial: Trial = get(scenario.trial[0].name)
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
